"""Sights of points: straight, by way of a flat sea surface that mirrors, and by way of the bed.

The echo of a point under a mirror leaves and returns by either way:

    e = f √(g_out g_back) (-1)^m

for m legs by the mirror, whose reflection is -1; f is the point's pressure at 1 m for the two directions, g the gain of
a leg (`sonar_equation`). By way of the mirror the sonar stands at its image, in water unfolded about the surface
(`tracing.water`).

The bed is a plane under each target (`bed_planes`). Sound that the plane reflects on to a target takes the bent ray to
the target's image, h below the plane. A target of height h has four echoes (Ingenito 1987, J. Acoust. Soc. Am. 82,
2051; Williams and others 2010, J. Acoust. Soc. Am. 127, 3356): straight, by way of the bed on either leg, and on both,

    e = f √(g_out g_back) V_out V_back,     V = 1 straight,     V = R(θ) exp(-2 (k σ sin θ)²) by way of the bed

R is the reflection coefficient of the bed's material where the sound bounces, θ the grazing angle there on the plane, σ
the root mean square of the roughness within the first Fresnel zone (Eckart 1953, J. Acoust. Soc. Am. 25, 566): that of
the material, for waves no longer than 2 √(λ l_1 l_2 / (l_1 + l_2)), and that of the mesh about the plane. Beds whose
material has no coefficient, such as the pure scattering law `lambert`, reflect nothing.

The water under the plane is not the mirror of that above. The travel time is therefore computed from both parts of the
way, to and from the place x where the ray to the image crosses the plane, and extrapolated to the true place nearby
(Fermat; Newton's step),

    τ = T_1(x) + T_2(x) - Σ_i g_i² / 2 H_i,     g = ∇(T_1 + T_2),   H = (1/l_1 + 1/l_2) / c  (across),  H sin² θ (along)
"""
from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.labels import SEABED
from mitsonar.scene.materials import coherent_reflection
from mitsonar.scene.tracing.connection import Connection, Connector
from mitsonar.scene.tracing.hits import Hits
from mitsonar.scene.tracing.tracer import Sources, registry_index

from ..record import Echoes, EchoLeg
from ..sonar_equation import leg_gain, mirrored_overhead, speed_ratio
from .bed_planes import BedPlanes, Planes, first_zone
from .sight import Sight

FLATTEST = 0.01                    # sine of the grazing angle below which nothing bounces
LIFT = 0.05                        # [m] the bed is searched from this height above the plane, plus LIFTED times σ
LIFTED = 4.0
FAINTEST = 20.0                    # exponent of V above which nothing is reflected: 2e-9 of the pressure
LYING = 0.02                       # [m] up to this height a point target lies on the bed: its strength includes the bed


