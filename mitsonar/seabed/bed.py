"""Heights of a seabed of triangles, looked up without rays.

Triangles are sorted by size into levels of side s = 2^n >= extent, and within a level by the square of side s with the
south-western corner of their bounding box. A triangle over a point therefore lies in the point's square or in its
neighbours to the west, the south and the south-west.
"""
from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

_EDGE = 1e-6                       # tolerance relative to a triangle, so that neighbours leave no gap


class _Level(NamedTuple):
    side: float                    # [m] of a square
    columns: int
    keys: np.ndarray               # (F,) row * columns + column, increasing
    faces: np.ndarray              # (F, 3) in the order of the keys


class Bed:
    """Seabed of triangles.

    Parameters
    ----------
    vertices : array (V, 3) [m]
        Scene coordinates, z up.
    faces : array (F, 3) of int
        Vertices of each triangle.

    Attributes
    ----------
    vertices : array (V, 3) [m]
        Scene coordinates, as given.
    bounds : (float, float, float, float) [m]
        West, south, east and north.
    lowest : float [m]
        Height of the lowest vertex.

    Raises
    ------
    ValueError
        If all triangles are vertical.
    """

    def __init__(self, vertices: ArrayLike, faces: ArrayLike):
        self.vertices = np.asarray(vertices)
        faces = np.asarray(faces)
        # corner by corner, which is much faster than along an axis of three
        (west, east), (south, north) = (_ends([self.vertices[:, axis][faces[:, corner]] for corner in range(3)])
                                        for axis in (0, 1))
        extent = np.maximum(east - west, north - south)
        flat = (extent > 0) & np.isfinite(extent)
        if not flat.any():
            raise ValueError("the seabed has no triangle that can be seen from above; give a mesh with some width")
        self.bounds = (float(west[flat].min()), float(south[flat].min()),
                       float(east[flat].max()), float(north[flat].max()))
        self.lowest = float(np.nanmin(self.vertices[:, 2]))
        size = np.where(flat, np.frexp(extent)[1], np.iinfo(np.int32).min)
        self._levels = [self._level(2.0**exponent, faces[of_size], west[of_size], south[of_size])
                        for exponent in np.unique(size[flat]) for of_size in (np.flatnonzero(size == exponent),)]

    def _level(self, side: float, faces: np.ndarray, west: np.ndarray, south: np.ndarray) -> _Level:
        columns = int((self.bounds[2] - self.bounds[0]) // side) + 3
        keys = self._key(west, south, side, columns)
        order = np.argsort(keys, kind="stable")
        return _Level(side, columns, keys[order], faces[order])

    def _key(self, x: np.ndarray, y: np.ndarray, side: float, columns: int) -> np.ndarray:
        column = np.floor((np.asarray(x, float) - self.bounds[0]) / side).astype(np.int64)
        row = np.floor((np.asarray(y, float) - self.bounds[1]) / side).astype(np.int64)
        return row * columns + column + 1

    def heights(self, x: ArrayLike, y: ArrayLike) -> np.ndarray:
        """Return the height (Q,) [m] of the highest triangle at points x, y (Q,) [m]; NaN without a triangle."""
        x, y = np.asarray(x, float), np.asarray(y, float)
        west, south, east, north = self.bounds
        inside = np.flatnonzero((x >= west) & (x <= east) & (y >= south) & (y <= north))
        best = np.full(x.shape, -np.inf)
        for level in self._levels:
            here = self._key(x[inside], y[inside], level.side, level.columns)
            for row in (here, here - level.columns):
                first = np.searchsorted(level.keys, row - 1, "left")
                count = np.searchsorted(level.keys, row, "right") - first
                pair = np.repeat(first - np.cumsum(count) + count, count) + np.arange(count.sum())
                point = np.repeat(inside, count)
                np.maximum.at(best, point, self._height(level.faces[pair], x[point], y[point]))
        return np.where(np.isinf(best), np.nan, best)

    def _height(self, faces: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the height of each triangle at its point; -inf beside the triangle."""
        a, b, c = (self.vertices[faces[:, corner]].astype(float) for corner in range(3))
        (u_x, u_y, u_z), (v_x, v_y, v_z) = (b - a).T, (c - a).T
        d_x, d_y = x - a[:, 0], y - a[:, 1]
        area = u_x * v_y - u_y * v_x
        with np.errstate(divide="ignore", invalid="ignore"):           # a vertical triangle covers no point
            u, v = (d_x * v_y - d_y * v_x) / area, (u_x * d_y - u_y * d_x) / area
            height = a[:, 2] + u * u_z + v * v_z
            over = (u >= -_EDGE) & (v >= -_EDGE) & (u + v <= 1 + _EDGE) & np.isfinite(height)
            return np.where(over, height, -np.inf)


def _ends(corners: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest and the highest of three corners, each (F,)."""
    a, b, c = corners
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
