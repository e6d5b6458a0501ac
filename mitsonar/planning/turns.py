"""The shortest way from the end of one survey line to the beginning of the next, with arcs no tighter than a radius.

It is one of six: an arc, a straight or a third arc between, and an arc (Dubins 1957, American Journal of Mathematics
79; the angles as of Shkel and Lumelsky 2001, Robotics and Autonomous Systems 34, eqs. 2 to 11). Between parallel lines
that are sailed to and fro at a distance w this is

    w >= 2 R:  π R + w - 2 R                    w < 2 R:  R (π + 4 arccos((2 R + w) / (4 R)))

the second swinging out to the other side first. R -> ``radius``. Angles within are those of mathematics:
counterclockwise from east.
"""
from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate
from math import acos, atan2, cos, hypot, inf, pi, sin, sqrt

import numpy as np

FULL = 2 * pi
_SAME = 1e-6                       # in radii: how near a way must end
_LEFT, _STRAIGHT, _RIGHT = 1.0, 0.0, -1.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Turn:
    """Hold a way from one line to the next."""

    length: float  # [m]
    path: np.ndarray  # (N, 2) [m]: x and y along it, from end to begin


def turn(begin: np.ndarray, heading: float, end: np.ndarray, end_heading: float, radius: float) -> Turn:
    """Find the shortest way between two places with headings."""
    # begin, end (2,) [m]; heading, end_heading [rad]; radius [m]
    way = np.asarray(end, float) - begin
    if radius <= 0:
        return Turn(length=float(np.hypot(*way)), path=np.stack([begin, end]))
    x, y = way / radius
    start, goal = 0.5 * pi - heading, 0.5 * pi - end_heading
    apart, bearing = hypot(x, y), atan2(y, x)
    signs: tuple[float, ...] = ()
    lengths: tuple[float, ...] = ()
    shortest = inf
    for turns, parts in _words(apart, (start - bearing) % FULL, (goal - bearing) % FULL):
        (u, v), total = _walked(start, turns, parts, [sum(parts)])[0], sum(parts)
        if total < shortest - _SAME and hypot(u - x, v - y) < _SAME * max(1.0, apart):
            signs, lengths, shortest = turns, parts, total
    places = np.linspace(0.0, shortest, 2 + int(shortest / 0.1) if shortest < 100 else 1000)
    path = np.array(_walked(start, signs, lengths, places)) * radius + begin
    return Turn(length=float(shortest * radius), path=path)


def _words(d, start, goal):
    """Yield the six ways between two angles, d radii apart: their turns, and the lengths of their parts.

    Those that begin to starboard are those to port in a mirror.
    """
    for side in (_LEFT, _RIGHT):
        a, b = side * start, side * goal
        sa, ca, sb, cb, cab = sin(a), cos(a), sin(b), cos(b), cos(a - b)
        square = 2 + d * d - 2 * cab + 2 * d * (sa - sb)
        lead = atan2(cb - ca, d + sa - sb)
        if square >= 0:
            yield (side, _STRAIGHT, side), (_positive(lead - a), sqrt(square), _positive(b - lead))
        share = (6 - d * d + 2 * cab + 2 * d * (sb - sa)) / 8
        if abs(share) <= 1:
            middle = FULL - acos(share)
            first = _positive(-a - atan2(ca - cb, d + sa - sb) + 0.5 * middle)
            yield (side, -side, side), (first, middle, _positive(b - a - first + middle))
        square = d * d - 2 + 2 * cab + 2 * d * (sa + sb)
        if square >= 0:
            lead = atan2(-ca - cb, d + sa + sb) - atan2(-2.0, sqrt(square))
            yield (side, _STRAIGHT, -side), (_positive(lead - a), sqrt(square), _positive(lead - b))


def _positive(angle):
    """An angle from 0 to a full turn, of which rounding makes none."""
    angle = angle % FULL
    return 0.0 if angle > FULL - 1e-9 else angle


def _walked(start, signs, lengths, places):
    """Where one is, in radii from the start, after so much of a way."""
    found, ends = [], [0.0, *accumulate(lengths)]
    for place in places:
        x = y = 0.0
        angle = start
        for sign, begin, length in zip(signs, ends, lengths):
            part = min(max(place - begin, 0.0), length)
            if sign == _STRAIGHT:
                x, y = x + part * cos(angle), y + part * sin(angle)
            else:
                x += sign * (sin(angle + sign * part) - sin(angle))
                y -= sign * (cos(angle + sign * part) - cos(angle))
                angle += sign * part
        found.append((x, y))
    return found
