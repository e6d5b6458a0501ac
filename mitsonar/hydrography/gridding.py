"""Soundings on square cells of a map, and what such a grid errs by.

    mean         z = Σ z_i / n
    weighted     z = Σ w_i z_i / Σ w_i,   w_i = 1 / σ_i²       of the soundings' uncertainty σ
    shoalest     z = min z_i                                     what is safe to sail over

    deviation    √(Σ (z_i - z̄)² / n)  about the mean z̄         uncertainty    1 / √Σ w_i,  of the weighted

Edges of cells are whole numbers of cells from 0, so that grids of the same cell and system fit together.
"""
from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import xarray as xr

__all__ = ["gridded", "residual"]

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
        ``origin``, ``rule``. `mitsonar.io.geotiff.write` takes one variable: ``grid[["depth"]]``.

    Raises
    ------
    ValueError
        If there are no soundings, no uncertainties to weight with, too many cells, two systems, or a bad number.
    """
    some = [lines] if isinstance(lines, xr.Dataset) else list(lines)
    _check(some, cell, rule, least)
    grid = _Grid.over(_bounds(some) if bounds is None else bounds, cell)
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
class _Grid:
    """Square cells, rows from north to south; west and north are in cells from 0."""

    cell: float
    west: int
    north: int
    rows: int
    columns: int

    @classmethod
    def over(cls, bounds: tuple[float, float, float, float], cell: float) -> _Grid:
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


def _points(some: list[xr.Dataset], grid: _Grid, rule: Rule) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
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
