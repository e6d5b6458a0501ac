"""Plots of images."""
