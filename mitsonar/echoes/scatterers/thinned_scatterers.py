"""Scatterers only as dense as the resolution needs, fixed to the ground: for images in the beam domain.

A patch of surface (a facet, or a part of a large one) of area A and normal n, seen at the distance R along the unit
vector l by a line array along the unit vector a, covers the area A |n·(l × a)| / R of an image over range and sine. It
gets

    m = q A max(|n·(l × a)|, 1/4) / (R ΔR Δs)                                                       scatterers,      (1)

q of them in a resolution cell ΔR Δs. Scatterer k = 0, 1, 2 ... of a patch lies at the place k of a low-discrepancy
sequence (Roberts 2018, R2: steps of 1/g and 1/g², g³ = g + 1) whose start is hashed from the patch. Its complex
Gaussian amplitude is hashed too. It exists while

    k + h < m,     m of (1) at the scatterer's own place, h in [0, 1) hashed from the patch                          (2)

and stands for the area A / m. The mean echo therefore does not depend on m. As the sonar moves, single scatterers come
or go while all others keep place and amplitude: sets are nested, and the seabed stays the same.

A line array along the unit vector b that sends or receives across the first one resolves sines Δt. Where its main lobe
meets the surface, a resolution cell is a piece of that lobe, and a patch gets

    max(m, q A max(|n·(l × b)| / ΔR, |n·l| / (R Δs)) / (R Δt))                                       scatterers;     (3)

outside the lobe it gets fewer than (1). The direction to the lobe is computed from that array's own middle, because
arrays that stand apart see a near scatterer in directions that differ by more than a lobe.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, compressed, opaque_vector, reinterpreted, upload
from mitsonar.device.chance import Salt, hashed, hashed_pair, uniform, uniform_inside

from .cells import divisions, place
from .scatterers import Scatterers

EDGE_ON = 0.25                     # share of the density that a surface seen edge-on keeps
NEAREST = 0.3                      # [m] range below which the density no longer grows
MOST_PATCHES = 2_000_000           # approximate limit of the cutting of large facets
MOST = 1 << 26                     # scatterers of a ping
SHARE = 1 / 64                     # greatest length of a patch, relative to the reach
LOBE = 1.0, 2.0                    # cells from the axis at which the main lobe begins and ends to fall off
BESIDE = 0.5, 1 / 32               # share of scatterers one cell outside the lobe, falling as 1 / distance; least share
BLOCK = 1024                       # patches that are tested together when those of a ping are chosen
PLASTIC = 1.324717957244746        # g
STEP_U, STEP_V = (round(2 ** 32 / PLASTIC ** power) for power in (1, 2))        # as 32-bit fractions


@dataclass(frozen=True, kw_only=True)
class TransmitLobe:
    """Main lobe of a transmitting line array, or of a long element."""

    axis: np.ndarray  # (3,) [-]: b
    sine: float  # to which it is steered, along the axis
    cell: float  # Δt
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
    around: bool = False  # True if the image is one over range and the bearing about the axis
    lobes: tuple[TransmitLobe, ...] = ()  # of lines that send or receive across the line


@dataclass(frozen=True, kw_only=True)
class ThinnedSet:
    """A block of thinned scatterers, on the device."""

    exists: mi.Bool  # (R,): by (2)
    offset: dr.ArrayBase  # (R,) [m]: from the density's origin
    normal: mi.Vector3f  # (R,): of the facet, unit; vertices run counter-clockwise seen from its side
    area: mi.Float  # (R,) [m²]: that the scatterer stands for
    amplitude: tuple[mi.Float, mi.Float]  # (Float, Float): real and imaginary part
    shape: mi.ShapePtr  # (R,)
    primitive: mi.UInt32  # (R,): facet of the shape
    registry: mi.UInt32  # (R,): registry index of the shape
    label: mi.UInt32  # (R,)
    uv: mi.Point2f  # (R,)
    smooth: mi.Vector3f | None = None  # (R,): interpolated normal, see `tracing.hits.towards_sound`

    def where_existing(self) -> ThinnedSet:
        """Return the scatterers that exist, evaluated."""
        dr.eval(*(value for value in vars(self).values() if value is not None))
        index = compressed(self.exists)
        real, imaginary = (dr.gather(mi.Float, part, index) for part in self.amplitude)
        values = {name: dr.gather(type(value), value, index) for name, value in vars(self).items()
                  if name != "amplitude" and value is not None}
        return ThinnedSet(amplitude=(real, imaginary), **values)


class ThinnedScatterers:
    """The patches of a scene, and the scatterers that a ping needs of them."""
    # farthest [m]; places (P, 3) [m]

    def __init__(self, facets: Scatterers, *, farthest: float, places: np.ndarray):
        self.lib, self._facets = arrays_of(mi.Float), facets
        cuts = _cuts(facets, farthest, places)
        count = cuts.astype(np.int64) ** 2
        self._facet = np.repeat(np.arange(len(count), dtype=np.uint32), count)
        self._part = (np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)).astype(np.uint32)
        corner = facets.corners(self._facet).astype(np.float32)                                  # (P, 3, 3)
        u, v = _middles(self._part, cuts[self._facet])
        edges = corner[:, 1:] - corner[:, :1]
        centre = corner[:, 0] + u[:, None] * edges[:, 0] + v[:, None] * edges[:, 1]
        cross = np.cross(edges[:, 0], edges[:, 1])
        twice = np.linalg.norm(cross, axis=1)
        n = cuts[self._facet].astype(np.float32)
        radius = facets.radius[self._facet].astype(np.float32) / n
        table = np.zeros((len(centre), 8), np.float32)
        table[:, :3], table[:, 3] = centre, 0.5 * twice / n ** 2
        table[:, 4:7], table[:, 7] = cross / np.maximum(twice, 1e-30)[:, None], radius
        self._table = upload(mi.Float, table)
        self._facet_of, self._part_of = upload(mi.UInt32, self._facet), upload(mi.UInt32, self._part)
        self._labels, self._cuts = upload(mi.UInt32, facets.label), upload(mi.UInt32, cuts)
        dr.eval(self._table, self._facet_of, self._part_of, self._labels, self._cuts)
        self._blocks = _balls(centre, radius)

    @property
    def patches(self) -> int:
        """Return the number of patches."""
        return len(self._facet)

    def candidates(self, density: Density,
                   useful: Callable[[mi.Vector3f, mi.Float], mi.Bool]) -> tuple[mi.UInt32, mi.UInt32]:
        """Return the patches and numbers k, UInt32 (R,), of all scatterers that may exist."""
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
            R + radius > dr.opaque(mi.Float, density.nearest)) & useful(sight, dr.maximum(R - radius, NEAREST))
        most = _count(density, normal, sight, least, area, d, radius)
        number = dr.select(reached, dr.maximum(dr.ceil(most - self._threshold(patch)), 0), 0)
        total = float(dr.sum(number)[0])
        if not total <= MOST:
            raise ValueError(f"A ping needs {total:.2g} scatterers of this scene; the limit is {MOST:.1e}. Use fewer "
                             "scatterers per cell, a longer pulse or a shorter range.")
        number = mi.UInt32(number)
        if not total:
            return mi.UInt32(), mi.UInt32()
        return _listed(self.lib, patch, number, int(dr.sum(number)[0]))

    def at(self, patch: mi.UInt32, k: mi.UInt32, density: Density) -> ThinnedSet:
        """Return the scatterers with these patches and numbers."""
        lib, facets = self.lib, self._facets
        facet, part = dr.gather(mi.UInt32, self._facet_of, patch), dr.gather(mi.UInt32, self._part_of, patch)
        a, b, c, _ = facets.device_corners(facet)
        n = dr.gather(mi.UInt32, self._cuts, facet)
        facts = facets.facts(facet)
        first, second = hashed_pair(lib, facts[2], facts[1], part, mi.UInt32(Salt.THINNED_PLACE))
        u, v = place(lib, part, n, uniform_inside(lib, first + k * STEP_U), uniform_inside(lib, second + k * STEP_V))
        third, fourth = hashed_pair(lib, facts[2], facts[1], part, k, mi.UInt32(Salt.THINNED_AMPLITUDE))
        origin = opaque_vector(lib.Array3f64, density.origin)
        offset = (a - origin) + (b - a) * u + (c - a) * v
        across = dr.cross(mi.Vector3f(b - a), mi.Vector3f(c - a))
        twice, cuts = dr.norm(across), mi.Float(n)
        normal, area = across / dr.maximum(twice, 1e-30), 0.5 * twice / (cuts * cuts)
        d = mi.Vector3f(offset)
        R = dr.maximum(dr.norm(d), NEAREST)
        m = _count(density, normal, d / R, R, area, d)
        shape = reinterpreted(mi.ShapePtr, facts[0])
        uv = facets.texture_coordinates(facet, facts[3] != 0, mi.Float(u), mi.Float(v))
        amplitude = facets.amplitudes.of(third, fourth, origin + offset, normal, shape, facts[1], uv)
        return ThinnedSet(exists=mi.Float(k) + self._threshold(patch) < m, offset=offset, normal=normal,
                          area=area / dr.maximum(m, 1e-30), amplitude=amplitude, shape=shape, primitive=facts[1],
                          registry=facts[0], label=dr.gather(mi.UInt32, self._labels, facet), uv=uv,
                          smooth=facets.smooth_normals(facet, mi.Float(u), mi.Float(v)))

    def _in_reach(self, density):
        """Return the numbers of the patches, uint32, in blocks that lie within reach."""
        centre, radius = self._blocks
        distance = np.linalg.norm(centre - density.origin, axis=1)
        blocks = np.flatnonzero((distance - radius < density.farthest) & (distance + radius > density.nearest))
        patches = (blocks[:, None] * BLOCK + np.arange(BLOCK)).ravel()
        return patches[patches < len(self._facet)].astype(np.uint32)

    def _patch(self, patch):
        """Return centre, area, normal and radius of patches."""
        first, second = (dr.gather(self.lib.Array4f, self._table, 2 * patch + half) for half in (0, 1))
        return (mi.Point3f(first[0], first[1], first[2]), first[3], mi.Vector3f(second[0], second[1], second[2]),
                second[3])

    def _threshold(self, patch):
        """Return h, hashed from the patch's facet and part, not its number, which depends on other shapes."""
        facet, part = dr.gather(mi.UInt32, self._facet_of, patch), dr.gather(mi.UInt32, self._part_of, patch)
        facts = self._facets.facts(facet)
        return uniform(self.lib, hashed(self.lib, facts[2], facts[1], part, mi.UInt32(Salt.THINNED_COUNT)))


