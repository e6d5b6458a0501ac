"""Scene files and the files that they name: meshes, pictures, tables."""
