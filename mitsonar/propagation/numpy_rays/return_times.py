"""Return times from hits to the elements of a moving array, by three methods (NumPy, float64).

    paper       equation 2 of the published vector approximation, coefficient 0.503      `paper_approximation`
    vector      equivalent straight vector, slice of local water, third order            `vector_approximation`
    eigenray    the exact ray to where the element is when its echo arrives

The ray is sent at time 0 from the origin O and reaches the hit I at t_i, and at t_i + t_r the element, which is at
O + v t + d at time t:

    t_r = T(I -> O + v (t_i + t_r) + d)

No stop-and-hop: the equation is solved for each element, in closed form along straight vectors, by Newton's method with
the slowness vector dT/dF of the ray's end for eigenrays. ``vector`` is kept within its range by its own error estimate:
where that exceeds `GUARD` the time is that of the eigenray.
"""
from __future__ import annotations

from collections.abc import Callable
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from mitsonar.water.profile import SoundSpeedProfile

from ..returns.straight_vectors import dot, straight_delay
from ..returns.vector_approximation import corrections
from ..returns.vector_legs import matched_leg
from .eigenrays import Eigenray, eigenray
from .layers import Layers
from .paper_approximation import published_time
from .slices import Slices
from .turned import BATCH

Method: TypeAlias = Callable[[SoundSpeedProfile, np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray]
GUARD = 0.5e-9             # [s]: expected errors above are not accepted; true ones are at most twice the expected
SAME_TIME = 2e-16          # [s], and relative: rounding
STEPS = 12
HEADROOM = .5            # share of the way to the limiting ray parameter that the array may change p by
PASSES = 2                 # the slice moves the time, the time the slice: a thousandth of it
TINY = 1e-12               # of the squared sine at the fastest depth: no division by zero


def return_time(profile: SoundSpeedProfile, origin: ArrayLike, hits: ArrayLike, elements: ArrayLike,
                velocity: ArrayLike = (0, 0, 0),
                method: Literal["vector", "paper", "eigenray"] = "vector") -> np.ndarray:
    """Return the travel time from each hit back to each element of a moving array.

    Parameters
    ----------
    profile : SoundSpeedProfile
    origin : array (3,) [m]
        Place of transmission at time 0; scene coordinates, z up, depth = -z.
    hits : array (H, 3) [m]
    elements : array (E, 3) [m]
        Offsets from the platform's position, at the attitude it has at reception, along the scene's axes.
    velocity : array (3,) [m/s]
        Of the platform, constant from transmission to reception.
    method : {"vector", "paper", "eigenray"}

    Returns
    -------
    array (H, E) [s]
        From the instant of the hit; NaN where no direct or once-turned ray leads from the origin to the hit or, where
        an eigenray is used, from the hit to the element. With ``eigenray`` every element gets its own earliest arrival;
        ``vector`` continues the earliest one at the origin.

    Raises
    ------
    ValueError
        If a shape is wrong, there is no element, a number is not finite, the method is unknown or the platform is not
        slower than sound.

    Notes
    -----
    Surface and seabed are ignored. `return_time_error` shows where ``vector`` falls back on eigenrays.

    Examples
    --------
    >>> import numpy as np
    >>> from mitsonar.propagation import return_time
    >>> from mitsonar.water import SoundSpeedProfile
    >>> water = SoundSpeedProfile([0, 5, 12, 25, 40, 60], [1508, 1507.5, 1499, 1491, 1489.5, 1490.5])
    >>> elements = [[0, 0, 0], [0, 0, -0.5]]
    >>> times = return_time(water, [0, 0, -8], [[60, 0, -60]], elements, velocity=[2, 0, 0])
    >>> np.round(np.diff(times) * 1e6, 3)     # lead of an element half a metre deeper [us]
    array([[-215.18]])
    """
    if method not in METHODS:
        raise ValueError(f"return_time: method {method!r} is unknown; use one of {', '.join(METHODS)}.")
    return _in_blocks(profile, *_checked(profile, origin, hits, elements, velocity), METHODS[method])


def return_time_error(profile: SoundSpeedProfile, origin: ArrayLike, hits: ArrayLike, elements: ArrayLike,
                      velocity: ArrayLike = (0, 0, 0)) -> np.ndarray:
    """Return the error to expect of the method ``vector`` without its guard; arguments and errors as `return_time`.

    Returns
    -------
    array (H, E) [s]
        Where it exceeds `GUARD`, `return_time` uses the eigenray. Infinite for rays that turn, run within about one
        degree of the horizontal at an element, or change too much across the array; NaN where there is no ray.
    """
    return _in_blocks(profile, *_checked(profile, origin, hits, elements, velocity), _expected)


# ------------------------------------------------------------------------------------------------------- arguments

def _checked(profile: SoundSpeedProfile,
             *arguments: ArrayLike) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    shapes = {"origin": "(3,)", "hits": "(H, 3)", "elements": "(E, 3)", "velocity": "(3,)"}
    arrays = []
    for (name, shape), value in zip(shapes.items(), arguments):
        try:
            array = np.asarray(value, float)
        except (TypeError, ValueError):
            raise ValueError(f"return_time: {name} must be numbers of shape {shape}, got {value!r}.") from None
        if array.ndim != (2 if "3)" in shape else 1) or array.shape[-1] != 3:
            raise ValueError(f"return_time: {name} must have shape {shape}, got {array.shape}; give x, y, z in metres.")
        if not np.isfinite(array).all():
            raise ValueError(f"return_time: {name} holds {array[~np.isfinite(array)].flat[0]}; it must be finite.")
        arrays.append(array)
    origin, hits, elements, velocity = arrays
    if not len(elements):
        raise ValueError("return_time: elements is empty; give at least one offset, (0, 0, 0) for the centre alone.")
    speed, slowest = float(np.linalg.norm(velocity)), float(profile.sound_speed.min())
    if speed >= slowest:
        raise ValueError(f"return_time: the platform moves at {speed:g} m/s, which is not slower than the sound "
                         f"({slowest:g} m/s at the slowest); give a velocity in m/s.")
    return origin, hits, elements, velocity


def _in_blocks(profile: SoundSpeedProfile, origin: np.ndarray, hits: np.ndarray, elements: np.ndarray,
               velocity: np.ndarray, method: Method) -> np.ndarray:
    """Apply a method to blocks of hits, so that memory stays bounded and in the cache."""
    size = max(1, BATCH // len(elements))
    result = np.empty((len(hits), len(elements)))
    for start in range(0, len(hits), size):
        block = slice(start, start + size)
        result[block] = method(profile, origin, hits[block] - origin, elements, velocity)
    return result


# --------------------------------------------------------------------------------------------------------- methods

def _outgoing(profile: SoundSpeedProfile, origin: np.ndarray, way: np.ndarray) -> Eigenray:
    return eigenray(profile, -origin[2], -(origin[2] + way[:, 2]), np.hypot(way[:, 0], way[:, 1]))


def _paper(profile: SoundSpeedProfile, origin: np.ndarray, way: np.ndarray, elements: np.ndarray,
           velocity: np.ndarray) -> np.ndarray:
    travel_time = _outgoing(profile, origin, way).travel_time
    with np.errstate(invalid="ignore"):
        effective = np.linalg.norm(way, axis=1) / travel_time
    effective = np.where(travel_time > 0, effective, profile.at(-origin[2]))[:, None]
    travel_time = travel_time[:, None]
    vector = [travel_time * v - w[:, None] + d for v, w, d in zip(velocity, way.T, elements.T)]
    depth = -origin[2] - elements[:, 2]
    return published_time(travel_time, effective, vector, velocity,
                          lambda climb: profile.at(depth - climb) - profile.at(-origin[2]))[0]


def _eigenray(profile: SoundSpeedProfile, origin: np.ndarray, way: np.ndarray, elements: np.ndarray,
              velocity: np.ndarray) -> np.ndarray:
    travel_time = _outgoing(profile, origin, way).travel_time
    hit, element = (index.ravel() for index in np.indices((len(way), len(elements))))
    times = np.full((len(way), len(elements)), np.nan)
    there = np.isfinite(travel_time)[hit]
    hit, element = hit[there], element[there]
    times[hit, element] = _exact(profile, origin, way[hit], elements[element], velocity, travel_time[hit],
                                 travel_time[hit])
    return times


def _vector(profile: SoundSpeedProfile, origin: np.ndarray, way: np.ndarray, elements: np.ndarray,
            velocity: np.ndarray) -> np.ndarray:
    travel_time, times, error = approximate(profile, origin, way, elements, velocity)
    hit, element = np.nonzero(np.isfinite(travel_time)[:, None] & ~(error <= GUARD))
    start = np.where(np.isfinite(error), times, travel_time[:, None])[hit, element]
    times[hit, element] = _exact(profile, origin, way[hit], elements[element], velocity, travel_time[hit], start)
    return times


def _expected(profile: SoundSpeedProfile, origin: np.ndarray, way: np.ndarray, elements: np.ndarray,
              velocity: np.ndarray) -> np.ndarray:
    return approximate(profile, origin, way, elements, velocity)[2]


METHODS = {"paper": _paper, "vector": _vector, "eigenray": _eigenray}


def _exact(profile: SoundSpeedProfile, origin: np.ndarray, way: np.ndarray, element: np.ndarray, velocity: np.ndarray,
           travel_time: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Solve t = T(t) for pairs of hit and element, all (N, 3) or (N,), from times ``start``."""
    times = start.copy()
    moving = np.arange(times.size)
    target = -(origin[2] + way[:, 2])
    for _ in range(STEPS):
        x, y, z = (element[moving] + velocity * (travel_time + times)[moving, None] - way[moving]).T
        across = np.hypot(x, y)
        ray = eigenray(profile, target[moving] - z, target[moving], across)
        p, scale = ray.ray_parameter, np.where(across > 0, across, 1)
        climb = np.sin(ray.launch_angle) / profile.at(target[moving] - z)
        slope = p * (x * velocity[0] + y * velocity[1]) / scale + climb * velocity[2]
        step = (ray.travel_time - times[moving]) / (1 - slope)
        times[moving] += step
        moving = moving[np.abs(step) > SAME_TIME * (1 + times[moving])]
        if not moving.size or not velocity.any():
            break
    return times


def approximate(profile: SoundSpeedProfile, origin: np.ndarray, way: np.ndarray, elements: np.ndarray,
                velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Apply the vector approximation without its guard."""
    # origin (3,) [m]; way (H, 3) [m]; elements (E, 3) [m]; velocity (3,) [m/s] -> travel_time (H,) [s], times, error
    # (H, E) [s]
    depth, height = -origin[2], elements[None, :, 2]
    ray = _outgoing(profile, origin, way)
    direct = ray.exists & np.isnan(ray.turning_depth)
    p = np.where(direct, ray.ray_parameter, 0.0)
    with np.errstate(all="ignore"):
        first, second, third, fastest = leg_integrals(profile, depth, depth - way[:, 2], p)
        leg = matched_leg(first, second, third, p, profile.at(depth))
        upwards = np.where(ray.launch_angle >= 0, 1.0, -1.0)[:, None]
        across = np.hypot(way[:, 0], way[:, 1])
        scale = leg.horizontal / np.where(across > 0, across, 1)
        n = -scale * way[:, 0], -scale * way[:, 1], upwards[:, 0] * leg.vertical
        travel_time = ray.travel_time[:, None]
        d = [2 * v * travel_time + offset for v, offset in zip(velocity, elements.T)]
        inverse, speed = 1 / leg.length[:, None], leg.speed[:, None]
        toward = dot(n, velocity)[:, None]
        closing = speed - toward - inverse * sum(part * v for part, v in zip(d, velocity))
        delay, shrinking = straight_delay(
            sum(a[:, None] * b for a, b in zip(n, d)), sum(part * part for part in d), inverse, speed, closing,
            speed * speed - velocity @ velocity)
        times = travel_time + delay
        drift = speed - closing + inverse * (velocity @ velocity) * delay
        closing = speed - drift * shrinking
        worst, change, square, water = 0.0, 0.0, speed * speed, Slices(profile)
        # where the platform keeps its depth, the slice from O to the element is the same for all hits
        for _ in range(PASSES if velocity[2] else 1):
            height = d[2] + velocity[2] * (times - travel_time) if velocity[2] else height
            mean, variance = water.between(depth, depth - height)
            correction, error, change = corrections(
                leg.vertical[:, None], leg.horizontal[:, None], leg.third[:, None], inverse, shrinking,
                upwards * height, square * mean - 1, square * square * variance)
            times = travel_time + delay + correction / closing
            worst = np.maximum(worst, error)
        # no series converges near the p of the ray that is level where the water is fastest
        near = np.abs(change) > HEADROOM * (leg.speed / fastest - leg.horizontal)[:, None]
        error = np.where(near, np.inf, np.abs(worst / closing))
    error = np.where(ray.exists[:, None], np.where(direct[:, None] & np.isfinite(error), error, np.inf), np.nan)
    return ray.travel_time, times, error


def leg_integrals(profile: SoundSpeedProfile, depth: float, target: np.ndarray,
                  ray_parameter: np.ndarray) -> np.ndarray:
    """Integrate Y, E and G of direct rays, exactly: with s the sines, P = s1 s2 and κ = (1 - P) / p², of every layer

        E = Y κ / P,    G = Y ((κ / P)² + ((c2² - c1²) / (s1 + s2))² / (3 P³))
    """
    # depth [m]; target (H,) [m]; ray_parameter (H,) [s/m] -> (4, H)
    upper, lower = np.minimum(depth, target), np.maximum(depth, target)
    sums = np.empty((4, target.size))
    size = max(1, BATCH // (profile.depth.size + 1))
    for start in range(0, target.size, size):
        block = slice(start, start + size)
        layers, p = Layers.between(profile, upper[block], lower[block]), ray_parameter[block]
        cosine = p * layers.fastest
        sines = layers.sines(np.sqrt(np.maximum((1 - cosine) * (1 + cosine), TINY)), cosine)
        c1, c2, s1, s2 = layers.speed[:, :-1], layers.speed[:, 1:], sines[:, :-1], sines[:, 1:]
        y, product = layers.arcs(sines).stretch, s1 * s2
        ratio = (c1**2 + c2**2 - (p[:, None] * c1 * c2) ** 2) / (1 + product) / product
        bend = (c2 - c1) * (c2 + c1) / (s1 + s2)
        sums[:3, block] = y.sum(1), (y * ratio).sum(1), (y * (ratio**2 + bend**2 / (3 * product**3))).sum(1)
        sums[3, block] = layers.fastest
    return sums
