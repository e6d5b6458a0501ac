"""Length of a leg to an end that has moved, for Dr.Jit numbers.

    |D n - r| - D = q / (|D n - r| + D),    q = |D n - r|² - D² = |r|² - 2 D n·r

D n -> the leg from the origin, r -> the place near the origin that the end has moved to. No large numbers are
subtracted, so float32 keeps the relative precision of the small r. An end that moves on at a velocity until an echo
meets it has `straight_vectors.straight_delay`, which this is at rest.
"""
from typing import Any

import drjit as dr

from mitsonar.device.types import DrJitArray, Numbers, Vector

NEAREST = 1e-12                    # [m] against division by zero, where both ends are one place


def further(square: Numbers, distance: Numbers, length: Numbers | None = None) -> Numbers:
    """Return |D n - r| - D [m] from q, D and, if it is known, |D n - r|."""
    if length is None:
        length = moved_length(square, distance)
    return square / dr.maximum(length + distance, NEAREST)


def moved_length(square: Numbers, distance: Numbers) -> Numbers:
    """Return |D n - r| [m] from q and D."""
    return dr.sqrt(dr.maximum(dr.fma(distance, distance, square), 0))


def detour(towards: Vector, distance: DrJitArray, place: Vector) -> tuple[Any, Any, Any]:
    """Return the way D n - r, its length [m], and how much longer than D it is [m]."""
    kind: Any = type(towards)
    way = kind(distance) * towards - place
    length = dr.norm(way)
    return way, length, further(dr.squared_norm(place) - 2 * distance * dr.dot(towards, place), distance, length)
