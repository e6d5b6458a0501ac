"""Scatterers of the ground and of meshes: where they are, how strong they are."""
