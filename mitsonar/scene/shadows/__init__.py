"""Shadows in a scene: those of objects and of the bed, and objects under the bed."""
