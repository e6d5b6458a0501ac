"""The vector approximation: return times to all elements of an array from the one ray that was traced.

The leg from the hit to the origin O of its ray is replaced by a straight vector in water of one speed. The vector is
the ray of a homogeneous layer that has the leg's ray parameter p and, with s = 1/c² - p² and integrals over depth,

    Y = X/p = ∫ s^(-1/2) dz,    E = ∫ s^(-3/2) dz,    D = dX/dp = Y + p² E
    c_m² = E / D,    u = sqrt(Y / E),    R = Y / c_m,    n = c_m (p, u)

so range, slope and curvature of the wavefront at O are the ray's own: a virtual point at the same bearing, distance R.
An element at d from where the array's centre is when its own echo arrives hears the hit later by δ along the vector
(`straight_vectors`, B as there). Three corrections follow, w the vertical cosine at the element, ε = c_m² <1/c²> - 1
and V the variance of c_m²/c² in the slice of water, h thick, between the centre and the element, Q = sqrt(w² + ε):

    slice          h ε / (w + Q) - h V / (8 Q³)                     the element's own water instead of the leg's
    bending        dX a/2 (1 - a p c_m/w²),  a = dX/D               the ray's change of p (Newton), dX its miss
    third order    -γ (Δp c_m)³,  γ = p³ (G - E²/Y) / (2 c_m²)      G = ∫ s^(-5/2) dz, Δp = p at the element - p

all in metres of c_m, divided by c_m - v·n at the element. What is left is judged by the next terms of the same three
series,

    4 γ Δp³ c_m³ (Δp c_m p c_m / w²) + 3 dX a (a p c_m / w²)² + (V/Q⁴)^(3/2) (h Q/8 + 3/5 h a p c_m/Q)

with the smaller of w and Q for w. On 17 profiles, offsets to 2 m and platforms to 5 m/s the error stayed below
1.3 ns wherever this number is below 1 ns, the ray at the element steeper than 1.1 degrees and Δp c_m p c_m < w²/2.
For flatter rays twice the third order and the slice, 2 γ (Δp c_m)³ + |h ε| / (w + Q) min(2, 2 |ε|/w²) + h V / Q³, are
doubted too: little where water hardly changes or elements lie level. Elsewhere nothing is promised. By reciprocity the
same with v = 0 gives the delays of transmit elements.

Everything is written once for NumPy (float64) and Dr.Jit (float32). Fields are in scene coordinates, z up.
"""
from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ..device.types import Numbers, Triple
from ..water import SoundSpeedProfile
from .paper_approximation import paper_difference, paper_element_fields
from .slices import Slices
from .straight_vectors import (
    Leg, dot, library, multiply_add, per_sqrt, select, shared_element_fields, straight_delay)
from .travel import Travel

__all__ = ["DIFFERENCES", "ELEMENT_FIELDS", "centre_return", "corrections", "difference_of", "expected_error",
           "level_difference", "matched_leg", "vector_difference", "vector_element_fields"]

LEVEL = 1e-4               # vertical cosines are kept above this: no division by zero
FLATTEST = 0.02            # vertical cosine below which the last orders are not trusted
LEVEL_WITHIN = 1e-9        # [m]: heights below are none, 2 ps of sound at one degree from the horizontal


