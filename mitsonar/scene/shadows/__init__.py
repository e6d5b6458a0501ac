"""Shadows of a scene: of objects, of the bed, of its cover."""
