"""Plots of lines of soundings."""
