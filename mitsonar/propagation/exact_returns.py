"""Exact times between hits and the elements of a moving, turning array: an eigenray for every pair.

    t = T(I, O + v (t_i + t) + R(ω (t_i + t)) d)          solved by Newton's method, dt <- (T - t) / (1 - v·n/c)

I the hit, met at t_i; O the array's origin, v its velocity, ω its rate of turn, d the element's offset at the ping; T
the time of the eigenray, n its direction at the element. What `vector_approximation` is measured by, and what takes
its place where it does not hold.
"""
import drjit as dr

from .aiming import CLOSE_ENOUGH, aim
from .two_point import PointState, to_hit

__all__ = ["exact_return"]

NEWTON_STEPS = 4               # each takes (v/c)² ~ 1e-5 of the error off


def exact_return(table, lib, origin_depth, displacement, elapsed, offset, velocity, turn_rate, first):
    """Time from hits to one element, where that is when the echo arrives.

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
    offset, velocity, turn_rate : triples of opaque Float64 [m], [m/s], [rad/s]
        Of the element at the ping; of the platform; scene coordinates.
    first : Float64 (H,) [s]
        A guess of the time, to a few microseconds.

    Returns
    -------
    Float64 (H,) [s]
        NaN where no ray is found.
    """
    return _solve(table, lib, origin_depth, displacement, elapsed, offset, velocity, turn_rate, first)


@dr.syntax
def _solve(table, lib, origin_depth, displacement, elapsed, offset, velocity, turn_rate, first):
    F = lib.Float64
    time, lost = F(first), lib.Bool(False)
    left = lib.UInt32(NEWTON_STEPS)
    one = dr.opaque(lib.UInt32, 1)
    while left > 0:
        passed = elapsed + time
        x, y, z = _turned(offset, turn_rate, passed)
        x, y, z = x + velocity[0] * passed, y + velocity[1] * passed, z + velocity[2] * passed
        here = origin_depth - z
        across_x, across_y = displacement.x - x, displacement.y - y
        across = dr.sqrt(across_x * across_x + across_y * across_y)
        depth = origin_depth - displacement.z
        c, moments = table.at(here)
        source, none = PointState(depth=here, speed=c, moments=moments), lib.UInt32(0)
        sine, cosine, found = aim(table, lib, source, none, across, depth, lib.Bool(True))
        t, arc, area, p, end_sine, end_speed = to_hit(table, lib, source, none, sine, cosine, across, depth, found,
                                                      dr.opaque(F, CLOSE_ENOUGH))
        # slowness of the echo at the element: against the ray that was sent from there
        scale = p / dr.maximum(across, 1e-9)
        steep = dr.copysign(dr.sqrt(dr.maximum(1 / (c * c) - p * p, 0)), sine)
        closing = -(velocity[0] * across_x + velocity[1] * across_y) * scale + velocity[2] * steep
        time += (t - time) / (1 - closing)
        lost |= ~found
        left -= one
    return dr.select(lost, dr.nan, time)


def _turned(vector, turn_rate, elapsed):
    """Turn a vector (Rodrigues)."""
    (x, y, z), (wx, wy, wz) = vector, turn_rate
    rate = dr.sqrt(wx * wx + wy * wy + wz * wz) + 1e-30
    kx, ky, kz = wx / rate, wy / rate, wz / rate
    sine, cosine = dr.sin(rate * elapsed), dr.cos(rate * elapsed)
    along = (kx * x + ky * y + kz * z) * (1 - cosine)
    return (x * cosine + (ky * z - kz * y) * sine + kx * along, y * cosine + (kz * x - kx * z) * sine + ky * along,
            z * cosine + (kx * y - ky * x) * sine + kz * along)
