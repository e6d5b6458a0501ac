"""Scattering laws of surfaces, one a file."""
