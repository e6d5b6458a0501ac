"""Rays that start anywhere in the water, not only at a source with a fan: the legs between bounces.

A ray is followed arc by arc (`propagation.fans.arc_step`), in chords within `TOLERANCE` of it, one triangle query a
chord. Two points are connected by aiming and by the exact eigenray (`propagation.aiming`, `propagation.two_point`), and
the same chords tell whether the way is free.

Water under a flat surface that mirrors is unfolded: above it lies the same water upside down, and a ray that is
reflected runs on there. Its chords are folded back before they meet the scene.
"""
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from ..propagation.arrivals import earliest
from ..propagation.layer_table import layer_table
from ..propagation.ray_fans import arc_step, first_layer
from ..propagation.two_point import PointState, arc_length, arc_time
from .connection import LIFT, LIFT_PER_RANGE, Connection
from .tracer import TOLERANCE

__all__ = ["FreeHits", "FreeRays"]

LEVELLEST = 1e-6                   # sine: exactly level rays spread 0/0


@dataclass(frozen=True, kw_only=True)
class FreeHits:
    """Meetings of free rays and scene, one a ray; entries are meaningful where `valid`.

    Attributes
    ----------
    valid : Bool (R,)
    point : Array3f64 (R,) [m]
    normal : Vector3f (R,)
        On the side the ray came from.
    label : UInt32 (R,)
    shape, primitive, uv
        As of `trace.Hits`.
    travel_time : Float64 (R,) [s]
    arc_length : Float (R,) [m]
    ray_parameter : Float64 (R,) [s/m]
    arrival_direction : Vector3f (R,)
    sound_speed : Float64 (R,) [m/s]
    """

    valid: object
    point: object
    normal: object
    label: object
    shape: object
    primitive: object
    uv: object
    travel_time: object
    arc_length: object
    ray_parameter: object
    arrival_direction: object
    sound_speed: object


