"""Scatterers of the ground and of meshes: their places and strengths."""
