"""Scatterers only as dense as the resolution needs, fixed to the ground: for images in the beam domain.

A surface of area A and normal n, seen at the distance R along the unit vector l by a line array along the unit vector
a, covers the area A |n·(l × a)| / R of an image over range and sine. A facet gets

    m = q A max(|n·(l × a)|, 1/4) / (R ΔR Δs)                                                       scatterers,      (1)

q of them in a resolution cell ΔR Δs, by the m of (1) at the place of each scatterer (`nested_points`). The mean echo
does not depend on m. As the sonar moves, single scatterers come or go while all others keep place and amplitude: sets
are nested, and the seabed stays the same.

A line array along the unit vector b that sends or receives across the first one resolves sines Δt. Where its main lobe
meets the surface, a resolution cell is a piece of that lobe, and a facet gets

    max(m, q p A max(|n·(l × b)| / ΔR, |n·l| / (R Δs)) / (R Δt))                                     scatterers;     (2)

p -> ``finer``. Outside the lobe it gets fewer than (1). The direction to the lobe is computed from that array's own
middle, because arrays that stand apart see a near scatterer in directions that differ by more than a lobe.
"""
from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from typing import Protocol

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, opaque_vector, upload
from mitsonar.scene.geometry import scattered_rows

from .cells import divisions
from .nested_points import LEVELS, MOST_OF_A_FACET
from .patch_groups import FEWEST, PatchGroups
from .scatterers import Cells, Scatterers, to_box

EDGE_ON = 0.25                     # share of the density that a surface seen edge-on keeps
NEAREST = 0.3                      # [m] range below which the density no longer grows
MOST_PATCHES = 2_000_000           # approximate limit of the cutting of large facets
MOST = 1 << 26                     # scatterers of a ping
SHARE = 1 / 64                     # greatest length of a patch, relative to the reach
ACROSS = 1.4                       # scatterers per equivalent width of a long face's two-way beam, over q
LOBE = 1.0, 2.0                    # cells from the axis at which the main lobe begins and ends to fall off
BESIDE = 0.5, 1 / 256              # share of scatterers one cell outside the lobe, falling as 1 / distance; least share
COARSER = 3                        # levels up from a patch to the triangles that are left out beyond the reach
SLACK = 1e-3                       # of limits that are computed for groups of patches
BLOCK, SMALL_BLOCK = 1024, 64      # patches that are tested together when those of a ping are chosen


class Useful(Protocol):
    """Test of directions and distances [m], which says which matter."""

    def __call__(self, direction: mi.Vector3f, distance: mi.Float, wider: mi.Float | float = 0.0, /) -> mi.Bool:
        """Return True for those that matter, or others do up to an angle `wider` [rad] off."""
        ...


@dataclass(frozen=True, kw_only=True)
class TransmitLobe:
    """Main lobe of a transmitting line array, or of a long element."""

    axis: np.ndarray  # (3,) [-]: b
    sine: float  # to which it is steered, along the axis
    cell: float  # Δt, by which the lobe is wide
    finer: float  # density over that of q scatterers in Δt
    place: np.ndarray  # (3,) [m]: middle of the line, from the density's origin, scene coordinates


@dataclass(frozen=True, kw_only=True)
class Density:
    """Density of scatterers that a ping needs."""

    origin: np.ndarray  # (3,) [m]: point from which distances are measured, scene coordinates
    axis: np.ndarray  # (3,) [-]: a, of the line
    per_cell: float  # q
    range_cell: float  # ΔR [m]
    sine_cell: float  # Δs [-]
    nearest: float  # [m]: limits of the distances that matter
    farthest: float
    planned: bool = True  # True for a ping from one of the places that patches were made for
    around: bool = False  # True if the image is one over range and the bearing about the axis
    lobes: tuple[TransmitLobe, ...] = ()  # of lines that send or receive across the line


