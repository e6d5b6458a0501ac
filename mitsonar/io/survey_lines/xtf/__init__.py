"""Read lines of multibeam sonars from XTF files."""
