"""Echoes of a scene, by kind, and the sonar equation."""
