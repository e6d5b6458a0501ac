"""Water that changes along a survey line: which casts hold at which pings.

Casts stand at marks on a line: times [s], or distances along the track [m]. Between two marks u_k < u_{k+1}, the
share of the second cast at a ping at u is w = (u - u_k) / (u_{k+1} - u_k); beyond the ends it has the water of the end.
The share is rounded to n steps, so that the sound speed changes by at most a given step; pings with equal shares have
equal water.
"""
from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .profile import SoundSpeedProfile
from .waters import WaterColumn

BY, RULES = ("place", "time"), ("nearest", "latest", "interpolated")


def nearest(at: np.ndarray, marks: np.ndarray) -> np.ndarray:
    """Return the numbers of the casts (P,) whose marks (C, D) are nearest to pings at (P, D); of two, the first."""
    best, least = np.zeros(len(at), int), np.full(len(at), np.inf)
    for number, mark in enumerate(marks):
        apart = np.linalg.norm(at - mark, axis=-1)
        best, least = np.where(apart < least, number, best), np.minimum(apart, least)
    return best


def latest(at: np.ndarray, marks: np.ndarray) -> np.ndarray:
    """Return the numbers of the last casts (P,) at marks (C,), increasing, before pings at (P,); before all, 0."""
    return np.maximum(np.searchsorted(marks, at, side="right") - 1, 0)


def between(at: np.ndarray, marks: np.ndarray, steps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the number of the cast before each ping (P,) and the share of the next; `steps` (C - 1,), 0 for none."""
    if len(marks) == 1:
        return np.zeros(len(at), int), np.zeros(len(at))
    place = np.interp(at, marks, np.arange(len(marks)))
    number = np.minimum(place.astype(int), len(marks) - 2)
    share, n = place - number, steps[number]
    return number, np.where(n > 0, np.round(share * n) / np.maximum(n, 1), share)


def steps_between(profiles: Sequence[SoundSpeedProfile], step: float) -> np.ndarray:
    """Return the numbers of steps (C - 1,) of at most `step` [m/s] from each profile to the next; 0 for none."""
    counts = np.zeros(len(profiles) - 1)
    for k, (one, other) in enumerate(zip(profiles, profiles[1:])):
        nodes = np.union1d(one.depth, other.depth)
        apart = float(np.max(np.abs(other.at(nodes) - one.at(nodes))))
        counts[k] = max(np.ceil(apart / step), 1) if step else 0
    return counts


def mixed_columns(columns: Sequence[WaterColumn], number: np.ndarray,
                  share: np.ndarray) -> tuple[list[WaterColumn], np.ndarray]:
    """Return the different columns of pings, `share` (P,) of the way from one to the next, and their numbers (P,)."""
    pairs, numbers = np.unique(np.stack([number + (share == 1), np.where(share == 1, 0.0, share)]), axis=1,
                               return_inverse=True)
    return [columns[int(k)].mixed(columns[min(int(k) + 1, len(columns) - 1)], float(w)) for k, w in pairs.T], \
        numbers.reshape(-1)


def along_track(track: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the distances of pings (P,) and of places (C,) along a track (P, 2), which goes straight on at its ends.

    A place lies where the perpendicular from it meets the nearest leg.
    """
    legs = np.diff(track, axis=0)
    length = np.hypot(*legs.T)
    along = np.concatenate([[0.0], np.cumsum(length)])
    moved = length > 0
    if not moved.any():
        return along, np.zeros(len(places))
    start, legs, length, begin = track[:-1][moved], legs[moved], length[moved], along[:-1][moved]
    low, high = np.zeros(len(length)), length.copy()
    low[0], high[-1] = -np.inf, np.inf
    marks = np.empty(len(places))
    for number, place in enumerate(places):
        on = np.clip(np.sum((place - start) * legs, -1) / length, low, high)
        away = np.hypot(*(start + legs * (on / length)[:, None] - place).T)
        marks[number] = begin[np.argmin(away)] + on[np.argmin(away)]
    return along, marks
