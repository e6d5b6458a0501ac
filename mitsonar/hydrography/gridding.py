"""Grids of soundings. With σ_i the uncertainty of sounding i and n the soundings of the cell:

    mean         z = Σ z_i / n
    weighted     z = Σ w_i z_i / Σ w_i,   w_i = 1 / σ_i²           uncertainty    1 / √Σ w_i
    shoalest     z = min z_i                                       least depth, for safe navigation
    deviation    √(Σ (z_i - z̄)² / n)  about the mean z̄

Cells are those of `map_grid`.
"""
from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Literal

import numpy as np
import xarray as xr

from mitsonar.device.earth import origin

from .map_grid import MapGrid, check_cells

Rule = Literal["mean", "weighted", "shoalest"]
RULES = ("mean", "weighted", "shoalest")
MOST_CELLS = 1 << 24               # half a gigabyte of sums
ROWS = 1 << 20                     # grid cells per evaluation of the true bed
POINTS = 4                         # points of the true bed along a cell's side


def gridded(lines: xr.Dataset | Sequence[xr.Dataset], cell: float, *, rule: Rule = "mean", least: int = 1,
            bounds: tuple[float, float, float, float] | None = None) -> xr.Dataset:
    """Lay soundings on a grid.

    Parameters
    ----------
    lines : xarray.Dataset or sequence of them
        Lines of soundings in one coordinate system. They are read one by one.
    cell : float [m]
        Side of a cell.
    rule : {'mean', 'weighted', 'shoalest'}
        Rule that combines the depths in a cell.
    least : int
        Least number of soundings in a cell that has a depth.
    bounds : west, south, east, north [m] or None
        Area in the coordinate system. None covers all soundings.

    Returns
    -------
    xarray.Dataset
        ``depth`` over (y, x) from north to south, NaN in cells with fewer than `least` soundings; ``count``,
        ``deviation`` and, for the weighted rule, ``uncertainty``. Coordinates are the cells' middles [m]. Attributes:
        ``crs``, ``cell``, ``origin``, ``rule`` and, if the lines have them, ``vertical_datum`` and ``start``.
        `mitsonar.io.records.geotiff.write` takes one variable: ``grid[["depth"]]``.

    Raises
    ------
    ValueError
        If there are no soundings, too many cells, two systems or vertical datums, no uncertainties to weight with, or a
        bad number.
    """
    lines = [lines] if isinstance(lines, xr.Dataset) else list(lines)
    _check(lines, cell, rule, least)
    grid = _covering(_bounds(lines) if bounds is None else bounds, cell)
    cells = grid.rows * grid.columns
    total, squares, best = (np.zeros(cells) for _ in range(3))
    if rule == "shoalest":
        best[:] = np.inf
    number = np.zeros(cells, np.int64)
    weight = np.zeros(cells if rule == "weighted" else 0)
    for index, depth, sigma in _points(lines, grid, rule):
        number += np.bincount(index, minlength=cells)
        total += np.bincount(index, depth, cells)
        if rule == "weighted":
            weight += np.bincount(index, sigma**-2, cells)
            best += np.bincount(index, depth * sigma**-2, cells)
        elif rule == "shoalest":
            np.minimum.at(best, index, depth)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = total / number
        for index, depth, _ in _points(lines, grid, rule):
            squares += np.bincount(index, (depth - mean[index])**2, cells)
        layers = {"depth": {"mean": mean, "shoalest": best}.get(rule, best / weight if weight.size else best),
                  "deviation": np.sqrt(squares / number)}
        if rule == "weighted":
            layers["uncertainty"] = weight**-0.5
    return _chart(grid, {name: np.where(number >= least, layer, np.nan) for name, layer in layers.items()}, number,
                  {"crs": lines[0].attrs.get("crs"), "origin": _origin(lines[0]), "cell": float(cell), "rule": rule}
                  | {name: lines[0].attrs[name] for name in ("vertical_datum", "start") if lines[0].attrs.get(name)})


