"""Echoes along straight vectors to the elements of a moving, turning array, shared by the return-time methods.

With n the unit vector along which the echo travels, R the vector's length to the array's centre at reception, c the
speed along it, v the platform's velocity and d the element's offset, the echo reaches the element later than the centre
by δ, |R n + d + v δ| = R + c δ, whose solution in a form that loses nothing to cancellation is

    q = 2 n·d + |d|²/R,   B = c - n·v - v·d/R,   δ = q / (B + sqrt(B² + (c² - |v|²) q/R))

The array turns at the rate ω while the echo is under way. For an array turned by the rotation A since the ping,
n·(A d) = (A' n)·d, so the hit carries A' n and the element stays as it was at the ping; and v grows by ω x d. With both

    B = c - n·v - d·g,    g = A'(v/R + n × ω)

and v, ω, A those of the echo's reception at the centre: the hit carries g, and elements know nothing of the motion.

Everything is written once for NumPy (float64) and Dr.Jit (float32). Scene coordinates, z up.
"""
from __future__ import annotations

from types import ModuleType
from typing import NamedTuple

import drjit as dr
import numpy as np
from numpy.typing import ArrayLike

from mitsonar.device.arrays import arrays_of
from mitsonar.device.rotations import rotated
from mitsonar.device.types import Numbers, Triple

from .travel import Travel


class StraightLeg(NamedTuple):
    """The equivalent straight vector of a leg, every field (H,)."""

    length: Numbers          # R [m]
    speed: Numbers           # c [m/s]
    horizontal: Numbers      # sine of the angle from the vertical [-]
    vertical: Numbers        # its cosine, positive: away from the hit is away from its depth [-]
    third: Numbers           # what the vector misses at third order, γ of `vector_approximation` [m]


def library(array: Numbers) -> ModuleType:
    """Return the module, NumPy or Dr.Jit, that an array's functions are in."""
    return np if isinstance(array, (np.ndarray, float)) else dr


def select(condition: Numbers, yes: Numbers, no: Numbers) -> Numbers:
    """Return yes where the condition holds, else no."""
    return np.where(condition, yes, no) if isinstance(condition, (np.ndarray, np.bool_)) else dr.select(
        condition, yes, no)


def multiply_add(a: Numbers, b: Numbers, c: Numbers) -> Numbers:
    """Return a b + c, on the device in one instruction."""
    return a * b + c if library(a + b) is np else dr.fma(a, b, c)


def dot(a: Triple, b: Triple) -> Numbers:
    """Return the sum of products of two sequences."""
    total = a[0] * b[0]
    for left, right in zip(a[1:], b[1:]):
        total = multiply_add(left, right, total)
    return total


def per_sqrt(array: Numbers) -> Numbers:
    """Return 1 / sqrt(array); on the device, to 1e-7, in less than half the time of either."""
    return 1 / np.sqrt(array) if library(array) is np else dr.rsqrt(array)


def straight_delay(along: Numbers, square: Numbers, inverse_length: Numbers, speed: Numbers, closing: Numbers,
                   speeds: Numbers) -> tuple[Numbers, Numbers]:
    """Return δ [s] and R / (R + c δ) [-]; ``along`` n·d, ``square`` |d|², ``closing`` B, ``speeds`` c² - |v|²."""
    q = multiply_add(inverse_length, square, 2 * along)
    divisor = closing + library(q).sqrt(multiply_add(speeds * inverse_length, q, closing * closing))
    return q / divisor, divisor / multiply_add(inverse_length * speed, q, divisor)


def hit_fields(leg: StraightLeg, direction: Triple, rise: Numbers, elapsed: Numbers, travel: Travel,
               origin_speed: Numbers) -> list[Numbers]:
    """Return the hit fields of a difference in float64; round to float32 afterwards."""
    # direction (H,); rise (H,) [m]; elapsed (H,) [s]; origin_speed (H,) [m/s] -> (H,)
    velocity, (wx, wy, wz) = travel.velocity(elapsed), travel.turn_rate(elapsed)
    rotation = travel.turned(elapsed)
    if dr.is_jit_v(rotation[0]):
        rotation = [arrays_of(part).Float(part) for part in rotation]
    nx, ny, nz = direction
    zero = 0 * leg.speed
    ratio, inverse = leg.speed / origin_speed, 1 / leg.length
    carried = ny * wz - nz * wy, nz * wx - nx * wz, nx * wy - ny * wx
    return [*rotated(direction, rotation, back=True), *rotated((zero, zero, zero + 1), rotation, back=True),
            inverse, leg.speed, leg.speed - dot(direction, velocity), leg.speed * leg.speed - dot(velocity, velocity),
            nz + zero, velocity[2] + zero, (ratio - 1) * (ratio + 1), rise + zero, leg.third + zero,
            *rotated([v * inverse + part for v, part in zip(velocity, carried)], rotation, back=True)]


def shared_element_fields(offsets: ArrayLike) -> list[np.ndarray]:
    """Return the element fields of every difference (NumPy): d (3), |d|², each (E,)."""
    offsets = np.asarray(offsets, float)
    return [*offsets.T, np.sum(offsets**2, axis=-1)]
