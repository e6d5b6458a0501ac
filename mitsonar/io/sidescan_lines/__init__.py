"""Recorded sidescans of all formats through one door, `read`."""
from mitsonar.device.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
