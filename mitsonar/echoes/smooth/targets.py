"""Echoes of smooth surfaces: coherent, from cells so small that phases are linear over them, corners included.

A cell of a facet is seen like a scatterer, along its own bent ray, and sends back (`scattering.facets`)

    e = √(g_out g_back) (ik/4π) R (n·u_s + n·u_r) S <e^iφ>

g the gains of its legs (`sonar_equation`), S its area, φ the phases at its corners: by how much further they are than
the cell's centroid, out and back, for spherical waves of the radius √A, A the leg's spreading area. Neighbours' phases
meet at their corners. Cells are as small as the curvature of the waves, the array's size and the range resolution ask
for where they are seen from.

Sound goes on from a lit cell as a tube: its corners are mirrored each at the surface's own normal there, as geometrical
optics has it, until they meet the next smooth facet. There the tube's footprint sends back as a cell does, S its area,
φ with the corners' ways in between, the pressure as high as keeps the power in the tube; so do the third facet's
footprint, and so on. Legs in between are straight. All orders of facets are there, for all are lit: a dihedral's two,
a trihedral's six. (Physical optics after geometrical: E. F. Knott, 1977, IEEE Trans. Antennas Propag. 25, 406.)

Under a flat surface all of it is seen straight and by way of the mirror (`sights`), over a bed that reflects single
facets by way of that (`bed_mirror`).
"""
from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, compressed, upload
from mitsonar.scattering.surfaces.facets import phase_mean
from mitsonar.scene.materials import reflection
from mitsonar.scene.shadows.occlusion import LIFT
from mitsonar.scene.tracing.hits import Hits
from mitsonar.scene.tracing.tracer import Sources

from ..record import Echoes, EchoLeg
from ..scatterers.cells import divisions
from ..sights.sight import path_of, product
from ..sights.sights import Sights
from ..sonar_equation import absorbed, pressure_along_legs
from .facets import SmoothFacets, warn_where_too_coarse
from .kirchhoff import further, mean_sent_back

CELLS_PER_BLOCK = 1 << 18
RUNS_PER_BLOCK = 1 << 20           # facets that a ping sees, all pings together: memory of the host
CURVED = 0.35                      # √(λ r) a cell spans at most: its phase is linear within π/16
ASIDE = 1 / 10                     # λ r / D, D of the array: within a fifth of a radian at its ends
DEEP = 1 / 3                       # of the range resolution: within half a radian at the ends of the band
BEHIND = 1.0                       # of a facet's side that the source may lie behind its plane
NEAREST = 0.05                     # [m] range that cells are cut for at least
MOST_CUTS = 32768
MOST_CELLS = 10 ** 8               # of a ping: minutes of connecting
WORTH_SAYING = 10 ** 7             # cells of a ping
LIT = 2.5e-7                       # [s] of one core for a cell
# sides of the cells that tubes start from, in wavelengths, if there are not more such cells to a ping than about this:
FLAT_CELLS = 0.25, 1 << 18         # edges cut footprints that finely
BENT_CELLS = 0.125, 1 << 19        # tubes of bent surfaces widen
FLATTEST = 0.02                    # sine of the grazing angle below which a tube has no footprint
STRONGEST_FOCUS = 1e4              # ratio of power densities along a tube: beyond lies a caustic


@dataclass(frozen=True, kw_only=True)
class _Tube:
    """Sound between two facets, or between sonar and facet, where it meets a facet; one an entry."""

    active: mi.Bool
    place: mi.UInt32               # number of the ping
    facet: mi.UInt32
    point: dr.ArrayBase            # of its middle [m]
    corners: list[mi.Vector3f]     # of its footprint, from there [m]
    ways: list[mi.Float]           # how much further the corners have come than the middle [m]
    directions: list[mi.Vector3f]  # of the middle and of the corners
    area: mi.Float                 # of the footprint [m²]
    pressure: mi.Float             # at the footprint
    reflected: tuple[mi.Float, mi.Float]    # product of reflection coefficients so far
    between: mi.Float64            # from the first facet on [s]
    out: EchoLeg

    def chosen(self, index: mi.UInt32) -> _Tube:
        """The tubes with these numbers."""
        return _Tube(**{name: _picked(value, index) for name, value in vars(self).items()})