def corrections(leg_vertical: Numbers, leg_horizontal: Numbers, third: Numbers, inverse_length: Numbers,
                shrinking: Numbers, height: Numbers, excess: Numbers,
                variance: Numbers) -> tuple[Numbers, Numbers, Numbers]:
    """Give slice, bending and third order together, and the error expected after them.

    Parameters
    ----------
    leg_vertical, leg_horizontal, third, inverse_length : arrays
        Of the leg: cosine and sine from the vertical, γ [m], 1/R [1/m].
    shrinking : array [-]
        1 / (1 + c_m δ / R): R over the length of the straight vector to the element.
    height : array [m]
        h, of the element above the end of the leg, away from the hit.
    excess, variance : arrays [-]
        ε and V of the water between.

    Returns
    -------
    correction, expected_error, change : arrays [m], [m], [-]
        The second is not negative, infinite where nothing is promised; the third is Δp c_m.

    Notes
    -----
    This is the inner loop of every simulation. Factors that the terms have in common are taken out of them, with k
    1 / length of the vector to the element: dX = h p c_m m, a p c_m / w² = p² c_m² k h m / N and

        m = (ε / (w (w + Q)) - 3 V / (8 Q⁴)) / Q,    N = 1 + k h / w ((1 + ε) (w/Q)³ - 1)
    """
    xp = library(leg_vertical)
    w = _at_least(LEVEL, multiply_add(inverse_length, height, leg_vertical) * shrinking)
    square = w * w
    squared_root = _at_least(LEVEL**2, square + excess)
    per_root, p2 = per_sqrt(squared_root), abs(1 - square)
    root = squared_root * per_root
    per_w, first = 1 / w, excess / (w + root)
    per_root2 = per_root * per_root
    spread = variance * per_root2 * per_root2
    miss = per_root * multiply_add(first, per_w, -0.375 * spread)
    ratio = w * per_root
    curved = inverse_length * shrinking * height
    turned = multiply_add(excess + 1, ratio * ratio * ratio, -1)
    bend = curved * miss / multiply_add(curved * per_w, turned, 1)
    steps, p = p2 * bend, xp.sqrt(p2)
    change = multiply_add(p, multiply_add(square, bend, 1), -leg_horizontal)
    cubic = third * change * change * change
    value = multiply_add(root * spread, -0.125, first)
    value = multiply_add(miss * square * steps, multiply_add(steps, -0.5, 0.5), value)
    value = multiply_add(height, value, -cubic)
    least = select(w < root, w, root)
    enlarged = steps * square / (least * least)
    next_order = 4 * change * p / (least * least)
    doubt = (abs(cubic * next_order) + abs(3 * height * miss * square * steps * enlarged * enlarged)
             + abs(spread * spread**0.5 * height * (root / 8 + 0.6 * steps * square * per_root)))
    # flatter rays: all of what their last orders bring is doubted
    uneven = abs(excess) / (least * least)
    flat = 2 * abs(cubic) + abs(height) * (2 * abs(first) * select(uneven < 1, uneven, 1.0) + spread * root)
    doubt = select(least > FLATTEST, doubt, doubt + flat)
    return value, select(abs(next_order) < 2, doubt, np.inf), change


def _at_least(limit: float, array: Numbers) -> Numbers:
    """Cheaper than maximum, which heeds NaN."""
    return select(array > limit, array, limit)


# -------------------------------------------------------------------------------------------------- legs, float64

def matched_leg(range_per_parameter: Numbers, second: Numbers, third: Numbers, ray_parameter: Numbers,
                speed: Numbers) -> Leg:
    """Match a straight vector to a leg.

    Parameters
    ----------
    range_per_parameter, second, third : float64 (H,)
        Y, E and G of the module's equations. Where E is not positive (a ray beyond its caustic) there is no such
        vector: the one with the speed of the origin is taken, right to first order alone.
    ray_parameter : float64 (H,) [s/m]
    speed : float64 (H,) or float [m/s]
        Sound speed at the origin.

    Returns
    -------
    Leg
    """
    y, p, xp = range_per_parameter, ray_parameter, library(ray_parameter)
    matched = (second > 0) & (y > 0)
    local = xp.maximum(1 / (speed * speed) - p * p, (LEVEL / speed) ** 2)
    e = select(matched, second, y / local)
    g = select(matched, third - e * e / xp.maximum(y, 1e-30), 0.0)
    speed = xp.sqrt(e / xp.maximum(y + p * p * e, 1e-30))
    u = xp.sqrt(y / xp.maximum(e, 1e-30))
    return Leg(y / speed, speed, p * speed, u * speed, 0.5 * g * p**3 / (speed * speed))


