"""Beams from echoes as points of sine and time: two transforms each way instead of a sum over elements.

`LineBeams` makes the beams of a line, be it of one element; it makes grids that echoes are added to, and forms what
these hold. `residual_doppler` is what an echo's own Doppler leaves.
"""
from .grids import BeamGrid
from .line_beams import LineBeams
from .noise import NoiseDensity
from .residual_doppler import ResidualDoppler, residual_doppler

__all__ = ["BeamGrid", "LineBeams", "NoiseDensity", "ResidualDoppler", "residual_doppler"]
