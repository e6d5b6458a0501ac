"""Parts of a seabed, and of things on it, that the bed hides: its horizon, azimuth by azimuth.

    hidden at (φ, x)   where   sin θ_0(x, z) < H(φ, x),     H(φ, x) = max over x' < x of sin θ_0(x', z_b(φ, x'))

θ_0 is the launch elevation of the eigenray to a point (`launch_rise`), z_b the height of the bed. A ray that leaves
lower than the one to a nearer crest of the same azimuth passes below that crest. This is exact for rays that do not
cross before the crest, and needs table look-ups instead of rays.

A bed hides parts of itself, or of what stands on it, only where it falls off more steeply than a ray comes down to it,
at an angle θ_1. With the straight line's angle α, tan α >= (z_0 - max z_b) / x, and cos θ_1 <= cos α max c / min c
(Snell's law, and a ray is somewhere as steep as its chord). The horizon begins at the first block of the grid where

    cos α max c / min c > 1 / √(1 + s²)                                           s the steepest slope of its cells

and what lies nearer is not hidden, unless it lies in the bed: `deep` tells that of points well under it.

A bed whose vertices are the nodes of a grid is used as it is. Any other bed is sampled by vertical rays at the nodes of
a grid; it needs a single height at every place. Nodes are fixed on the ground: shadows do not depend
on the part of the bed that is looked at.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, held, upload

from ..geometry import Geometry
from ..labels import SEABED
from ..protocols import strewn_shape
from ..queries.height_field import in_rows
from ..queries.several_scenes import scene_of

AZIMUTHS = 2048
FINEST, COARSEST = 1 / 1200, 1 / 100   # limits of the grid's step, relative to the reach
LOOKED_AT = 20_000                 # facets, at least, that decide the step
INSET = 1e-3                       # steps, inside the rim, where vertical rays begin
OFF_NODE = 0.01                    # steps that a vertex may lie off its node
AREA_SHARE = 25                    # percentile of the facets' areas that the step follows
WALK = 0.5                         # distance of places at which the horizon is known, in steps of the grid
MOST_PLACES = 2400                 # of these along an azimuth
AHEAD = 1.5                        # places short of a point at which its horizon is read, so it does not hide itself
NO_BED = -1e9                      # [m]: the height where there is no bed
OPEN = -2.0                        # sine that hides nothing
SLACK = 2e-4                       # sine below its own horizon at which the bed still counts as seen
SLACK_ABOVE = 6e-4                 # the same for things on the bed
BLOCK = 16                         # cells of a grid whose least height is known together
UNDER = 0.05                       # [m] under these heights, from where points count as under the bed
STEEPER = 1.05                     # margin of slopes, as heights are interpolated
WINDOW = 0.5                       # step of the sampled window, relative to the reach


@dataclass(frozen=True, kw_only=True)
class Horizon:
    """Horizon around a place, on the device."""

    sine: mi.Float  # H
    first: int  # number of the first place
    places: int  # from there on
    step: float  # [m]: between places

    def hidden(self, heading: mi.Vector2f, horizontal_range: mi.Float, rise: mi.Float, on_bed: mi.Bool) -> mi.Bool:
        """Return True for points (R,) that the bed hides, at horizontal ranges [m] and launch sines `rise`."""
        turn = dr.atan2(heading.y, heading.x) * float(AZIMUTHS / (2 * np.pi))
        turn = held(dr.select(turn < 0, turn + AZIMUTHS, turn), 0.0, AZIMUTHS - 1e-3)
        a, places = mi.UInt32(turn), dr.opaque(mi.UInt32, self.places)
        share = turn - mi.Float(a)
        place = horizontal_range * dr.opaque(mi.Float, 1 / self.step) - dr.opaque(mi.Float, AHEAD + self.first)
        k = mi.UInt32(held(place, 0.0, mi.Float(places) - 1))
        after = dr.select(a + 1 < AZIMUTHS, a + 1, 0)
        here, there = (dr.gather(mi.Float, self.sine, row * places + k) for row in (a, after))
        lower = rise < here + (there - here) * share - dr.select(on_bed, SLACK, SLACK_ABOVE)
        return lower & ((place >= 0) | dr.opaque(mi.Bool, not self.first))


class BedHorizon:
    """Horizon of a scene's seabed, up to the range `farthest` [m]."""

    def __init__(self, geometry: Geometry, farthest: float):
        self.lib, self.farthest = arrays_of(mi.Float), float(farthest)
        kinds = geometry.named.label_kinds()
        beds = [shape for shape in geometry.scene.shapes() if kinds[geometry.named.of(shape)] == SEABED
                and strewn_shape(shape) is None]                   # a field without targets lies below the bed
        self.exists = bool(beds)
        if not beds:
            return
        boxes = [bed.bbox() for bed in beds]
        self._low = np.min([np.array(box.min, float) for box in boxes], axis=0)
        self._high = np.max([np.array(box.max, float) for box in boxes], axis=0)
        own, meshes = _facet_size(geometry, beds, self.farthest), [mesh for mesh in geometry.meshes if mesh[1] in beds]
        self._scene, self._beds, self._sampled = geometry.scene, beds, None
        self._grid = _as_grid(geometry, meshes[0], own) if len(meshes) == len(beds) == 1 else None
        self._step = np.full(2, _grid_step(own, self.farthest))                  # along x and y [m]
        if self._grid is not None:
            self._step = (self._high - self._low)[:2] / (np.array(self._grid.shape[::-1]) - 1)
        self._window: tuple[tuple[int, ...], mi.Float] | None = None
        self._floor = self._lowest(meshes)
        self._steepest = self._slopes() if self._floor is not None else None

    def _lowest(self, meshes: list) -> tuple[mi.Float, np.ndarray] | None:
        """Return the least heights in blocks of the grid's cells, and their sizes [m]; None if the grid has holes."""
        grid = self._grid
        if grid is None or 0 in grid.shape:
            return None
        rows, columns = np.array(grid.shape) - 1
        if meshes[0][3] != 2 * rows * columns:
            return None
        # the nodes at the edges of a block belong to it
        lowest = _of_blocks(np.minimum, np.minimum(np.minimum(grid[:-1, :-1], grid[1:, :-1]),
                                                   np.minimum(grid[:-1, 1:], grid[1:, 1:])))
        return upload(mi.Float, lowest), np.array(lowest.shape)

    def _slopes(self) -> tuple[np.ndarray, np.ndarray, float]:
        """Return the steepest slopes (N,) of the blocks of a grid, their middles (N, 2) [m], and their radius [m]."""
        grid, (dx, dy) = self._grid, self._step
        assert grid is not None
        x, y = (np.abs(np.diff(grid, axis=axis)) * np.float32(1 / step) for axis, step in ((1, dx), (0, dy)))
        steepest = _of_blocks(np.maximum, np.hypot(np.maximum(x[:-1], x[1:]), np.maximum(y[:, :-1], y[:, 1:])))
        row, column = np.indices(steepest.shape).reshape(2, -1)
        middle = self._low[:2] + (np.stack([column, row], 1) + 0.5) * BLOCK * self._step
        return steepest.ravel().astype(float), middle, 0.5 * BLOCK * float(np.hypot(dx, dy))

    def _first(self, origin: np.ndarray, speed_ratio: float, step: float, places: int) -> int:
        """Return the number of the first of the places, a step apart, at which the bed may hide something."""
        drop = float(origin[2] - self._high[2]) if self._steepest is not None else 0.0
        if self._steepest is None or drop <= 0:
            return 0
        slope, middle, radius = self._steepest
        away = np.hypot(*(middle - origin[:2]).T)
        far = away + radius
        hides = far * speed_ratio * np.hypot(1, STEEPER * slope) > np.hypot(far, drop)
        nearest = float(np.min(away - radius, where=hides, initial=np.inf))
        return int(min(max(nearest / step - 1, 0), places - 1))

    def under(self, origin: np.ndarray) -> Callable[[dr.ArrayBase], mi.Bool] | None:
        """Return a test of points (R,) [m] that is True only for those under the bed that a place (3,) [m] lies over.

        Rays from a place over a bed without holes meet it on the way to any point under it. None if that is not known.
        """
        if not self.exists or self._floor is None:
            return None
        low, high, place = self._low, self._high, np.asarray(origin, float)
        if not ((low[:2] < place[:2]) & (place[:2] < high[:2])).all() or place[2] <= high[2]:
            return None
        lowest, (rows, columns) = self._floor
        side = BLOCK * self._step

        def under(point: dr.ArrayBase) -> mi.Bool:
            x, y = (mi.Float(part - start) * dr.opaque(mi.Float, 1 / length)
                    for part, start, length in zip(point, low, side))
            inside = (x >= 0) & (y >= 0) & (point.x < high[0]) & (point.y < high[1])
            column, row = (mi.UInt32(held(value, 0.0, dr.opaque(mi.Float, float(count - 1))))
                           for value, count in ((x, columns), (y, rows)))
            floor = dr.gather(mi.Float, lowest, row * dr.opaque(mi.UInt32, columns) + column)
            return inside & (mi.Float(point.z) < floor - UNDER)

        return under

    @property
    def highest(self) -> float:
        """Height of the beds' highest point [m]; minus infinity if there is no seabed."""
        return float(self._high[2]) if self.exists else -np.inf

    def around(self, origin: np.ndarray, launch_rise: Callable[[mi.Float, mi.Float], mi.Float],
               speed_ratio: float) -> Horizon | None:
        """Return the horizon around a place (3,) [m]; None if there is no seabed.

        `speed_ratio` is that of the largest and the least speed of sound.
        """
        if not self.exists:
            return None
        first, size = self._span(origin)
        heights = self._heights(first, size)
        step = max(float(self._step.min()) * WALK, self.farthest / MOST_PLACES)
        places = int(self.farthest / step) + 2
        first_place = self._first(origin, speed_ratio, step, places)
        places -= first_place
        base = (self._low[:2] + np.array(first) * self._step - origin[:2]) / self._step
        numbers = [dr.opaque(mi.Float, float(v)) for v in (step, *(1 / self._step), -base[0], -base[1], origin[2])]
        columns, rows, begin, count = (dr.opaque(mi.UInt32, n) for n in (*size, first_place, places))
        sine = _walked(self.lib, heights, launch_rise, numbers, columns, rows, begin, count, AZIMUTHS * places)
        return Horizon(sine=sine, first=first_place, places=places, step=step)

    def deep(self, point: mi.Point3f, active: mi.Bool) -> mi.Bool:
        """Return True for `active` points (R,) well under the bed, within the window of the last horizon."""
        if self._window is None:
            return mi.Bool(False)
        (i0, j0, columns, rows), heights = self._window
        pitch = dr.opaque(mi.UInt32, columns)
        (x, i), (y, j) = (_cell(place, low + first * step, step, count) for place, low, first, step, count in (
            (point.x, self._low[0], i0, self._step[0], columns), (point.y, self._low[1], j0, self._step[1], rows)))
        inside = active & (x >= 0) & (x <= 1) & (y >= 0) & (y <= 1)
        lower, upper = ([dr.gather(mi.Float, heights, (j + step) * pitch + i + right, inside) for right in (0, 1)]
                        for step in (0, 1))
        inside &= dr.minimum(dr.minimum(*lower), dr.minimum(*upper)) > NO_BED * 0.5
        low, high = (near + (far - near) * x for near, far in (lower, upper))
        return inside & (point.z < low + (high - low) * y - UNDER)

    def _span(self, origin: np.ndarray) -> tuple[tuple[int, int], tuple[int, int]]:
        """Return the first node and the number of nodes, along x and y, of the window about a place."""
        move = WINDOW * self.farthest
        corner = np.floor(origin[:2] / move) * move - self.farthest
        low, high = np.maximum(corner, self._low[:2]), np.minimum(corner + move + 2 * self.farthest, self._high[:2])
        first = np.floor((low - self._low[:2]) / self._step).astype(int)
        last = np.ceil((high - self._low[:2]) / self._step - 1e-6).astype(int)
        size = np.maximum(last - first + 1, 2)
        return (int(first[0]), int(first[1])), (int(size[0]), int(size[1]))

    def _heights(self, first: tuple[int, int], size: tuple[int, int]) -> mi.Float:
        """Return the heights at the nodes, rows of y; those of the last window are kept."""
        key = (*first, *size)
        if self._grid is not None and (self._window is None or self._window[0] != key):
            part = self._grid[first[1]:first[1] + size[1], first[0]:first[0] + size[0]]
            missing = [(0, wanted - present) for wanted, present in zip(size[::-1], part.shape)]
            self._window = key, upload(mi.Float, np.pad(part, missing, constant_values=NO_BED))
        if self._window is None or self._window[0] != key:
            i = dr.arange(mi.UInt32, size[0] * size[1])
            columns = dr.opaque(mi.UInt32, size[0])
            row = i // columns
            x, y = (dr.opaque(mi.Float, float(low)) + mi.Float(dr.opaque(mi.UInt32, begin) + node) * dr.opaque(
                mi.Float, float(step)) for low, begin, node, step in zip(self._low, first, (i - row * columns, row),
                                                                        self._step))
            # slightly inside, so that nodes on the rim and on edges meet facets
            x, y = (dr.clip(v, dr.opaque(mi.Float, float(low + INSET * step)),
                            dr.opaque(mi.Float, float(high - INSET * step)))
                    for v, low, high, step in zip((x, y), self._low, self._high, self._step))
            top = dr.opaque(mi.Float, float(self._high[2] + 1))
            ray = mi.Ray3f(mi.Point3f(x, y, top), mi.Vector3f(0, 0, -1))
            if self._sampled is None:
                scene = self._scene
                self._sampled = scene if len(scene.shapes()) == len(self._beds) else scene_of(self._beds)
            met = self._sampled.ray_intersect_preliminary(ray, coherent=mi.Bool(True))
            heights = dr.select(met.is_valid(), top - met.t, NO_BED)
            dr.eval(heights)
            self._window = key, heights
        return self._window[1]