def centre_return(leg: Leg, travel_time: Numbers, bearing: tuple[Numbers, Numbers], upwards: Numbers, travel: Travel,
                  slice_to: Callable[[Numbers], tuple[Numbers, Numbers]],
                  elapsed: Numbers | None = None) -> tuple[Numbers, Leg, Triple, Numbers]:
    """Follow the platform to where the echo meets the array's centre, and match the leg to there.

    Parameters
    ----------
    leg : Leg
        From the hit to the origin.
    travel_time : float64 (H,) [s]
        Of the traced ray, origin to hit.
    bearing : pair of float64 (H,) [-]
        Horizontal unit vector (x, y) from the origin to the hit.
    upwards : float64 (H,) [-]
        +1 where the returning ray comes up to the origin, -1 where it comes down.
    travel : Travel
        Of the platform since the ping.
    slice_to : callable
        Height above the origin [m] -> mean [s²/m²] and variance [s⁴/m⁴] of 1/c² from the origin to there.
    elapsed : float64 (H,) [s] or None
        From the ping to when the hit sends the echo back; None: the travel time.

    Returns
    -------
    return_time : float64 (H,) [s]
        From the hit to the centre, where that is at reception.
    leg : Leg
        From the hit to the centre at reception.
    direction : triple of float64 (H,)
        n, the way the echo travels there.
    rise : float64 (H,) [m]
        Height of the centre at reception above the origin.
    """
    xp = library(travel_time)
    n = (-bearing[0] * leg.horizontal, -bearing[1] * leg.horizontal, upwards * leg.vertical)
    elapsed = travel_time if elapsed is None else elapsed
    wait = travel_time + elapsed
    # the way as a straight one, x + v (t - wait), that touches it within microseconds of when the echo is there
    about = wait + dot(n, travel.moved(wait)) / leg.speed
    velocity = travel.velocity(about)
    place = [part + v * (wait - about) for part, v in zip(travel.moved(about), velocity)]
    inverse = 1 / xp.maximum(leg.length, 1e-9)
    square, along = dot(velocity, velocity), dot(velocity, place)
    toward = dot(n, velocity)
    closing = leg.speed - toward - inverse * along
    c2 = leg.speed * leg.speed
    straight, shrinking = straight_delay(dot(n, place), dot(place, place), inverse, leg.speed, closing, c2 - square)
    delay, height, excess = straight, 0.0, 0.0
    closing = leg.speed - (leg.speed - closing + inverse * square * delay) * shrinking
    for _ in range(2):          # the slice moves the time, the time the slice: a thousandth of it
        height = upwards * (place[2] + velocity[2] * delay)
        mean, variance = slice_to(upwards * height)
        excess = c2 * mean - 1
        correction = corrections(leg.vertical, leg.horizontal, leg.third, inverse, shrinking, height, excess,
                                 c2 * c2 * variance)[0]
        delay = straight + correction / closing
    # the leg to there: the matched layer and the slice in a row, at the p that spans the new range; in units of c_m
    place = [part + v * delay for part, v in zip(place, velocity)]
    x, y = leg.length * n[0] + place[0], leg.length * n[1] + place[1]
    across = xp.sqrt(x * x + y * y)
    layer, height = leg.length * leg.vertical, upwards * place[2]
    p = across / xp.sqrt(across * across + xp.maximum(layer + height, 1e-9) ** 2)
    for _ in range(2):
        first, second, _ = _two_layers(leg, p, layer, height, excess)
        p = xp.minimum(p + (across - p * first) / (first + p * p * second), 1 - 0.5 * LEVEL**2)
    there = matched_leg(*_two_layers(leg, p, layer, height, excess), p, 1.0)
    # a level ray has no layer to match; it only moves
    level = leg.vertical <= 2 * LEVEL
    there = Leg(select(level, leg.length + dot(n, place), there.length), leg.speed * select(level, 1.0, there.speed),
                select(level, leg.horizontal, there.horizontal), select(level, leg.vertical, there.vertical),
                there.third)
    still = across < 1e-9
    scale = there.horizontal / select(still, 1.0, across)
    direction = select(still, 0.0, x * scale), select(still, 0.0, y * scale), upwards * there.vertical
    return travel_time + delay, there, direction, upwards * height


