"""Signals of arrays from echoes as points of time, without responses of every element.

`LineBeams` makes the beams of a line: it makes grids of sine and time, to which echoes are added, and forms beams from
them, by two transforms each way instead of a sum over elements. `ElementReceivers` make the signals of a few elements.
"""
from .element_receivers import ElementReceivers
from .grids import BeamGrid
from .line_beams import LineBeams
from .noise import NoiseDensity

__all__ = ["BeamGrid", "ElementReceivers", "LineBeams", "NoiseDensity"]