def _cell(place: mi.Float, low: float, step: float, count: int) -> tuple[mi.Float, mi.UInt32]:
    """Return where in a cell of nodes a step apart places lie, from 0 to 1, and the number of the cell."""
    there = (place - dr.opaque(mi.Float, float(low))) * dr.opaque(mi.Float, 1 / float(step))
    number = mi.UInt32(held(there, 0.0, dr.opaque(mi.Float, count - 1.5)))
    return there - mi.Float(number), number


def _of_blocks(reduction: np.ufunc, cells: np.ndarray) -> np.ndarray:
    """Return a reduction of the cells (R, C) of every block."""
    for axis in (0, 1):
        cells = reduction.reduceat(cells, np.arange(0, cells.shape[axis], BLOCK), axis=axis)
    return cells


def _facet_size(geometry: Geometry, beds: list, otherwise: float) -> float:
    """Return the side [m] of squares of two of the bed's facets, where a quarter of the facets are smaller."""
    areas = []
    for _, shape, first, count in geometry.meshes:
        if shape in beds:
            vertices, faces = geometry.mesh(first, count)
            corner = vertices[faces[::max(1, count // LOOKED_AT)]]
            (ax, ay), (bx, by) = (corner[:, end, :2].T - corner[:, 0, :2].T for end in (1, 2))
            areas.append(0.5 * np.abs(ax * by - ay * bx))
    own = float(np.sqrt(2 * np.percentile(np.concatenate(areas), AREA_SHARE))) if areas else otherwise
    return max(own, 1e-6)


def _grid_step(own: float, farthest: float) -> float:
    """Return the step [m] of a grid sampled by rays: that of the facets, divided or multiplied to suit the reach."""
    finest, coarsest = FINEST * farthest, COARSEST * farthest
    return own / np.ceil(own / coarsest) if own > coarsest else own * np.ceil(finest / own)


def _as_grid(geometry: Geometry, mesh: tuple, own: float) -> np.ndarray | None:
    """Return the heights (rows of y, columns of x) of a mesh whose vertices are nodes of a grid, else None."""
    vertices = geometry.mesh(*mesh[2:])[0]
    if (grid := in_rows(vertices)) is not None:
        return grid.heights
    vertices = vertices.astype(float)
    low, extent = vertices[:, :2].min(0), np.ptp(vertices[:, :2], axis=0)
    nodes = np.maximum(np.rint(extent / own).astype(int), 1)
    columns, rows = nodes + 1
    if columns * rows != len(vertices):
        return None
    place = (vertices[:, :2] - low) / np.maximum(extent, 1e-9) * nodes
    node = np.rint(place).astype(int)
    if np.abs(place - node).max() > OFF_NODE:
        return None
    heights = np.full((rows, columns), NO_BED, np.float32)
    heights[node[:, 1], node[:, 0]] = vertices[:, 2]
    return heights


@dr.syntax
def _walked(lib, heights, launch_rise, numbers, columns, rows, first, places, total):
    """Return the running maxima of the launch sines along every azimuth: Float (total,)."""
    step, per_x, per_y, x0, y0, z0 = numbers
    azimuth = dr.arange(lib.UInt32, AZIMUTHS)
    sine, cosine = dr.sincos(lib.Float(azimuth) * float(2 * np.pi / AZIMUTHS))
    out = dr.empty(lib.Float, total)
    best, k = lib.Float(OPEN), lib.UInt32(0)
    last_x, last_y = lib.Float(columns) - 1, lib.Float(rows) - 1
    while k < places:
        x = lib.Float(first + k) * step
        px, py = dr.fma(cosine, x * per_x, x0), dr.fma(sine, x * per_y, y0)
        inside = (px >= 0) & (py >= 0) & (px < last_x) & (py < last_y) & (first + k > 0)
        j, i = lib.UInt32(dr.select(inside, px, 0)), lib.UInt32(dr.select(inside, py, 0))
        fx, fy, at = px - lib.Float(j), py - lib.Float(i), i * columns + j
        a, b = dr.gather(lib.Float, heights, at, inside), dr.gather(lib.Float, heights, at + 1, inside)
        c, d = (dr.gather(lib.Float, heights, at + columns + right, inside) for right in (0, 1))
        inside &= dr.minimum(dr.minimum(a, b), dr.minimum(c, d)) > NO_BED * 0.5
        low, high = a + (b - a) * fx, c + (d - c) * fx
        rise = launch_rise(x, low + (high - low) * fy - z0)
        best = dr.select(inside, dr.maximum(best, rise), best)
        dr.scatter(out, best, azimuth * places + k)
        k += 1
    return out
