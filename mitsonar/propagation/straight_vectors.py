"""Echoes along straight vectors to the elements of a moving, turning array: what the methods of return time share.

With n the unit vector along which the echo travels, R the vector's length to the array's centre at reception, c the
speed along it, v the platform's velocity and d the element's offset, the echo reaches the element later than the centre
by δ, |R n + d + v δ| = R + c δ, whose solution in a form that loses nothing to cancellation is

    q = 2 n·d + |d|²/R,   B = c - n·v - v·d/R,   δ = q / (B + sqrt(B² + (c² - |v|²) q/R))

The array turns at the rate ω while the echo is under way. For an array turned by the rotation A since the ping,
n·(A d) = (A' n)·d, so the hit carries A' n and the element stays as it was at the ping; and v grows by ω x d.

Everything is written once for NumPy (float64) and Dr.Jit (float32). Scene coordinates, z up.
"""
from typing import NamedTuple

import drjit as dr
import numpy as np

__all__ = ["Leg", "dot", "hit_fields", "library", "multiply_add", "per_sqrt", "select", "shared_element_fields",
           "straight_delay"]


class Leg(NamedTuple):
    """The equivalent straight vector of a leg, every field (H,)."""

    length: object           # R [m]
    speed: object            # c [m/s]
    horizontal: object       # sine of the angle from the vertical [-]
    vertical: object         # its cosine, positive: away from the hit is away from its depth [-]
    third: object            # what the vector misses at third order, γ of `vector_approximation` [m]


def library(array):
    """Give the module, NumPy or Dr.Jit, that an array's functions are in."""
    return np if isinstance(array, (np.ndarray, float)) else dr


def select(condition, yes, no):
    """Give yes where the condition holds, else no."""
    return np.where(condition, yes, no) if isinstance(condition, (np.ndarray, np.bool_)) else dr.select(
        condition, yes, no)


def multiply_add(a, b, c):
    """Give a b + c, on the device in one instruction."""
    return a * b + c if library(a + b) is np else dr.fma(a, b, c)


def dot(a, b):
    """Give the sum of products of two sequences."""
    total = a[0] * b[0]
    for left, right in zip(a[1:], b[1:]):
        total = multiply_add(left, right, total)
    return total


def per_sqrt(array):
    """Give 1 / sqrt(array); on the device, to 1e-7, in less than half the time of either."""
    return 1 / np.sqrt(array) if library(array) is np else dr.rsqrt(array)


def straight_delay(along, square, inverse_length, speed, closing, speeds):
    """Give δ [s] and R / (R + c δ) [-]; ``along`` n·d, ``square`` |d|², ``closing`` B, ``speeds`` c² - |v|²."""
    q = multiply_add(inverse_length, square, 2 * along)
    divisor = closing + library(q).sqrt(multiply_add(speeds * inverse_length, q, closing * closing))
    return q / divisor, divisor / multiply_add(inverse_length * speed, q, divisor)


def hit_fields(leg, direction, rise, elapsed, velocity, turn_rate, origin_speed):
    """Make what a difference needs of the hits, in float64; round to float32 afterwards.

    Parameters
    ----------
    leg : Leg
        From the hit to the array's centre at reception.
    direction : triple of float64 (H,)
        n, unit.
    rise : float64 (H,) [m]
        Height of the centre at reception above the origin.
    elapsed : float64 (H,) [s]
        From the ping to the echo's arrival at the centre: the time the array has turned for.
    velocity : triple [m/s]
    turn_rate : triple [rad/s]
        Angular velocity of the platform.
    origin_speed : float or float64 (H,) [m/s]
        Sound speed at the depth the element fields are made for.

    Returns
    -------
    list of float64 (H,)
        n (3) and the vertical (3) as the turned array sees them; 1/R, c, c - n·v, c² - |v|², n_z, v_z,
        (c / origin speed)² - 1, rise, γ.
    """
    vx, vy, vz = velocity
    zero = 0 * leg.speed
    toward = direction[0] * vx + direction[1] * vy + direction[2] * vz
    ratio = leg.speed / origin_speed
    return [*_turned_back(direction, turn_rate, elapsed), *_turned_back((zero, zero, zero + 1), turn_rate, elapsed),
            1 / leg.length, leg.speed, leg.speed - toward, leg.speed * leg.speed - (vx * vx + vy * vy + vz * vz),
            direction[2] + zero, vz + zero, (ratio - 1) * (ratio + 1), rise + zero, leg.third + zero]


def _turned_back(vector, turn_rate, elapsed):
    """Turn vectors by -turn_rate * elapsed (Rodrigues)."""
    xp = library(elapsed)
    wx, wy, wz = turn_rate
    rate = (wx * wx + wy * wy + wz * wz) ** 0.5 + 1e-30
    kx, ky, kz = wx / rate, wy / rate, wz / rate
    x, y, z = vector
    sine, cosine = xp.sin(rate * elapsed), xp.cos(rate * elapsed)
    along = (kx * x + ky * y + kz * z) * (1 - cosine)
    return (x * cosine - (ky * z - kz * y) * sine + kx * along, y * cosine - (kz * x - kx * z) * sine + ky * along,
            z * cosine - (kx * y - ky * x) * sine + kz * along)


def shared_element_fields(offsets, velocity, turn_rate):
    """Make what every difference needs of the elements (NumPy): d (3), |d|², v·d, ω x d (3), each (E,)."""
    offsets = np.asarray(offsets, float)
    turning = np.cross(np.asarray(turn_rate, float), offsets)
    return [*offsets.T, np.sum(offsets**2, axis=-1), offsets @ np.asarray(velocity, float), *turning.T]
