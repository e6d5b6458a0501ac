"""XTF files of sidescans."""
