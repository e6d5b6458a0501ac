"""Gradients of records and signals with respect to what is in the scene."""
from mitsonar.device.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
