"""Sweeps: many renders of a scene by a plan, which an interrupted run completes when started again."""
from mitsonar.device.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