def _picked(value: Any, index: mi.UInt32) -> Any:
    if isinstance(value, (list, tuple)):
        return type(value)(_picked(part, index) for part in value)
    return value.chosen(index) if isinstance(value, EchoLeg) else dr.gather(type(value), value, index)


class SmoothTargets:
    """The smooth surfaces of a scene."""
    # frequency [Hz]; resolution [m]; reach [m]; farthest [m]

    def __init__(self, sights: Sights, *, frequency: float, resolution: float, reach: float, farthest: float,
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
        self._said = False

    def __bool__(self) -> bool:
        return len(self.facets) > 0

    def echoes(self, sources: Sources, origins: np.ndarray, source: np.ndarray,
               choose: Callable[[int, np.ndarray, np.ndarray], np.ndarray] | None = None,
               ) -> Iterator[tuple[mi.UInt32, mi.UInt32, Echoes]]:
        """Ensonify the surfaces."""
        # origins (P, 3) [m]; source (P,); choose (F, 3) -> place, label (R,)
        if not self:
            return
        place = _TargetPlaces(self.lib, np.asarray(origins, float), source)
        yield from self._single(sources, place, choose)
        for there, back, sign in self.sights.ways():
            if there <= back:                        # the others are these the other way round
                yield from self._single(sources, place, choose, "s" * there, "s" * back, sign)
        for there, back in self.sights.bed_ways():
            if there <= back:
                yield from self._single(sources, place, choose, there, back, -1.0 if "s" in there + back else 1.0)
        if self.bounces > 1 and not self.facets.convex:
            yield from self._several(sources, place, choose, False)
            if self.sights.mirror and self.bounces > 2:
                yield from self._several(sources, place, choose, True)

    def edges(self, origin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Longest side of cells of every facet, (F,) [m], and which facets may be seen.

        `origin` (3,) or (F, 3) [m] is where they are seen from.
        """
        facets = self.facets
        towards = facets.centre - origin
        distance = np.linalg.norm(towards, axis=1)
        plane = -np.sum(towards * facets.normal, axis=1)
        nearest = np.maximum(np.maximum(distance - facets.radius, np.abs(plane)), NEAREST)
        edge = np.minimum(CURVED * np.sqrt(self.wavelength * nearest), DEEP * self.resolution)
        if self.reach > 0 or self.drift > 0:
            edge = np.minimum(edge, ASIDE * self.wavelength * nearest / (self.reach + self.drift * nearest))
        # a bent surface is seen a little beyond where its facets are seen from behind
        hidden = facets.outward * plane < -BEHIND * facets.side
        return edge, (distance - facets.radius < self.farthest) & (facets.area > 0) & ~hidden

    def _blocks(self, places, tubes, choose, views):
        """Lists of cells as (place, facet, s, n, m): to be lit as a whole and integrated over in m² parts.

        Those that `tubes` start from are smaller, and of one part. `views` are those that they are seen in, straight
        ("") or by way of the mirror ("s") or the bed ("b").
        """
        facets, runs = self.facets, []
        for number, origin in enumerate(places.origins):
            edge, seen = np.full(len(facets), np.inf), np.ones(len(facets), bool)
            for by in views:
                there, visible = self.edges(self._image(origin, by))
                edge, seen = np.minimum(edge, there), seen & visible
                if by == "b" and self.sights.bed is not None:
                    seen &= self.sights.bed.planes.table[facets.label, 4] > 0
                if choose is not None:
                    seen &= choose(number, self._image(facets.centre, by), facets.radius)
            seen = np.flatnonzero(seen)
            if tubes:
                bent = facets.bent[seen]
                for some, (share, most) in ((seen[~bent], FLAT_CELLS), (seen[bent], BENT_CELLS)):
                    affordable = np.sqrt(facets.area[some].sum() * 4 / (np.sqrt(3) * most))
                    edge[some] = np.minimum(edge[some], max(share * self.wavelength, affordable))
            n = divisions(facets.side[seen], edge[seen]).astype(np.int64)
            n = np.maximum(n, facets.fewest[seen] if tubes else facets.fewest_lit[seen])
            parts = -(-facets.fewest[seen] // n)
            if n.max(initial=1) > MOST_CUTS:
                raise ValueError(f"a smooth facet of {facets.side[seen].max():.0f} m has to be cut into cells of "
                                 f"{edge[seen].min():.2g} m, more than {MOST_CUTS} to a side; take smaller facets")
            cells = int(np.sum((n * parts) ** 2))
            if cells > MOST_CELLS:
                raise ValueError(f"smooth surfaces within reach of a ping take {cells:.2g} cells, of half a wavelength "
                                 f"where they are bent, and {MOST_CELLS:.0e} is the most; make large surfaces rough, "
                                 "or take a shorter range or a lower frequency")
            if cells >= WORTH_SAYING and not self._said:
                self._said = True
                warnings.warn(f"smooth surfaces within reach take {cells:.2g} cells each time they are ensonified, at "
                              f"least once a ping: about {LIT * cells:.2g} s of one core; make large surfaces rough, "
                              "or take a shorter range, less bandwidth or a lower frequency", stacklevel=2)
            runs.append(np.stack([np.full(len(seen), number), seen, n, parts], 1))
            if number + 1 == len(places.origins) or sum(map(len, runs)) > RUNS_PER_BLOCK:
                yield from _listed(np.concatenate(runs))
                runs = []

    def _image(self, point, by):
        """Where points (F, 3), or one (3,), appear to lie by way of something; of the bed, that under each facet."""
        if by == "b" and self.sights.bed is not None:
            return self.sights.bed.planes.image(point, self.facets.label)
        return point * np.array([1, 1, -1 if by == "s" else 1])

    def _seen(self, sources, places, number, cells, by):
        """Cells as they are seen by way of something."""
        origin, source = places.at(number)
        if by == "b" and self.sights.bed is not None:
            return self.sights.bed.see(sources, origin, source, cells.point, cells.normal,
                                       self.facets.facts(cells.facet)[2], smooth=True)
        return self.sights.see(sources, origin, source, cells.point, cells.normal, folded=by == "s")

    def _single(self, sources, places, choose, there="", back="", sign=1.0):
        """Echoes of one facet, seen straight, by way of the mirror or of the bed."""
        for number, facet, s, n, parts in self._blocks(places, False, choose, {there, back}):
            cells = self.facets.cells(facet, s, n)
            sights = [self._seen(sources, places, number, cells, by) for by in sorted({there, back})]
            ways = [sight.way for sight in sights]
            active = mi.Bool(True)
            for way in ways:
                active &= way.free & dr.isfinite(way.spreading_area)
            active &= ways[0].travel_time + ways[-1].travel_time < 2 * self.longest
            wavenumber = self.turn_rate / mi.Float(ways[0].sound_speed)
            waves = [(way.arrival_direction, dr.sqrt(way.spreading_area)) for way in ways]
            mean = mean_sent_back(self.facets, cells, parts, waves, wavenumber, active)
            gain = sights[0].gain if len(sights) == 1 else pressure_along_legs(1.0, sights[0].gain, sights[1].gain)
            pressure = gain * wavenumber * cells.area * float(sign * 0.5 / np.pi)
            # off the specular direction the mean of both angles' coefficients: the same both ways
            factors = [self._coefficient(facet, cells.point, direction, way.sound_speed, active)
                       for way, (direction, _) in zip(ways, waves)]
            factor = tuple(sum(column) * (1 / len(factors)) for column in zip(*factors))
            amplitude, later = _turned(factor, mean, pressure), dr.zeros(mi.Float64, dr.width(s))
            if "b" in there + back:
                (real, imaginary), later = product(sights[0], sights[-1])
                amplitude = (amplitude[0] * real - amplitude[1] * imaginary,
                             amplitude[0] * imaginary + amplitude[1] * real)
            for out, home in [(0, -1)] if len(sights) == 1 else [(0, 1), (1, 0)]:
                # by way of the bed on both legs these are two, for the time between to count
                leg = None if there == back != "b" else replace(sights[home].leg)
                yield from _sent(number, self.facets.facts(facet)[2], sights[out].leg, leg, later, amplitude,
                                 path_of(there, back), active)

    def _several(self, sources, places, choose, folded):
        """Echoes of more facets, of tubes that start straight or by way of the mirror."""
        for number, facet, s, n, _ in self._blocks(places, True, choose, {"s" * folded}):
            cells = self.facets.cells(facet, s, n)
            origin, source = places.at(number)
            sight = self.sights.see(sources, origin, source, cells.point, cells.normal, folded=folded)
            way = sight.way
            direction, radius = way.arrival_direction, dr.sqrt(way.spreading_area)
            tube = _Tube(
                active=way.free & (way.travel_time < self.longest) & dr.isfinite(radius), place=number, facet=facet,
                point=cells.point, corners=cells.corners, area=cells.area,
                ways=[further(corner, direction, radius) for corner in cells.corners],
                directions=[direction, *(dr.normalize(radius * direction + corner) for corner in cells.corners)],
                pressure=dr.sqrt(sight.gain),
                reflected=(dr.ones(mi.Float, dr.width(s)), dr.zeros(mi.Float, dr.width(s))),
                between=dr.zeros(mi.Float64, dr.width(s)), out=sight.leg)
            tube, path = self._reflected(tube, way.sound_speed), "b"
            while len(path) + folded < self.bounces:
                tube = self._on(sources, tube, way)
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
        """Of the surface that facets stand for, at points of them."""
        return self.facets.normals_at(facet, point, [dr.zeros(mi.Vector3f, dr.width(facet))])[0]

    def _coefficient(self, facet, point, direction, sound_speed, active):
        """Reflection coefficient for sound that comes along `direction`."""
        shape, primitive, _ = self.facets.facts(facet)
        normal = self._normal(facet, point)
        hits = Hits.on_surface(valid=active, point=point, normal=normal, arrival_direction=direction,
                               sound_speed=sound_speed, shape=shape, primitive=primitive,
                               uv=dr.zeros(mi.Point2f, dr.width(primitive)))
        return reflection(hits, active, self.frequency)

    def _reflected(self, tube, sound_speed):
        """The tube with the coefficient of the facet it meets."""
        real, imaginary = self._coefficient(tube.facet, tube.point, tube.directions[0], sound_speed, tube.active)
        a, b = tube.reflected
        return replace(tube, reflected=(a * real - b * imaginary, a * imaginary + b * real))

    def _sent_back(self, tube, sight, path, sign):
        """What the footprints of tubes send back to where they are seen from."""
        way = sight.way
        normal, towards, back = self._normal(tube.facet, tube.point), tube.directions[0], way.arrival_direction
        wavenumber = self.turn_rate / mi.Float(way.sound_speed)
        in_cosine, out_cosine = dr.dot(normal, towards), dr.dot(normal, back)
        active = tube.active & way.free & (in_cosine * out_cosine > 0)
        active &= tube.out.travel_time + tube.between + way.travel_time < 2 * self.longest
        radius = dr.sqrt(way.spreading_area)
        mean = phase_mean(*(-wavenumber * (way_there + further(corner, back, radius))
                            for way_there, corner in zip(tube.ways, tube.corners)))
        pressure = tube.pressure * dr.sqrt(sight.gain)
        pressure *= wavenumber * float(sign * 0.25 / np.pi) * abs(in_cosine + out_cosine) * tube.area
        yield from _sent(tube.place, self.facets.facts(tube.facet)[2], tube.out, sight.leg, tube.between,
                         _turned(tube.reflected, mean, pressure), path, active)

    def _on(self, sources, tube, way):
        """Mirror tubes and follow them to the next smooth facet: the tubes that meet one, or None."""
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
        tube, facet = tube.chosen(index), dr.gather(mi.UInt32, facet, index)
        directions, side = _picked(directions, index), _picked(side, index)
        speed, height = _picked(way.sound_speed, index), _picked(tube.point.z, dr.arange(mi.UInt32, dr.width(index)))
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
            # from the facet on to the bent surface
            ((u, v),) = self.facets.barycentric(facet, point, [aside + more * other])
            more += self.facets.height(facet, u, v) / falling
            corners.append(aside + more * other)
            ways.append(way_there + more)
        area = 0.5 * dr.norm(dr.cross(corners[1] - corners[0], corners[2] - corners[0]))
        # power in the tube: its cross-section before and after
        widening = area * abs(steep) / dr.maximum(tube.area * abs(dr.dot(side, direction)), 1e-30)
        loss_db = 0.5 * self.water.direct.loss_db(mi.Float(-height), mi.Float(-point.z), short,
                                                  dr.zeros(mi.Float, dr.width(short)))
        pressure = tube.pressure * dr.sqrt(absorbed(loss_db) / dr.maximum(widening, 1 / STRONGEST_FOCUS))
        tube = _Tube(active=active & (area > 0), place=tube.place, facet=facet, point=point, corners=corners, ways=ways,
                     directions=directions, area=area, pressure=pressure, reflected=tube.reflected,
                     between=tube.between + length / speed, out=tube.out)
        dr.eval({name: value for name, value in vars(tube).items() if name != "out"})
        return tube


def _turned(factor, mean, pressure):
    """i times complex factor, mean and a real pressure."""
    (a, b), (real, imaginary) = factor, mean
    return -pressure * (a * imaginary + b * real), pressure * (a * real - b * imaginary)


def _sent(place, label, out, back, between, amplitude, path, active):
    """Yield what of some echoes is there; `back` None: the way out."""
    energy = dr.square(amplitude[0]) + dr.square(amplitude[1])
    echoes = Echoes(out=out, back=out if back is None else back, between=between, energy=energy, amplitude=amplitude,
                    path=path).evaluated()
    active &= dr.isfinite(energy)
    dr.eval(active, label, place)
    index = compressed(active)
    if dr.width(index):
        yield (dr.gather(mi.UInt32, place, index), dr.gather(mi.UInt32, label, index),
               echoes.chosen(index).evaluated())


class _TargetPlaces:
    """Where sound leaves from: look-ups by number."""

    def __init__(self, lib, origins, source):
        self.lib, self.origins = lib, origins
        self._origin = upload(mi.Float64, np.concatenate([origins, np.zeros((len(origins), 1))], 1))
        self._source = upload(mi.UInt32, np.asarray(source, np.uint32))
        dr.eval(self._origin, self._source)

    def at(self, number: mi.UInt32) -> tuple[dr.ArrayBase, mi.UInt32]:
        """Place, Array3f64 (R,) [m], and index of the source."""
        row = dr.gather(self.lib.Array4f64, self._origin, number)
        return self.lib.Array3f64(row[0], row[1], row[2]), dr.gather(mi.UInt32, self._source, number)


def _listed(runs):
    """Yield cells (place, facet, s, n, m), UInt32, of runs (K, 4) of all but s, CELLS_PER_BLOCK at most."""
    counts = runs[:, 2].astype(np.int64) ** 2
    ends = np.cumsum(counts)
    total = int(ends[-1]) if len(ends) else 0
    for start in range(0, total, CELLS_PER_BLOCK):
        cell = np.arange(start, min(start + CELLS_PER_BLOCK, total))
        run = np.searchsorted(ends, cell, side="right")
        s = cell - (ends[run] - counts[run])
        yield tuple(upload(mi.UInt32, column.astype(np.uint32))
                    for column in (runs[run, 0], runs[run, 1], s, runs[run, 2], runs[run, 3]))
