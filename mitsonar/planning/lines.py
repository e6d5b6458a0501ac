"""Layout of survey lines: evenly spaced, or each as far from the last as its swath over the bed allows.

The edge of a swath is where the distance beside the line r first exceeds the reach over the bed there,

    r > reach(d(s, u ± r))

with s along the line, u its offset across and d the depth of the bed. A swath is therefore wider downslope, and ends at
a bank. F(s) is the front up to which the area is covered. The next line lies at the largest u with

    u - r_port(s, u) <= F(s) - overlap (r_port + r_starboard)         for 98 of 100 stations with area left

and moves the front to its starboard edge. The other 2 % are stations at steep banks, where a swath ends: without a gap
there, lines would lie side by side for all their length. If keeping all stations costs less than half of the step in u,
all stations count.
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
TRIED = 50                         # lines after which the total is estimated
MOST_SAMPLES = 256                 # across one side of a swath
MAY_GAP = 0.02                     # share of a line's stations that may leave a gap,
DEAR = 0.5                         # if keeping them costs more than this share of the line's distance to the last
LEAST_STEP = 0.25                  # of the swath width without overlap
_HALVINGS = 14                     # in the search for a line's offset


@dataclass(frozen=True, kw_only=True, eq=False)
class Lattice:
    """Area as nodes along s (S,) and across u (U,) the lines [m], increasing, and a mask of those inside (S, U)."""

    frame: LineFrame
    s: np.ndarray
    u: np.ndarray
    inside: np.ndarray


@dataclass(frozen=True, kw_only=True)
class Segment:
    """Straight segment to survey, from ``begin`` to ``end`` [m], at the offset [m] of line number ``row``."""

    row: int
    offset: float
    begin: float
    end: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Edges:
    """Reach of a swath to port and to starboard, arrays (S,) [m]."""

    port: np.ndarray
    starboard: np.ndarray

    @property
    def width(self) -> np.ndarray:
        """Return the width of the swath [m]."""
        return self.port + self.starboard


def swath_edges(bed: PlannedBed, rays: SwathRays, frame: LineFrame, offset: float, s: np.ndarray) -> Edges:
    """Return the edges of a swath at stations s (S,) [m] of a line."""
    farthest = float(rays.reach.max())
    number = int(np.clip(2 * farthest / min(bed.step), 32, MOST_SAMPLES))
    r = np.linspace(0.0, farthest * (1 + 1e-9), number + 1)
    edges = []
    for side in (-1.0, 1.0):
        depth = bed.depth_at(*frame.place(s[:, None], offset + side * r))
        beyond = r - rays.reach_at(depth)
        beyond[:, -1] = np.maximum(beyond[:, -1], 0)
        first = np.argmax(beyond[:, 1:] >= 0, axis=1)
        row = np.arange(s.size)
        before, after = -beyond[row, first], beyond[row, first + 1]
        share = np.divide(before, before + after, out=np.ones(s.size), where=before + after > 0)
        edges.append(r[first] + np.clip(share, 0, 1) * (r[1] - r[0]))
    return Edges(port=edges[0], starboard=edges[1])


def even_segments(lattice: Lattice, spacing: float, shortest: float) -> list[Segment]:
    """Return lines at an even spacing [m], centred on the area; gaps along a line up to ``shortest`` [m] are sailed."""
    across = lattice.u[lattice.inside.any(axis=0)]
    low, high = float(across[0]), float(across[-1])
    number = max(int(np.ceil((high - low) / spacing * (1 - 1e-9))), 1)
    refuse_many(number, spacing)
    offsets = 0.5 * (low + high) + (np.arange(number) - 0.5 * (number - 1)) * spacing
    segments = []
    for row, offset in enumerate(offsets):
        near = (lattice.u >= offset - 0.5 * spacing - 1e-9) & (lattice.u <= offset + 0.5 * spacing + 1e-9)
        segments += _pieces(lattice, row, offset, np.any(lattice.inside[:, near], axis=1), shortest)
    return segments


def refuse_many(number: float, spacing: float) -> None:
    """Raise `ValueError` if ``number`` lines at a spacing [m] are too many."""
    if number > MOST_LINES:
        raise ValueError(f"lines {spacing:.3g} m apart give {min(number, 1e9):.0f} lines in the area, more than "
                         f"{MOST_LINES}; take a wider spacing or less overlap, or a part of the area.")


def fitted_segments(bed: PlannedBed, rays: SwathRays, lattice: Lattice, overlap: float,
                    shortest: float) -> list[Segment]:
    """Return lines whose neighbouring swaths overlap by at least a share of the width at nearly all stations."""
    s, u, inside = lattice.s, lattice.u, lattice.inside
    last = np.where(inside.any(axis=1), u[u.size - 1 - np.argmax(inside[:, ::-1], axis=1)], -np.inf)
    front = np.full(s.size, -np.inf)
    covered = np.zeros(s.size, bool)                     # True where the front is the edge of a swath
    farthest, segments, low, offset, begun = float(rays.reach.max()), [], -np.inf, None, 0.0
    for row in range(MOST_LINES + 1):
        ahead = inside & (u > front[:, None] + 1e-6)
        left = ahead.any(axis=1)
        if not left.any():
            return segments
        begins = np.where(left, u[np.argmax(ahead, axis=1)], np.inf)
        # beyond a hole, no overlap is required
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
        complete = _farthest(fits, 0.0, low, offset)
        if complete - last_offset >= DEAR * (offset - last_offset):
            offset = complete
        edges = swath_edges(bed, rays, lattice.frame, offset, s)
        if np.all(offset + edges.starboard[here] >= last[here]):
            offset = max(_pulled_back(bed, rays, lattice, here, last, offset, farthest), low)
            edges = swath_edges(bed, rays, lattice.frame, offset, s)
        new = offset + edges.starboard
        seen = (u >= np.maximum(front, offset - edges.port)[:, None]) & (u <= new[:, None])
        segments += _pieces(lattice, row, offset, np.any(inside & seen, axis=1), shortest)
        covered |= left & (new > front)
        front = np.where(left, np.maximum(front, new), front)
        # the next line keeps a least distance: steep banks may leave this swath no width at all
        if row == TRIED and (float(np.max(last)) - offset) / (spacing := (offset - begun) / TRIED) > 10 * MOST_LINES:
            refuse_many((float(np.max(last)) - offset) / spacing, spacing)
        begun = offset if row == 0 else begun
        low = offset + LEAST_STEP * (1 - overlap) * max(float(np.median(edges.width[here])), u[1] - u[0])
    refuse_many(MOST_LINES + 1, (low - float(u[0])) / MOST_LINES)
    return segments


def _farthest(fits, share, low, high) -> float:
    """Return the largest offset that fits, between ``low``, which fits, and ``high``."""
    if fits(high, share):
        return high
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if fits(middle, share) else (low, middle)
    return low


def _pulled_back(bed, rays, lattice, here, last, offset, farthest) -> float:
    """Return the smallest offset whose swath still reaches the end of the area."""
    low, high = offset - farthest, offset
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        edges = swath_edges(bed, rays, lattice.frame, middle, lattice.s[here])
        low, high = (low, middle) if np.all(middle + edges.starboard >= last[here]) else (middle, high)
    return high


def _pieces(lattice: Lattice, row: int, offset: float, wanted: npt.ArrayLike, shortest: float) -> list[Segment]:
    """Return the segments of a line, cut at gaps longer than ``shortest`` [m], with one more node at every end."""
    at = np.flatnonzero(wanted)
    if not at.size:
        return []
    cuts = np.flatnonzero(np.diff(lattice.s[at]) > max(shortest, 2.5 * (lattice.s[1] - lattice.s[0])))
    begins, ends = at[np.r_[0, cuts + 1]], at[np.r_[cuts, at.size - 1]]
    begins, ends = np.maximum(begins - 1, 0), np.minimum(ends + 1, lattice.s.size - 1)
    return [Segment(row=row, offset=float(offset), begin=float(lattice.s[first]), end=float(lattice.s[stop]))
            for first, stop in zip(begins, ends)]


def in_sailing_order(segments: Sequence[Segment]) -> list[tuple[Segment, bool]]:
    """Return segments in the order of sailing, to and fro, each with True if it is sailed from ``begin`` to ``end``.

    The order is line by line across holes, or one side of a hole first, whichever has less way between segments.
    """
    rows: dict[int, list[Segment]] = {}
    for segment in sorted(segments, key=lambda segment: (segment.row, segment.begin)):
        rows.setdefault(segment.row, []).append(segment)
    by_line = [(segment, number % 2 == 0) for number, row in enumerate(rows.values())
               for segment in (row if number % 2 == 0 else row[::-1])]
    return min(by_line, _side_by_side(segments), key=lambda order: sum(
        float(np.hypot(*(_ends(*after)[0] - _ends(*before)[1]))) for before, after in zip(order, order[1:])))


def _ends(segment: Segment, forwards: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return the first and last point of a segment as sailed, each (2,) along and across."""
    first, last = (np.array([along, segment.offset]) for along in (segment.begin, segment.end))
    return (first, last) if forwards else (last, first)


def _side_by_side(segments: Sequence[Segment]) -> list[tuple[Segment, bool]]:
    """Return the segments so that each lies beside the last if possible, else nearest to it."""
    left = list(segments)
    order = [(left.pop(0), True)]
    while left:
        last, forwards = order[-1]
        at = _ends(last, forwards)[1]
        choice = [segment for segment in left if abs(segment.row - last.row) == 1 and segment.begin < last.end
                  and segment.end > last.begin] or left
        _, number, ahead = min((float(np.hypot(*(_ends(segment, ahead)[0] - at))), number, ahead)
                               for number, segment in enumerate(choice) for ahead in (True, False))
        chosen = choice[number]
        left.remove(chosen)
        order.append((chosen, ahead))
    return order
