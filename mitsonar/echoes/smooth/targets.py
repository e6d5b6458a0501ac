"""Echoes of smooth surfaces: coherent, from cells so small that phases are linear over them, several facets included.

A cell of a facet is reached like a scatterer, along its own bent ray, and sends back (`scattering.surfaces.facets`)

    e = √(g_out g_back) (ik/4π) R (n·u_s + n·u_r) S <e^iφ>

g are the gains of its legs (`sonar_equation`), S its area, φ the phases at its corners: the extra distances from the
cell's centroid, out and back, for spherical waves of the radius √A, with A the leg's spreading area. Phases of
neighbours agree at shared corners. The size of cells follows from the curvature of the waves, the array's size and the
range resolution, at the place they are seen from.

Sound continues from a lit cell as a tube. Its corners are mirrored, each at the surface's own normal there, as in
geometrical optics, until they meet the next smooth facet. There the tube's footprint sends back as a cell does, with
its area as S, the corners' ways in between in φ, and a pressure that conserves the power in the tube. So do the
footprints on the third facet, and so on. Legs in between are straight. All orders of facets occur, because all are lit:
two for a dihedral, six for a trihedral. (Physical optics after geometrical: E. F. Knott, 1977, IEEE Trans. Antennas
Propag. 25, 406.)

Under a flat sea surface all of this is seen straight and by way of the mirror (`sights`). Over a bed that reflects,
single facets are also seen by way of the bed (`sights`).
"""
from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, compressed, upload
from mitsonar.scattering.surfaces.facets import phase_mean
from mitsonar.scene.materials import reflection
from mitsonar.scene.shadows.occlusion import LIFT
from mitsonar.scene.tracing.hits import Hits
from mitsonar.scene.tracing.tracer import Sources

from ..record import Echoes, EchoLeg, entries
from ..scatterers.cells import divisions
from ..sights.sight import complex_product, path_of, product
from ..sights.sights import Sights
from ..sonar_equation import absorbed, pressure_along_legs
from .facets import SmoothFacets, warn_where_too_coarse
from .kirchhoff import mean_sent_back, off_middle

CELLS_PER_BLOCK = 1 << 18
RUNS_PER_BLOCK = 1 << 20           # visible facets, all pings of a block together: limits host memory
CURVED = 0.35                      # largest cell in √(λ r): its phase is linear within π/16
ASIDE = 1 / 10                     # in λ r / D, D of the array: within a fifth of a radian at the ends of the array
DEEP = 1 / 3                       # in range resolutions: within half a radian at the ends of the band
BEHIND = 1.0                       # facet sides that the source may lie behind the facet's plane
NEAREST = 0.05                     # [m] least range that cells are cut for
MOST_CUTS = 32768
MOST_CELLS = 10 ** 8               # of a ping: minutes of connecting
WORTH_SAYING = 10 ** 7             # cells of a ping that cause a warning
LIT = 2.5e-7                       # [s] of one core per cell
# sides of the cells that tubes start from, in wavelengths, and about how many such cells a ping may have at that size
FLAT_CELLS = 0.25, 1 << 18         # edges cut footprints that finely
BENT_CELLS = 0.125, 1 << 19        # tubes of curved surfaces widen
FLATTEST = 0.02                    # sine of the grazing angle below which a tube has no footprint
STRONGEST_FOCUS = 1e4              # largest ratio of power densities along a tube: a caustic lies beyond


@dataclass(frozen=True, kw_only=True)
class _Tube:
    """Sound between two facets, or between sonar and facet, where it meets a facet; one tube per entry."""

    active: mi.Bool
    place: mi.UInt32               # number of the ping
    facet: mi.UInt32
    point: dr.ArrayBase            # of its middle [m]
    corners: list[mi.Vector3f]     # of its footprint, from there [m]
    ways: list[mi.Float]           # extra distances of the corners over the middle [m]
    directions: list[mi.Vector3f]  # of the middle and of the corners
    area: mi.Float                 # of the footprint [m²]
    pressure: mi.Float             # at the footprint
    reflected: tuple[mi.Float, mi.Float]    # product of reflection coefficients so far
    between: mi.Float64            # from the first facet on [s]
    out: EchoLeg


