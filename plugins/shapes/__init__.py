"""Shapes that are made, not drawn: the synthetic seabed and surveyed bathymetry."""
