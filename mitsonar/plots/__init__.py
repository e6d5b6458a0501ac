"""Plots of sonar records: images, lines of soundings, focused images, and videos."""
from mitsonar.device.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
