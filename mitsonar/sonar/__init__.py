"""Sonars: arrays and their beams, pulses, tracks and motion."""
from mitsonar.device.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
