"""Compute shifts of rays at the depths of their hits by changes of water, sonar and attitude.

    p = cos θ_0 / c_0                                     the ray's parameter, as it leaves the sonar
    X, T, S, A = f(p, z_0, z; c(z))                       range, time, arc and spreading at the depth z of the hit

by the series of `propagation.two_point`, without its step of Newton: a launched ray needs none. z is detached; source
depth z_0, sound speeds, launch angle θ_0 and heading may be attached. The hit itself then slides along the ray
(`finish`). Rays that turned, or for which the series is too slow, are walked instead (`walked_rays`), and

    A = X |D| |sin θ sin θ_0| / (p c_0²),    D = dX/dp at fixed depths,    dS = cos θ_1 dX - sin θ_0 dz_0

θ_1 -> the flatter of both ends. Increments are 0 and carry a gradient, so that a record has the same numbers with and
without gradients, and every derivative is a term of its own:

    y = y_0 + tangent(f(x)),    tangent(f) = 0,  d tangent(f) = df
"""
from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeVar

import drjit as dr
import mitsuba as mi

from mitsonar.device.arrays import arrays_of
from mitsonar.propagation.device_rays.layer_table import LayerTable
from mitsonar.propagation.device_rays.two_point import LEVEL, MAX_TUBE_GAIN
from mitsonar.scene.tracing.hits import Hits

from .walked_rays import walked

Attached = TypeVar("Attached")


def tangent(value: Attached) -> Attached:
    """Return 0 with the gradient of a Dr.Jit value."""
    zero: Any = dr.zeros(type(value), dr.width(value))
    moving: Any = dr.replace_grad(zero, value)
    return moving


# of a_4: times err by 0.03 a_4^1.25 of themselves, derivatives by more; spreading counts for less
SERIES_LIMIT, WIDENS = 1e-4, 3e-3
LEAST_SINE = 1e-3                  # of rays at launch and hit, below which their spreading stands still
CAUSTIC = 2 / MAX_TUBE_GAIN        # of the squared distance: spreading areas below it stand still, too


@dataclass(frozen=True, kw_only=True)
class RayShift:
    """Hold increments at the depths of hits: 0, with gradients."""

    across: mi.Vector3f  # (R,) [m]: of the ray, level
    travel_time: mi.Float64  # (R,) [s]
    arc_length: mi.Float  # (R,) [m]
    spreading: mi.Float  # (R,) [-]: of the logarithm of the spreading area
    ray_parameter: mi.Float64  # (R,) [s/m]
    sound_speed: mi.Float64  # (R,) [m/s]
    heading: mi.Vector2f  # (R,) [-]
    widens: mi.Bool  # (R,): where `spreading` is known


def ray_shift(layers: LayerTable, speeds: mi.Float64, origin: dr.ArrayBase, direction: mi.Vector3f,
              hits: Hits) -> RayShift:
    """Return the shifts of rays at the depths of their hits."""
    wide = mi.Float64
    x, y, z = wide(direction.x), wide(direction.y), wide(direction.z)
    across = dr.sqrt(dr.maximum(x * x + y * y, 1e-24))
    scale = dr.rsqrt(across * across + z * z)
    sine0, cosine0 = -z * scale, across * scale
    upright = dr.detach(across) < 1e-6
    heading = mi.Vector2f(mi.Float(dr.select(upright, 1, x / across)), mi.Float(dr.select(upright, 0, y / across)))
    depth0 = -origin.z
    speed0, moments0 = layers.at(depth0)
    parameter = cosine0 / speed0
    there = _at_depth(layers, parameter, depth0, moments0, speed0, dr.detach(-hits.point.z))
    reach = dr.detach(hits.point - origin)
    distance = dr.sqrt(reach.x * reach.x + reach.y * reach.y)
    down = dr.detach(sine0) * dr.detach(-reach.z) > 0                  # it went straight to its depth
    near = abs(dr.detach(-reach.z)) < LEVEL * distance
    series = hits.valid & down & ~near & (there.fourth < WIDENS)
    exact = series & (there.fourth < SERIES_LIMIT)
    walk = hits.valid & ~exact
    lib = arrays_of(mi.Float)
    across, time, spread = walked(layers, lib, speeds, depth0, sine0, dr.detach(-hits.point.z), distance, walk)
    log_area = _log_area(across, spread, parameter, there.speed, speed0, sine0)
    wide = hits.valid & ~series & dr.isfinite(dr.detach(log_area)) & (
        dr.detach(dr.exp(log_area)) > CAUSTIC * (dr.square(distance) + dr.square(dr.detach(reach.z))))

    def increment(value: Any, where: mi.Bool) -> Any:
        return dr.select(where, tangent(value), 0)

    moved = mi.Float(increment(there.range, exact) + increment(across, walk))
    later = increment(there.time, exact) + increment(time, walk)
    # of walked rays as of an end that moves where they are flattest, which is where they move most
    flattest = dr.detach(parameter * dr.maximum(there.speed, speed0))
    longer = increment(across, walk) * flattest - dr.detach(sine0) * tangent(depth0)
    arc = mi.Float(increment(there.arc, series) + dr.select(walk & ~series, longer, 0))
    shift = [mi.Float(tangent(axis)) for axis in (origin.x, origin.y)]
    turned = [dr.select(hits.valid, mi.Float(distance) * tangent(part), 0) for part in (heading.x, heading.y)]
    along = [dr.detach(part) * moved for part in (heading.x, heading.y)]
    return RayShift(
        across=mi.Vector3f(shift[0] + turned[0] + along[0], shift[1] + turned[1] + along[1], 0), travel_time=later,
        arc_length=arc, spreading=mi.Float(increment(there.log_area, series) + increment(log_area, wide)),
        ray_parameter=increment(parameter, hits.valid), sound_speed=increment(there.speed, hits.valid),
        heading=mi.Vector2f(tangent(heading.x), tangent(heading.y)), widens=series | wide)


