"""Comparison of real records with simulated ones of the same line.

    mitsonar.compare("line.kmall", "twin.nc")              an xarray.Dataset that prints figures and their evidence
"""
from mitsonar.device.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
