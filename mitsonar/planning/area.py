"""The area that a survey is to cover: polygons with holes, or all that a bathymetry knows.

A place is inside where a line from it to the far side crosses the rings an odd number of times, so that holes and
islands within holes need no rule of their own. Lattices are tested row by row: a row at s crosses the edge from
(s_0, u_0) to (s_1, u_1) at u = u_0 + (s - s_0) (u_1 - u_0) / (s_1 - s_0), and each crossing turns inside to outside.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

MOST_CORNERS = 20_000
_ROWS = 64                         # tested at once
_PAIRS = 1 << 20                   # of edges compared at once


@dataclass(frozen=True, kw_only=True)
class LineFrame:
    """Count along and across lines of one heading."""

    heading: float  # [rad]: clockwise from north

    def along_across(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return s along the lines and u to starboard of them [m]."""
        sine, cosine = np.sin(self.heading), np.cos(self.heading)
        return x * sine + y * cosine, x * cosine - y * sine

    def place(self, along: np.ndarray, across: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return x and y [m] of a place: the way back."""
        sine, cosine = np.sin(self.heading), np.cos(self.heading)
        return along * sine + across * cosine, along * cosine - across * sine


@dataclass(frozen=True, kw_only=True, eq=False)
class Area:
    """Hold the rings around an area."""

    rings: tuple[np.ndarray, ...]  # (N, 2) [m]: x and y of corners, the last not repeated

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Return west, south, east and north [m]."""
        corners = np.concatenate(self.rings)
        low, high = corners.min(0), corners.max(0)
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])

    @property
    def size(self) -> float:
        """Return the area [m²]: of every ring what it adds or takes away, by how many others it lies in."""
        total = 0.0
        for number, ring in enumerate(self.rings):
            x, y = ring.T
            shoelace = 0.5 * abs(float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))))
            others = [one for other, one in enumerate(self.rings) if other != number]
            within = bool(others) and bool(inside_rows(others, ring[:1, 1], ring[:1, 0])[0, 0])
            total += -shoelace if within else shoelace
        return total

    def rows(self, frame: LineFrame, along: np.ndarray, across: np.ndarray) -> np.ndarray:
        """Tell which nodes of a lattice along and across lines lie inside: bool array (S, U)."""
        turned = [np.stack(frame.along_across(*ring.T)[::-1], -1) for ring in self.rings]
        return inside_rows(turned, along, across)

    def nodes(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Tell which nodes of a grid lie inside: bool array (Y, X)."""
        return inside_rows(self.rings, y, x)


def inside_rows(rings: Sequence[np.ndarray], rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Tell which nodes (row, column) lie within rings."""
    # rings (N, 2); rows (R,); columns (C,) -> (R, C)
    begins = np.concatenate(rings)
    ends = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
    (u_0, s_0), (u_1, s_1) = begins.T, ends.T
    inside = np.zeros((rows.size, columns.size), bool)
    for start in range(0, rows.size, _ROWS):
        s = rows[start:start + _ROWS, None]
        row, edge = np.nonzero((s_0 <= s) != (s_1 <= s))
        at = u_0[edge] + (s[row, 0] - s_0[edge]) / (s_1[edge] - s_0[edge]) * (u_1[edge] - u_0[edge])
        turns = np.zeros((s.size, columns.size + 1), np.int32)
        np.add.at(turns, (row, np.searchsorted(columns, at)), 1)
        inside[start:start + _ROWS] = np.cumsum(turns, axis=1)[:, :-1] % 2 == 1
    return inside


def polygon(rings: Sequence[np.ndarray], what: str = "the area") -> Area:
    """Check the rings of an area."""
    # rings (N, 2) [m]
    kept = []
    for ring in rings:
        ring = np.asarray(ring, float)
        ring = ring[np.any(ring != np.roll(ring, 1, axis=0), axis=1)] if len(ring) else ring
        if len(ring) < 3:
            raise ValueError(f"{what} has a ring of {len(ring)} corners; it needs three that differ.")
        if not np.isfinite(ring).all():
            raise ValueError(f"{what} has a corner that is not a finite number; repair it.")
        kept.append(ring)
    if not kept:
        raise ValueError(f"{what} is empty: it has no ring of corners; draw a polygon.")
    corners = sum(map(len, kept))
    if corners > MOST_CORNERS:
        raise ValueError(f"{what} has {corners} corners, more than {MOST_CORNERS}; simplify it.")
    crossing = crossed_edges(kept)
    if crossing is not None:
        raise ValueError(f"{what} crosses itself near x = {crossing[0]:.7g}, y = {crossing[1]:.7g}; give the corners "
                         "in their order around it.")
    area = Area(rings=tuple(kept))
    if not area.size > 0:
        raise ValueError(f"{what} has no extent: its corners lie on a line; draw a polygon.")
    return area


def crossed_edges(rings: Sequence[np.ndarray]) -> np.ndarray | None:
    """Return a corner (2,) beside the first two edges that cross, not counting neighbours that share one; else None."""
    begins = np.concatenate(rings)
    ends = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
    origin = begins.mean(0)
    begins, ends = begins - origin, ends - origin
    number = len(begins)
    rows = max(1, _PAIRS // number)
    for start in range(0, number, rows):
        p, q = begins[start:start + rows, None], ends[start:start + rows, None]
        apart = [_side(p, q, begins) * _side(p, q, ends) < 0, _side(begins, ends, p) * _side(begins, ends, q) < 0]
        first = np.argwhere(apart[0] & apart[1])
        if first.size:
            return begins[start + first[0, 0]] + origin
    return None


def _side(begin, end, point):
    """On which side of edges points lie: twice the triangle's area."""
    edge, away = end - begin, point - begin
    return edge[..., 0] * away[..., 1] - edge[..., 1] * away[..., 0]
