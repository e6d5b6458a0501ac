"""Scattering of sound by surfaces: laws of the seabed, of targets and of the sea surface, one a file."""
from mitsonar.device.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