def _two_layers(leg: Leg, p: Numbers, layer: Numbers, height: Numbers,
                excess: Numbers) -> tuple[Numbers, Numbers, Numbers]:
    """Y, E and G, speeds in units of c_m, of the leg's layer and the slice above it; to third order of the leg."""
    xp = library(p)
    below = xp.maximum(1 - p * p, LEVEL**2)
    above = xp.maximum(below + excess, LEVEL**2)
    first, further = layer / xp.sqrt(below), height / xp.sqrt(above)
    second, third = first / below + further / above, first / (below * below) + further / (above * above)
    first = first + further
    beyond = third - second * second / first + 2 * leg.third / xp.maximum(leg.horizontal, 1e-6) ** 3
    change = p - leg.horizontal
    bent = 3 * leg.third * change / xp.maximum(leg.horizontal, 1e-6) ** 2
    first, second = first + bent * change * leg.horizontal, second + 2 * bent
    return first, second, second * second / first + beyond


# ------------------------------------------------------------------------------------------------- the difference

def vector_element_fields(offsets: ArrayLike, depth: float, profile: SoundSpeedProfile) -> list[np.ndarray]:
    """Make what `vector_difference` needs of the elements (NumPy).

    Parameters
    ----------
    offsets : array (E, 3) [m]
        From the array's centre, scene coordinates, as the array stands at the ping.
    depth : float [m]
        Of the centre at the ping.
    profile : SoundSpeedProfile

    Returns
    -------
    list of float64 (E,)
        d (3), |d|², c²<1/c²> - 1, its change with the rise [1/m] and the rise squared [1/m²],
        variance of c²/c².
    """
    shared = shared_element_fields(offsets)
    speed, height = profile.at(depth), shared[2]
    there = depth - height
    mean, variance = Slices(profile).between(depth, there)
    # what the mean changes by as both ends rise, to second order
    slopes = [(profile.gradient(z, "below") + profile.gradient(z, "above")) * speed**2 / profile.at(z) ** 3
              for z in (np.asarray(depth), there)]
    level = np.abs(height) < 1e-6
    divisor = np.where(level, 1.0, height)
    rate = np.where(level, slopes[0], ((speed / profile.at(there)) ** 2 - 1) / divisor)
    bend = np.where(level, 0.0, 0.5 * (slopes[1] - slopes[0]) / divisor)
    return [*shared, speed**2 * mean - 1, rate, bend, speed**4 * variance]


def vector_difference(hits: Sequence[Numbers], elements: Sequence[Numbers]) -> Numbers:
    """Give how much later than at the array's centre an echo arrives at an element.

    Parameters
    ----------
    hits : sequence of arrays
        As of `straight_vectors.hit_fields`.
    elements : sequence of arrays
        As of `vector_element_fields`; both broadcast.

    Returns
    -------
    array [s]
        Of the type of the fields.
    """
    delay, (correction, *_), per_closing = _to_element(hits, elements)
    return multiply_add(correction, per_closing, delay)


def level_difference(hits: Sequence[Numbers], elements: Sequence[Numbers]) -> Numbers:
    """Give the `vector_difference` of elements for which slice and bending vanish, at half its cost.

    Parameters
    ----------
    hits, elements : sequences of arrays
        As of `vector_difference`.

    Returns
    -------
    array [s]
    """
    w, third = hits[10], hits[14]
    delay, shrinking, at_element = _along_the_vector(hits, elements)
    root = library(delay).sqrt
    there = w * shrinking
    change = root(abs(1 - there * there)) - root(abs(1 - w * w))
    return multiply_add(third * change * change, -change * _per_closing(hits, at_element, shrinking), delay)


