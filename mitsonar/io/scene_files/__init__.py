"""Scene files and what they name: meshes, pictures, tables."""
