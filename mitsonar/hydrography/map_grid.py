"""Grid of square cells on a map; edges are whole multiples of the cell from 0, so that grids of one cell fit together.

The cell of a place (x, y) has the number row · columns + column, with

    column = ⌊x / cell - west⌋          row = ⌊north - y / cell⌋

so that a place on an edge belongs to the cell east or south of it, as in GeoTIFF.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, kw_only=True)
class MapGrid:
    """Square cells, rows from north to south."""

    cell: float  # [m]
    west: int  # edge [cells]
    north: int  # edge [cells]
    rows: int
    columns: int

    @classmethod
    def over(cls, bounds: tuple[float, float, float, float], cell: float, tolerance: float = 0.0) -> MapGrid:
        """Return the grid of one or more cells that covers west, south, east, north [m], but for a tolerance [cells].
        """
        west, south = (int(np.floor(low / cell + tolerance)) for low in bounds[:2])
        east, north = (int(np.ceil(high / cell - tolerance)) for high in bounds[2:])
        rows, columns = max(1, north - south), max(1, east - west)
        return cls(cell=cell, west=west, north=south + rows, rows=rows, columns=columns)

    @property
    def shape(self) -> tuple[int, int]:
        """Return the numbers of rows and columns."""
        return self.rows, self.columns

    @property
    def x(self) -> np.ndarray:
        """Return the middles of the columns [m]."""
        return (self.west + np.arange(self.columns) + 0.5) * self.cell

    @property
    def y(self) -> np.ndarray:
        """Return the middles of the rows [m], from the north."""
        return (self.north - np.arange(self.rows) - 0.5) * self.cell

    def find(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the cell numbers of places [m], and True for places on the grid."""
        column = np.floor(x / self.cell - self.west).astype(np.int64)
        row = np.floor(self.north - y / self.cell).astype(np.int64)
        inside = (column >= 0) & (column < self.columns) & (row >= 0) & (row < self.rows)
        return row * self.columns + column, inside

    def off_middle(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the squared distances [cells²] of places [m] from the middles of their cells."""
        east, north = (place - np.floor(place) - 0.5 for place in (x / self.cell, y / self.cell))
        return east**2 + north**2


def check_cells(extent: tuple[float, float], cell: float, most: int, *, what: str = "map", cells: str = "cells",
                instead: str = "") -> None:
    """Refuse a map of a width and a height [m] that has more than ``most`` cells [m]."""
    width, height = extent
    if not width * height <= most * cell**2:
        finest = 1.05 * (width * height / most) ** 0.5
        raise ValueError(f"a {what} of {width:.4g} x {height:.4g} m in {cells} of {cell:g} m has more than {most:,} of "
                         f"them; take {cells} of {finest:.2g} m or more{instead}.")
