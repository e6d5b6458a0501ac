"""Exact times between hits and the elements of a moving, turning array: an eigenray for every pair.

    t = T(I, O + D(t_i + t) + R(t_i + t) d)               solved by Newton's method, dt <- (T - t) / (1 - v·n/c)

I the hit, met at t_i; O the array's origin, D and R its displacement and rotation since the ping (`travel`), v = dD/dt,
d the element's offset at the ping; T the time of the earliest eigenray, n its direction at the element. These times
are the reference for `vector_approximation` and replace it where it is invalid. Where aiming finds no ray, or an
earlier ray may exist, the exhaustive search (`eigenrays`) is used.
"""
from typing import cast

import drjit as dr
import numpy as np

from mitsonar.device.arrays import compressed, picked, upload
from mitsonar.device.rotations import rotated
from mitsonar.device.types import ArrayTypes, Bool, Float64, Numbers, Triple, Vector64

from ..device_rays.aiming import CLOSE_ENOUGH, aim
from ..device_rays.layer_table import LayerTable
from ..device_rays.two_point import PointState, to_hit
from ..returns.travel import Travel
from .eigenrays import eigenray

NEWTON_STEPS = 4               # each takes (v/c)² ~ 1e-5 of the error off
SETTLED = 1e-10                # [s] a step that needs no other: at 20 m/s, turning included, it leaves 1e-12 s


def exact_return(table: LayerTable, lib: ArrayTypes, origin_depth: Float64, displacement: Vector64, elapsed: Float64,
                 offset: Triple, travel: Travel, first: Float64) -> tuple[Float64, tuple[Float64, Float64, Float64]]:
    """Find the time from hits to one element, where it is when the echo arrives, and the direction back from there."""
    # origin_depth [m]; displacement (H,) [m]; elapsed (H,) [s]; offset [m]; first (H,) [s] -> time (H,) [s], towards
    # (H,) [-]
    time, towards, unsure = _solve(table, lib, origin_depth, displacement, elapsed, offset, travel, first)
    dr.eval(time, towards, unsure)
    some = compressed(unsure)
    if dr.width(some):
        place = type(displacement)(*(picked(axis, some) for axis in displacement))
        first = dr.select(dr.isfinite(time), time, first)
        found = _looked_for(table, origin_depth, place, picked(elapsed, some), offset, travel, picked(first, some))
        for column, values in zip((time, *towards), found):
            dr.scatter(column, upload(lib.Float64, values), some)
    return time, towards


def _looked_for(table: LayerTable, origin_depth: Float64, displacement: Vector64, elapsed: Float64, offset: Triple,
                travel: Travel, first: Float64) -> tuple[np.ndarray, ...]:
    """Solve as `_solve` by exhaustive search: time and direction, four arrays; NaN where there is no ray."""
    time, towards, kind = first.numpy().copy(), np.empty((3, dr.width(first))), type(first)
    depth, rest = (origin_depth - displacement.z).numpy(), np.arange(time.size)
    for _ in range(NEWTON_STEPS):
        some, guess = upload(table.lib.UInt32, rest.astype(np.uint32)), time[rest]
        place = type(displacement)(*(picked(axis, some) for axis in displacement))
        passed = picked(elapsed, some) + upload(kind, np.nan_to_num(guess))
        here, across_x, across_y, *velocity = (np.broadcast_to(part.numpy(), guess.shape) for part in
                                               _seen_from_element(origin_depth, place, offset, travel, passed))
        across = np.hypot(across_x, across_y)
        ray = eigenray(table.profile, here, depth[rest], across)
        sine, level = np.sin(ray.launch_angle), np.cos(ray.launch_angle) / np.maximum(across, 1e-9)
        step = (ray.travel_time - guess) / (1 - _closing(velocity, across_x, across_y, ray.ray_parameter,
                                                         sine / table.profile.at(here)))
        time[rest] += step
        towards[:, rest] = across_x * level, across_y * level, -sine
        rest = rest[np.abs(step) > SETTLED]
        if not rest.size:
            break
    return time, *towards


def _seen_from_element(origin_depth: Float64, displacement: Vector64, offset: Triple, travel: Travel,
                       passed: Float64) -> tuple[Float64, Float64, Float64, Float64, Float64, Float64]:
    """Return an element's depth some time after the ping, its distances from the hits along x and y, its velocity."""
    x, y, z = (part + d for part, d in zip(rotated(offset, travel.turned(passed)), travel.moved(passed)))
    return origin_depth - z, displacement.x - x, displacement.y - y, *travel.velocity(passed)


def _closing(velocity: Triple, across_x: Numbers, across_y: Numbers, ray_parameter: Numbers, steep: Numbers) -> Numbers:
    """Return the element's speed against the echo over that of sound; `steep`: vertical slowness of the ray sent."""
    scale = ray_parameter / ((across_x * across_x + across_y * across_y) ** 0.5 + 1e-9)
    return -(velocity[0] * across_x + velocity[1] * across_y) * scale + velocity[2] * steep


@dr.syntax
def _solve(table: LayerTable, lib: ArrayTypes, origin_depth: Float64, displacement: Vector64, elapsed: Float64,
           offset: Triple, travel: Travel, first: Float64) -> tuple[Float64, tuple[Float64, Float64, Float64], Bool]:
    F = lib.Float64
    # a ray that is lost stays where it was lost: what follows from its time would be NaN, and no look-up takes that
    never = ~dr.isfinite(first + elapsed + dr.sum(displacement))
    lost = lib.Bool(never)
    time, elapsed = dr.select(lost, 0, F(first)), dr.select(lost, 0, F(elapsed))
    toward_x, toward_y, toward_z, at, away = F(0), F(0), F(0), F(0), F(0)
    depth = origin_depth - displacement.z
    left = lib.UInt32(NEWTON_STEPS)
    one = dr.opaque(lib.UInt32, 1)
    going = ~lost
    while going:
        here, across_x, across_y, v_x, v_y, v_z = _seen_from_element(origin_depth, displacement, offset, travel,
                                                                     elapsed + time)
        across = dr.sqrt(across_x * across_x + across_y * across_y)
        source, none = PointState.at(table, here), lib.UInt32(0)
        c, end = source.speed, PointState.at(table, depth)
        sine, cosine, found = aim(table, lib, source, none, across, end, going)
        t, arc, area, p, end_sine, end_speed, _ = to_hit(table, lib, source, none, sine, cosine, across, end, found,
                                                         dr.opaque(F, CLOSE_ENOUGH))
        # slowness of the echo at the element: against the ray that was sent from there
        steep = cast(Float64, dr.copysign(dr.sqrt(dr.maximum(1 / (c * c) - p * p, 0)), sine))
        step = (t - time) / (1 - _closing((v_x, v_y, v_z), across_x, across_y, p, steep))
        lost |= going & (~found | ~dr.isfinite(step))
        going = going & ~lost
        time = dr.select(going, time + step, time)
        level = p * c / dr.maximum(across, 1e-9)
        toward_x, toward_y = dr.select(going, across_x * level, toward_x), dr.select(going, across_y * level, toward_y)
        toward_z = dr.select(going, -steep * c, toward_z)
        at, away = dr.select(going, here, at), dr.select(going, across, away)
        left -= one
        going = going & (abs(step) > SETTLED) & (left > 0)
    unsure = ~never & (lost | ~(away < table.sole_range(at, depth)))
    return dr.select(lost, dr.nan, time), (toward_x, toward_y, toward_z), unsure
