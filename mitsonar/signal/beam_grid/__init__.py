"""Beams of a line from echoes as points of sine and time: two transforms instead of a sum over elements."""
from .grids import BeamGrid, RowGrid
from .line_beams import LineBeams
from .noise import NoiseDensity

__all__ = ["BeamGrid", "LineBeams", "NoiseDensity", "RowGrid"]
