"""Beams from element signals: delay-and-sum, fans of uniform lines, and the adaptive beamformer.

Every beamformer takes an xarray.DataArray (ping, tx, rx, sample) with the element positions, and returns one with
(ping, beam, sample); `mitsonar.signal.beamforming.recording` lists its coordinates. An echo of amplitude a in the look
direction keeps its amplitude and phase, whatever the window.
"""
from .delay_and_sum import backproject, delay_and_sum, focus
from .fan_beams import fan_beams, fft_beams
from .interpolation import INTERPOLATIONS
from .mvdr import mvdr
from .recording import directions

__all__ = ["INTERPOLATIONS", "backproject", "delay_and_sum", "directions", "fan_beams", "fft_beams", "focus", "mvdr"]
