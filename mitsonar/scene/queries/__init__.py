"""What rays ask of a scene: trees of triangles, of what stands and of what moves, and grids walked cell by cell."""
