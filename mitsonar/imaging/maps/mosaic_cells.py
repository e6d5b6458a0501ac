"""Sums of mosaic samples in map cells. With w the weight of a sample and g its ground range [m]:

    level    10 log10 (Σ w p / Σ w),  p = 10^(level / 10)         means of powers
    number   Σ w x / Σ w                                          other averaged values
    label    label of the sample nearest to the cell's middle     values that must not be mixed

    w = 1                               nearest: samples of the nearest track that sees the cell; mean: all samples
    w = 1 - g / (farthest g)            feather: all samples, with less weight towards the edge of a swath

Ranges of one track within a cell differ by the cell's diagonal at most.
"""
from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mitsonar.hydrography.map_grid import MapGrid

BLENDS = ("nearest", "feather", "mean")
DIAGONAL = 1.5                     # cells, largest range difference of one track within a cell
NOWHERE = np.iinfo(np.int64).max
FINE = 1 << 20                     # steps of a squared distance [1/cells²]


@dataclass(frozen=True, kw_only=True, eq=False)
class MosaicCells:
    """Sums of samples in the cells of a map: `see` all samples, then `add` them, then read `means` or `nearest`."""

    grid: MapGrid
    blend: str  # one of `BLENDS`
    mixed: bool  # average values, instead of taking the nearest
    _seen: np.ndarray = field(init=False)
    _sum: np.ndarray = field(init=False)
    _weight: np.ndarray = field(init=False)

    def __post_init__(self):
        count = int(np.prod(self.grid.shape))
        nearest = self.blend == "nearest" or not self.mixed
        for name, size, kind, value in (("_seen", count * nearest, np.float32, np.inf),
                                        ("_sum", count, np.float32 if self.mixed else np.int64,
                                         0 if self.mixed else NOWHERE),
                                        ("_weight", count * self.mixed, np.float32, 0)):
            object.__setattr__(self, name, np.full(size, value, kind))

    @property
    def looks_first(self) -> bool:
        """Return True if `see` must be called for all samples before `add`."""
        return self._seen.size > 0

    def see(self, place: np.ndarray, ground_range: np.ndarray) -> None:
        """Record the range of the nearest track for samples at places (N, 2) [m]."""
        number, inside = self.grid.find(*place.T)
        np.minimum.at(self._seen, number[inside], ground_range[inside].astype(np.float32))

    def add(self, place: np.ndarray, ground_range: np.ndarray, values: np.ndarray, farthest: float) -> None:
        """Add values (N,) of samples: powers or numbers if `mixed`, else integers from 0 to 2³² - 1."""
        number, own = self.grid.find(*place.T)
        if self.looks_first:
            own[own] = ground_range[own] <= self._seen[number[own]] + DIAGONAL * self.grid.cell
        place, number, values, ground_range = place[own], number[own], values[own], ground_range[own]
        if not number.size:
            return
        if not self.mixed:
            off = self.grid.off_middle(*place.T)
            key = (np.rint(off * FINE).astype(np.int64) << 32) | values.astype(np.int64)
            np.minimum.at(self._sum, number, key)
            return
        weight = np.maximum(1 - ground_range / farthest, 1e-3) if self.blend == "feather" else np.ones(number.size)
        low = int(number.min())
        part = slice(low, int(number.max()) + 1)
        self._sum[part] += np.bincount(number - low, weight * values).astype(np.float32)
        self._weight[part] += np.bincount(number - low, weight).astype(np.float32)

    def means(self) -> np.ndarray:
        """Return the weighted means (rows, columns); NaN in cells without samples."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return (self._sum / self._weight).reshape(self.grid.shape)

    def nearest(self, nothing: int) -> np.ndarray:
        """Return the values nearest to the cells' middles (rows, columns) int64; `nothing` in cells without samples."""
        found = np.where(self._sum == NOWHERE, nothing, self._sum & 0xFFFFFFFF)
        return found.reshape(self.grid.shape)
