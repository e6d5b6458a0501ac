"""Edge terms of gradients: outlines and lines where visibility jumps."""