def difference_of(method: Literal["vector", "paper"], offsets: ArrayLike, profile: SoundSpeedProfile, tilt: float = 0.0,
                  climb: float = 0.0) -> Callable[[Sequence[Numbers], Sequence[Numbers]], Numbers]:
    """Choose the difference to evaluate: the method's, or a cheaper one that gives the same for this array.

    Parameters
    ----------
    method : {"vector", "paper"}
    offsets, profile
        As of `vector_element_fields`.
    tilt : float [rad]
        Largest angle by which the array leans over while echoes come in.
    climb : float [m/s]
        Largest vertical speed meanwhile.

    Returns
    -------
    callable
        One of `DIFFERENCES`, or `level_difference` where the array is level, stays so and does not heave, or where the
        sound has one speed.
    """
    if method != "vector":
        return DIFFERENCES[method]
    offsets = np.asarray(offsets, float)
    reach = np.linalg.norm(offsets, axis=-1).max(initial=0)
    height = np.abs(offsets[..., 2]).max(initial=0) + tilt * reach + climb * reach / profile.sound_speed.min()
    one_speed = np.ptp(profile.sound_speed) == 0
    return level_difference if one_speed or height < LEVEL_WITHIN else vector_difference


def expected_error(hits: Sequence[Numbers], elements: Sequence[Numbers]) -> Numbers:
    """Give the error [s] to expect of `vector_difference`, not negative, infinite where nothing is promised."""
    _, (_, error, _), per_closing = _to_element(hits, elements)
    return error * per_closing


def _along_the_vector(hits: Sequence[Numbers], elements: Sequence[Numbers]) -> tuple[Numbers, Numbers, Numbers]:
    """Delay along the straight vector [s], R over its length to the element, and B [m/s]."""
    inverse, speed, closing, speeds = hits[6:10]
    d, square = elements[:3], elements[3]
    at_element = closing - dot(hits[15:18], d)
    return *straight_delay(dot(hits[:3], d), square, inverse, speed, at_element, speeds), at_element


def _per_closing(hits: Sequence[Numbers], at_element: Numbers, shrinking: Numbers) -> Numbers:
    """1 / (c_m - v·n) at the element, from that at the centre by a step of Newton's method: they hardly differ."""
    per_closing, last = 1 / hits[8], multiply_add(at_element - hits[7], shrinking, hits[7])
    return per_closing * multiply_add(-per_closing, last, 2)


def _to_element(hits: Sequence[Numbers],
                elements: Sequence[Numbers]) -> tuple[Numbers, tuple[Numbers, Numbers, Numbers], Numbers]:
    """Delay along the straight vector [s], corrections and their error [m], and what turns these into time [s/m]."""
    zx, zy, zz, inverse, _, _, _, w, vz, faster, rise, third = hits[3:15]
    dx, dy, dz, *_, excess, rate, bend, variance = elements
    delay, shrinking, at_element = _along_the_vector(hits, elements)
    # of the hit alone: traced once for all elements
    xp, scale = library(delay), 1 + faster
    upwards, sine = xp.copysign(1.0 + 0 * w, w), xp.sqrt(abs(1 - w * w))
    up = [upwards * part for part in (zx, zy, zz, vz)]
    # of the pair
    height = dot(up, (dx, dy, dz, delay))
    middle = multiply_add(0.5 * upwards, height, rise)
    local = multiply_add(rate, middle, multiply_add(bend, rise * rise, excess - 0.5 * rate * dz))
    found = corrections(abs(w), sine, third, inverse, shrinking, height, multiply_add(local, scale, faster),
                        scale * scale * variance)
    return delay, found, _per_closing(hits, at_element, shrinking)


DIFFERENCES = {"paper": paper_difference, "vector": vector_difference}
ELEMENT_FIELDS = {"paper": paper_element_fields, "vector": vector_element_fields}
