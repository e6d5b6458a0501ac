"""Attach gradients to traced hits, which the tracer returns detached.

A ray of one launch meets a surface at x_0. As the surface, the ray or the water move, the point slides:

    δ = n·(dx - dr) / (n·t)                      along the ray, to the facet that moved
    x = x_0 + dr + δ t,    T = T_0 + dT + δ/c,    L = L_0 + dL + δ
    A = A_0 (1 + dA/A + κ δ),    κ = cos θ / X + 1 / R_w
    1/R_w = (c sin θ_0 / c_0 - p g V cos θ) / (V sin θ),    V = ± A cos θ_0 / X

dx -> the motion of the facet's point that was hit, n -> its normal, t -> the ray's direction there; dr, dT, dL, dA/A ->
`RayShift`; κ is the relative widening of the ray's tube along it, R_w the radius of the wavefront in the vertical
plane. Angles are positive down; V has the sign of sin θ sin θ_0 dX/dp, which changes where rays cross (`side_of`). The
point slides over the facet by x - x_0 - dx, which moves its barycentric coordinates, and with them interpolated normals
and texture coordinates.

Spheres, cylinders, disks and rectangles have no corners: dx, and the normal at the new point, are those of `shapes`.

Edges are not included: a point that slides off its facet goes on in the facet's plane. Points that come out of a shadow
or go into one are the part of `edge_terms`.
"""
from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi

from mitsonar.device.arrays import arrays_of
from mitsonar.propagation.device_rays.layer_table import LayerTable
from mitsonar.scene.tracing.hits import Hits, towards_sound

from .geometry import AttachedGeometry
from .ray_shift import RayShift, tangent
from .shapes import OnShapes
from .walked_rays import walked

GRAZING = 1e-4                     # sine below which nothing slides: its derivative has no bound


@dataclass(frozen=True, kw_only=True)
class Facets:
    """Hold the facets of hits."""

    on_mesh: mi.Bool  # (R,)
    shape: mi.UInt32  # (R,): registry index of what was hit
    face: dr.ArrayBase  # (R,): corners and label, see `Geometry`
    u: mi.Float  # (R,): barycentric coordinates of the hits
    v: mi.Float


def finished(hits: Hits, facets: Facets, geometry: AttachedGeometry, layers: LayerTable, sine0: mi.Float,
             distance: mi.Float, shift: RayShift | None, side: mi.Float | None = None) -> Hits:
    """Return the same hits with gradients."""
    t, n, valid = hits.arrival_direction, hits.normal, hits.valid
    a, b, c = (geometry.vertex(facets.face[i], facets.on_mesh) for i in range(3))
    e1, e2 = b - a, c - a
    dx = tangent(a + e1 * facets.u + e2 * facets.v)
    on = None if geometry.shapes is None else geometry.shapes.on(facets.shape, valid & ~facets.on_mesh)
    if on is not None:
        dx = dr.select(on.known, on.motion(mi.Vector3f(hits.point)), dx)
    dr_ = mi.Vector3f(0) if shift is None else shift.across
    slope = dr.dot(n, t)
    lit = valid & (slope < -GRAZING)
    delta = dr.select(lit, dr.dot(n, dx - dr_) / dr.select(lit, slope, -1), 0)
    moved = dr_ + t * delta
    across = dr.detach(dr.cross(e1, e2))
    square = dr.maximum(dr.squared_norm(across), 1e-30)
    slid = dr.select(facets.on_mesh & valid, moved - dx, 0)
    du = dr.dot(dr.cross(slid, dr.detach(e2)), across) / square
    dv = dr.dot(dr.cross(dr.detach(e1), slid), across) / square
    gradient = layers.shape(layers.find(-hits.point.z))[2]
    speed = hits.sound_speed - gradient * mi.Float64(t.z * delta)
    widening = _widening(hits, sine0, distance, mi.Float(gradient), side) * delta
    time, arc = hits.travel_time + mi.Float64(delta) / hits.sound_speed, hits.arc_length + delta
    parameter = hits.ray_parameter
    if shift is not None:
        time, arc, parameter = time + shift.travel_time, arc + shift.arc_length, parameter + shift.ray_parameter
        speed, widening = speed + shift.sound_speed, widening + shift.spreading
    arrival = _arrival(hits, parameter, speed, shift)
    normal, smooth = _normals(hits, facets, geometry, (e1, e2), (facets.u + du, facets.v + dv), arrival)
    uv = _texture(hits, facets, geometry, du, dv)
    if on is not None:
        place = mi.Vector3f(dr.detach(hits.point)) + moved
        normal = normal + dr.select(on.known, _of_shapes(on, place, hits.normal), 0)
        if smooth is not None:
            smooth = towards_sound(dr.select(on.known, normal, smooth), normal, arrival)
        if geometry.textured:
            uv = uv + dr.select(on.known, on.texture(place), 0)
    wide = arrays_of(mi.Float).Array3f64
    return replace(hits, point=hits.point + wide(moved), travel_time=time, arc_length=arc,
                   spreading_area=hits.spreading_area * (1 + widening), ray_parameter=parameter, sound_speed=speed,
                   arrival_direction=arrival, normal=normal, smooth=smooth,
                   uv=uv)


