"""Exact times between hits and the elements of a moving, turning array: an eigenray for every pair.

    t = T(I, O + D(t_i + t) + R(t_i + t) d)               solved by Newton's method, dt <- (T - t) / (1 - v·n/c)

I the hit, met at t_i; O the array's origin, D and R its displacement and rotation since the ping (`travel`), v = dD/dt,
d the element's offset at the ping; T the time of the eigenray, n its direction at the element. What
`vector_approximation` is measured by, and what takes its place where it does not hold.
"""
import drjit as dr

from .aiming import CLOSE_ENOUGH, aim
from .travel import rotated
from .two_point import PointState, to_hit

__all__ = ["exact_return"]

NEWTON_STEPS = 4               # each takes (v/c)² ~ 1e-5 of the error off


def exact_return(table, lib, origin_depth, displacement, elapsed, offset, travel, first):
    """Time from hits to one element, where that is when the echo arrives, and where from it comes.

    Parameters
    ----------
    table : LayerTable
    lib : Dr.Jit namespace
    origin_depth : Float64 [m]
        Of the array's origin at the ping, opaque.
    displacement : Array3f64 (H,) [m]
        Hit minus origin, scene coordinates.
    elapsed : Float64 (H,) [s]
        From the ping to the hit.
    offset : triple of opaque Float64 [m]
        Of the element at the ping, scene coordinates.
    travel : Travel
        Of the platform since the ping, of opaque Float64.
    first : Float64 (H,) [s]
        A guess of the time, to a few microseconds.

    Returns
    -------
    time : Float64 (H,) [s]
        NaN where no ray is found.
    towards : triple of Float64 (H,) [-]
        Unit vector at the element along the ray to the hit, scene coordinates.
    """
    time, x, y, z = _solve(table, lib, origin_depth, displacement, elapsed, offset, travel, first)
    return time, (x, y, z)


@dr.syntax
def _solve(table, lib, origin_depth, displacement, elapsed, offset, travel, first):
    F = lib.Float64
    # a ray that is lost stays where it was lost: what follows from its time would be NaN, and no look-up takes that
    found = dr.isfinite(first + elapsed)
    time, elapsed = dr.select(found, F(first), 0), dr.select(found, F(elapsed), 0)
    toward_x, toward_y, toward_z = F(0), F(0), F(0)
    left = lib.UInt32(NEWTON_STEPS)
    one = dr.opaque(lib.UInt32, 1)
    while found & (left > 0):
        passed = elapsed + time
        x, y, z = rotated(offset, travel.turned(passed))
        moved, velocity = travel.moved(passed), travel.velocity(passed)
        x, y, z = x + moved[0], y + moved[1], z + moved[2]
        here = origin_depth - z
        across_x, across_y = displacement.x - x, displacement.y - y
        across = dr.sqrt(across_x * across_x + across_y * across_y)
        depth = origin_depth - displacement.z
        c, moments = table.at(here)
        source, none = PointState(depth=here, speed=c, moments=moments), lib.UInt32(0)
        sine, cosine, aimed = aim(table, lib, source, none, across, depth, found)
        t, arc, area, p, end_sine, end_speed = to_hit(table, lib, source, none, sine, cosine, across, depth, aimed,
                                                      dr.opaque(F, CLOSE_ENOUGH))
        # slowness of the echo at the element: against the ray that was sent from there
        scale = p / dr.maximum(across, 1e-9)
        steep = dr.copysign(dr.sqrt(dr.maximum(1 / (c * c) - p * p, 0)), sine)
        closing = -(velocity[0] * across_x + velocity[1] * across_y) * scale + velocity[2] * steep
        step = (t - time) / (1 - closing)
        found = found & aimed & dr.isfinite(step)
        time = dr.select(found, time + step, time)
        toward_x, toward_y, toward_z = across_x * scale * c, across_y * scale * c, -steep * c
        left -= one
    return dr.select(found, time, dr.nan), toward_x, toward_y, toward_z