class ThinnedScatterers:
    """The patches of a scene, and the scatterers that a ping needs of them.

    With `everywhere`, pings may also come from other places than the given ones. Patches beyond the reach of those are
    coarser where a scene has many, and tested with the directions that they fill.
    """
    # farthest, margin [m]; places (P, 3) [m]

    def __init__(self, facets: Scatterers, *, farthest: float, places: np.ndarray, everywhere: bool = False,
                 margin: float = 0.0):
        self.lib, self._facets = arrays_of(mi.Float), facets
        near = facets.near(places, farthest)
        level = _levels(facets, farthest, near)
        if everywhere:
            level = np.maximum(level, _levels(facets, farthest, facets.scattering & ~near))
        self._facet, first = _patches_of(level)
        if not everywhere and level.max(initial=0) >= COARSER:
            kept = _within(facets, level, self._facet, first, farthest + margin, places)
            self._facet, first = self._facet[kept], first[kept]
        self._planned = near[self._facet] if everywhere else None
        level = level[self._facet].astype(np.uint32)
        # for each patch: its facet, the first scatterer, and 2 L
        beyond = np.zeros_like(level) if self._planned is None else ~self._planned
        facts = np.stack([self._facet, first, 2 * level, beyond], 1, dtype=np.uint32)
        self._patches = upload(mi.UInt32, facts)
        # numbers of scatterers above which the first one of a patch exists
        threshold = (first.astype(np.float32) + facets.threshold[self._facet]) / np.ldexp(np.float32(1), 2 * level)
        self._threshold = upload(mi.Float, threshold)
        self._table = self._rows_of(dr.arange(mi.UInt32, len(facts)))
        table = self._table.numpy().reshape(-1, 8)
        self._groups: PatchGroups | None = None
        if len(table) >= FEWEST and not everywhere:
            self._groups = PatchGroups(table, threshold, ~facets.moving[self._facet])
        # facets of a whole scene are many more than a ping reaches
        self._block = SMALL_BLOCK if everywhere else BLOCK
        self._blocks = _balls(table[:, :3], table[:, 7], self._block)
        self._moving = moving = np.flatnonzero(facets.moving[self._facet]).astype(np.uint32)
        # blocks that hold moving patches, with all of their patches
        self._moving_blocks = np.unique(moving // self._block)
        self._beside = np.concatenate([np.zeros(0, int), *(
            np.arange(b * self._block, min((b + 1) * self._block, len(table))) for b in self._moving_blocks)])
        self._rows, self._row = table[self._beside], np.searchsorted(self._beside, moving)
        facets.geometry.follow(self._moved)

    def _rows_of(self, patch: mi.UInt32) -> mi.Float:
        """Return centre, area, normal and radius of patches as they stand, packed (N, 8)."""
        if not dr.width(patch):
            return mi.Float()
        lib = self.lib
        facet, first, twice_level, _ = dr.gather(lib.Array4u, self._patches, patch)
        a, b, c = (mi.Vector3f(corner) for corner in self._facets.triangles(facet, first, twice_level >> 1))
        centre, cross = (a + b + c) / 3, dr.cross(b - a, c - a)
        twice = dr.norm(cross)
        normal = cross / dr.maximum(twice, 1e-30)
        radius = reduce(dr.maximum, (dr.norm(corner - centre) for corner in (a, b, c)))
        rows, half = dr.empty(mi.Float, 8 * dr.width(patch)), 2 * dr.arange(mi.UInt32, dr.width(patch))
        dr.scatter(rows, lib.Array4f(*centre, 0.5 * twice), half)
        dr.scatter(rows, lib.Array4f(*normal, radius), half + 1)
        dr.eval(rows)
        return rows

    def _moved(self) -> None:
        """Measure the patches of moving objects anew, and the balls of their blocks."""
        if not len(self._moving):
            return
        rows = self._rows_of(upload(mi.UInt32, self._moving)).numpy().reshape(-1, 8)
        self._table = scattered_rows(self._table, self._moving, rows, 8)
        self._rows[self._row] = rows
        centre, radius = self._blocks
        # the blocks are taken whole and in order, so that only the last one may have fewer patches
        centre[self._moving_blocks], radius[self._moving_blocks] = _balls(
            self._rows[:, :3], self._rows[:, 7], self._block)

    @property
    def patches(self) -> int:
        """Return the number of patches."""
        return len(self._facet)

    def candidates(self, density: Density,
                   useful: Useful) -> tuple[mi.UInt32, mi.UInt32]:
        """Return the patches and the numbers in them, UInt32 (R,), of all scatterers that may exist."""
        patches = self._in_reach(density)
        if not len(patches):
            return mi.UInt32(), mi.UInt32()
        patch = upload(mi.UInt32, patches)
        centre, area, normal, radius = self._patch(patch)
        d = mi.Vector3f(centre) - opaque_vector(mi.Vector3f, density.origin)
        R = dr.norm(d)
        least = dr.maximum(dr.maximum(abs(dr.dot(d, normal)), R - radius), NEAREST)
        sight = d / dr.maximum(R, NEAREST)
        reached = (R - radius < dr.opaque(mi.Float, density.farthest)) & (
            R + radius > dr.opaque(mi.Float, density.nearest)) & useful(
                sight, dr.maximum(R - radius, NEAREST), self._filled(patch, radius / least))
        most = dr.minimum(_count(density, normal, sight, least, area, d, radius), self._most(patch))
        number = dr.select(reached, dr.maximum(dr.ceil(most - dr.gather(mi.Float, self._threshold, patch)), 0), 0)
        total = float(dr.sum(number)[0])
        if not total <= MOST:
            raise ValueError(f"A ping needs {total:.2g} scatterers of this scene; the limit is {MOST:.1e}. Use fewer "
                             "scatterers per cell, a longer pulse or a shorter range.")
        number = mi.UInt32(number)
        if not total:
            return mi.UInt32(), mi.UInt32()
        return _listed(self.lib, patch, number, int(dr.sum(number)[0]))

    def at(self, patch: mi.UInt32, number: mi.UInt32, density: Density) -> tuple[Cells, mi.Bool]:
        """Return scatterers 0, 1, 2 ... of patches, and True for those that exist."""
        facet, first, twice_level, _ = dr.gather(self.lib.Array4u, self._patches, patch)
        k = first + (number << twice_level)
        cells = self._facets.at(facet, k)
        d = mi.Vector3f(cells.point - opaque_vector(self.lib.Array3f64, density.origin))
        R = dr.maximum(dr.norm(d), NEAREST)
        m = dr.minimum(_count(density, cells.normal, d / R, R, cells.area, d), MOST_OF_A_FACET)
        return self._facets.glinted(cells, cells.area / dr.maximum(m, 1e-30)), self._facets.exist(facet, k, m)

    def _in_reach(self, density):
        """Return the numbers of the patches, uint32, in groups or blocks that lie within reach."""
        if self._groups is not None:
            return self._groups.reaching(_most_of_groups(density, self._groups))
        centre, radius = self._blocks
        distance = np.linalg.norm(centre - density.origin, axis=1)
        blocks = np.flatnonzero((distance - radius < density.farthest) & (distance + radius > density.nearest))
        patches = (blocks[:, None] * self._block + np.arange(self._block)).ravel()
        patches = patches[patches < len(self._facet)].astype(np.uint32)
        # the margin beyond the reach has facets that count only for other pings: planned pings leave them out
        return patches[self._planned[patches]] if density.planned and self._planned is not None else patches

    def _patch(self, patch):
        """Return centre, area, normal and radius of patches."""
        first, second = (dr.gather(self.lib.Array4f, self._table, 2 * patch + half) for half in (0, 1))
        return (mi.Point3f(first[0], first[1], first[2]), first[3], mi.Vector3f(second[0], second[1], second[2]),
                second[3])

    def _filled(self, patch: mi.UInt32, angle: mi.Float) -> mi.Float | float:
        """Return the angles that patches may fill about their middles [rad]; planned ones are small enough for 0."""
        if self._planned is None:
            return 0.0
        beyond = dr.gather(self.lib.Array4u, self._patches, patch)[3] != 0
        return dr.select(beyond, angle, 0)

    def _most(self, patch):
        """Return the greatest number of scatterers of a patch."""
        twice_level = dr.gather(self.lib.Array4u, self._patches, patch)[2]
        return MOST_OF_A_FACET / mi.Float(mi.UInt32(1) << twice_level)


def _levels(facets: Scatterers, farthest: float, wanted: np.ndarray) -> np.ndarray:
    """Return the level of the patches of each facet, int64 (F,); -1 where it has none, because it is not wanted.

    Patches are at most a share of the reach long, or longer where there would be too many.
    """
    side = facets.longest_side
    area = float(np.sum(side[wanted] ** 2))
    longest = max(farthest * SHARE, np.sqrt(area / MOST_PATCHES))
    level = np.ceil(np.log2(divisions(side, longest))).astype(np.int64)
    return np.where(wanted, np.minimum(level, LEVELS - 1), -1)


def _patches_of(level: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return facets and first scatterers, uint32 (P,), of all patches of facets that are cut to levels (F,)."""
    count = np.where(level < 0, 0, 4 ** np.maximum(level, 0))
    facet = np.repeat(np.arange(len(count), dtype=np.uint32), count)
    return facet, (np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)).astype(np.uint32)


def _within(facets: Scatterers, level: np.ndarray, facet: np.ndarray, first: np.ndarray, farthest: float,
            places: np.ndarray) -> np.ndarray:
    """Return True (P,) for the patches of `_patches_of` in coarser triangles that reach into the range, or that move.

    The triangle of a level in which scatterer k lies is that of the number k modulo 4^level.
    """
    level = np.where(level < 0, -1, np.maximum(level - COARSER, 0))
    coarse, number = _patches_of(level)
    centre, radius = facets.balls(coarse, number, level[coarse])
    within = facets.moving[coarse] | (to_box(centre, places) - radius < (1 + SLACK) * farthest)
    begin = np.searchsorted(coarse, np.arange(len(level)))
    return within[begin[facet] + (first & (4 ** np.maximum(level, 0) - 1).astype(np.uint32)[facet])]


def _balls(centre: np.ndarray, radius: np.ndarray, block: int) -> tuple[np.ndarray, np.ndarray]:
    """Return middles (B, 3) and radii (B,) of balls that contain the patches of blocks of a length."""
    starts = np.arange(0, len(centre), block)
    if not len(starts):
        return np.zeros((0, 3)), np.zeros(0)
    low = np.minimum.reduceat(centre - radius[:, None], starts).astype(float)
    high = np.maximum.reduceat(centre + radius[:, None], starts).astype(float)
    return 0.5 * (low + high), 0.5 * np.linalg.norm(high - low, axis=1)


def _most_of_groups(density: Density, groups: PatchGroups) -> np.ndarray:
    """Return upper limits of m (G,) for the patches of groups, a little more than `_count` gives; 0 out of reach."""
    def away(place: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        d = groups.centre - place
        R = np.linalg.norm(d, axis=1)
        return d, R, np.maximum(R - groups.radius, NEAREST)

    d, R, distance = away(density.origin)
    wide = (1 + SLACK) * (groups.spread + groups.radius / distance)
    across = np.abs(np.sum(np.cross(d, density.axis) * groups.normal, 1)) / np.maximum(R, NEAREST)
    seen = 1.0 if density.around else np.clip(across + wide, EDGE_ON, 1)
    per_area = (1 + SLACK) * density.per_cell * groups.area / distance
    m = per_area * seen / (density.range_cell * density.sine_cell)
    most, by_sine = np.zeros_like(m) if density.lobes else m, 1 / (distance * density.sine_cell)
    for lobe in density.lobes:
        from_line, middle, nearest = away(density.origin + lobe.place)
        off = np.abs(from_line @ lobe.axis / np.maximum(middle, NEAREST) - lobe.sine)
        off = np.maximum(off - (1 + SLACK) * groups.radius / nearest, 0) / lobe.cell
        finer = per_area * lobe.finer * np.maximum(by_sine, 1 / density.range_cell) / lobe.cell
        begin, end = LOBE
        inside = np.clip((end - off) / (end - begin), 0, 1)
        beside = np.maximum(BESIDE[0] / np.maximum(off, BESIDE[0]), BESIDE[1])
        most = np.maximum(most, np.maximum(inside * np.maximum(m, finer), beside * m))
    reached = (R - groups.radius < density.farthest) & (R + groups.radius > density.nearest)
    return np.where(reached, most, 0.0)


def _covered(density: Density, normal: mi.Vector3f, sight: mi.Vector3f) -> mi.Float:
    """Return |n·(l × a)| of (1) along unit vectors l."""
    axis = opaque_vector(mi.Vector3f, density.axis)
    if not density.around:
        return abs(dr.dot(normal, dr.cross(sight, axis)))
    across = axis - dr.dot(axis, sight) * sight
    return abs(dr.dot(normal, across)) * dr.rcp(dr.maximum(dr.norm(across), 1e-6))


def _count(density: Density, normal: mi.Vector3f, sight: mi.Vector3f, distance: mi.Float, area: mi.Float,
           offset: mi.Vector3f, radius: mi.Float | float = 0.0) -> mi.Float:
    """Return m of (1) and (2) along unit vectors l; with `radius` [m], its upper limit within that distance."""
    per_area = dr.opaque(mi.Float, density.per_cell / (density.range_cell * density.sine_cell))
    slack = radius / distance
    seen = dr.minimum(_covered(density, normal, sight) + slack, 1)
    m = per_area * dr.maximum(seen, EDGE_ON) * area / distance
    if not density.lobes:
        return m
    by_sine = dr.minimum(abs(dr.dot(normal, sight)) + slack, 1) / (distance * dr.opaque(mi.Float, density.sine_cell))
    shares = [_in_lobe(lobe, density, normal, sight, distance, area, offset, radius, m, by_sine)
              for lobe in density.lobes]
    return reduce(dr.maximum, shares)


def _in_lobe(lobe: TransmitLobe, density: Density, normal: mi.Vector3f, sight: mi.Vector3f, distance: mi.Float,
             area: mi.Float, offset: mi.Vector3f, radius: mi.Float | float, m: mi.Float, by_sine: mi.Float) -> mi.Float:
    """Return m of (2) for one lobe, where (1) gives m."""
    b, cell, slack = opaque_vector(mi.Vector3f, lobe.axis), dr.opaque(mi.Float, lobe.cell), radius / distance
    # near the sonar, the direction from the line differs from that from the origin
    seen = offset - opaque_vector(mi.Vector3f, lobe.place)
    away = dr.maximum(dr.norm(seen), NEAREST)
    wide = radius / dr.maximum(dr.maximum(abs(dr.dot(seen, normal)), away - radius), NEAREST)
    off = dr.maximum(abs(dr.dot(seen / away, b) - dr.opaque(mi.Float, lobe.sine)) - wide, 0) / cell
    by_range = dr.minimum(abs(dr.dot(normal, dr.cross(sight, b))) + slack, 1) / dr.opaque(mi.Float, density.range_cell)
    per_cell = dr.opaque(mi.Float, density.per_cell * lobe.finer)
    finer = per_cell * dr.maximum(by_range, by_sine) * area / (distance * cell)
    begin, end = LOBE
    inside = dr.minimum(dr.maximum((end - off) / (end - begin), 0), 1)
    beside = dr.maximum(BESIDE[0] * dr.rcp(dr.maximum(off, BESIDE[0])), BESIDE[1])
    return dr.maximum(inside * dr.maximum(m, finer), beside * m)


@dr.syntax
def _listed(lib, patch, number, total):
    """Return every patch repeated by its number of scatterers, and the scatterers' numbers."""
    start = dr.prefix_sum(number)                         # scatterers of the patches before
    patches, numbers = dr.empty(lib.UInt32, total), dr.empty(lib.UInt32, total)
    k = lib.UInt32(0)
    while k < number:
        dr.scatter(patches, patch, start + k)
        dr.scatter(numbers, k, start + k)
        k += 1
    return patches, numbers

