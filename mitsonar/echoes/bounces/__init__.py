"""Echoes by several bounces: multipath, ghosts, the water column."""
