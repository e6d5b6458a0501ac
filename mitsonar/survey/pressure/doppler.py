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
from mitsonar.device.rotations import rotated
from mitsonar.device.types import Float64
from mitsonar.echoes.record import Echoes
from mitsonar.propagation.returns.return_paths import ReturnPaths
from mitsonar.signal.doppler import two_way_doppler

from .ping_source import PingSource, opaque64

SHORTEST_WAY = 1e-3                # [m] against division by zero


def time_scale(source: PingSource, echoes: Echoes, back: ReturnPaths, *, sender: np.ndarray, receiver: np.ndarray,
               moment: float = 0.0) -> tuple[Float64, Float64]:
    """Return the two-way factor at a moment of the pulse, and its arrival time after the beginning of the echo.

    `back` are the paths of echoes that leave at `Echoes.arrival`.
    """
    # sender, receiver (3,) [m]; moment [s] -> doppler (R,) [-], when (R,) [s]
    speed = dr.opaque(mi.Float64, source.speed)
    slower, bend, wide = [], 0, arrays_of(mi.Float).Array3f64
    sent = dr.opaque(mi.Float64, moment)
    ways = ((echoes.out, wide(echoes.out.launch_direction), echoes.out.travel_time, sender, mi.Float64(0)),
            (echoes.back, -wide(*map(mi.Float64, back.direction)), back.return_time, receiver,
             echoes.arrival + back.return_time))
    # the mean velocity until the moment, and that at the moment
    for share in (0.5, 1.0):
        closing = []
        for leg, towards, time, position, begin in ways:
            view, when = source.view(leg), begin + share * sent
            arm = rotated(opaque64(view.rotation @ (position - source.position)), view.travel.turned(when))
            velocity = wide(*view.travel.velocity(when)) + dr.cross(wide(*view.travel.turn_rate(when)), wide(*arm))
            distance = time * speed
            towards = dr.normalize(towards * distance - wide(*arm))
            closing.append(dr.dot(velocity, towards))
            if share < 1:
                across = dr.maximum(dr.squared_norm(velocity) - dr.square(closing[-1]), 0)
                bend += across / dr.maximum(distance, SHORTEST_WAY) / speed
        slower.append(1 / two_way_doppler(closing[0], speed, closing[1]))
    factor, when = 1 / (slower[1] + bend * sent), (slower[0] + 0.5 * bend * sent) * sent
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
    nearest = source.speed * min(float(dr.min(leg.travel_time)[0]) for leg in (echoes.out, echoes.back))
    travel = source.travel
    return float((travel.peak(travel.displacement, 1)[0] / max(nearest, SHORTEST_WAY)
                  + travel.peak(travel.turn, 1)[0]) / source.speed)