def residual(grid: xr.Dataset, bed: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> xr.DataArray:
    """Return the depth of a grid less the true depth of the bed.

    Parameters
    ----------
    grid : xarray.Dataset
        Grid returned by `gridded`.
    bed : callable(x, y) -> depth, arrays (...) [m]
        True depth at scene coordinates.

    Returns
    -------
    xarray.DataArray (y, x) [m]
        Grid depth less the mean true depth over each cell, from 16 points; NaN where the grid is NaN.
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


def _covering(bounds: tuple[float, float, float, float], cell: float) -> MapGrid:
    """Return the grid that covers west, south, east, north [m]."""
    west, south, east, north = map(float, bounds)
    if not (np.isfinite([west, south, east, north]).all() and west < east and south < north):
        raise ValueError(f"a grid has the bounds {bounds}; give west, south, east, north, in order.")
    check_cells((east - west, north - south), cell, MOST_CELLS, what="grid", instead=", or give bounds")
    return MapGrid.over((west, south, east, north), cell)


def _chart(grid: MapGrid, layers: dict[str, np.ndarray], number: np.ndarray, attrs: dict) -> xr.Dataset:
    """Return the layers as a map."""
    words = {"depth": f"below {attrs.get('vertical_datum', 'the still surface')}, positive down",
             "deviation": "of the soundings in a cell, about their mean",
             "uncertainty": "of the depth, standard deviation"}
    variables: dict[str, tuple] = {
        name: (("y", "x"), layer.reshape(grid.shape).astype(np.float32), {"units": "m", "long_name": words[name]})
        for name, layer in layers.items()}
    variables["count"] = (("y", "x"), number.reshape(grid.shape).astype(np.int32),
                          {"units": "1", "long_name": "soundings", "nodata": -1})
    return xr.Dataset(variables, {name: (name, getattr(grid, name), {"units": "m"}) for name in "xy"}, attrs)


def _origin(soundings: xr.Dataset) -> tuple[float, float]:
    """Return the easting and northing [m] of the scene's origin."""
    return origin(soundings.attrs, "origin", "the line")


def _places(soundings: xr.Dataset) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return True for usable soundings (ping, beam), and their easting and northing [m]."""
    x, y = soundings["x"].values, soundings["y"].values
    good = soundings["valid"].values & np.isfinite(x) & np.isfinite(y) & np.isfinite(soundings["depth"].values)
    east, north = _origin(soundings)
    return good, x[good] + east, y[good] + north


def _points(lines: list[xr.Dataset], grid: MapGrid,
            rule: Rule) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield cell numbers, depths and uncertainties of the soundings, line by line."""
    for soundings in lines:
        good, x, y = _places(soundings)
        index, inside = grid.find(x, y)
        depth, sigma = soundings["depth"].values[good], np.ones(len(x))
        if rule == "weighted":
            sigma = soundings["uncertainty"].values[good].astype(float)
            inside &= sigma > 0
        yield index[inside], depth[inside], sigma[inside]


def _bounds(lines: list[xr.Dataset]) -> tuple[float, float, float, float]:
    # so that soundings on the outer edges lie in a cell
    edges = [(x.min(), np.nextafter(y.min(), -np.inf), np.nextafter(x.max(), np.inf), y.max())
             for _, x, y in map(_places, lines) if x.size]
    if not edges:
        raise ValueError("a grid needs valid soundings, and the line has none.")
    west, south, east, north = zip(*edges)
    return min(west), min(south), max(east), max(north)


def _check(lines: list[xr.Dataset], cell: float, rule: str, least: int) -> None:
    if not lines:
        raise ValueError("a grid needs soundings: no line was given.")
    if not (np.isfinite(cell) and cell > 0):
        raise ValueError(f"a grid's cell is {cell!r} m; give a positive number.")
    if rule not in RULES:
        raise ValueError(f'a grid\'s rule is "{rule}"; give one of {", ".join(RULES)}.')
    if least < 1:
        raise ValueError(f"a cell is to have at least {least!r} soundings; give a whole number of 1 or more.")
    if rule == "weighted" and any("uncertainty" not in line for line in lines):
        raise ValueError("soundings without uncertainty cannot be weighted by it; add it, or take the mean.")
    systems = {line.attrs.get("crs") for line in lines}
    if len(systems) > 1:
        raise ValueError(f"lines in {' and '.join(sorted(map(str, systems)))} cannot be on one grid; give one system.")
    datums = {line.attrs.get("vertical_datum") for line in lines}
    if len(datums) > 1:
        raise ValueError(f"depths below {' and '.join(sorted(str(datum or 'an unnamed datum') for datum in datums))} "
                         "cannot be on one grid; give lines of one vertical datum.")
