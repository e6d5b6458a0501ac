"""The published return time: a straight vector, and equation 2 for the speed along it.

    ev_r = ev_i + 0.503 g (h_r - h_i),    t_r = |F - I| / ev_r

ev_i effective speed of the traced leg, its chord over its time; h_i and h_r the heights of transmission and reception;
g the mean gradient dc/dh between the two, so that g (h_r - h_i) is the difference of the sound speeds there whichever
way the depth is counted. The position F at reception solves |F - I| = ev_r t_r for a platform that moves on, the
closed form of what equation 1 constructs from angles (that one fails along the track, and takes ev_i for ev_r).

The coefficient is 1/2 - g h / (6 c) for one gradient over the whole path, and has nothing to do with the local gradient
in any other water: kept for comparison; `vector_approximation` is the method to use.
"""
from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from mitsonar.device.types import Numbers, Triple
from mitsonar.water.profile import SoundSpeedProfile

from ..returns.straight_vectors import StraightLeg, library, shared_element_fields
from ..returns.travel import Travel

COEFFICIENT = 0.503
PASSES = 3                 # each leaves 2e-4 of the error of the height at reception, at 5 1/s and 1 m/s of heave


def published_time(travel_time: Numbers, effective_speed: Numbers, vector: Triple, velocity: Triple,
                   faster: Callable[[Numbers], Numbers]) -> tuple[Numbers, Numbers, Numbers]:
    """Solve for the return time, the speed along the vector and the height won."""
    # travel_time (...) [s]; effective_speed (...) [m/s]; vector (...) [m]; velocity [m/s] -> return_time [s], speed
    # [m/s], climb [m] (...)
    x, y, z = vector
    vx, vy, vz = velocity
    square, toward = x * x + y * y + z * z, x * vx + y * vy + z * vz
    time, speed, climb = travel_time, effective_speed, 0.0
    for _ in range(PASSES):
        climb = vz * (travel_time + time)
        speed = effective_speed + COEFFICIENT * faster(climb)
        remaining = speed * speed - (vx * vx + vy * vy + vz * vz)
        time = (toward + library(square).sqrt(toward * toward + remaining * square)) / remaining
    return time, speed, climb


def paper_centre_return(travel_time: Numbers, displacement: Triple, travel: Travel,
                        speed_at: Callable[[Numbers], Numbers],
                        elapsed: Numbers | None = None) -> tuple[Numbers, StraightLeg, Triple, Numbers]:
    """Find when and from where the echo meets the array's centre."""
    # travel_time (H,) [s]; displacement (H,) [m]; elapsed (H,) [s] -> return_time (H,) [s], direction (H,), rise (H,)
    # [m]
    xp = library(travel_time)
    here = speed_at(0 * travel_time)
    effective = xp.sqrt(sum(component * component for component in displacement)) / travel_time
    elapsed = travel_time if elapsed is None else elapsed
    # one velocity, as published: that which leads to where the platform is when the echo is there
    wait = travel_time + elapsed
    velocity = [part / wait for part in travel.moved(wait)]
    start = [component + v * elapsed for component, v in zip(displacement, velocity)]
    time, speed, climb = published_time(elapsed, effective, start, velocity, lambda rise: speed_at(rise) - here)
    x, y, z = (component + v * time for component, v in zip(start, velocity))
    across = xp.sqrt(x * x + y * y)
    length = xp.sqrt(across * across + z * z)
    return time, StraightLeg(length, speed, across / length, abs(z) / length, 0 * length), (
        x / length, y / length, z / length), climb


def paper_element_fields(offsets: ArrayLike, depth: float, profile: SoundSpeedProfile) -> list[np.ndarray]:
    """Make what `paper_difference` needs of the elements (NumPy)."""
    # offsets (E, 3) [m]; depth [m] -> (E,)
    shared = shared_element_fields(offsets)
    there = depth - shared[2]
    gradients = [-0.5 * (profile.gradient(z, "below") + profile.gradient(z, "above"))
                 for z in (there, np.asarray(depth))]
    return [*shared, COEFFICIENT * (profile.at(there) - profile.at(depth)),
            COEFFICIENT * (gradients[0] - gradients[1]), COEFFICIENT * gradients[0]]


def paper_difference(hits: Sequence[Numbers], elements: Sequence[Numbers]) -> Numbers:
    """Return how much later than at the array's centre an echo arrives at an element, both by the published formula."""
    # -> [s]
    nx, ny, nz, zx, zy, zz, inverse, speed, closing, speeds, _, vz, _, rise, _, gx, gy, gz = hits
    dx, dy, dz, square, faster, bend, slope = elements
    along = nx * dx + ny * dy + nz * dz
    higher = zx * dx + zy * dy + zz * dz - dz
    gain = (faster + bend * rise + slope * higher) / speed
    # the platform climbs on until the echo is there
    gain = gain + slope * vz * (along + inverse * square / 2 - gain / inverse) / (closing * speed)
    more = gain * (2 + gain)                                             # (ev of the element / of the centre)^2 - 1
    length = 2 * along + inverse * square - more / inverse
    closing = closing + speed * more - (gx * dx + gy * dy + gz * dz)
    return length / (closing + library(along).sqrt(
        closing * closing + (speeds + speed * speed * more) * inverse * length))
