"""Synthetic aperture: from the echoes that a moving array records to focused images and what they show."""
from mitsonar.device.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
