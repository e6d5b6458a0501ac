"""Places of survey lines: evenly spaced, or each as far from the last as its swath over the bed allows.

The edge of a swath is where its distance to the side r first exceeds what the bed there allows,

    r > reach(d(s, u ± r))

s along the line, u its offset across, d the bed's depth: so a swath is wider downslope, and ends at a bank. Lines
follow from a front F(s), up to which the area is covered: the next lies at the largest u with

    u - r_port(s, u) <= F(s) - overlap (r_port + r_starboard)         for 98 of 100 stations with area left

and moves the front to its starboard edge. The others are those at steep banks, where a swath ends: lines that left no
gap there would lie side by side for all their length. Where all stations cost less than half of u, they all count.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .area import LineFrame
from .bed import PlannedBed
from .rays import SwathRays

MOST_LINES = 2000
TRIED = 50                         # lines before it is guessed how many there will be
MOST_SAMPLES = 256                 # across a side of a swath
MAY_GAP = 0.02                     # share of a line's stations that may leave a gap, where none costs more than
DEAR = 0.5                         # of the line's distance to the last
LEAST_STEP = 0.25                  # of the width that swaths have to themselves
_HALVINGS = 14                     # of the search for a line's offset


@dataclass(frozen=True, kw_only=True, eq=False)
class Lattice:
    """An area as nodes along s (S,) and across u (U,) the lines [m], increasing: which of them (S, U) are inside."""

    frame: LineFrame
    s: np.ndarray
    u: np.ndarray
    inside: np.ndarray


@dataclass(frozen=True, kw_only=True)
class Segment:
    """A straight piece to survey: from ``begin`` to ``end`` [m] at the offset [m] of line number ``row``."""

    row: int
    offset: float
    begin: float
    end: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Edges:
    """Return the reach of a swath to port and to starboard, arrays (S,) [m]."""

    port: np.ndarray
    starboard: np.ndarray

    @property
    def width(self) -> np.ndarray:
        """Return the width of the swath [m]."""
        return self.port + self.starboard


def swath_edges(bed: PlannedBed, rays: SwathRays, frame: LineFrame, offset: float, s: np.ndarray) -> Edges:
    """Return a swath's edges at stations s (S,) [m] of a line."""
    farthest = float(rays.reach.max())
    number = int(np.clip(2 * farthest / min(bed.step), 32, MOST_SAMPLES))
    r = np.linspace(0.0, farthest * (1 + 1e-9), number + 1)
    found = []
    for side in (-1.0, 1.0):
        depth = bed.depth_at(*frame.place(s[:, None], offset + side * r))
        beyond = r - rays.reach_at(depth)
        beyond[:, -1] = np.maximum(beyond[:, -1], 0)
        first = np.argmax(beyond[:, 1:] >= 0, axis=1)
        row = np.arange(s.size)
        before, after = -beyond[row, first], beyond[row, first + 1]
        share = np.divide(before, before + after, out=np.ones(s.size), where=before + after > 0)
        found.append(r[first] + np.clip(share, 0, 1) * (r[1] - r[0]))
    return Edges(port=found[0], starboard=found[1])


def even_segments(lattice: Lattice, spacing: float, shortest: float) -> list[Segment]:
    """Lay lines at even spacing [m], in the middle of the area; gaps along a line up to ``shortest`` [m] are sailed."""
    across = lattice.u[lattice.inside.any(axis=0)]
    low, high = float(across[0]), float(across[-1])
    number = max(int(np.ceil((high - low) / spacing * (1 - 1e-9))), 1)
    refuse_many(number, spacing)
    offsets = 0.5 * (low + high) + (np.arange(number) - 0.5 * (number - 1)) * spacing
    found = []
    for row, offset in enumerate(offsets):
        own = (lattice.u >= offset - 0.5 * spacing - 1e-9) & (lattice.u <= offset + 0.5 * spacing + 1e-9)
        found += _pieces(lattice, row, offset, np.any(lattice.inside[:, own], axis=1), shortest)
    return found


def refuse_many(number: float, spacing: float) -> None:
    """Raise `ValueError` if so many lines, at a spacing [m], are too many."""
    if number > MOST_LINES:
        raise ValueError(f"lines {spacing:.3g} m apart would be {min(number, 1e9):.0f} in the area, more than "
                         f"{MOST_LINES}; take a wider spacing or less overlap, or a part of the area.")


def _refuse_hopeless(sailed, left):
    """Raise after some lines if the rest would be ten times too many at their spacing."""
    spacing = sailed / TRIED
    if left / spacing > 10 * MOST_LINES:
        refuse_many(left / spacing, spacing)


