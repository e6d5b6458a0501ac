"""Lists of soundings as text (x, y and z on each line, with or without column names), and their grids.

Soundings that are the nodes of a regular grid stay on it. Scattered soundings are averaged over the cells of a grid
(where several fall into one), then interpolated linearly over the Delaunay triangles between them. Nodes that are
farther from every sounding than a few mean distances of soundings are holes.
"""
import itertools
import logging
import math
import os
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mitsonar.device.earth import transformed
from mitsonar.device.files import FilePath

from .rasters import MOST_NODES, crs_of, is_metric, refuse_degrees, utm

if TYPE_CHECKING:
    from rasterio.crs import CRS


_MOST_TRIANGULATED = 5_000_000   # about 2 GB of triangles
_NODES = 1_000_000               # interpolated at a time
_MOST_STEPS = 1000               # from triangle to triangle; only degenerate triangulations need more
_ON_A_SIDE = 1e-9                # share of a triangle by which rounding may put a place beyond a side
_REACH = 3                       # mean distances of soundings over which heights are interpolated
_OFF_LATTICE = 0.05              # steps by which rounded coordinates may miss the nodes of a regular grid
_EMPTIEST = 20                   # most nodes of a regular grid for each sounding
_NEIGHBOURS = 0.7                # share of its soundings that must have a neighbour east, and one north

