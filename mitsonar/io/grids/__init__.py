"""Grids of depths and sediments in files."""
