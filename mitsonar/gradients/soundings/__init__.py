"""Gradients of soundings."""
