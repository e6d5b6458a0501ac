"""Test if the ray between two points is free, chord by chord.

A ray that starts at a source follows the chords of its ray fan, and its last chord ends just before the point. Any
other ray is walked arc by arc. Both end in front of the surface that the point lies on, so that it does not hide
itself.
"""
from __future__ import annotations

import drjit as dr
import mitsuba as mi

from mitsonar.device.types import ArrayTypes
from mitsonar.propagation.device_rays.device_arcs import arc_step, first_layer
from mitsonar.propagation.device_rays.layer_table import LayerTable
from mitsonar.propagation.device_rays.ray_fans import RayFans

TOLERANCE = 0.008      # [m] chord against arc: 1e-11 s in time, which is stationary in the path
LIFT, LIFT_PER_RANGE = 5e-4, 2e-5     # [m], [-] distance at which a ray ends in front of its target's surface


def segment(start: mi.Point3f, stop: mi.Point3f, beyond: float = 0.0) -> tuple[mi.Ray3f, mi.Bool]:
    """Return the ray along a chord, of unit direction and `beyond` its end [m], and if it has any length."""
    way = mi.Vector3f(stop - start)
    length = dr.norm(way)
    return mi.Ray3f(mi.Ray3f(start, way / dr.maximum(length, 1e-9)), length + beyond), length > 1e-6


@dr.syntax
def along_fan(scene: mi.Scene, ray_fans: RayFans, origin: mi.Point3f, source: mi.UInt32, launch_angle: mi.Float,
              heading: mi.Vector2f, end: mi.Point3f, reach: mi.Float, active: mi.Bool) -> mi.Bool:
    """Return True if something lies on the way to `end`, at horizontal range `reach`, along a source's ray fan."""
    row, off = ray_fans.row(source, launch_angle)
    base = row * ray_fans.stride
    size = dr.gather(mi.UInt32, ray_fans.size, row)
    v = dr.gather(ray_fans.lib.Array4f, ray_fans.vertex, base)
    # -------------------------------------------------- loop state
    r0, z0 = dr.fma(off, v[2], v[0]), dr.fma(off, v[3], v[1])    # start of the present chord
    i = mi.UInt32(1)                                             # its end
    blocked = mi.Bool(False)
    # a row that never reaches the scene's depths has no chords, and its first vertex was never written
    active = mi.Bool(active) & (size > 1)
    one = dr.opaque(mi.UInt32, 1)
    while active:
        v = dr.gather(ray_fans.lib.Array4f, ray_fans.vertex, base + i, active & (i < size))
        r1, z1 = dr.fma(off, v[2], v[0]), dr.fma(off, v[3], v[1])
        last = (r1 >= reach) | (i + 1 >= size)
        start = mi.Point3f(dr.fma(r0, heading.x, origin.x), dr.fma(r0, heading.y, origin.y), -z0)
        stop = mi.Point3f(dr.fma(r1, heading.x, origin.x), dr.fma(r1, heading.y, origin.y), -z1)
        stop = dr.select(last, end, stop)
        way = mi.Vector3f(stop - start)
        length = dr.norm(way)
        # Of unit direction, because Mitsuba's spheres and cylinders misplace other hits. And backwards, because their
        # edges are inexact far from a ray's start, and a point on one would be in its own shadow.
        ray = mi.Ray3f(mi.Ray3f(stop, -way / dr.maximum(length, 1e-9)), length)
        met = scene.ray_test(ray, coherent=mi.Bool(True), active=active & (length > 1e-6))
        blocked |= met & active
        active = active & ~blocked & ~last
        r0, z0 = dr.select(active, r1, r0), dr.select(active, z1, z0)
        i += one
    return blocked


@dr.syntax
def along_arcs(scene: mi.Scene, table: LayerTable, lib: ArrayTypes, start: mi.Point3f, heading: mi.Vector2f,
               z: mi.Float64, s: mi.Float64, p: mi.Float64, end: mi.Point3f, reach: mi.Float64, longest: mi.Float64,
               folded: bool, only_meshes: bool, active: mi.Bool) -> mi.Bool:
    """Return True if something lies on the way to `end`, at horizontal range `reach`, arc by arc."""
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
        # a steep ray may end slightly short of its range: then it ends by its depth
        last = ~(r < reach) | (k2 < 0) | (k2 > last_layer)         # so that NaN ends, too
        flat, height = mi.Float(r), -mi.Float(z2)
        if dr.hint(folded, mode="scalar"):
            # slightly below, so that the mirroring surface does not block
            height = -dr.maximum(abs(height), LIFT)
        there = mi.Point3f(dr.fma(flat, heading.x, start.x), dr.fma(flat, heading.y, start.y), height)
        stop = dr.select(last, end, there)
        if dr.hint(only_meshes, mode="scalar"):
            ray, long_enough = segment(here, stop)
            blocked |= scene.ray_test(ray, coherent=mi.Bool(False), active=active & long_enough) & active & long_enough
        else:
            # from both ends: edges of spheres and cylinders are inexact far from a ray's start, and a point on one
            # would be in its own shadow
            middle = 0.5 * (here + stop)
            ray, long_enough = segment(here, middle)
            blocked |= scene.ray_test(ray, coherent=mi.Bool(False), active=active & long_enough) & active & long_enough
            ray, long_enough = segment(stop, middle)
            blocked |= scene.ray_test(ray, coherent=mi.Bool(False), active=active & long_enough) & active & long_enough
        active = active & ~blocked & ~last
        here = stop
        z, s, k = F(z2), F(s2), k2
    return blocked