def _cuts(facets: Scatterers, farthest: float, places: np.ndarray) -> np.ndarray:
    """Return the number of rows of patches of each facet, uint32 (F,); 0 where it has none.

    Patches are at most a share of the reach long, or longer where there would be too many.
    """
    low, high = places.min(0), places.max(0)
    away = np.linalg.norm(np.clip(facets.centre, low, high) - facets.centre, axis=1) - facets.radius
    wanted = facets.scattering & (away < farthest)
    side = facets.longest_side
    area = float(np.sum(side[wanted] ** 2))
    longest = max(farthest * SHARE, np.sqrt(area / MOST_PATCHES))
    return np.where(wanted, divisions(side, longest), 0).astype(np.uint32)


def _middles(part: np.ndarray, n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the barycentric coordinates of the middles of parts (see `cells`), (P,) each."""
    part, n = part.astype(np.int64), n.astype(np.int64)
    i = (n - np.ceil(np.sqrt(n ** 2 - part.astype(float)))).astype(np.int64)
    i = np.where(i * (2 * n - i) > part, i - 1, i)
    i = np.where((i + 1) * (2 * n - (i + 1)) <= part, i + 1, i)
    rest = part - i * (2 * n - i)
    third = (1 + (rest & 1)) / 3
    return ((i + third) / n).astype(np.float32), (((rest >> 1) + third) / n).astype(np.float32)


def _balls(centre: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return middles (B, 3) and radii (B,) of balls that contain the patches of blocks."""
    starts = np.arange(0, len(centre), BLOCK)
    if not len(starts):
        return np.zeros((0, 3)), np.zeros(0)
    low = np.minimum.reduceat(centre - radius[:, None], starts).astype(float)
    high = np.maximum.reduceat(centre + radius[:, None], starts).astype(float)
    return 0.5 * (low + high), 0.5 * np.linalg.norm(high - low, axis=1)


def _covered(density: Density, normal: mi.Vector3f, sight: mi.Vector3f) -> mi.Float:
    """Return |n·(l × a)| of (1) along unit vectors l."""
    axis = opaque_vector(mi.Vector3f, density.axis)
    if not density.around:
        return abs(dr.dot(normal, dr.cross(sight, axis)))
    across = axis - dr.dot(axis, sight) * sight
    return abs(dr.dot(normal, across)) * dr.rcp(dr.maximum(dr.norm(across), 1e-6))


def _count(density: Density, normal: mi.Vector3f, sight: mi.Vector3f, distance: mi.Float, area: mi.Float,
           offset: mi.Vector3f, radius: mi.Float | float = 0.0) -> mi.Float:
    """Return m of (1) and (3) along unit vectors l; with `radius` [m], its upper limit within that distance."""
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
    """Return m of (3) for one lobe, where (1) gives m."""
    b, cell, slack = opaque_vector(mi.Vector3f, lobe.axis), dr.opaque(mi.Float, lobe.cell), radius / distance
    # near the sonar, the direction from the line differs from that from the origin
    seen = offset - opaque_vector(mi.Vector3f, lobe.place)
    away = dr.maximum(dr.norm(seen), NEAREST)
    wide = radius / dr.maximum(dr.maximum(abs(dr.dot(seen, normal)), away - radius), NEAREST)
    off = dr.maximum(abs(dr.dot(seen / away, b) - dr.opaque(mi.Float, lobe.sine)) - wide, 0) / cell
    by_range = dr.minimum(abs(dr.dot(normal, dr.cross(sight, b))) + slack, 1) / dr.opaque(mi.Float, density.range_cell)
    finer = dr.opaque(mi.Float, density.per_cell) * dr.maximum(by_range, by_sine) * area / (distance * cell)
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

