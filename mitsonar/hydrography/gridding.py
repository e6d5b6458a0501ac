"""Soundings on square cells of a map, and what such a grid errs by.

    mean         z = Σ z_i / n
    weighted     z = Σ w_i z_i / Σ w_i,   w_i = 1 / σ_i²       of the soundings' uncertainty σ
    shoalest     z = min z_i                                     what is safe to sail over

    deviation    √(Σ (z_i - z̄)² / n)  about the mean z̄         uncertainty    1 / √Σ w_i,  of the weighted

Edges of cells are whole numbers of cells from 0, so that grids of the same cell and system fit together.

The cells of a mosaic, and what samples of the ground add up to in them.

    level    10 log10 (Σ w p / Σ w),  p = 10^(level / 10)         means of powers
    number   Σ w x / Σ w                                          of what is measured otherwise
    label    that of the sample nearest to the cell's middle      of what must not be mixed

    w = 1                               nearest: only samples of the nearest of the tracks that see the cell; mean: all
    w = 1 - g / (farthest g)            feather: all, less towards the edge of a swath

g -> ground range of the sample [m]. Samples of one track lie in a cell with ranges that differ by its diagonal at most.
"""
from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import xarray as xr

BLENDS = ("nearest", "feather", "mean")
DIAGONAL = 1.5                     # cells, over which ranges of one track differ
NOWHERE = np.iinfo(np.int64).max
FINE = 1 << 20                     # steps of a squared distance


@dataclass(frozen=True, kw_only=True)
class SoundingGrid:
    """Lay out square cells, rows from north to south; edges are whole numbers of cells from 0."""

    cell: float  # [m]
    west: int  # edges, in cells
    north: int  # edges, in cells
    rows: int
    columns: int

    @classmethod
    def over(cls, bounds: tuple[float, float, float, float], cell: float) -> SoundingGrid:
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
        """Return the cells' numbers of places (N, 2) on the grid, and squared distances from their middles [cells²]."""
        across, down = place[:, 0] / self.cell - self.west, self.north - place[:, 1] / self.cell
        column = np.clip(across.astype(np.int64), 0, self.columns - 1)
        row = np.clip(down.astype(np.int64), 0, self.rows - 1)
        return row * self.columns + column, (across - column - 0.5) ** 2 + (down - row - 0.5) ** 2


@dataclass(frozen=True, kw_only=True, eq=False)
class GridCells:
    """Sum up samples in the cells of a grid; `see` all first, then `add` them, then `means` or `nearest`."""

    grid: SoundingGrid
    blend: str  # one of `BLENDS`
    mixed: bool  # values are averaged
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
        """Return whether `see` is needed."""
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
        """Return the weighted means (rows, columns); NaN where no sample is."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return (self._sum / self._weight).reshape(self.grid.rows, self.grid.columns)

    def nearest(self, nothing: int) -> np.ndarray:
        """Return the values nearest to the cells' middles (rows, columns) int64; `nothing` where no sample is."""
        found = np.where(self._sum == NOWHERE, nothing, self._sum & 0xFFFFFFFF)
        return found.reshape(self.grid.rows, self.grid.columns)


Rule = Literal["mean", "weighted", "shoalest"]
RULES = ("mean", "weighted", "shoalest")
MOST_CELLS = 1 << 24               # half a gigabyte of sums
ROWS = 1 << 20                     # cells of a grid whose truth is asked for at a time
POINTS = 4                         # a side of a cell at which the truth is asked for