def side_of(hits: Hits, layers: LayerTable, speeds: mi.Float64, origin: dr.ArrayBase,
            direction: mi.Vector3f) -> mi.Float | None:
    """Return the sign of V for detached hits of rays from points `origin` in launch directions; see `finished`."""
    sine0, drop = mi.Float64(-direction.z), mi.Float64(origin.z - hits.point.z)
    turned = hits.valid & ((sine0 * mi.Float64(-hits.arrival_direction.z) < 0) | (sine0 * drop < 0))
    if not dr.any(turned)[0]:
        return None
    away = hits.point - origin
    distance = dr.sqrt(away.x * away.x + away.y * away.y)
    lib = arrays_of(mi.Float)
    spread = walked(layers, lib, speeds, mi.Float64(-origin.z), sine0, mi.Float64(-hits.point.z), distance, turned)[2]
    sign = mi.Float(dr.sign(spread * sine0)) * dr.sign(-hits.arrival_direction.z)
    return dr.select(turned, dr.select(spread == 1, 0, sign), 1)       # 1: the walk came by elsewhere


def _widening(hits: Hits, sine0: mi.Float, distance: mi.Float, gradient: mi.Float, side: mi.Float | None) -> mi.Float:
    """Return κ, the derivative of the logarithm of the spreading area along the ray [1/m]."""
    length = dr.maximum(hits.arc_length, 1e-6)
    speed, parameter = mi.Float(hits.sound_speed), mi.Float(hits.ray_parameter)
    cosine0 = dr.sqrt(dr.maximum(1 - sine0 * sine0, 0))
    cosine = parameter * speed
    sine = -hits.arrival_direction.z
    plain = 2 / length                                # straight rays; level and upright ones take it, too
    bent = hits.valid & (abs(sine) > 0.02) & (distance > 1e-3 * length) & (
        sine * sine0 > 0 if side is None else side != 0)
    source_speed = cosine0 / dr.select(bent, parameter, 1)             # Snell: p = cos θ_0 / c_0
    aside = dr.select(bent, distance, 1)
    v = hits.spreading_area * cosine0 / aside
    if side is not None:
        v = dr.select(side < 0, -v, v)
    curved = (speed * sine0 / source_speed - parameter * gradient * v * cosine) / (
        dr.select(bent, v, 1) * dr.select(bent, sine, 1))
    return dr.select(bent, cosine / aside + curved, plain)


def _arrival(hits: Hits, parameter: mi.Float64, speed: mi.Float64, shift: RayShift | None) -> mi.Vector3f:
    """Return directions at the hits: cos θ = p c, and the ray's heading."""
    cosine = mi.Float(parameter * speed)
    across = dr.sqrt(dr.maximum(dr.square(hits.arrival_direction.x) + dr.square(hits.arrival_direction.y), 1e-12))
    heading = mi.Vector2f(hits.arrival_direction.x, hits.arrival_direction.y) / across
    if shift is not None:
        heading += shift.heading
    sine = dr.copysign(dr.sqrt(dr.maximum(1 - cosine * cosine, 1e-6)), hits.arrival_direction.z)
    bent = mi.Vector3f(heading.x * cosine, heading.y * cosine, sine)
    turned: Any = dr.replace_grad(hits.arrival_direction, bent)
    return turned


def _normals(hits: Hits, facets: Facets, geometry: AttachedGeometry, edges: tuple[mi.Vector3f, mi.Vector3f],
             place: tuple[mi.Float, mi.Float], arrival: mi.Vector3f) -> tuple[mi.Vector3f, mi.Vector3f | None]:
    """Return normals of facets, and those that the surface scatters by."""
    there = facets.on_mesh & hits.valid
    across = dr.cross(*edges)
    facet = across * dr.rsqrt(dr.maximum(dr.squared_norm(across), 1e-30))
    facet = dr.select(dr.dot(dr.detach(facet), hits.normal) < 0, -facet, facet)
    normal = hits.normal + dr.select(there, tangent(facet), 0)
    if geometry.normals is None:
        return normal, None
    between = geometry.normal(facets.face, *place, facets.on_mesh)
    return normal, towards_sound(between, normal, arrival)


def _of_shapes(on: OnShapes, place: mi.Vector3f, side: mi.Vector3f) -> mi.Vector3f:
    """Return the change of normals of shapes without facets, on the side of `side`: 0, with gradients."""
    normal = on.normal(place)
    return tangent(dr.select(dr.dot(dr.detach(normal), side) < 0, -normal, normal))


def _texture(hits: Hits, facets: Facets, geometry: AttachedGeometry, du: mi.Float, dv: mi.Float) -> mi.Point2f:
    """Return texture coordinates of the points that slide."""
    if geometry.texcoords is None:
        return hits.uv
    lib = arrays_of(mi.Float)
    a, b, c = (mi.Point2f(dr.gather(lib.Array2f, geometry.texcoords, facets.face[i], facets.on_mesh))
               for i in range(3))
    return hits.uv + dr.select(facets.on_mesh, (b - a) * du + (c - a) * dv, 0)