class FreeRays:
    """Follow and connect rays in the water and the scene of a tracer.

    Parameters
    ----------
    tracer : trace.Tracer
    """

    def __init__(self, tracer):
        self.tracer, self.lib = tracer, tracer.lib
        self._unfolded = None

    def table(self, folded):
        """Layers of the water, or of the water unfolded about the surface."""
        if not folded:
            return self.tracer.table
        if self._unfolded is None:
            self._unfolded = layer_table(self.tracer.profile.mirrored(), mi.Float)
        return self._unfolded

    def hit(self, start, normal, direction, active=True):
        """Follow rays to their first hit.

        Parameters
        ----------
        start : Array3f64 (R,) [m]
        normal : Vector3f (R,)
            Of the surface they leave, on their side.
        direction : Vector3f (R,)
            Unit.
        active : Bool (R,)

        Returns
        -------
        FreeHits
        """
        lib, table, geometry = self.lib, self.tracer.table, self.tracer.geometry
        across = dr.sqrt(dr.fma(direction.x, direction.x, direction.y * direction.y))
        scale = dr.rcp(dr.maximum(across, 1e-9))
        heading = mi.Vector2f(dr.select(across < 1e-9, 1, direction.x * scale), direction.y * scale)
        sine = lib.Float64(-direction.z)
        sine = dr.select(abs(sine) < LEVELLEST, dr.copysign(lib.Float64(LEVELLEST), sine), sine)
        cosine = dr.sqrt(dr.maximum(1 - sine * sine, 0))
        z = -start.z
        c = table.at(z)[0]
        p = cosine / c
        lifted = mi.Point3f(start) + LIFT * normal
        limits = [dr.opaque(lib.Float64, v) for v in (
            8 * TOLERANCE, self.tracer.max_range, geometry.depth_range[1] + 1.0)]
        valid, pi, chord, time, arc = _followed(geometry.scene, table, lib, lifted, heading, z, sine, p, limits,
                                                mi.Bool(active))
        point, facet_normal, uv, label, shape = self.tracer.rebuilt(pi, chord, lifted, heading, valid)
        # the rest of the way, from the chord's start to the hit, on the arc through both
        r0, z0, r1, z1 = chord
        dx, dy = point.x - lib.Float64(lifted.x), point.y - lib.Float64(lifted.y)
        run = dr.sqrt(dr.fma(dx, dx, dy * dy)) - lib.Float64(r0)
        drop = -point.z - lib.Float64(z0)
        d2 = dr.fma(run, run, drop * drop)
        c1, c2 = table.at(lib.Float64(z0))[0], table.at(-point.z)[0]
        gradient = dr.select(abs(drop) > 1e-3, (c2 - c1) / dr.select(abs(drop) > 1e-3, drop, 1), 0)
        time += arc_time(c1, c2, gradient, d2)
        arc += arc_length(p * gradient, d2)
        cosine, down = mi.Float(dr.minimum(p * c2, 1)), dr.select(z1 >= z0, mi.Float(1), mi.Float(-1))
        sine = down * dr.sqrt(dr.maximum(1 - cosine * cosine, 0))
        arrival = mi.Vector3f(heading.x * cosine, heading.y * cosine, -sine)
        normal = dr.select(dr.dot(facet_normal, arrival) > 0, -facet_normal, facet_normal)
        return FreeHits(valid=valid, point=point, normal=normal, label=label, shape=shape, primitive=pi.prim_index,
                        uv=uv, travel_time=time, arc_length=lib.Float(arc), ray_parameter=p, arrival_direction=arrival,
                        sound_speed=c2)

    def connect(self, start, start_normal, end, end_normal, active=True, *, folded=False, occlusion=True, short=0.0):
        """Connect points to points, one pair an entry.

        Parameters
        ----------
        start, end : Array3f64 (R,) [m]
            Where ways are folded, below the surface both.
        start_normal, end_normal : Vector3f (R,)
            Of the surfaces they lie on, either side; zero for points in free water.
        active : Bool (R,)
        folded : bool
            By way of the mirror that the surface is; the launch direction is then the one that leads up to it.
        occlusion : bool
            Look for what lies in the way; else every way is free.
        short : float [m]
            The last of the way that is not looked at.

        Returns
        -------
        Connection
            Launch direction at the start, arrival direction, ray parameter and sound speed at the end.
        """
        lib, table = self.lib, self.table(folded)
        active = lib.Bool(active)
        z0 = start.z if folded else -start.z
        z = -end.z
        dx, dy = end.x - start.x, end.y - start.y
        x = dr.sqrt(dr.fma(dx, dx, dy * dy))
        upright = x < 1e-6
        scale = mi.Float(dr.rcp(dr.maximum(x, 1e-9)))
        heading = mi.Vector2f(dr.select(upright, 1, mi.Float(dx) * scale), dr.select(upright, 0, mi.Float(dy) * scale))
        c0, moments = table.at(z0)
        here, none = PointState(depth=z0, speed=c0, moments=moments), lib.UInt32(0)
        ray = earliest(table, lib, here, none, x, z, active)
        time, area, p, c = ray.travel_time, ray.spreading_area, ray.ray_parameter, ray.sound_speed
        launch_cosine, cosine = mi.Float(p * c0), mi.Float(p * c)
        launch_sine = dr.copysign(dr.sqrt(dr.maximum(1 - p * p * c0 * c0, 0)), ray.launch_sine)
        up = mi.Float(launch_sine) if folded else -mi.Float(launch_sine)
        launch = mi.Vector3f(heading.x * launch_cosine, heading.y * launch_cosine, up)
        arrival = mi.Vector3f(heading.x * cosine, heading.y * cosine, -ray.arrival_sine)
        exists = ray.found & dr.isfinite(time) & dr.isfinite(area)
        blocked = mi.Bool(False)
        if occlusion:
            lift = LIFT + LIFT_PER_RANGE * mi.Float(x)
            begin = mi.Point3f(start) + dr.copysign(lift, dr.dot(start_normal, launch)) * start_normal
            back = dr.copysign(lift, -dr.dot(end_normal, arrival)) * end_normal - short * arrival
            finish, reach = mi.Point3f(end) + back, x + dr.minimum(heading.x * back.x + heading.y * back.y, 0)
            blocked = _blocked(self.tracer.geometry.scene, table, lib, begin, heading, z0, launch_sine, p, finish,
                               reach, dr.opaque(lib.Float64, 8 * TOLERANCE), folded,
                               self.tracer.geometry.only_meshes, exists)
        return Connection(exists=exists, free=exists & ~blocked, horizontal_range=x, travel_time=time,
                          arc_length=ray.arc_length, spreading_area=area, launch_direction=launch,
                          arrival_direction=arrival, ray_parameter=p, sound_speed=c)