class BedMirror:
    """Sights of targets by way of the bed."""

    def __init__(self, connector: Connector, frequency: float):                                # frequency [Hz]
        self._connector, self._frequency = connector, float(frequency)
        self._geometry: Geometry = connector.geometry
        self._lib, self.planes = arrays_of(mi.Float), BedPlanes(connector.geometry)

    def see(self, sources: Sources, origin: dr.ArrayBase, source: mi.UInt32, point: dr.ArrayBase, normal: mi.Vector3f,
            label: mi.UInt32, active: mi.Bool | bool = True, *, short: float = 0.0, smooth: bool = False) -> Sight:
        """Return the sights of points, one per entry; `label` (R,) selects the plane."""
        lib, water, plane = self._lib, self._connector.water, self.planes.of(label)
        upward, up = self._upward(plane)
        over, sonar_over = (_over(plane, up, place) for place in (point, origin))
        wide = lib.Array3f64
        image = point - 2 * over * upward
        known = plane.known & active & (over > (0.0 if smooth else LYING)) & (sonar_over > 0)
        way = self._connector.connect(sources, origin, source, image, mi.Vector3f(0, 0, 0), known, occlusion=False)
        down = way.arrival_direction
        flat = mi.Vector3f(upward)
        sine = -dr.dot(down, flat)
        known &= way.exists & (sine > FLATTEST)
        last = over / dr.maximum(lib.Float64(sine), FLATTEST)
        met = image - last * wide(down)
        direction = dr.normalize(down + 2 * sine * flat)
        speed = water.layers().at(-point.z)[0]
        known, hits = self._bounce(met, flat, plane, down, speed, known)
        # obstacles lie beside the bed itself, not beside the plane
        first = self._connector.connect(sources, origin, source, met, hits.normal, known, end=hits.point)
        second = self._connector.join(met, hits.normal, point, normal, known, short=short, begin=hits.point)
        free = known & first.free & second.free
        later = self._time(first, second, flat, way, last) - way.travel_time
        real, imaginary = self._reflection_factor(hits, sine, plane, way, mi.Float(last), free, smooth)
        ratio = speed_ratio(speed, sources.state.gather(lib, source)[1])
        gain = leg_gain(spreading_area=way.spreading_area, speed_ratio=ratio,
                        loss_db=water.loss_db(origin, image, way))
        return Sight(way=replace(way, free=free, arrival_direction=direction, sound_speed=speed),
                     leg=EchoLeg.along(way, origin, image), gain=gain, factor=(real, imaginary), later=later)

    def may_reflect(self, origin: np.ndarray, point: np.ndarray, label: np.ndarray) -> np.ndarray:
        """Return True for points (F, 3) [m] of targets (F,) that the bed may reflect sound to from `origin` (3,) [m].

        By Snell's law and the mean value theorem, the cosine of a ray's angle from the horizontal is at most the
        straight line's times the ratio of the fastest and the slowest water.
        """
        (_, b, c, rest, known), water = self.planes.table[label].T, self._connector.water
        way = self.planes.image(point, label) - origin
        way /= np.maximum(np.linalg.norm(way, axis=1), 1e-9)[:, None]
        angle = np.arcsin(np.clip((b * way[:, 0] + c * way[:, 1] - way[:, 2]) / np.sqrt(1 + b * b + c * c), -1, 1))
        level = np.arcsin(np.clip(np.abs(way[:, 2]), 0, 1))
        bent = level - np.arccos(np.minimum(np.cos(level) * water.fastest / water.slowest, 1))
        sine = np.sin(np.maximum(angle - bent, 0))
        wavenumber = 2 * np.pi * self._frequency / water.fastest
        return (known > 0) & (2 * np.square(wavenumber * rest * sine) < FAINTEST)

    def _upward(self, plane: Planes) -> tuple[dr.ArrayBase, mi.Float64]:
        """Return the normals of planes, Array3f64 (R,), and their upward parts."""
        b, c = plane.slope
        up = dr.rsqrt(1 + b * b + c * c)
        return self._lib.Array3f64(-b * up, -c * up, up), up

    def _bounce(self, met: dr.ArrayBase, flat: mi.Vector3f, plane: Planes, down: mi.Vector3f, speed: mi.Float64,
                active: mi.Bool) -> tuple[mi.Bool, Hits]:
        """Return whether there is bed where sound meets the planes, and the hits on it."""
        wide = self._lib.Array3f64
        lift = LIFT + LIFTED * plane.rest
        start = mi.Point3f(met + self._lib.Float64(lift) * wide(flat))
        ray = mi.Ray3f(mi.Ray3f(start, -flat), 2 * lift)
        si = self._geometry.scene.ray_intersect(ray, active)
        kind = dr.gather(mi.UInt32, self._geometry.kinds, registry_index(si), si.is_valid())
        active = active & si.is_valid() & (kind == SEABED)
        point = wide(start) - self._lib.Float64(si.t) * wide(flat)
        return active, Hits.on_surface(valid=active, point=dr.select(active, point, met), normal=mi.Vector3f(si.n),
                                       arrival_direction=down, sound_speed=speed, shape=si.shape,
                                       primitive=si.prim_index, uv=si.uv)

    def _time(self, first: Connection, second: Connection, flat: mi.Vector3f, way: Connection,
              last: mi.Float64) -> mi.Float64:
        """Return τ [s]."""
        gradient = first.arrival_direction - second.launch_direction
        down = way.arrival_direction
        across = dr.normalize(dr.cross(down, flat) + mi.Vector3f(1e-9, 0, 0))
        sine = dr.maximum(-dr.dot(down, flat), FLATTEST)
        a, b = dr.dot(gradient, across), dr.dot(gradient, dr.cross(flat, across)) / sine
        bent = 1 / dr.maximum(way.arc_length - mi.Float(last), 1e-3) + 1 / dr.maximum(mi.Float(last), 1e-6)
        return first.travel_time + second.travel_time - (
            self._lib.Float64((a * a + b * b) / (2 * bent)) / first.sound_speed)

    def _reflection_factor(self, hits: Hits, sine: mi.Float, plane: Planes, way: Connection, last: mi.Float,
                           active: mi.Bool, smooth: bool) -> tuple[mi.Float, mi.Float]:
        """Return V as real and imaginary part."""
        wavenumber = dr.opaque(mi.Float, 2 * np.pi * self._frequency) / mi.Float(hits.sound_speed)
        first = dr.maximum(way.arc_length - last, 1e-3)
        zone = first_zone((2 * np.pi) / wavenumber, first, last)
        real, imaginary = coherent_reflection(hits, sine, active, self._frequency,
                                              (2 * np.pi) / zone, smooth_too=not smooth)
        kept = dr.exp(-2 * dr.square(wavenumber * plane.rest * sine))
        return dr.select(active, real * kept, 0), dr.select(active, imaginary * kept, 0)


