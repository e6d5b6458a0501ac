"""Vector approximation: return times to all elements of an array from a single traced ray.

The leg from the hit to the origin O of its ray is replaced by a straight vector in water of one speed. The vector is
the ray of a homogeneous layer that has the leg's ray parameter p and, with s = 1/c² - p² and integrals over depth,

    Y = X/p = ∫ s^(-1/2) dz,    E = ∫ s^(-3/2) dz,    D = dX/dp = Y + p² E
    c_m² = E / D,    u = sqrt(Y / E),    R = Y / c_m,    n = c_m (p, u)

so range, slope and curvature of the wavefront at O are the ray's own: a virtual point at the same bearing, distance R.
An element at d from the array's centre at reception receives the echo later by δ along the vector
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
added: little where the sound speed hardly changes or elements lie level. Elsewhere the error has no bound. By
reciprocity the same equations with v = 0 give the delays of transmit elements.

`vector_legs` matches the vector to a leg. Everything is written once for NumPy (float64) and Dr.Jit (float32). Fields
are in scene coordinates, z up.
"""
from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from mitsonar.device.types import Numbers
from mitsonar.water.profile import SoundSpeedProfile

from ..numpy_rays.paper_approximation import paper_difference, paper_element_fields
from ..numpy_rays.slices import Slices
from .straight_vectors import dot, library, multiply_add, per_sqrt, select, shared_element_fields, straight_delay

LEVEL = 1e-4               # vertical cosines are kept above this: no division by zero
FLATTEST = 0.02            # vertical cosine below which the last orders count as error
LEVEL_WITHIN = 1e-9        # [m]: smaller heights are 0; 2 ps of sound at one degree from the horizontal


def corrections(leg_vertical: Numbers, leg_horizontal: Numbers, third: Numbers, inverse_length: Numbers,
                shrinking: Numbers, height: Numbers, excess: Numbers,
                variance: Numbers) -> tuple[Numbers, Numbers, Numbers]:
    """Return slice, bending and third order together, and the error expected after them.

    This is the inner loop of every simulation. Factors that the terms have in common are taken out of them, with k
    1 / length of the vector to the element: dX = h p c_m m, a p c_m / w² = p² c_m² k h m / N and

        m = (ε / (w (w + Q)) - 3 V / (8 Q⁴)) / Q,    N = 1 + k h / w ((1 + ε) (w/Q)³ - 1)
    """
    # height [m]
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
    # flatter rays: the last orders count as error in full
    uneven = abs(excess) / (least * least)
    flat = 2 * abs(cubic) + abs(height) * (2 * abs(first) * select(uneven < 1, uneven, 1.0) + spread * root)
    doubt = select(least > FLATTEST, doubt, doubt + flat)
    return value, select(abs(next_order) < 2, doubt, np.inf), change


def _at_least(limit: float, array: Numbers) -> Numbers:
    """Return the larger of the two; cheaper than `maximum`, which looks for NaN."""
    return select(array > limit, array, limit)


def vector_element_fields(offsets: ArrayLike, depth: float, profile: SoundSpeedProfile) -> list[np.ndarray]:
    """Return the element fields of `vector_difference` (NumPy)."""
    # offsets (E, 3) [m]; depth [m] -> (E,)
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
    """Return how much later than at the array's centre an echo arrives at an element."""
    # -> [s]
    delay, (correction, *_), per_closing = _to_element(hits, elements)
    return multiply_add(correction, per_closing, delay)


def level_difference(hits: Sequence[Numbers], elements: Sequence[Numbers]) -> Numbers:
    """Return the `vector_difference` of elements for which slice and bending vanish, at half its cost."""
    # -> [s]
    w, third = hits[10], hits[14]
    delay, shrinking, at_element = _along_the_vector(hits, elements)
    root = library(delay).sqrt
    there = w * shrinking
    change = root(abs(1 - there * there)) - root(abs(1 - w * w))
    return multiply_add(third * change * change, -change * _per_closing(hits, at_element, shrinking), delay)


def difference_of(method: Literal["vector", "paper"], offsets: ArrayLike, profile: SoundSpeedProfile, tilt: float = 0.0,
                  climb: float = 0.0) -> Callable[[Sequence[Numbers], Sequence[Numbers]], Numbers]:
    """Choose the difference to evaluate: the method's, or a cheaper one that gives the same for this array."""
    # tilt [rad]; climb [m/s]
    if method != "vector":
        return DIFFERENCES[method]
    level = np.ptp(profile.sound_speed) == 0 or stays_level(np.asarray(offsets, float), profile, tilt, climb)
    return level_difference if level else vector_difference


def stays_level(offsets: np.ndarray, profile: SoundSpeedProfile, tilt: float, climb: float) -> bool:
    """Return True if elements (E, 3) [m] stay at the depth of the source while echoes arrive."""
    reach = np.linalg.norm(offsets, axis=-1).max(initial=0)
    height = np.abs(offsets[..., 2]).max(initial=0) + tilt * reach + climb * reach / profile.sound_speed.min()
    return bool(height < LEVEL_WITHIN)


def expected_error(hits: Sequence[Numbers], elements: Sequence[Numbers]) -> Numbers:
    """Return the error [s] to expect of `vector_difference`, not negative, infinite where it has no bound."""
    _, (_, error, _), per_closing = _to_element(hits, elements)
    return error * per_closing


def level_error(hits: Sequence[Numbers], elements: Sequence[Numbers]) -> Numbers:
    """Return the `expected_error` of elements for which slice and bending vanish, at a third of its cost."""
    w, faster, third = abs(hits[10]), hits[12], hits[14]
    _, shrinking, at_element = _along_the_vector(hits, elements)
    xp, there = library(w), _at_least(LEVEL, w * shrinking)
    root = xp.sqrt(_at_least(LEVEL**2, there * there + faster))
    p, least = xp.sqrt(abs(1 - there * there)), select(there < root, there, root)
    change = p - xp.sqrt(abs(1 - w * w))
    cubic, next_order = abs(third * change * change * change), abs(4 * change * p / (least * least))
    doubt = cubic * select(least > FLATTEST, next_order, next_order + 2)
    return select(next_order < 2, doubt, np.inf) * _per_closing(hits, at_element, shrinking)


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
