"""Sediments and target materials, one scattering law a file."""
