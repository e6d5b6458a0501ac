"""Gradients of energy records."""
