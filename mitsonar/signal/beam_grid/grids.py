"""Grids that echoes are added to, before they become beams."""
from __future__ import annotations

from dataclasses import dataclass

import drjit as dr

from mitsonar.device.types import DrJitArray, Float

from ..impulses import Bell
from .absorption import AbsorptionTerms
from .spreading import GridSums

MARGIN = 16                        # [samples] kept before and after a record, so that echoes at its edges stay whole


@dataclass(frozen=True, kw_only=True, eq=False)
class GridShape:
    """Size and bells of a grid of sine and time."""

    rows: int  # number of rows
    samples: int  # number of samples of the record
    length: int  # number of columns in memory of a row
    along: Bell  # over samples
    across: Bell  # over rows
    first: float  # sine of row 0
    step: float  # of the sine, from row to row
    absorption: AbsorptionTerms | None = None

    def sums(self, like: DrJitArray | type) -> GridSums:
        """Make empty sums on the backend of `like`."""
        return GridSums(like, rows=self.rows, columns=self.samples + 2 * MARGIN, pitch=self.length, along=self.along,
                        across=self.across, absorption=self.absorption)


class BeamGrid:
    """Sums of echoes on (sine, time), made by `LineBeams.grid` and read once."""

    def __init__(self, like: DrJitArray | type, shape: GridShape):
        self.shape, self._like = shape, like
        self._sums = shape.sums(like)

    def taken(self) -> Float:
        """Return the sums, real and imaginary parts interleaved, and empty the grid."""
        sums, self._sums = self._sums.sums, self.shape.sums(self._like)
        return sums

    def add(self, *, column: Float, sine: Float, real: Float, imaginary: Float) -> None:
        """Add echoes. Several calls add up.

        Echoes outside the record, with a sine beyond ±1, or not finite are ignored.
        """
        # column (H,) [samples]; sine (H,) [-]; real, imaginary (H,)
        if not dr.width(sine):
            return
        scale = dr.opaque(type(sine), 1 / self.shape.step)
        begin = dr.opaque(type(sine), self.shape.first)
        row = dr.select(abs(sine) <= 1 + 1e-6, (sine - begin) * scale, -1)
        self._sums.add(row, column + MARGIN, real, imaginary)