def _over(plane: Planes, up: mi.Float64, point: dr.ArrayBase) -> mi.Float64:
    """Return the height of points over planes [m]."""
    b, c = plane.slope
    return (point.z - plane.height - b * point.x - c * point.y) * up


JUST_BELOW = 1e-4                  # [m] depth at which the sea surface is met from below


class Sights:
    """Sights of points from sonars."""

    def __init__(self, connector: Connector, *, max_depth: int, frequency: float | None = None):        # [Hz]
        self.connector, self.max_depth = connector, max_depth
        self.geometry, self.water = connector.geometry, connector.water
        self.lib, self.mirror = arrays_of(mi.Float), connector.geometry.surface_mirrors
        bed = BedMirror(connector, frequency) if frequency is not None and max_depth > 1 else None
        self.bed = bed if bed is not None and bed.planes else None

    def see(self, sources: Sources, origin: dr.ArrayBase, source: mi.UInt32, point: dr.ArrayBase,
            normal: mi.Vector3f, active: mi.Bool | bool = True, *, folded: bool = False,
            short: float = 0.0) -> Sight:
        """Return the sights of points, one per entry, straight or (`folded`) by way of the mirror."""
        if folded:
            start = origin + dr.zeros(type(origin), dr.width(point))
            way = self.connector.join(start, mi.Vector3f(0, 0, 0), point, normal, active, folded=True, short=short)
        else:
            way = self.connector.connect(sources, origin, source, point, normal, active, short=short)
        return self.along(sources, origin, source, point, way, folded=folded)

    def along(self, sources: Sources, origin: dr.ArrayBase, source: mi.UInt32, point: dr.ArrayBase, way: Connection,
              *, folded: bool = False) -> Sight:
        """Return the sights of points along known ways."""
        ratio = speed_ratio(way.sound_speed, sources.state.gather(self.lib, source)[1])
        gain = leg_gain(spreading_area=way.spreading_area, speed_ratio=ratio,
                        loss_db=self.water.loss_db(origin, point, way, folded))
        start = type(origin)(origin.x, origin.y, -origin.z) if folded else origin
        return Sight(way=way, leg=EchoLeg.along(way, start, point, folded=folded), gain=gain)

    def ways(self, bounces: int = 1) -> Iterator[tuple[bool, bool, float]]:
        """Yield the ways that also use the mirror, as (out, back, sign), for an echo that has `bounces` without it."""
        if self.mirror:
            for there, back in ((False, True), (True, False), (True, True)):
                if bounces + there + back <= self.max_depth:
                    yield there, back, 1.0 if there == back else -1.0

    def bed_ways(self, bounces: int = 1) -> Iterator[tuple[str, str]]:
        """Yield the ways by the bed, "", "s" or "b" for each leg, for an echo that has `bounces` without it."""
        if self.bed is None:
            return
        legs = ("", "s", "b") if self.mirror else ("", "b")
        for there in legs:
            for back in legs:
                if "b" in there + back and bounces + len(there + back) <= self.max_depth:
                    yield there, back

    def overhead(self, sources: Sources, origin: dr.ArrayBase, source: mi.UInt32) -> tuple[Echoes, mi.Bool]:
        """Return the echo of a mirror straight above (half the pressure of a wave from there), and if it is visible."""
        point = self.lib.Array3f64(origin.x, origin.y, -JUST_BELOW)
        sight = self.see(sources, origin, source, point, mi.Vector3f(0, 0, 0))
        if (sea := self.geometry.sea) is not None:
            wide = self.lib.Float64
            lift = wide(sea.device.height(wide(point.x), wide(point.y), sight.way.travel_time))
            way = replace(sight.way, travel_time=sight.way.travel_time + lift / sight.way.sound_speed)
            sight = self.along(sources, origin, source, point, way)
        way, nothing = sight.way, dr.zeros(mi.Float, dr.width(sight.gain))
        ratio = speed_ratio(way.sound_speed, sources.state.gather(self.lib, source)[1])
        pressure = mirrored_overhead(sight.gain, spreading_area=way.spreading_area, speed_ratio=ratio)
        return Echoes(out=sight.leg, back=sight.leg, between=dr.zeros(mi.Float64, dr.width(nothing)),
                      energy=dr.square(pressure), amplitude=(pressure, nothing), path="s"), way.free
