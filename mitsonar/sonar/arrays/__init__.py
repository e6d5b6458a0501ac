"""Arrays of elements: positions, shading, and the beams they form."""
