"""Bent rays against a scene: where they are sent, where they meet it, and how two points are connected."""
