"""The shortest way from the end of one survey line to the beginning of the next, with arcs no tighter than a radius.

It is one of six: an arc, a straight or a third arc between, and an arc (Dubins 1957, American Journal of Mathematics
79). In radii, with D the way from the first arc's centre to the last one's,

    both to one side     straight |D| along D,        or for |D| <= 4 an arc of 2 π - 2 asin(|D| / 4) between
    to either side       straight sqrt(|D|² - 4), by atan2(2, straight) to the first side of D

Between parallel lines that are sailed to and fro at a distance w this is

    w >= 2 R:  π R + w - 2 R                    w < 2 R:  R (π + 4 arccos((2 R + w) / (4 R)))

the second swinging out to the other side first. R -> ``radius``. Places are complex numbers here, east + i north, and
angles counterclockwise from east.
"""
from __future__ import annotations

from cmath import phase
from collections.abc import Iterator
from math import acos, asin, atan2, pi, sqrt
from typing import NamedTuple

import numpy as np

_ROUNDING = 9                      # digits to which ways are as long as each other, in radii
_Parts = tuple[float, float, float]


class VesselTurn(NamedTuple):
    """Way from one line to the next: its length [m], and places along it (N, 2) [m]."""

    length: float
    path: np.ndarray


def turn(begin: np.ndarray, heading: float, end: np.ndarray, end_heading: float, radius: float) -> VesselTurn:
    """Return the shortest way between two places (2,) [m] with headings [rad], clockwise from north.

    ``radius`` [m] is that of the arcs; 0: straight from place to place.
    """
    way = np.asarray(end, float) - begin
    if radius <= 0:
        return VesselTurn(float(np.hypot(*way)), np.stack([begin, end]))
    start, goal = 0.5 * pi - heading, 0.5 * pi - end_heading
    signs, lengths = min(_words(complex(*way) / radius, start, goal), key=lambda word: round(sum(word[1]), _ROUNDING))
    whole = sum(lengths)
    left = np.linspace(0.0, whole, 2 + int(whole / 0.1) if whole < 100 else 1000)
    place, angle = np.zeros(left.size, np.complex128), start
    for sign, length in zip(signs, lengths):
        part = np.clip(left, 0.0, length)
        place += np.exp(1j * angle) * (1j * sign * (1 - np.exp(1j * sign * part)) if sign else part)
        left, angle = left - length, angle + sign * length
    return VesselTurn(whole * radius, np.stack([np.real(place), np.imag(place)], -1) * radius + begin)


def _words(way: complex, start: float, goal: float) -> Iterator[tuple[_Parts, _Parts]]:
    """Yield the six ways: the signs of their turns, 1 to port, and the lengths of their parts in radii."""
    for side in (1.0, -1.0):
        for last in (side, -side):
            between = way + 1j * (last * np.exp(1j * goal) - side * np.exp(1j * start))
            apart = abs(between)
            lead = phase(between) if apart > 1e-9 else start          # one arc: its middle stays
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
    """Return an angle from 0 to a full turn; 0 for a full turn but for rounding."""
    angle = angle % (2 * pi)
    return 0.0 if angle > 2 * pi - 1e-9 else angle
