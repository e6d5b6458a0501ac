"""Coherent echoes of smooth surfaces."""