def _segment(start, stop):
    """Ray along a chord, of unit direction, and whether it has any length."""
    way = stop - start
    length = dr.norm(way)
    return mi.Ray3f(mi.Ray3f(start, way / dr.maximum(length, 1e-9)), length), length > 1e-6


@dr.syntax
def _followed(scene, table, lib, start, heading, z, s, p, limits, active):
    """Walk chords to the first hit: validity, preliminary intersection, chord (r0, z0, r1, z1), time and arc before."""
    F = lib.Float64
    longest, max_range, deepest = limits
    # -------------------------------------------------- loop state
    z, s, r, t, arc = F(z), F(s), F(0), F(0), F(0)
    k = first_layer(table, z, s)
    last_layer = lib.Int32(table.last)
    r0, z0 = mi.Float(0), mi.Float(-start.z)
    r1, z1 = mi.Float(0), mi.Float(-start.z)
    pi = dr.zeros(mi.PreliminaryIntersection3f, dr.width(start))
    valid = mi.Bool(False)
    active = mi.Bool(active) & (k >= 0) & (k <= last_layer)
    while active:
        k2, z2, s2, advance, descent, c1, c2, g = arc_step(table, k, z, s, p, longest, active)
        r1, z1 = mi.Float(r + advance), mi.Float(z2)
        a = mi.Point3f(dr.fma(r0, heading.x, start.x), dr.fma(r0, heading.y, start.y), -z0)
        b = mi.Point3f(dr.fma(r1, heading.x, start.x), dr.fma(r1, heading.y, start.y), -z1)
        ray, long_enough = _segment(a, b)
        pi = scene.ray_intersect_preliminary(ray, coherent=False, active=active & long_enough)
        valid = pi.is_valid() & active & long_enough
        going = active & ~valid
        d2 = advance * advance + descent * descent
        t = dr.select(going, t + arc_time(c1, c2, g, d2), t)
        arc = dr.select(going, arc + arc_length(p * g, d2), arc)
        r = dr.select(going, r + advance, r)
        z, s, k = dr.select(going, z2, z), dr.select(going, s2, s), dr.select(going, k2, k)
        # it ends at the surface of the water, below the scene, or far away
        active = going & (r < max_range) & (z > -0.01) & ((z < deepest) | (s < 0)) & (k >= 0) & (k <= last_layer)
        r0, z0 = dr.select(active, r1, r0), dr.select(active, z1, z0)
    return valid, pi, (r0, z0, r1, z1), t, arc


@dr.syntax
def _blocked(scene, table, lib, start, heading, z, s, p, end, reach, longest, folded, only_meshes, active):
    """Tell whether something lies on the way to `end`, at horizontal range `reach`."""
    F = lib.Float64
    # -------------------------------------------------- loop state
    z, s, r = F(z), F(s), F(0)
    k = first_layer(table, z, s)
    last_layer = lib.Int32(table.last)
    here = mi.Point3f(start)
    blocked = mi.Bool(False)
    active = mi.Bool(active) & (k >= 0) & (k <= last_layer)
    while active:
        k2, z2, s2, advance, descent, c1, c2, g = arc_step(table, k, z, s, p, longest, active)
        r = r + advance
        # a steep ray may end a hair short of it: it ends with its depth, then
        last = ~(r < reach) | (k2 < 0) | (k2 > last_layer)         # so that NaN ends, too
        flat, height = mi.Float(r), -mi.Float(z2)
        if dr.hint(folded, mode="scalar"):
            # a hair below, so that the surface that mirrors does not block
            height = -dr.maximum(abs(height), LIFT)
        there = mi.Point3f(dr.fma(flat, heading.x, start.x), dr.fma(flat, heading.y, start.y), height)
        stop = dr.select(last, end, there)
        if dr.hint(only_meshes, mode="scalar"):
            ray, long_enough = _segment(here, stop)
            blocked |= scene.ray_test(ray, coherent=False, active=active & long_enough) & active & long_enough
        else:
            # from both ends: of spheres and cylinders far from where a ray starts they do not know the edge, and a
            # point on one is in its own shadow or not
            middle = 0.5 * (here + stop)
            ray, long_enough = _segment(here, middle)
            blocked |= scene.ray_test(ray, coherent=False, active=active & long_enough) & active & long_enough
            ray, long_enough = _segment(stop, middle)
            blocked |= scene.ray_test(ray, coherent=False, active=active & long_enough) & active & long_enough
        active = active & ~blocked & ~last
        here = stop
        z, s, k = F(z2), F(s2), k2
    return blocked