def gridded(lines: xr.Dataset | Sequence[xr.Dataset], cell: float, *, rule: Rule = "mean", least: int = 1,
            bounds: tuple[float, float, float, float] | None = None) -> xr.Dataset:
    """Lay soundings on a grid.

    Parameters
    ----------
    lines : xarray.Dataset or sequence of them
        Lines of soundings in one coordinate system; they are gone through one by one.
    cell : float [m]
        Side of a cell.
    rule : {'mean', 'weighted', 'shoalest'}
        What becomes of the depths in a cell.
    least : int
        Soundings that a cell must have.
    bounds : west, south, east, north [m] or None
        What is covered, in the system's coordinates; None: all soundings.

    Returns
    -------
    xarray.Dataset
        ``depth`` over (y, x), from north to south, NaN where there are too few soundings; ``count``, ``deviation`` and,
        of the weighted rule, ``uncertainty``. Coordinates are the cells' middles [m]. Attributes: ``crs``, ``cell``,
        ``origin``, ``rule``. `mitsonar.io.records.geotiff.write` takes one variable: ``grid[["depth"]]``.

    Raises
    ------
    ValueError
        If there are no soundings, no uncertainties to weight with, too many cells, two systems, or a bad number.
    """
    some = [lines] if isinstance(lines, xr.Dataset) else list(lines)
    _check(some, cell, rule, least)
    grid = _CellGrid.over(_bounds(some) if bounds is None else bounds, cell)
    total, squares, best = (np.zeros(grid.count) for _ in range(3))
    if rule == "shoalest":
        best[:] = np.inf
    number = np.zeros(grid.count, np.int64)
    weight = np.zeros(grid.count if rule == "weighted" else 0)
    for index, depth, sigma in _points(some, grid, rule):
        number += np.bincount(index, minlength=grid.count)
        total += np.bincount(index, depth, grid.count)
        if rule == "weighted":
            weight += np.bincount(index, sigma**-2, grid.count)
            best += np.bincount(index, depth * sigma**-2, grid.count)
        elif rule == "shoalest":
            np.minimum.at(best, index, depth)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = total / number
        for index, depth, _ in _points(some, grid, rule):
            squares += np.bincount(index, (depth - mean[index])**2, grid.count)
        layers = {"depth": {"mean": mean, "shoalest": best}.get(rule, best / weight if weight.size else best),
                  "deviation": np.sqrt(squares / number)}
        if rule == "weighted":
            layers["uncertainty"] = weight**-0.5
    return grid.chart({name: np.where(number >= least, layer, np.nan) for name, layer in layers.items()}, number,
                      {"crs": some[0].attrs.get("crs"), "origin": _origin(some[0]), "cell": float(cell), "rule": rule})