_log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True, eq=False)
class Soundings:
    """Soundings in metres.

    Parameters
    ----------
    x, y : float64 array (N,) [m]
        Eastings and northings.
    z : float64 array (N,) [m]
        Elevation or depth, as in the file.
    crs, source : rasterio.crs.CRS or None
        Coordinate systems of x and y, and of the coordinates in the file.
    """

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    crs: "CRS | None" = None
    source: "CRS | None" = None

    @property
    def distance(self) -> float:
        """Return the mean distance [m] of soundings, as if they were a square grid over their convex hull."""
        from scipy.spatial import ConvexHull, QhullError

        try:
            area = ConvexHull(np.column_stack((self.x, self.y)) - (self.x[0], self.y[0])).volume
        except QhullError:
            area = 0.0
        if not area > 0:
            raise ValueError(f"the {self.x.size} soundings lie on a line or in a point; a seabed needs an area.")
        return math.sqrt(area / self.x.size)

    def gridded(self, resolution: float | None = None) -> tuple[float, float, tuple[float, float], np.ndarray]:
        """Interpolate the soundings to a grid.

        Parameters
        ----------
        resolution : float [m], optional
            Distance of the nodes, which lie at its multiples; by default the rounded mean distance of the soundings.
            It does not change soundings that are a regular grid.

        Returns
        -------
        west, north : float [m]
            Coordinates of the first node.
        step : tuple of 2 floats [m]
            Distance to the next column east and to the next row south.
        values : float64 array (Y, X) [m]
            Rows from the north; NaN where nothing was sounded.

        Raises
        ------
        ValueError
            If the soundings span no area, or the grid would have too many nodes.
        """
        if (regular := self._regular()) is not None:
            return regular
        distance = self.distance
        if resolution is None:
            resolution = float(f"{distance:.2g}")
            _log.info("%d scattered soundings, %.3g m apart, are laid on a grid of %g m", self.x.size, distance,
                      resolution)
        first = [math.floor(axis.min() / resolution) for axis in (self.x, self.y)]
        columns, rows = (math.ceil(axis.max() / resolution) - start + 1
                         for axis, start in zip((self.x, self.y), first))
        if rows * columns > MOST_NODES:
            raise ValueError(f"at {resolution:g} m the soundings span {rows} x {columns} nodes, more than "
                             f"{MOST_NODES:.0e}; use a coarser resolution.")
        values = self._interpolated(first, columns, rows, resolution, _REACH * max(resolution, distance))
        return first[0] * resolution, (first[1] + rows - 1) * resolution, (resolution, resolution), values[::-1]

    def _regular(self):
        """Return the result of `gridded` for soundings at the nodes of a regular grid; None for others."""
        columns_of, rows_of = _lattice(self.x), _lattice(self.y)
        if columns_of is None or rows_of is None:
            return None
        (west, step_x, columns), (south, step_y, rows) = columns_of, rows_of
        if columns * rows > max(_EMPTIEST * self.x.size, 100):
            return None
        node = _node(self.y, south, step_y) * columns + _node(self.x, west, step_x)
        values = _means(node, rows * columns, self.z).reshape(rows, columns)
        # Coordinates rounded to metres lie on a lattice too, but few of its nodes have neighbours.
        filled = np.isfinite(values)
        for here, beside in (filled[:, :-1], filled[:, 1:]), (filled[:-1], filled[1:]):
            if np.count_nonzero(here & beside) < _NEIGHBOURS * np.count_nonzero(here):
                return None
        return west, south + (rows - 1) * step_y, (step_x, step_y), values[::-1]

    def _interpolated(self, first, columns, rows, resolution, reach):
        """Return the heights (Y, X), rows from the south, at multiples of the resolution from ``first``."""
        from scipy.spatial import Delaunay, KDTree, QhullError

        x, y = self.x / resolution - first[0], self.y / resolution - first[1]  # [nodes]
        cell = np.rint(y).astype(np.int64) * columns + np.rint(x).astype(np.int64)
        filled, cell, count = np.unique(cell, return_inverse=True, return_counts=True)
        if filled.size > _MOST_TRIANGULATED:
            raise ValueError(f"{filled.size} cells of {resolution:g} m hold soundings, more than "
                             f"{_MOST_TRIANGULATED:.0e}; use a coarser resolution, or grid the survey.")
        x, y, z = (np.bincount(cell, values) / count for values in (x, y, self.z))
        places = np.column_stack((x, y))
        try:
            triangles = Delaunay(places)
        except QhullError:
            raise ValueError(f"in cells of {resolution:g} m the soundings lie on a line; use a finer "
                             "resolution.") from None
        near, values = KDTree(places), np.full(rows * columns, np.nan)
        for start in range(0, rows * columns, _NODES):
            node = np.arange(start, min(start + _NODES, rows * columns))
            wanted = np.column_stack((node % columns, node // columns)).astype(float)
            away, nearest = near.query(wanted, distance_upper_bound=reach / resolution)
            inside = np.isfinite(away)
            values[node[inside]] = _on_triangles(triangles, z, wanted[inside], np.asarray(nearest)[inside])
        return values.reshape(rows, columns)


def _on_triangles(triangles, z, places, nearest):
    """Interpolate linearly at places (N, 2), each near a corner of the triangulation; NaN beyond its hull.

    The search starts from a triangle at that corner and steps through the side beyond which the place lies farthest.
    (SciPy's own search first inverts a matrix for each triangle by LAPACK: minutes for a million triangles where its
    threads contend.)
    """
    at, values = triangles.vertex_to_simplex[nearest], np.full(len(places), np.nan)
    walking = np.flatnonzero(at >= 0)
    for _ in range(_MOST_STEPS):
        corners = triangles.simplices[at[walking]]
        (x0, y0), (x1, y1), (x2, y2) = (triangles.points[corners[:, i]].T for i in range(3))
        x, y = places[walking].T
        with np.errstate(divide="ignore", invalid="ignore"):        # triangles without area are left at once
            area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
            second = ((x - x0) * (y2 - y0) - (x2 - x0) * (y - y0)) / area
            third = ((x1 - x0) * (y - y0) - (x - x0) * (y1 - y0)) / area
        weights = np.stack((1 - second - third, second, third), axis=-1)
        side = np.argmin(weights, axis=1)
        inside = np.take_along_axis(weights, side[:, None], 1)[:, 0] >= -_ON_A_SIDE
        values[walking[inside]] = np.sum(weights * z[corners], axis=1)[inside]
        at[walking] = triangles.neighbors[at[walking], side]
        walking = walking[~inside & (at[walking] >= 0)]
        if walking.size == 0:
            break
    return values


def _lattice(values):
    """Return the first, the step and the number of evenly spaced coordinates, or None if their steps differ."""
    places = np.unique(values)
    if places.size < 2:
        return None
    gaps = np.diff(places)
    # Rounding splits one coordinate into several.
    gaps = gaps[gaps > 2 * _OFF_LATTICE * np.median(gaps)]
    number = round((places[-1] - places[0]) / np.median(gaps))
    if not 1 <= number < MOST_NODES:
        return None
    step = (places[-1] - places[0]) / number
    away = (places - places[0]) / step
    return (places[0], step, number + 1) if np.abs(away - np.rint(away)).max() < _OFF_LATTICE else None


def _node(values, first, step):
    return np.rint((values - first) / step).astype(np.int64)


def _means(node, count, values):
    """Return the mean of the values at each of ``count`` nodes, NaN for nodes without values."""
    number = np.bincount(node, minlength=count)
    return np.bincount(node, values, minlength=count) / np.where(number, number, np.nan)


_SUFFIXES = (".xyz", ".txt", ".csv", ".tsv", ".pts", ".dat")
_MOST_SOUNDINGS = 50_000_000     # 1.2 GB
_LINES = 1_000_000               # read at a time
_NAMES = {"x": ("x", "easting", "east", "e", "lon", "long", "longitude"),
          "y": ("y", "northing", "north", "n", "lat", "latitude"),
          "z": ("z", "depth", "elevation", "height", "altitude")}
_GEOGRAPHIC = ("lon", "long", "longitude")


def holds_soundings(path: FilePath) -> bool:
    """Return True if a file is text with three numbers a line at its start, or has a usual name of such files."""
    if os.path.isfile(path) and str(path).lower().endswith(_SUFFIXES):
        return True
    try:
        with open(path, "rb") as file:
            lines = file.read(4096).decode("ascii").splitlines()
    except (OSError, UnicodeDecodeError):
        return False
    first = next((line for line in lines if line.strip() and not line.lstrip().startswith("#")), "")
    return len(_numbers(first)) >= 3


def read(path: FilePath, *, crs: str | None = None, nodata: float | None = None) -> Soundings:
    """Read a list of soundings.

    Blanks, tabs, commas or semicolons divide the columns, and ``#`` starts a comment. A header may name the columns.
    Without these names the first three columns are x, y and z. Soundings whose z is NaN are left out.

    Parameters
    ----------
    path : path
    crs : str, optional
        Coordinate system; by default "EPSG:4326" for columns named longitude and latitude, else metres.
    nodata : float, optional
        Value of z that means no sounding.

    Returns
    -------
    Soundings
        Degrees and feet are converted to metres of the UTM zone at their middle.

    Raises
    ------
    ValueError
        If a line does not hold three numbers, or the file holds fewer than three soundings or too many.
    """
    divider, skipped, columns, geographic = _layout(path)
    parts, total = [], 0
    with open(path, encoding="utf-8-sig", errors="replace") as file:
        for _ in range(skipped):
            file.readline()
        while True:
            lines = list(itertools.islice(file, _LINES))
            if not lines:
                break
            parts.append(_parsed(lines, divider, columns, skipped + total))
            total += len(lines)
            if total > _MOST_SOUNDINGS:
                raise ValueError(f"the file has more than {_MOST_SOUNDINGS} lines; grid it, or thin it out.")
    x, y, z = np.concatenate(parts).T if parts else np.empty((3, 0))
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise ValueError("a sounding has no place: x or y is not a finite number; remove it.")
    kept = np.isfinite(z) if nodata is None else np.isfinite(z) & (z != nodata)
    x, y, z = (values[kept] for values in (x, y, z))
    if z.size < 3:
        raise ValueError(f"the file holds {z.size} soundings; a seabed needs three at least.")
    source = crs_of(crs) if crs is not None else crs_of("EPSG:4326") if geographic else None
    if source is None:
        refuse_degrees((x.min(), y.min(), x.max(), y.max()))
    if is_metric(source):
        return Soundings(x=x, y=y, z=z, crs=source, source=source)
    return in_metres(x, y, z, source)


def in_metres(x: np.ndarray, y: np.ndarray, z: np.ndarray, source: "CRS") -> Soundings:
    """Return soundings in a system of other units in metres of the UTM zone at their middle."""
    target = utm((x.min() + x.max()) / 2, (y.min() + y.max()) / 2, source)
    x, y = transformed(source.to_wkt(), target.to_wkt(), x, y)
    return Soundings(x=x, y=y, z=z, crs=target, source=source)


def _layout(path):
    """Return the divider, the lines before the first sounding, the columns of x, y, z, and whether they are degrees."""
    with open(path, "rb") as file:
        head = file.read(1 << 16)
    if b"\0" in head:
        raise ValueError("this is no text; soundings are lines of x, y and z.")
    if b"\n" not in head and len(head) == 1 << 16:
        raise ValueError("the first line has no end; soundings are lines of x, y and z.")
    names, skipped = [], 0
    for line in head.decode("utf-8-sig", "replace").splitlines():
        if line.strip() and not line.lstrip().startswith("#"):
            if len(_numbers(line)) >= 2:
                break
            if names:
                raise ValueError(f'line {skipped + 1}, "{line.strip()[:60]}", does not hold x, y and z.')
            names = re.split(r"[,;\s]+", re.sub(r"[(\[].*?[)\]]", "", line).strip().strip('"').lower())
        skipped += 1
    else:
        raise ValueError("the file holds no soundings; they are lines of x, y and z.")
    divider = next((mark for mark in ",;" if mark in line), None)
    columns = [next((index for index, name in enumerate(names) if name in _NAMES[key]), -1) for key in "xyz"]
    if -1 in columns:
        return divider, skipped, (0, 1, 2), False
    return divider, skipped, tuple(columns), names[columns[0]] in _GEOGRAPHIC


def _parsed(lines, divider, columns, before):
    """Return x, y and z (N, 3) of lines, the first of which has number ``before + 1``."""
    try:
        return np.loadtxt(lines, delimiter=divider, usecols=columns, ndmin=2, comments="#").reshape(-1, 3)
    except ValueError:
        pass
    for number, line in enumerate(lines, before + 1):      # NumPy does not count empty lines and comments
        words = line.partition("#")[0]
        try:
            if words.strip():
                np.loadtxt([line], delimiter=divider, usecols=columns)
        except ValueError:
            raise ValueError(f'line {number}, "{line.strip()[:60]}", does not hold x, y and z as numbers.') from None
    raise ValueError("the file does not hold x, y and z as numbers.")


def _numbers(line):
    """Return the numbers at the start of a line."""
    values = []
    for word in re.split(r"[,;\s]+", line.partition("#")[0].strip()):
        try:
            values.append(float(word))
        except ValueError:
            break
    return values
