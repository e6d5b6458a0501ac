"""The cells of a mosaic, and what samples of the ground add up to in them.

    level    10 log10 (Σ w p / Σ w),  p = 10^(level / 10)         means of powers
    number   Σ w x / Σ w                                          of what is measured otherwise
    label    that of the sample nearest to the cell's middle      of what must not be mixed

    w = 1                               nearest: only samples of the nearest of the tracks that see the cell; mean: all
    w = 1 - g / (farthest g)            feather: all, less towards the edge of a swath

g -> ground range of the sample [m]. Samples of one track lie in a cell with ranges that differ by its diagonal at most.
"""
from dataclasses import dataclass, field

import numpy as np

__all__ = ["BLENDS", "Cells", "Grid"]

BLENDS = ("nearest", "feather", "mean")
DIAGONAL = 1.5                     # cells, over which ranges of one track differ
NOWHERE = np.iinfo(np.int64).max
FINE = 1 << 20                     # steps of a squared distance


@dataclass(frozen=True, kw_only=True)
class Grid:
    """Lay out square cells, rows from north to south; edges are whole numbers of cells from 0.

    Attributes
    ----------
    cell : float [m]
    west, north : int
        Edges, in cells.
    rows, columns : int
    """

    cell: float
    west: int
    north: int
    rows: int
    columns: int

    @classmethod
    def over(cls, bounds: tuple[float, float, float, float], cell: float) -> "Grid":
        """Cover west, south, east, north [m]."""
        west, south, east, north = bounds
        first, top = int(np.floor(west / cell)), int(np.ceil(north / cell))
        return cls(cell=cell, west=first, north=top, rows=top - int(np.floor(south / cell)),
                   columns=int(np.ceil(east / cell)) - first)

    @property
    def x(self) -> np.ndarray:
        """Middles of the columns [m]."""
        return (self.west + np.arange(self.columns) + 0.5) * self.cell

    @property
    def y(self) -> np.ndarray:
        """Middles of the rows [m], from the north."""
        return (self.north - np.arange(self.rows) - 0.5) * self.cell

    def find(self, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Give the cells' numbers of places (N, 2) on the grid, and squared distances from their middles [cells²]."""
        across, down = place[:, 0] / self.cell - self.west, self.north - place[:, 1] / self.cell
        column = np.clip(across.astype(np.int64), 0, self.columns - 1)
        row = np.clip(down.astype(np.int64), 0, self.rows - 1)
        return row * self.columns + column, (across - column - 0.5) ** 2 + (down - row - 0.5) ** 2


@dataclass(frozen=True, kw_only=True, eq=False)
class Cells:
    """Sum up samples in the cells of a grid; `see` all first, then `add` them, then `means` or `nearest`.

    Attributes
    ----------
    grid : Grid
    blend : str
        One of `BLENDS`.
    mixed : bool
        Values are averaged; else the nearest to a cell's middle is taken.
    """

    grid: Grid
    blend: str
    mixed: bool
    _seen: np.ndarray = field(init=False)
    _sum: np.ndarray = field(init=False)
    _weight: np.ndarray = field(init=False)

    def __post_init__(self):
        count = self.grid.rows * self.grid.columns
        nearest = self.blend == "nearest" or not self.mixed
        for name, size, kind, value in (("_seen", count * nearest, np.float32, np.inf),
                                        ("_sum", count, np.float32 if self.mixed else np.int64,
                                         0 if self.mixed else NOWHERE),
                                        ("_weight", count * self.mixed, np.float32, 0)):
            object.__setattr__(self, name, np.full(size, value, kind))

    @property
    def looks_first(self) -> bool:
        """Whether `see` is needed."""
        return self._seen.size > 0

    def see(self, place: np.ndarray, ground_range: np.ndarray) -> None:
        """Note which track is nearest, of samples at places (N, 2) [m]."""
        number, _ = self.grid.find(place)
        np.minimum.at(self._seen, number, ground_range.astype(np.float32))

    def add(self, place: np.ndarray, ground_range: np.ndarray, values: np.ndarray, farthest: float) -> None:
        """Add the values (N,) of samples: powers or numbers where they are mixed, else numbers from 0 to 2³² - 1."""
        number, off = self.grid.find(place)
        if self.looks_first:
            own = ground_range <= self._seen[number] + DIAGONAL * self.grid.cell
            number, off, values, ground_range = number[own], off[own], values[own], ground_range[own]
        if not number.size:
            return
        if not self.mixed:
            key = (np.rint(off * FINE).astype(np.int64) << 32) | values.astype(np.int64)
            np.minimum.at(self._sum, number, key)
            return
        weight = np.maximum(1 - ground_range / farthest, 1e-3) if self.blend == "feather" else np.ones(number.size)
        low = int(number.min())
        part = slice(low, int(number.max()) + 1)
        self._sum[part] += np.bincount(number - low, weight * values).astype(np.float32)
        self._weight[part] += np.bincount(number - low, weight).astype(np.float32)

    def means(self) -> np.ndarray:
        """Give the weighted means (rows, columns); NaN where no sample is."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return (self._sum / self._weight).reshape(self.grid.rows, self.grid.columns)

    def nearest(self, nothing: int) -> np.ndarray:
        """Give the values nearest to the cells' middles (rows, columns) int64; `nothing` where no sample is."""
        found = np.where(self._sum == NOWHERE, nothing, self._sum & 0xFFFFFFFF)
        return found.reshape(self.grid.rows, self.grid.columns)