class SmoothTargets:
    """Echoes of the smooth surfaces of a scene."""

    def __init__(self, sights: Sights, *, frequency: float,                                      # [Hz]
                 resolution: float, reach: float, farthest: float,                              # [m]
                 drift: float = 0.0):
        self.sights, self.geometry, self.water = sights, sights.geometry, sights.water
        self.lib = arrays_of(mi.Float)
        self.frequency, self.bounces = float(frequency), sights.max_depth
        self.resolution, self.reach, self.farthest = float(resolution), float(reach), float(farthest)
        self.drift = float(drift)
        slowest = float(np.min(self.water.profile.at(np.linspace(*self.geometry.depth_range, 9))))
        self.wavelength = slowest / self.frequency
        warn_where_too_coarse(self.geometry, self.wavelength)
        self.facets = SmoothFacets(self.geometry, self.wavelength)
        self.turn_rate = dr.opaque(mi.Float, 2 * np.pi * self.frequency)
        self.longest = dr.opaque(self.lib.Float64, self.farthest / slowest)
        self._warned = False

    def __bool__(self) -> bool:
        return len(self.facets) > 0

    def echoes(self, sources: Sources, origins: np.ndarray, source: np.ndarray,
               choose: Callable[[int, np.ndarray, np.ndarray], np.ndarray] | None = None,
               ) -> Iterator[tuple[mi.UInt32, mi.UInt32, Echoes]]:
        """Yield numbers of pings, labels and echoes of the surfaces, seen from pings at `origins` (P, 3) [m].

        `choose`, called with a ping, centres (F, 3) and radii (F,), returns True for the facets to take.
        """
        if not self:
            return
        place = _TargetPlaces(self.lib, np.asarray(origins, float), source)
        yield from self._single(sources, place, choose)
        if self.bounces > 1 and not self.facets.convex:
            yield from self._several(sources, place, choose, False)
            if self.sights.mirror and self.bounces > 2:
                yield from self._several(sources, place, choose, True)

    def edges(self, origin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the longest side of cells of every facet, (F,) [m], and which facets may be visible.

        They are seen from `origin` [m], (3,) or (F, 3).
        """
        facets = self.facets
        towards = facets.centre - origin
        distance = np.linalg.norm(towards, axis=1)
        plane = -np.sum(towards * facets.normal, axis=1)
        nearest = np.maximum(np.maximum(distance - facets.radius, np.abs(plane)), NEAREST)
        edge = np.minimum(CURVED * np.sqrt(self.wavelength * nearest), DEEP * self.resolution)
        if self.reach > 0 or self.drift > 0:
            edge = np.minimum(edge, ASIDE * self.wavelength * nearest / (self.reach + self.drift * nearest))
        # a curved surface is visible from a little behind the plane of its facets
        hidden = facets.outward * plane < -BEHIND * facets.side
        return edge, (distance - facets.radius < self.farthest) & (facets.area > 0) & ~hidden

    def _blocks(self, places, tubes, choose, views):
        """Yield cells to be lit as a whole as (place, facet, s, n, m, by), for integration over m² parts.

        Cells that `tubes` start from are smaller, and of one part. `views` are ways by which cells may be seen:
        straight (""), the mirror ("s") or the bed ("b"); bit i of `by` is 1 where a cell may be seen by way i.
        """
        facets, runs = self.facets, []
        for number, origin in enumerate(places.origins):
            edge, seen_by = np.full(len(facets), np.inf), np.zeros(len(facets), np.int64)
            for bit, by in enumerate(views):
                reflected = np.True_
                if by == "b" and self.sights.bed is not None:
                    reflected = self.sights.bed.may_reflect(origin, facets.centre, facets.label)
                    if not reflected.any():
                        continue
                there, visible = self.edges(self._image(origin, by))
                visible &= reflected
                if choose is not None:
                    visible &= choose(number, self._image(facets.centre, by), facets.radius)
                edge = np.where(visible, np.minimum(edge, there), edge)
                seen_by |= visible.astype(np.int64) << bit
            seen = np.flatnonzero(seen_by)
            if tubes:
                bent = facets.bent[seen]
                for own, (share, most) in ((seen[~bent], FLAT_CELLS), (seen[bent], BENT_CELLS)):
                    affordable = np.sqrt(facets.area[own].sum() * 4 / (np.sqrt(3) * most))
                    edge[own] = np.minimum(edge[own], max(share * self.wavelength, affordable))
            n = divisions(facets.side[seen], edge[seen]).astype(np.int64)
            n = np.maximum(n, facets.fewest[seen] if tubes else facets.fewest_lit[seen])
            parts = -(-facets.fewest[seen] // n)
            if n.max(initial=1) > MOST_CUTS:
                raise ValueError(f"A smooth facet of {facets.side[seen].max():.0f} m needs cells of "
                                 f"{edge[seen].min():.2g} m, more than {MOST_CUTS} to a side. Use smaller facets.")
            cells = int(np.sum((n * parts) ** 2))
            if cells > MOST_CELLS:
                raise ValueError(f"Smooth surfaces within reach of a ping need {cells:.2g} cells, of half a wavelength "
                                 f"where they are curved; the limit is {MOST_CELLS:.0e}. Make large surfaces rough, or "
                                 "use a shorter range or a lower frequency.")
            if cells >= WORTH_SAYING and not self._warned:
                self._warned = True
                warnings.warn(f"smooth surfaces within reach need {cells:.2g} cells each time they are ensonified, at "
                              f"least once a ping: about {LIT * cells:.2g} s of one core. To save time, make large "
                              "surfaces rough, or use a shorter range, less bandwidth or a lower frequency",
                              stacklevel=2)
            runs.append(np.stack([np.full(len(seen), number), seen, n, parts, seen_by[seen]], 1))
            if number + 1 == len(places.origins) or sum(map(len, runs)) > RUNS_PER_BLOCK:
                yield from _listed(np.concatenate(runs))
                runs = []

    def _image(self, point, by):
        """Return the images of points (F, 3), or of one (3,), in the mirror or in the bed under each facet."""
        if by == "b" and self.sights.bed is not None:
            return self.sights.bed.planes.image(point, self.facets.label)
        return point * np.array([1, 1, -1 if by == "s" else 1])

    def _seen(self, sources, places, number, cells, by, active):
        """Return the sights of cells, straight, by way of the mirror or of the bed."""
        origin, source = places.at(number)
        if by == "b" and self.sights.bed is not None:
            return self.sights.bed.see(sources, origin, source, cells.point, cells.normal,
                                       self.facets.facts(cells.facet)[2], active, smooth=True)
        return self.sights.see(sources, origin, source, cells.point, cells.normal, active, folded=by == "s")

    def _ways(self):
        """Yield the ways out and back that single facets are seen by, and the sign; the reverse ways share theirs."""
        yield "", "", 1.0
        for there, back, sign in self.sights.ways():
            if there <= back:
                yield "s" * there, "s" * back, sign
        for out, home in self.sights.bed_ways():
            if out <= home:
                yield out, home, -1.0 if "s" in out + home else 1.0

    def _single(self, sources, places, choose):
        """Yield the echoes of single facets, seen straight, by way of the mirror and of the bed."""
        ways = list(self._ways())
        views = sorted({by for there, back, _ in ways for by in (there, back)})
        for number, facet, s, n, parts, by in self._blocks(places, False, choose, views):
            cells, sights = self.facets.cells(facet, s, n), {}
            some = int(np.bitwise_or.reduce(by.numpy()))
            for bit, view in enumerate(views):
                if some == 1 << bit:
                    sights[view] = self._seen(sources, places, number, cells, view, mi.Bool(True))
                elif some >> bit & 1:
                    visible = (by & dr.opaque(mi.UInt32, 1 << bit)) != 0
                    sight = self._seen(sources, places, number, cells, view, visible)
                    sights[view] = replace(sight, way=replace(sight.way, free=sight.way.free & visible))
            if len(sights) > 1:
                dr.eval(sights)                                  # each for more ways than one
            for there, back, sign in ways:
                if there in sights and back in sights:
                    yield from self._on_facets(number, cells, parts, sights, there, back, sign)

    def _on_facets(self, number, cells, parts, sights, there, back, sign):
        """Yield the echoes of cells that are seen by one way out and by one back."""
        facet, legs = cells.facet, [sights[by] for by in sorted({there, back})]
        ways = [sight.way for sight in legs]
        active = mi.Bool(True)
        for way in ways:
            active &= way.free & dr.isfinite(way.spreading_area)
        active &= ways[0].travel_time + ways[-1].travel_time < 2 * self.longest
        wavenumber = self.turn_rate / mi.Float(ways[0].sound_speed)
        waves = [(way.arrival_direction, dr.sqrt(way.spreading_area)) for way in ways]
        mean = mean_sent_back(self.facets, cells, parts, waves, wavenumber, active)
        gain = legs[0].gain if len(legs) == 1 else pressure_along_legs(1.0, legs[0].gain, legs[1].gain)
        pressure = gain * wavenumber * cells.area * float(sign * 0.5 / np.pi)
        # off the specular direction, the mean of the coefficients at both angles, so that it is reciprocal
        factors = [self._coefficient(facet, cells.point, direction, way.sound_speed, active)
                   for way, (direction, _) in zip(ways, waves)]
        factor = tuple(sum(column) * (1 / len(factors)) for column in zip(*factors))
        amplitude, later = _turned(factor, mean, pressure), dr.zeros(mi.Float64, dr.width(facet))
        if "b" in there + back:
            factors, later = product(legs[0], legs[-1])
            amplitude = complex_product(amplitude, factors)
        for out, home in [(0, -1)] if len(legs) == 1 else [(0, 1), (1, 0)]:
            # by way of the bed on both legs, a copy, so that the time between counts
            leg = None if there == back != "b" else replace(legs[home].leg)
            yield from _sent(number, self.facets.facts(facet)[2], legs[out].leg, leg, later, amplitude,
                             path_of(there, back), active)

    def _several(self, sources, places, choose, folded):
        """Yield the echoes of several facets, by tubes that start straight or by way of the mirror."""
        for number, facet, s, n, *_ in self._blocks(places, True, choose, ["s" * folded]):
            cells = self.facets.cells(facet, s, n)
            origin, source = places.at(number)
            sight = self.sights.see(sources, origin, source, cells.point, cells.normal, folded=folded)
            way = sight.way
            direction, radius = way.arrival_direction, dr.sqrt(way.spreading_area)
            tube = _Tube(
                active=way.free & (way.travel_time < self.longest) & dr.isfinite(radius), place=number, facet=facet,
                point=cells.point, corners=cells.corners, area=cells.area,
                ways=[off_middle(corner, direction, radius) for corner in cells.corners],
                directions=[direction, *(dr.normalize(radius * direction + corner) for corner in cells.corners)],
                pressure=dr.sqrt(sight.gain),
                reflected=(dr.ones(mi.Float, dr.width(s)), dr.zeros(mi.Float, dr.width(s))),
                between=dr.zeros(mi.Float64, dr.width(s)), out=sight.leg)
            tube, path = self._reflected(tube, way.sound_speed), "b"
            while len(path) + folded < self.bounces:
                tube = self._next_footprints(sources, tube, way)
                if tube is None:
                    break
                origin, source = places.at(tube.place)
                normal, path, ends = self.facets.flat_normal(tube.facet), path + "b", {}
                for back in (False, True)[:1 + (self.sights.mirror and len(path) + folded < self.bounces)]:
                    ends[back] = self.sights.see(sources, origin, source, tube.point, normal, folded=back)
                way = ends[False].way
                tube = self._reflected(tube, way.sound_speed)
                for back, sight in ends.items():
                    name = "s" * (folded and back) + path + "s" * (folded or back)
                    yield from self._sent_back(tube, sight, name, 1.0 if back == folded else -1.0)

    def _normal(self, facet, point):
        """Return the normals of the surface that facets stand for, at points of the facets."""
        return self.facets.normals_at(facet, point, [dr.zeros(mi.Vector3f, dr.width(facet))])[0]

    def _coefficient(self, facet, point, direction, sound_speed, active):
        """Return the reflection coefficient for sound that arrives along `direction`."""
        shape, primitive, _ = self.facets.facts(facet)
        normal = self._normal(facet, point)
        hits = Hits.on_surface(valid=active, point=point, normal=normal, arrival_direction=direction,
                               sound_speed=sound_speed, shape=shape, primitive=primitive,
                               uv=dr.zeros(mi.Point2f, dr.width(primitive)))
        return reflection(hits, active, self.frequency)

    def _reflected(self, tube, sound_speed):
        """Return the tube, multiplied by the coefficient of the facet that it meets."""
        coefficient = self._coefficient(tube.facet, tube.point, tube.directions[0], sound_speed, tube.active)
        return replace(tube, reflected=complex_product(tube.reflected, coefficient))

    def _sent_back(self, tube, sight, path, sign):
        """Yield the echoes of the tubes' footprints along the legs of a sight."""
        way = sight.way
        normal, towards, back = self._normal(tube.facet, tube.point), tube.directions[0], way.arrival_direction
        wavenumber = self.turn_rate / mi.Float(way.sound_speed)
        in_cosine, out_cosine = dr.dot(normal, towards), dr.dot(normal, back)
        active = tube.active & way.free & (in_cosine * out_cosine > 0)
        active &= tube.out.travel_time + tube.between + way.travel_time < 2 * self.longest
        radius = dr.sqrt(way.spreading_area)
        mean = phase_mean(*(-wavenumber * (way_there + off_middle(corner, back, radius))
                            for way_there, corner in zip(tube.ways, tube.corners)))
        pressure = tube.pressure * dr.sqrt(sight.gain)
        pressure *= wavenumber * float(sign * 0.25 / np.pi) * abs(in_cosine + out_cosine) * tube.area
        yield from _sent(tube.place, self.facets.facts(tube.facet)[2], tube.out, sight.leg, tube.between,
                         _turned(tube.reflected, mean, pressure), path, active)

    def _next_footprints(self, sources, tube, way):
        """Mirror tubes and follow them to the next smooth facet; return the tubes that meet one, or None."""
        zero = dr.zeros(mi.Vector3f, dr.width(tube.facet))
        normals = self.facets.normals_at(tube.facet, tube.point, [zero, *tube.corners])
        directions = [d - 2 * dr.dot(d, n) * n for d, n in zip(tube.directions, normals)]
        flat, towards = self.facets.flat_normal(tube.facet), tube.directions[0]
        side = dr.select(dr.dot(flat, towards) > 0, -flat, flat)
        active = tube.active & (dr.dot(side, directions[0]) > FLATTEST)
        ray = mi.Ray3f(mi.Ray3f(mi.Point3f(mi.Vector3f(tube.point) + LIFT * side), directions[0]),
                       dr.opaque(mi.Float, self.farthest))
        met = self.geometry.scene.ray_intersect_preliminary(ray, coherent=mi.Bool(False), active=active)
        active &= met.is_valid() & (met.instance == None)    # noqa: E711  (element-wise)
        wide = self.lib.Array3f64
        facet, smooth = self.facets.of(met.shape, met.prim_index, wide(ray.o) + wide(ray.d) * self.lib.Float64(met.t),
                                       active)
        active &= smooth
        dr.eval(active, facet, directions)
        index = compressed(active)
        if not dr.width(index):
            return None
        tube, facet = entries(tube, index), dr.gather(mi.UInt32, facet, index)
        directions, side, speed = entries(directions, index), entries(side, index), entries(way.sound_speed, index)
        normal = self.facets.flat_normal(facet)
        direction, a = directions[0], self.facets.corners_of(facet)[0]
        length = dr.dot(a - tube.point, wide(normal)) / dr.dot(wide(direction), wide(normal))
        point = tube.point + wide(direction) * length
        steep, short = dr.dot(direction, normal), mi.Float(length)
        active = (length > 0) & (abs(steep) > FLATTEST)
        corners, ways = [], []
        for corner, way_there, other in zip(tube.corners, tube.ways, directions[1:]):
            aside = corner + short * (other - direction)
            falling = dr.dot(other, normal)
            active &= falling * steep > FLATTEST * abs(steep)
            more = -dr.dot(aside, normal) / falling
            # from the facet on to the curved surface
            ((u, v),) = self.facets.barycentric(facet, point, [aside + more * other])
            more += self.facets.height(facet, u, v) / falling
            corners.append(aside + more * other)
            ways.append(way_there + more)
        area = 0.5 * dr.norm(dr.cross(corners[1] - corners[0], corners[2] - corners[0]))
        # power in the tube: its cross-section before and after
        widening = area * abs(steep) / dr.maximum(tube.area * abs(dr.dot(side, direction)), 1e-30)
        loss_db = 0.5 * self.water.direct.loss_db(mi.Float(-tube.point.z), mi.Float(-point.z), short,
                                                  dr.zeros(mi.Float, dr.width(short)))
        pressure = tube.pressure * dr.sqrt(absorbed(loss_db) / dr.maximum(widening, 1 / STRONGEST_FOCUS))
        tube = _Tube(active=active & (area > 0), place=tube.place, facet=facet, point=point, corners=corners, ways=ways,
                     directions=directions, area=area, pressure=pressure, reflected=tube.reflected,
                     between=tube.between + length / speed, out=tube.out)
        dr.eval({name: value for name, value in vars(tube).items() if name != "out"})
        return tube


def _turned(factor, mean, pressure):
    """Return i times a complex factor, a complex mean and a real pressure."""
    (a, b), (real, imaginary) = factor, mean
    return -pressure * (a * imaginary + b * real), pressure * (a * real - b * imaginary)


def _sent(place, label, out, back, between, amplitude, path, active):
    """Yield the active echoes with ping and label; without `back`, they return along the way out."""
    energy = dr.square(amplitude[0]) + dr.square(amplitude[1])
    echoes = Echoes(out=out, back=out if back is None else back, between=between, energy=energy, amplitude=amplitude,
                    path=path)
    active &= dr.isfinite(energy)
    dr.eval(echoes, active, label, place)      # in one kernel, so that obstacles are not searched for twice
    index = compressed(active)
    if dr.width(index):
        yield (dr.gather(mi.UInt32, place, index), dr.gather(mi.UInt32, label, index),
               echoes.chosen(index).evaluated())


class _TargetPlaces:
    """Sources of sound, looked up by number."""

    def __init__(self, lib, origins, source):
        self.lib, self.origins = lib, origins
        self._origin = upload(mi.Float64, np.concatenate([origins, np.zeros((len(origins), 1))], 1))
        self._source = upload(mi.UInt32, np.asarray(source, np.uint32))
        dr.eval(self._origin, self._source)

    def at(self, number: mi.UInt32) -> tuple[dr.ArrayBase, mi.UInt32]:
        """Return places, Array3f64 (R,) [m], and indices of the sources."""
        row = dr.gather(self.lib.Array4f64, self._origin, number)
        return self.lib.Array3f64(row[0], row[1], row[2]), dr.gather(mi.UInt32, self._source, number)


def _listed(runs):
    """Yield cells (place, facet, s, n, m, by), UInt32, of runs (K, 5) without s; at most CELLS_PER_BLOCK at a time."""
    counts = runs[:, 2].astype(np.int64) ** 2
    ends = np.cumsum(counts)
    total = int(ends[-1]) if len(ends) else 0
    for start in range(0, total, CELLS_PER_BLOCK):
        cell = np.arange(start, min(start + CELLS_PER_BLOCK, total))
        run = np.searchsorted(ends, cell, side="right")
        s = cell - (ends[run] - counts[run])
        yield tuple(upload(mi.UInt32, column.astype(np.uint32))
                    for column in (runs[run, 0], runs[run, 1], s, *runs[run, 2:].T))
