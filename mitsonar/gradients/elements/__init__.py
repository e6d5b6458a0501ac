"""Gradients of element signals."""
