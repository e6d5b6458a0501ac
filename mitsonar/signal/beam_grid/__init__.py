"""Beams from echoes as points of sine and time: two transforms each way instead of a sum over elements.

`LineBeams` makes the beams of a line, `RowSignals` rows of compressed pulses where the beam is one element's; both make
grids that echoes are added to, and form what these hold. `residual_doppler` tells what an echo's own Doppler leaves.
"""
from .grids import BeamGrid, RowGrid
from .line_beams import LineBeams
from .noise import NoiseDensity
from .residual_doppler import ResidualDoppler, residual_doppler
from .row_signals import RowSignals

__all__ = ["BeamGrid", "LineBeams", "NoiseDensity", "ResidualDoppler", "RowGrid", "RowSignals", "residual_doppler"]
