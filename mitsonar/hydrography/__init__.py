"""Soundings: from angles and travel times of echo sounders to depths on a map, with their uncertainty."""
from mitsonar.device.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
