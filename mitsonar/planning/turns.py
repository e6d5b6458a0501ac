"""Shortest way from the end of a survey line to the start of the next, with arcs no tighter than a radius.

The way is one of six: an arc, then a straight or a third arc, then an arc (Dubins 1957, American Journal of Mathematics
79). In radii, with D the vector from the first arc's centre to that of the last,

    same side            straight |D| along D,        or for |D| <= 4 an arc of 2 π - 2 asin(|D| / 4) between
    opposite sides       straight sqrt(|D|² - 4), by atan2(2, straight) to the first side of D

Between parallel lines a distance w apart, sailed to and fro, the length is

    w >= 2 R:  π R + w - 2 R                    w < 2 R:  R (π + 4 arccos((2 R + w) / (4 R)))

where the second way first swings out to the other side. R -> ``radius``. Points are complex numbers, east + i north,
and angles are counterclockwise from east.
"""
from __future__ import annotations

from cmath import phase
from collections.abc import Iterator
from math import acos, asin, atan2, pi, sqrt
from typing import NamedTuple

import numpy as np

_ROUNDING = 9                      # digits, in radii, to which lengths of ways count as equal
_Parts = tuple[float, float, float]


class VesselTurn(NamedTuple):
    """Way from one line to the next: its length [m], and points along it (N, 2) [m]."""

    length: float
    path: np.ndarray


def turn(begin: np.ndarray, heading: float, end: np.ndarray, end_heading: float, radius: float) -> VesselTurn:
    """Return the shortest way between two points (2,) [m] with headings [rad], clockwise from north.

    ``radius`` [m] is the radius of the arcs; 0 gives a straight line.
    """
    way = np.asarray(end, float) - begin
    if radius <= 0:
        return VesselTurn(float(np.hypot(*way)), np.stack([begin, end]))
    start, goal = 0.5 * pi - heading, 0.5 * pi - end_heading
    signs, lengths = min(_words(complex(*way) / radius, start, goal), key=lambda word: round(sum(word[1]), _ROUNDING))
    total = sum(lengths)
    left = np.linspace(0.0, total, 2 + int(total / 0.1) if total < 100 else 1000)
    place, angle = np.zeros(left.size, np.complex128), start
    for sign, length in zip(signs, lengths):
        part = np.clip(left, 0.0, length)
        place += np.exp(1j * angle) * (1j * sign * (1 - np.exp(1j * sign * part)) if sign else part)
        left, angle = left - length, angle + sign * length
    return VesselTurn(total * radius, np.stack([np.real(place), np.imag(place)], -1) * radius + begin)


def _words(way: complex, start: float, goal: float) -> Iterator[tuple[_Parts, _Parts]]:
    """Yield the six ways: the signs of their turns, 1 to port, and the lengths of their parts in radii."""
    for side in (1.0, -1.0):
        for last in (side, -side):
            between = way + 1j * (last * np.exp(1j * goal) - side * np.exp(1j * start))
            apart = abs(between)
            lead = phase(between) if apart > 1e-9 else start          # a single arc: its centre stays
            if side == last:
                yield (side, 0.0, side), (_positive(side * (lead - start)), apart, _positive(side * (goal - lead)))
                if apart <= 4:
                    middle, lead = 2 * pi - 2 * asin(apart / 4), lead + side * (acos(apart / 4) + 0.5 * pi)
                    yield (side, -side, side), (_positive(side * (lead - start)), middle,
                                                _positive(side * (goal - lead) + middle))
            elif apart >= 2:
                straight = sqrt(apart**2 - 4)
                lead += side * atan2(2.0, straight)
                yield (side, 0.0, last), (_positive(side * (lead - start)), straight, _positive(last * (goal - lead)))


def _positive(angle: float) -> float:
    """Return an angle in 0 to 2 π; 0 for a full turn within rounding."""
    angle %= 2 * pi
    return 0.0 if angle > 2 * pi - 1e-9 else angle
