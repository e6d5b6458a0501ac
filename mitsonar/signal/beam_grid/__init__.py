"""Beams from echoes as points of sine and time, by two transforms each way instead of a sum over elements.

`LineBeams` makes the beams of a line of one or more elements: it makes grids, to which echoes are added, and forms
beams from them.
"""
from .grids import BeamGrid
from .line_beams import LineBeams
from .noise import NoiseDensity

__all__ = ["BeamGrid", "LineBeams", "NoiseDensity"]
