"""Checks of the numbers of an `Array`; errors name the first element that is wrong."""
from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .element_patterns import BAFFLES, PATTERNS

FARTHEST = 10_000                  # [m] from an array's centre; more than any towed array is long


def positions_of(values: ArrayLike) -> np.ndarray:
    """Return the positions (E, 3) [m] of at least one element, or raise a ValueError."""
    position = as_numbers("position", values)
    if position.ndim != 2 or position.shape[1] != 3:
        raise ValueError(f"array: position has shape {position.shape}; give three coordinates [m] for each "
                         "element.")
    if len(position) == 0:
        raise ValueError("array: it has no elements; give at least one position.")
    refuse(~np.isfinite(position).all(axis=1), "position", position, "give finite numbers")
    refuse(np.abs(position).max(axis=1) > FARTHEST, "position", position, f"give places within {FARTHEST} m")
    return position


def check_face(length: float, height: float, pattern: str, baffle: str, floor: float) -> None:
    """Raise a ValueError if a face has an unknown pattern or baffle, or numbers that its pattern does not use."""
    for name, given, known in (("pattern", pattern, PATTERNS), ("baffle", baffle, BAFFLES)):
        if given not in known:
            raise ValueError(f'array: {name} is "{given}"; give one of {", ".join(known)}.')
    for name, size in (("length", length), ("height", height)):
        if not 0 <= size <= FARTHEST:
            raise ValueError(f"array: element {name} is {size} m; give a size from 0 to {FARTHEST} m.")
    if pattern == "omni" and (length or height):
        raise ValueError(f"array: elements are omni, but their length is {length} m and their height "
                         f"{height} m; leave the sizes out or make the pattern rectangular or circular.")
    if pattern == "circular" and height:
        raise ValueError(f"array: elements are circular, but their height is {height} m; the length is the "
                         "diameter, leave the height out.")
    if not 0 <= floor < 1 or (floor and pattern != "rectangular"):
        raise ValueError(f"array: the floor of side lobes of {pattern} elements is {floor:g}; give a power from 0 to "
                         "below 1 to rectangular elements, and 0 to others.")


def as_numbers(name: str, value: ArrayLike) -> np.ndarray:
    """Return a new float64 array of a value, or raise a ValueError that names it."""
    try:
        return np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"array: {name} must be numbers, got {value!r}.") from None


def vector_of(name: str, value: ArrayLike) -> np.ndarray:
    """Return three finite numbers (forward, starboard, down) [m], or raise a ValueError that names them."""
    vector = as_numbers(name, value)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise ValueError(f"array: {name} is {value}; give three finite numbers (forward, starboard, down) [m].")
    return vector


def checked_speed(sound_speed: float) -> float:
    """Return the sound speed [m/s], or raise a ValueError if it is not finite and above 0."""
    if not (np.isfinite(sound_speed) and sound_speed > 0):
        raise ValueError(f"array: sound_speed is {sound_speed} m/s; give a finite number above 0.")
    return sound_speed


def refuse(bad: np.ndarray | np.bool_, name: str, values: np.ndarray, remedy: str) -> None:
    """Raise for the first element marked bad."""
    first = np.flatnonzero(bad)[:1]
    if first.size:
        raise ValueError(f"array: {name} of element {first[0]} is {values[first[0]]}; {remedy}.")
