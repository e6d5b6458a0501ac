"""Echoes of several bounces, by way of a flat sea surface, and of the water column."""
