"""Sweeps: many renders of a scene, described by a plan, run to their end however often they are interrupted."""
from mitsonar.device.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
