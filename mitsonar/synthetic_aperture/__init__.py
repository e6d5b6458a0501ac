"""Synthetic aperture: focusing of a moving array's echoes, micronavigation, and products of the focused images."""
from mitsonar.device.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