def _log_area(distance: mi.Float64, spread: mi.Float64, parameter: mi.Float64, speed: mi.Float64, speed0: mi.Float64,
              sine0: mi.Float64) -> mi.Float64:
    """Return ln A of walked rays; NaN where it has no derivative."""
    square, square0 = 1 - dr.square(parameter * speed), sine0 * sine0
    there = (dr.detach(square) > LEAST_SINE ** 2) & (dr.detach(square0) > LEAST_SINE ** 2) & (
        dr.detach(spread) != 0) & (dr.detach(distance) > 0)
    area = dr.square(distance * spread / (parameter * speed0 * speed0)) * square * square0
    return dr.select(there, 0.5 * dr.log(dr.select(there, area, 1)), dr.nan)


@dataclass(frozen=True, kw_only=True)
class _AtDepth:
    """Hold a launched ray at a depth; symbols are those of `two_point`."""

    range: mi.Float64
    time: mi.Float64
    arc: mi.Float64
    log_area: mi.Float64
    speed: mi.Float64
    fourth: mi.Float64


def _at_depth(table: LayerTable, parameter: mi.Float64, depth0: mi.Float64, moments0: list[mi.Float64],
              speed0: mi.Float64, depth: mi.Float64) -> _AtDepth:
    """Compute the series of `two_point` for a ray of this parameter, in float64."""
    speed, moments = table.at(depth)
    signed = depth - depth0
    height = dr.maximum(abs(signed), 1e-9)
    per_height = dr.sign(dr.detach(signed)) / height
    n1, n2, n3, n4 = ((end - start) * per_height for end, start in zip(moments, moments0))
    m2 = n2 - n1 * n1
    m3 = n3 - n1 * (3 * n2 - 2 * n1 * n1)
    m4 = n4 - n1 * (4 * n3 - n1 * (6 * n2 - 3 * n1 * n1))
    # p and q in units of √r0: s² = 1 + <e>
    root = dr.sqrt(table.reference)
    s2, p2 = 1 + n1, parameter * parameter * table.scale
    q2 = s2 - p2
    there = dr.detach(q2) > 1e-12
    w = dr.rcp(dr.select(there, q2, 1))
    q = dr.sqrt(w)                                                     # 1/q
    a2, a3, a4 = m2 * w * w, m3 * w * w * w, m4 * (w * w) * (w * w)
    per_p = height * q * (1 + 0.375 * a2 - 0.3125 * a3 + (35 / 128) * a4)
    slope = per_p + height * q * p2 * w * (1 + 1.875 * a2 - 2.1875 * a3 + (315 / 128) * a4)
    distance = parameter * per_p / root
    time = parameter * distance + height * root * dr.sqrt(dr.select(there, q2, 1)) * (
        1 - 0.125 * a2 + a3 / 16 - (5 / 128) * a4)
    sine0 = dr.sqrt(dr.maximum(1 - dr.square(parameter * speed0), 1e-12))
    sine = dr.sqrt(dr.maximum(1 - dr.square(parameter * speed), 1e-12))
    # A = X |D| sin θ sin θ_0 / (c_0 cos θ_0),  cos θ_0 = p c_0
    area = per_p * slope * sine * sine0 / (table.reference * speed0 * speed0)
    u = q2 / s2
    b1, b2, b3, b4 = 0.5 * u, -0.125 * u * u, u * u * u / 16, -(5 / 128) * u * u * u * u
    arc = height * dr.sqrt(s2) * q * (
        1 + a2 * (0.375 - 0.5 * b1 + b2) + a3 * (-0.3125 + 0.375 * b1 - 0.5 * b2 + b3)
        + a4 * (35 / 128 - 0.3125 * b1 + 0.375 * b2 - 0.5 * b3 + b4))
    log_area = dr.log(dr.select(there & (dr.detach(area) > 0), area, 1))
    return _AtDepth(range=distance, time=time, arc=arc, log_area=log_area, speed=speed,
                    fourth=dr.select(there, abs(dr.detach(a4)), 1.0))
