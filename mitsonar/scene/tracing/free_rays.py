"""Rays that start anywhere in the water, not at a source with a ray fan: the legs between bounces.

A ray is followed arc by arc (`device_rays.device_arcs.arc_step`), in chords within `TOLERANCE` of the ray, with one
triangle query for each chord.
"""
from __future__ import annotations

from typing import cast

import drjit as dr
import mitsuba as mi

from mitsonar.device.types import Float64
from mitsonar.propagation.device_rays.device_arcs import arc_length, arc_step, arc_time, first_layer

from ..shadows.occlusion import LIFT, TOLERANCE, segment
from .hits import Hits, towards_sound
from .tracer import Tracer

LEVELLEST = 1e-6                   # sine: exactly level rays spread 0/0


class FreeRays:
    """Follow rays in the water and scene of a tracer."""

    def __init__(self, tracer: Tracer):
        self.tracer, self.lib = tracer, tracer.lib

    def hit(self, start: dr.ArrayBase, normal: mi.Vector3f, direction: mi.Vector3f,
            active: mi.Bool | bool = True) -> Hits:
        """Follow rays (R,) to their first hit, from points [m] on surfaces with these normals."""
        lib, table, geometry = self.lib, self.tracer.water.layers(), self.tracer.geometry
        across = dr.sqrt(dr.fma(direction.x, direction.x, direction.y * direction.y))
        scale = dr.rcp(dr.maximum(across, 1e-9))
        heading = mi.Vector2f(dr.select(across < 1e-9, 1, direction.x * scale), direction.y * scale)
        sine = lib.Float64(-direction.z)
        leaning = cast(Float64, dr.copysign(lib.Float64(LEVELLEST), sine))
        sine = dr.select(abs(sine) < LEVELLEST, leaning, sine)
        cosine = dr.sqrt(dr.maximum(1 - sine * sine, 0))
        z = -start.z
        c = table.at(z)[0]
        p = cosine / c
        lifted = mi.Point3f(start) + mi.Point3f(LIFT * normal)
        limits = [dr.opaque(lib.Float64, v) for v in (
            8 * TOLERANCE, self.tracer.max_range, geometry.depth_range[1] + 1.0)]
        valid, pi, chord, time, arc = _followed(geometry.scene, table, lib, lifted, heading, z, sine, p, limits,
                                                mi.Bool(active))
        on = self.tracer.on_facet(pi, chord, lifted, heading, valid)
        point, (smooth, uv) = on.point, self.tracer.shading(on, valid)
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
        normal = dr.select(dr.dot(on.normal, arrival) > 0, -on.normal, on.normal)
        return Hits(valid=valid, point=point, normal=normal, label=on.label, shape=on.shape, primitive=pi.prim_index,
                    uv=uv, travel_time=time, arc_length=lib.Float(arc), spreading_area=mi.Float(dr.nan),
                    ray_parameter=p, launch_direction=direction, arrival_direction=arrival, sound_speed=c2,
                    smooth=towards_sound(smooth, normal, arrival))


def _point(start: mi.Point3f, heading: mi.Vector2f, r: mi.Float, z: mi.Float) -> mi.Point3f:
    """Return the points at horizontal distances r [m] from `start` and depths z [m]."""
    return mi.Point3f(dr.fma(r, heading.x, start.x), dr.fma(r, heading.y, start.y), -z)


@dr.syntax
def _followed(scene, table, lib, start, heading, z, s, p, limits, active):
    """Walk chords to the first hit.

    Returns validity, preliminary intersection, chord (r0, z0, r1, z1), and time and arc length before the chord.
    """
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
        # chords end at the layers' edges; rounding must not let one pass a flat bed there
        ray, long_enough = segment(_point(start, heading, r0, z0), _point(start, heading, r1, z1), LIFT)
        pi = scene.ray_intersect_preliminary(ray, coherent=False, active=active & long_enough)
        valid = pi.is_valid() & active & long_enough
        going = active & ~valid
        d2 = advance * advance + descent * descent
        t = dr.select(going, t + arc_time(c1, c2, g, d2), t)
        arc = dr.select(going, arc + arc_length(p * g, d2), arc)
        r = dr.select(going, r + advance, r)
        z, s, k = dr.select(going, z2, z), dr.select(going, s2, s), dr.select(going, k2, k)
        # a ray ends at the water's surface, below the scene, or far away
        active = going & (r < max_range) & (z > -0.01) & ((z < deepest) | (s < 0)) & (k >= 0) & (k <= last_layer)
        r0, z0 = dr.select(active, r1, r0), dr.select(active, z1, z0)
    return valid, pi, (r0, z0, r1, z1), t, arc
