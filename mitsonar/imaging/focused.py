"""Geometry of focused images: their dimensions, and the positions of their points on the map.

    (x, y) = (x_0, y_0) + i (a_x, a_y) + j (b_x, b_y)           for row i and column j of an even grid

x_0, y_0 -> ``first``, a -> ``ahead``, b -> ``abeam``. All banks of an image share its points and their truth.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

BANK, GROUND = "bank", ("along_track", "across_track")
EVEN = 0.01                        # of a cell: tolerance of a point of an even grid


@dataclass(frozen=True, kw_only=True, eq=False)
class EvenGrid:
    """Positions of the points of an even grid in the scene."""

    first: np.ndarray  # (2,) [m]: x and y of the first row's first point
    ahead: np.ndarray  # (2,) [m]: from a row to the next
    abeam: np.ndarray  # (2,) [m]: from a column to the next


def is_focused(dataset: xr.Dataset) -> bool:
    """Return True for a focused image or a product of one, over (along_track, across_track)."""
    return set(GROUND) <= set(dataset.dims)


def bin_dims(dataset: xr.Dataset) -> tuple[str, ...]:
    """Return the dimensions of a record's bins and of its truth: those of ``level`` without the banks."""
    return tuple(str(dim) for dim in dataset["level"].dims if dim != BANK)


def to_starboard(image: xr.Dataset) -> bool:
    """Return True if the columns of a focused image run to starboard of its rows, or if their direction is unknown."""
    grid = _corners(image)
    return grid is None or not grid.ahead[0] * grid.abeam[1] - grid.ahead[1] * grid.abeam[0] > 0


def even_grid(image: xr.Dataset) -> EvenGrid | None:
    """Return the grid of a focused image, or None if its points are uneven or fewer than 2 x 2."""
    grid = _corners(image)
    if grid is None:
        return None
    rows, columns = image.sizes[GROUND[0]], image.sizes[GROUND[1]]
    cell = min(float(np.hypot(*grid.ahead)), float(np.hypot(*grid.abeam)))
    for number, name in enumerate("xy"):
        even = (grid.first[number] + grid.ahead[number] * np.arange(rows)[:, None]
                + grid.abeam[number] * np.arange(columns))
        if not np.abs(image[name].transpose(*GROUND).values - even).max() <= EVEN * cell:     # also refuses NaN
            return None
    return grid


def _corners(image: xr.Dataset) -> EvenGrid | None:
    """Return the grid that the corners of an image span, or None."""
    rows, columns = image.sizes[GROUND[0]], image.sizes[GROUND[1]]
    if min(rows, columns) < 2 or not all(name in image and set(image[name].dims) == set(GROUND) for name in "xy"):
        return None
    x, y = (image[name].transpose(*GROUND).values for name in "xy")
    first, last_row, last_column = (np.array([x[at], y[at]], float) for at in ((0, 0), (-1, 0), (0, -1)))
    return EvenGrid(first=first, ahead=(last_row - first) / (rows - 1), abeam=(last_column - first) / (columns - 1))
