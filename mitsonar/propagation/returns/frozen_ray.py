"""Travel time through water that changes across: the frozen ray.

In c_0(z) + dc the time along the eigenray of c_0 alone, with the slowness that is there, is exact but for the bending:

    F = ∫ g ds,    g = 1/(c_0 + dc) - 1/c_0,    T = T_0 + F                                                        (1)

By Fermat's principle what is missing is of second order in the bending. A ray that is bent by f = c ∇⊥g has turned by
K(s) - <K>, K = ∫ f ds, with <K> its mean over the length S, and is earlier by

    b = S/(2c) (<K²> - <K>²),    T = T_0 + F - b                                                                   (2)

but for how the profile itself spreads the bend: b lacks a tenth at 200 m, and a third at 400 m, along a thermocline
with an internal wave. The time changes with
the place r of the leg's start, an element of an array, by

    ∇F = ∫ (1 - s/S) ∇g ds - F n/S                                                                                 (3)

n the unit vector from the start to the end along the chord. The path is that of the eigenray's ray parameter p,
dz/ds = q, dq/ds = -p² c dc/dz, q the sine downwards, by `STEPS` leapfrog steps, shorn so that it ends where it should;
its middles are the nodes of (1) to (3), and (1) has the end correction of the midpoint rule, h²/24 dg/ds. Written once
for NumPy and Dr.Jit.
"""
from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import drjit as dr
import numpy as np

from mitsonar.device.types import Numbers
from mitsonar.water.fields import SoundSpeedField, SpeedAt

from .straight_vectors import select

STEPS = 48


class FrozenLeg(NamedTuple):
    """An eigenray of the profile, from its start to its end; every field (R,)."""

    start: tuple[Numbers, Numbers, Numbers]  # x, y and depth [m]
    heading: tuple[Numbers, Numbers]  # unit, east and north
    horizontal_range: Numbers  # [m]
    end_depth: Numbers  # [m]
    arc_length: Numbers  # [m]
    ray_parameter: Numbers  # [s/m]
    launch_sine: Numbers  # positive down


class FrozenRay(NamedTuple):
    """Hold what a field adds to an eigenray; every field is (R,)."""

    later: Numbers  # F - b [s]
    slope: tuple[Numbers, Numbers, Numbers]  # ∇F with the start: x, y and depth [s/m]
    bending: Numbers  # b [s]

    def slope_upwards(self, kind: Callable) -> Numbers:
        """Return ∇F in scene coordinates, z up, as a vector of a kind."""
        return kind(self.slope[0], self.slope[1], -self.slope[2])


def frozen_ray(leg: FrozenLeg, field: SoundSpeedField, speed_at: SpeedAt, *, steps: int = STEPS) -> FrozenRay:
    """Return what a field adds to eigenrays of the profile; `speed_at` returns the profile's speed and gradient."""
    x0, y0, z0 = leg.start
    step, p = leg.arc_length / steps, leg.ray_parameter
    xp, zero = dr if dr.is_jit_v(step) else np, 0 * step
    begin = zero + z0, zero + leg.launch_sine, zero

    def advance(z, q, x):
        """One step; returns the state after it, and depth, way, speed and gradient of its middle."""
        middle = z + 0.5 * step * q
        speed, gradient = speed_at(middle)
        turned = q - step * p * p * speed * gradient
        way = x + 0.5 * step * p * speed
        return (middle + 0.5 * step * turned, turned, x + step * p * speed), (middle, way, speed, gradient)

    z, _, x = _repeated(lambda _, *state: advance(*state)[0], begin, steps, step)
    shear, stretch = (leg.end_depth - z) / steps, leg.horizontal_range / xp.maximum(x, 1e-9)

    def add(number, z, q, x, *sums):
        state, (depth, way, speed, gradient) = advance(z, q, x)
        depth, way = depth + shear * (number + 0.5), way * stretch
        change = field.change(x0 + leg.heading[0] * way, y0 + leg.heading[1] * way, depth, speed_at)
        speed, gradient = speed_at(depth)
        slow = 1 / (speed + change.value)
        g, square = -change.value * slow / speed, slow * slow
        down = gradient * (1 / (speed * speed) - square) - change.down * square
        east, north = -change.east * square, -change.north * square
        weight = 1 - (number + 0.5) / steps
        # along the ray, across it in its plane, and sideways
        level, sine = p * speed, 0.5 * (q + state[1])
        ahead = east * leg.heading[0] + north * leg.heading[1]
        bends = (speed * (sine * ahead - level * down), speed * (north * leg.heading[0] - east * leg.heading[1]))
        along = sine * down + level * ahead
        turned = [sums[4 + k] + 0.5 * step * bend for k, bend in enumerate(bends)]
        return (*state, sums[0] + g, sums[1] + weight * east, sums[2] + weight * north, sums[3] + weight * down,
                *(sums[4 + k] + step * bend for k, bend in enumerate(bends)),
                sums[6] + turned[0], sums[7] + turned[1], sums[8] + turned[0] * turned[0] + turned[1] * turned[1],
                select(number < 0.5, along, sums[9]), along)

    *_, later, east, north, down, _, _, first, second, square, at_start, at_end = _repeated(
        add, (*begin, *[zero] * 11), steps, step)
    later = step * later + step * step / 24 * (at_end - at_start)
    length = xp.maximum(leg.arc_length, 1e-9)
    fall = leg.end_depth - z0
    chord = xp.maximum(xp.sqrt(leg.horizontal_range * leg.horizontal_range + fall * fall), 1e-9)
    per_chord = later / (chord * length)
    slope = (step * east - leg.heading[0] * leg.horizontal_range * per_chord,
             step * north - leg.heading[1] * leg.horizontal_range * per_chord, step * down - fall * per_chord)
    spread = square / steps - (first * first + second * second) / (steps * steps)
    bending = 0.5 * length / speed_at(z0 + zero)[0] * spread
    return FrozenRay(later - bending, slope, bending)


def _repeated(body: Callable, state: tuple, steps: int, like: Numbers) -> tuple:
    """Return the state after a number of steps of ``body(number, *state)``; on the device in one loop."""
    if not dr.is_jit_v(like):
        for number in range(steps):
            state = body(number, *state)
        return state
    kind = type(like)
    count = dr.opaque(kind, steps)
    return dr.while_loop((kind(0), *state), lambda number, *_: number < count,
                         lambda number, *rest: (number + 1, *body(number, *rest)), label="frozen ray")[1:]
