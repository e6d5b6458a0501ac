"""Motion of a platform between transmission and reception."""
