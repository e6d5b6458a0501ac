"""Plots and videos of fans."""