def fitted_segments(bed: PlannedBed, rays: SwathRays, lattice: Lattice, overlap: float,
                    shortest: float) -> list[Segment]:
    """Lay lines whose neighbouring swaths overlap by a share of the width or more, but for a few stations of each."""
    s, u, inside = lattice.s, lattice.u, lattice.inside
    last = np.where(inside.any(axis=1), u[u.size - 1 - np.argmax(inside[:, ::-1], axis=1)], -np.inf)
    front = np.full(s.size, -np.inf)
    covered = np.zeros(s.size, bool)                     # whether the front is the edge of a swath
    farthest, found, low, offset, begun = float(rays.reach.max()), [], -np.inf, None, 0.0
    for row in range(MOST_LINES + 1):
        ahead = inside & (u > front[:, None] + 1e-6)
        left = ahead.any(axis=1)
        if not left.any():
            return found
        begins = np.where(left, u[np.argmax(ahead, axis=1)], np.inf)
        # where the next area begins beyond a hole, no overlap is asked for
        joined = covered & (begins <= front + 2 * (u[1] - u[0]))
        begins = np.where(joined, front, begins)
        here = np.flatnonzero(left)
        nearest = float(np.min(begins[here]))

        def fits(at: float, share: float, here: np.ndarray = here, begins: np.ndarray = begins,
                 joined: np.ndarray = joined) -> bool:
            edges = swath_edges(bed, rays, lattice.frame, at, s[here])
            short = at - edges.port > begins[here] - overlap * edges.width * joined[here]
            return int(np.count_nonzero(short)) <= share * here.size

        low = max(nearest - 2 * farthest * overlap, low)
        last_offset = nearest if offset is None else offset
        offset = _farthest(fits, MAY_GAP, low, max(float(np.quantile(begins[here], MAY_GAP)) + farthest, low))
        whole = _farthest(fits, 0.0, low, offset)
        if whole - last_offset >= DEAR * (offset - last_offset):
            offset = whole
        edges = swath_edges(bed, rays, lattice.frame, offset, s)
        if np.all(offset + edges.starboard[here] >= last[here]):
            offset = max(_pulled_back(bed, rays, lattice, here, last, offset, farthest), low)
            edges = swath_edges(bed, rays, lattice.frame, offset, s)
        new = offset + edges.starboard
        seen = (u >= np.maximum(front, offset - edges.port)[:, None]) & (u <= new[:, None])
        found += _pieces(lattice, row, offset, np.any(inside & seen, axis=1), shortest)
        covered |= left & (new > front)
        front = np.where(left, np.maximum(front, new), front)
        # the next is not nearer than a part of what this swath allows: steep banks may leave it no width at all
        if row == TRIED:
            _refuse_hopeless(offset - begun, float(np.max(last)) - offset)
        begun = offset if row == 0 else begun
        low = offset + LEAST_STEP * (1 - overlap) * max(float(np.median(edges.width[here])), u[1] - u[0])
    refuse_many(MOST_LINES + 1, (low - float(u[0])) / MOST_LINES)
    return found


def _farthest(fits, share, low, high):
    """Return the largest offset that fits, between one that does and one that may not."""
    if fits(high, share):
        return high
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if fits(middle, share) else (low, middle)
    return low


def _pulled_back(bed, rays, lattice, here, last, offset, farthest):
    """Return the smallest offset whose swath still reaches the area's end."""
    low, high = offset - farthest, offset
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        edges = swath_edges(bed, rays, lattice.frame, middle, lattice.s[here])
        low, high = (low, middle) if np.all(middle + edges.starboard >= last[here]) else (middle, high)
    return high


def _pieces(lattice: Lattice, row: int, offset: float, wanted: npt.ArrayLike, shortest: float) -> list[Segment]:
    """Cut a line where there is nothing to survey for longer than ``shortest`` [m]; a node more at every end."""
    at = np.flatnonzero(wanted)
    if not at.size:
        return []
    cuts = np.flatnonzero(np.diff(lattice.s[at]) > max(shortest, 2.5 * (lattice.s[1] - lattice.s[0])))
    begins, ends = at[np.r_[0, cuts + 1]], at[np.r_[cuts, at.size - 1]]
    begins, ends = np.maximum(begins - 1, 0), np.minimum(ends + 1, lattice.s.size - 1)
    return [Segment(row=row, offset=float(offset), begin=float(lattice.s[first]), end=float(lattice.s[stop]))
            for first, stop in zip(begins, ends)]


def in_sailing_order(segments: Sequence[Segment]) -> list[tuple[Segment, bool]]:
    """Return segments in the order of sailing, to and fro, and whether each is sailed from ``begin`` to ``end``.

    Of two orders it is the one with the shorter ways between: line by line, across holes; or on one side of a hole
    first, each segment beside the last.
    """
    rows: dict[int, list[Segment]] = {}
    for one in sorted(segments, key=lambda one: (one.row, one.begin)):
        rows.setdefault(one.row, []).append(one)
    by_line = [(one, number % 2 == 0) for number, row in enumerate(rows.values())
               for one in (row if number % 2 == 0 else row[::-1])]
    return min(by_line, _side_by_side(segments), key=_between)


def _ends(one: Segment, forwards: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return where a segment is begun and left, (2,) along and across."""
    first, last = (np.array([along, one.offset]) for along in (one.begin, one.end))
    return (first, last) if forwards else (last, first)


def _between(order: Sequence[tuple[Segment, bool]]) -> float:
    """Return the length of the straight ways between segments [m]."""
    return sum(float(np.hypot(*(_ends(*after)[0] - _ends(*before)[1]))) for before, after in zip(order, order[1:]))


def _side_by_side(segments: Sequence[Segment]) -> list[tuple[Segment, bool]]:
    """Return each segment beside the last if there is one, else the nearest."""
    left = list(segments)
    order = [(left.pop(0), True)]
    while left:
        last, forwards = order[-1]
        at = _ends(last, forwards)[1]
        beside = [one for one in left if abs(one.row - last.row) == 1 and one.begin < last.end and one.end > last.begin]
        ways = [(float(np.hypot(*(_ends(one, ahead)[0] - at))), number, ahead)
                for number, one in enumerate(beside or left) for ahead in (True, False)]
        _, number, ahead = min(ways)
        chosen = (beside or left)[number]
        left.remove(chosen)
        order.append((chosen, ahead))
    return order
