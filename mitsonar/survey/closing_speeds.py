"""How fast elements close in on what they hear: the bounds of the Doppler factors that stand for the echoes of a ping.

    -v <= u <= v                                v speed of the fastest element
    min, max of v·d over directions d of the beams, ± v β        where side lobes are thinned

Of the beams are all directions in which `ElementBeams.bound` is above the intensity that cells are thinned below. They
are looked for among N of a Fibonacci lattice, no direction farther from one of them than β. Echoes from beyond are as
weak, and are of the outermost class: their level, delay and mid frequency are right, the ends of a sweep are off.
"""
from __future__ import annotations

from functools import lru_cache

import drjit as dr
import mitsuba as mi
import numpy as np

from ..device.arrays import upload
from ..echoes.element_beams import ElementBeams
from .array_survey import ArraySurvey

__all__ = ["closing_speeds"]

DIRECTIONS = 1 << 14               # N
APART = 4.0 / np.sqrt(DIRECTIONS)  # β [rad]: no place of the sphere is farther off, by a wide margin
GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))


def closing_speeds(survey: ArraySurvey, ping: int, *, fastest: float, acceleration: float,
                   nearest: float) -> tuple[float, float]:
    """Give the least and the largest closing speed of a ping's echoes, one way [m/s].

    Parameters
    ----------
    survey : ArraySurvey
    ping : int
    fastest, acceleration : float [m/s], [m/s²]
        Of the fastest element while echoes come in.
    nearest : float [m]
        From which on echoes matter.
    """
    beams = ElementBeams(survey.transmit, survey.receive, survey.wavelength)
    if not (survey.thin_below and beams):
        return -fastest, fastest
    direction = _lattice()
    bound = beams.bound(mi.Vector3f(*(upload(mi.Float, column.astype(np.float32)) for column in direction.T)),
                        dr.opaque(mi.Float, nearest), survey.track.rotation()[ping], dr.opaque(mi.Float, APART))
    heard = direction[bound.numpy() > survey.thin_below]
    if not len(heard):
        return -fastest, fastest
    velocity = survey.velocity[ping]
    along = heard @ velocity
    # what elements do besides: they turn, and the platform speeds up and down
    spare = (fastest * APART + (fastest - float(np.linalg.norm(velocity)))
             + acceleration * (survey.time[-1] + survey.pulse.duration))
    return max(float(along.min()) - spare, -fastest), min(float(along.max()) + spare, fastest)


@lru_cache(maxsize=1)
def _lattice() -> np.ndarray:
    """Directions (N, 3) that lie evenly on the sphere: of a Fibonacci lattice."""
    number = np.arange(DIRECTIONS) + 0.5
    height, angle = 1 - 2 * number / DIRECTIONS, GOLDEN_ANGLE * number
    level = np.sqrt(1 - height ** 2)
    return np.stack([level * np.cos(angle), level * np.sin(angle), height], 1)
