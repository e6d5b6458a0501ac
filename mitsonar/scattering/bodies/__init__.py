"""Scattering of bodies: spheres, cylinders, measured patterns."""