def residual(grid: xr.Dataset, bed: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> xr.DataArray:
    """Compare a grid with the truth.

    Parameters
    ----------
    grid : xarray.Dataset
        As `gridded` gives it.
    bed : function of x and y [m], arrays (...), of the scene
        Its depth (...) [m].

    Returns
    -------
    xarray.DataArray (y, x) [m]
        Depth of the grid less the mean depth of the bed over each cell, by 16 points of it; NaN where the grid is.
    """
    offsets = (np.arange(POINTS) + 0.5) / POINTS - 0.5
    east, north = (grid[name].values[:, None] + offsets * grid.attrs["cell"] - origin
                   for name, origin in zip("xy", grid.attrs.get("origin", (0.0, 0.0))))
    depth = np.empty(grid["depth"].shape)
    rows = max(1, ROWS // (POINTS**2 * max(1, depth.shape[1])))
    for first in range(0, depth.shape[0], rows):
        part = north[first:first + rows]
        x, y = np.broadcast_arrays(east[None, :, None, :], part[:, None, :, None])
        depth[first:first + rows] = np.mean(bed(x, y), axis=(2, 3))
    return (grid["depth"] - depth).rename("residual").assign_attrs(units="m", long_name="depth less that of the bed")


@dataclass(frozen=True, kw_only=True)
class _CellGrid:
    """Square cells, rows from north to south; west and north are in cells from 0."""

    cell: float
    west: int
    north: int
    rows: int
    columns: int

    @classmethod
    def over(cls, bounds: tuple[float, float, float, float], cell: float) -> _CellGrid:
        west, south, east, north = (float(one) for one in bounds)
        if not (np.isfinite([west, south, east, north]).all() and west < east and south < north):
            raise ValueError(f"a grid has the bounds {bounds}; give west, south, east, north, in order.")
        if (east - west) / cell * ((north - south) / cell) > MOST_CELLS:
            raise ValueError(f"a grid of {east - west:.0f} m by {north - south:.0f} m in cells of {cell:g} m has more "
                             f"than {MOST_CELLS} cells; give a larger cell, or bounds.")
        first, top = int(np.floor(west / cell)), int(np.ceil(north / cell))
        return cls(cell=cell, west=first, north=top, rows=max(1, top - int(np.floor(south / cell))),
                   columns=max(1, int(np.ceil(east / cell)) - first))

    @property
    def count(self) -> int:
        """Of cells."""
        return self.rows * self.columns

    def find(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Cells' numbers of places, and which places are inside."""
        column = np.floor(x / self.cell).astype(np.int64) - self.west
        row = self.north - 1 - np.floor(y / self.cell).astype(np.int64)
        inside = (column >= 0) & (column < self.columns) & (row >= 0) & (row < self.rows)
        return row * self.columns + column, inside

    def chart(self, layers: dict[str, np.ndarray], number: np.ndarray, attrs: dict) -> xr.Dataset:
        """The layers as a map."""
        shape, words = (self.rows, self.columns), {"depth": "below the still surface, positive down",
                                                   "deviation": "of the soundings in a cell, about their mean",
                                                   "uncertainty": "of the depth, standard deviation"}
        variables: dict[str, tuple] = {
            name: (("y", "x"), layer.reshape(shape).astype(np.float32), {"units": "m", "long_name": words[name]})
            for name, layer in layers.items()}
        variables["count"] = (("y", "x"), number.reshape(shape).astype(np.int32),
                              {"units": "1", "long_name": "soundings", "nodata": -1})
        middles = {"x": (self.west + np.arange(self.columns) + 0.5) * self.cell,
                   "y": (self.north - np.arange(self.rows) - 0.5) * self.cell}
        return xr.Dataset(variables, {name: (name, one, {"units": "m"}) for name, one in middles.items()}, attrs)


def _origin(soundings: xr.Dataset) -> tuple[float, float]:
    """Where x and y begin in the coordinate system."""
    east, north = soundings.attrs.get("origin", (0.0, 0.0))
    return float(east), float(north)


def _places(soundings: xr.Dataset) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which soundings can be laid out (ping, beam), and easting and northing of those."""
    x, y = soundings["x"].values, soundings["y"].values
    good = soundings["valid"].values & np.isfinite(x) & np.isfinite(y) & np.isfinite(soundings["depth"].values)
    east, north = _origin(soundings)
    return good, x[good] + east, y[good] + north


def _points(some: list[xr.Dataset], grid: _CellGrid, rule: Rule) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Cells, depths and uncertainties of the soundings, line by line."""
    for soundings in some:
        good, x, y = _places(soundings)
        index, inside = grid.find(x, y)
        depth, sigma = soundings["depth"].values[good], np.ones(len(x))
        if rule == "weighted":
            sigma = soundings["uncertainty"].values[good].astype(float)
            inside &= sigma > 0
        yield index[inside], depth[inside], sigma[inside]


def _bounds(some: list[xr.Dataset]) -> tuple[float, float, float, float]:
    edges = [(x.min(), y.min(), np.nextafter(x.max(), np.inf), np.nextafter(y.max(), np.inf))
             for _, x, y in map(_places, some) if x.size]
    if not edges:
        raise ValueError("a grid needs soundings: none is valid.")
    west, south, east, north = zip(*edges)
    return min(west), min(south), max(east), max(north)


def _check(some: list[xr.Dataset], cell: float, rule: str, least: int) -> None:
    if not some:
        raise ValueError("a grid needs soundings: no line was given.")
    if not (np.isfinite(cell) and cell > 0):
        raise ValueError(f"a grid's cell is {cell!r} m; give a positive number.")
    if rule not in RULES:
        raise ValueError(f'a grid\'s rule is "{rule}"; give one of {", ".join(RULES)}.')
    if least < 1:
        raise ValueError(f"a cell is to have at least {least!r} soundings; give a whole number of 1 or more.")
    if rule == "weighted" and any("uncertainty" not in one for one in some):
        raise ValueError("soundings without uncertainty cannot be weighted by it; add it, or take the mean.")
    systems = {one.attrs.get("crs") for one in some}
    if len(systems) > 1:
        raise ValueError(f"lines in {' and '.join(sorted(map(str, systems)))} cannot be on one grid; give one system.")
