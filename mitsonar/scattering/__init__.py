"""Scattering of sound by surfaces: laws of seabeds and the sea surface, and bodies."""
from mitsonar.device.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
