"""Doppler of echoes between a moving array's elements: their time scale, and groups of receivers that share one.

At a moment of the pulse the factor is that of `signal.doppler`, from the velocities of both elements towards the echo.
The scatterer's own motion multiplies it (`echoes.body_motion`).
It changes while the platform passes: the part of the pulse sent at t arrives t/η̄ after the beginning of the
echo, with η̄ the mean over [0, t]. The bend grows with the speed across and with 1 / range.
"""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of
from mitsonar.device.rotations import cross, rotated
from mitsonar.device.types import Float64
from mitsonar.echoes.record import Echoes
from mitsonar.propagation.returns.return_paths import ReturnPaths
from mitsonar.propagation.returns.straight_vectors import dot
from mitsonar.signal.doppler import two_way_shift

from .pairs import seen_from
from .ping_source import PingSource, opaque

SAME_PLACE = 1e-9                  # [m]
SHORTEST_WAY = 1e-3                # [m] against division by zero


def time_scale(source: PingSource, echoes: Echoes, back: ReturnPaths, *, sender: np.ndarray, receiver: np.ndarray,
               moment: float = 0.0) -> tuple[Float64, Float64]:
    """Return the two-way factor at a moment of the pulse, and its arrival time after the beginning of the echo.

    `back` are the paths of echoes that leave at `Echoes.arrival`; what they hold of a later moment must be of this one.
    """
    # sender, receiver (3,) [m]; moment [s] -> doppler (R,) [-], when (R,) [s]
    #
    # All that differs from echo to echo is float32: it makes the small changes of the factor, never the factor itself.
    lib = arrays_of(mi.Float)
    F, sent, speed = lib.Float, dr.opaque(mi.Float64, moment), dr.opaque(lib.Float, source.speed)
    ways = ((echoes.out, [F(part) for part in echoes.out.launch_direction], F(echoes.out.travel_time), sender,
             mi.Float64(0)),
            (echoes.back, [-part for part in back.direction], F(back.return_time), receiver,
             echoes.arrival + back.return_time))
    closing, bends = [], []
    # the mean velocity until the moment, and that at the moment
    for leg, towards, time, position, begin in ways:
        view, arm, distance = source.view(leg), position - source.position, time * speed
        off = bool(np.linalg.norm(arm) > SAME_PLACE)
        for share in (0.5, 1.0):
            when, seen = begin + share * sent, towards
            velocity = [F(part) for part in view.travel.velocity(when)]
            if off:
                turn, rate = ([F(part) for part in function(when)]
                              for function in (view.travel.turned, view.travel.turn_rate))
                there = rotated(opaque(F, view.rotation @ arm), turn)
                velocity = [part + more for part, more in zip(velocity, cross(rate, there))]
                seen = seen_from(towards, there, dr.rcp(dr.maximum(distance, SHORTEST_WAY)))
            closing.append(dot(velocity, seen))
            if share < 1:
                across = dr.maximum(dot(velocity, velocity) - dr.square(closing[-1]), 0)
                bends.append(across / (dr.maximum(distance, SHORTEST_WAY) * speed) * F(sent))
    # 1 / η - 1: echoes along directions of the beginning arrive slower from then on, of the moment faster before
    shifts = [two_way_shift(closing[k], speed, closing[k + 2]) for k in (0, 1)]
    mean, last = (-shift / (1 + shift) for shift in shifts)
    out, home = bends
    mean, last = ((mean + 0.5 * (out + home), last + (out + home)) if back.later is None else
                  (mean + 0.5 * (out - home), last + out))
    factor, when = 1 / (1 + mi.Float64(last)), sent + mi.Float64(mean) * sent
    if echoes.shift is None:
        return factor, when
    own = 1 + mi.Float64(echoes.shift)
    return factor * own, when / own


def receiver_groups(source: PingSource, echoes: Echoes, position: np.ndarray,
                    tolerance: float) -> list[tuple[slice, np.ndarray]]:
    """Return groups of receive elements, with their centres, whose Doppler factors agree within a tolerance."""
    # position (E, 3) [m]
    widest, groups, first = tolerance / max(factor_per_metre(source, echoes), 1e-30), [], 0
    for last in range(1, len(position) + 1):
        group = position[first:last + 1]
        if last == len(position) or np.linalg.norm(group - group.mean(0), axis=1).max() > widest:
            groups.append((slice(first, last), position[first:last].mean(0)))
            first = last
    return groups


def factor_per_metre(source: PingSource, echoes: Echoes) -> float:
    """Return the largest difference of the factors of elements per metre between them [1/m]."""
    nearest = source.speed * min(leg.soonest for leg in (echoes.out, echoes.back))
    travel = source.travel
    return float((travel.peak(travel.displacement, 1)[0] / max(nearest, SHORTEST_WAY)
                  + travel.peak(travel.turn, 1)[0]) / source.speed)
