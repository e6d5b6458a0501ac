"""Beams from echoes as points of sine and time, by two transforms each way instead of a sum over elements.

`LineBeams` makes the beams of a line of one or more elements: it makes grids, to which echoes are added, and forms
beams from them. `residual_doppler` is the remaining Doppler of an echo.
"""
from .grids import BeamGrid
from .line_beams import LineBeams
from .noise import NoiseDensity
from .residual_doppler import ResidualDoppler, residual_doppler

__all__ = ["BeamGrid", "LineBeams", "NoiseDensity", "ResidualDoppler", "residual_doppler"]
