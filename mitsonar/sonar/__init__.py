"""Sonars: faces and their beams, pulses, tracks, and the directions a ping's rays are drawn in."""
from .directivity import Aperture, length_for_beam_width
from .presets import presets
from .sidescan import Sidescan
from .track import Track

__all__ = ["Aperture", "Sidescan", "Track", "length_for_beam_width", "presets"]
