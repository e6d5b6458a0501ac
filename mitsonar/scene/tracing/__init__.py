"""Bent rays in a scene: launch, hits on surfaces, and connections between two points."""
