"""Sonars: arrays and their beams, pulses, tracks and the motion of what carries them."""
from mitsonar.device.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
