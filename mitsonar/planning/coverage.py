"""Coverage of a plan's swaths: how often each node of the bed is seen, and how densely it is sounded.

A node at s along a line and r to its side is seen where r is within the edge of the swath there, and where no bed
nearer to the line hides it, that is where the angle θ(r) of the ray to it is the largest so far. With N beams, n pings
a second and the speed v, soundings a square metre are

    N / (2 Θ) |dθ/dr| n / v    of beams at even angles         N / (r_port + r_starboard) n / v    at even distances

Θ -> ``half_angle``, N -> ``beams``, n -> ``rate``. A sonar that is told no rate pings when the echo of its farthest
beam is back.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .area import LineFrame
from .bed import PlannedBed
from .lines import MOST_SAMPLES, Edges, Segment, swath_edges
from .rays import SwathRays

_REPEATED = 1e-9                   # [rad] that an angle may fall behind the largest so far


@dataclass(frozen=True, kw_only=True)
class SwathSonar:
    """Hold what a plan needs of a sonar."""

    swath: float  # [rad]: between the outermost beams
    beams: int = 256  # soundings of a ping
    rate: float = np.inf  # [1/s]: most pings a second
    head_depth: float = 0.0  # [m]
    max_range: float = np.inf  # [m]
    even: str = "angle"  # "angle" or "distance"
    name: str = ""

    def __post_init__(self):
        if not 0 < self.swath < np.pi:
            raise ValueError(f"the swath is {np.rad2deg(self.swath):g} degrees; give more than 0 and less than 180.")
        if not 1 <= self.beams <= 100_000:
            raise ValueError(f"the sonar has {self.beams} beams; give 1 to 100000.")
        if not self.rate > 0:
            raise ValueError(f"the sonar pings {self.rate:g} times a second; give more than 0.")
        if not (self.head_depth >= 0 and self.max_range > 0):
            raise ValueError(f"the sonar's head is {self.head_depth:g} m deep and hears up to {self.max_range:g} m; "
                             "give a depth of 0 or more and a range above 0.")
        if self.even not in ("angle", "distance"):
            raise ValueError(f'beams are even in {self.even!r}; choose "angle" or "distance".')


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedTrack:
    """A segment with its swath at stations s (S,) [m]: depth under the sonar [m] and pings a second there."""

    segment: Segment
    s: np.ndarray
    edges: Edges
    depth: np.ndarray
    rate: np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class Coverage:
    """Nodes (Y, X) that are to be covered, how many lines see each, and soundings [1/m²] of all of them."""

    wanted: np.ndarray
    times: np.ndarray
    density: np.ndarray

    @property
    def gap(self) -> np.ndarray:
        """Return which nodes are wanted and not seen."""
        return self.wanted & (self.times == 0)

    def share(self, times: int = 1) -> float:
        """Return the share of the wanted nodes that at least so many lines see."""
        return float(np.count_nonzero(self.times[self.wanted] >= times) / max(np.count_nonzero(self.wanted), 1))


@dataclass(frozen=True, kw_only=True)
class Gap:
    """A gap: its node that lies farthest in [m], and its area [m²]."""

    x: float
    y: float
    area: float


def track(bed: PlannedBed, rays: SwathRays, sonar: SwathSonar, frame: LineFrame, segment: Segment, sound_speed: float,
          step: float) -> PlannedTrack:
    """Return a segment with its swath, at stations about a ``step`` [m] apart; ``sound_speed`` [m/s] is at the head."""
    length = segment.end - segment.begin
    s = np.linspace(segment.begin, segment.end, int(np.clip(np.ceil(length / step) + 1, 2, 4000)))
    edges = swath_edges(bed, rays, frame, segment.offset, s)
    slant = np.zeros(s.size)
    for side, reach in ((-1, edges.port), (1, edges.starboard)):
        below = bed.depth_at(*frame.place(s, segment.offset + side * reach)) - sonar.head_depth
        slant = np.maximum(slant, np.hypot(reach, below))
    with np.errstate(divide="ignore"):
        rate = np.minimum(sonar.rate, sound_speed / (2 * slant))
    depth = bed.depth_at(*frame.place(s, np.full(s.size, segment.offset)))
    return PlannedTrack(segment=segment, s=s, edges=edges, depth=depth, rate=rate)


def coverage(bed: PlannedBed, rays: SwathRays, sonar: SwathSonar, frame: LineFrame, tracks: Sequence[PlannedTrack],
             speed: float,
             wanted: np.ndarray) -> Coverage:
    """Count what all swaths see of the wanted nodes (Y, X) of a bed, at a speed [m/s]."""
    row, column = np.nonzero(wanted)
    along, across = frame.along_across(bed.x[column], bed.y[row])
    order = np.argsort(across)
    along, across = along[order], across[order]
    times, density = np.zeros(along.size, np.uint16), np.zeros(along.size, np.float32)
    for one in tracks:
        low, high = np.searchsorted(across, one.segment.offset + np.array([-one.edges.port.max(),
                                                                           one.edges.starboard.max()]))
        # a node stands for the cell about it
        half = 0.5 * max(bed.step)
        near = low + np.flatnonzero((along[low:high] >= one.s[0] - half) & (along[low:high] <= one.s[-1] + half))
        s, r = along[near], across[near] - one.segment.offset
        within = np.abs(r) <= np.where(r < 0, np.interp(s, one.s, one.edges.port),
                                       np.interp(s, one.s, one.edges.starboard))
        near, s, r = near[within], s[within], r[within]
        if near.size:
            found = _sounded(bed, rays, sonar, frame, one, speed, s, r)
            times[near] += found > 0
            density[near] += found
    counts = np.zeros(wanted.shape, np.uint16), np.zeros(wanted.shape, np.float32)
    for grid, values in zip(counts, (times, density)):
        grid[row[order], column[order]] = values
    return Coverage(wanted=wanted, times=counts[0], density=counts[1])


def _sounded(bed, rays, sonar, frame, one, speed, s, r):
    """Return soundings a square metre at places along and beside a line; 0 where nearer bed hides them."""
    farthest = max(one.edges.port.max(), one.edges.starboard.max(), 1e-6)
    number = int(np.clip(farthest / min(bed.step), 16, MOST_SAMPLES))
    side = np.linspace(-farthest, farthest, 2 * number + 1)
    depth = bed.depth_at(*frame.place(one.s[:, None], one.segment.offset + side))
    angle = rays.angle(np.abs(side) + 0 * depth, depth)
    hidden = np.zeros(angle.shape, bool)
    for half in (np.s_[:, number:], np.s_[:, number::-1]):
        hidden[half] = angle[half] < np.maximum.accumulate(angle[half], axis=1) - _REPEATED
    if sonar.even == "angle":
        signed = np.where(side < 0, -angle, angle)
        spread = sonar.beams / sonar.swath * np.abs(np.gradient(signed, side, axis=1))
    else:
        spread = np.broadcast_to((sonar.beams / np.maximum(one.edges.width, 1e-6))[:, None], angle.shape)
    spread = np.where(hidden, 0.0, spread * (one.rate / speed)[:, None])
    step = one.s[1] - one.s[0] if one.s.size > 1 else 1.0
    i = np.clip(np.rint((s - one.s[0]) / step).astype(int), 0, one.s.size - 1)
    j = np.clip(np.rint((r + farthest) / (side[1] - side[0])).astype(int), 0, side.size - 1)
    return spread[i, j]


def gaps(bed: PlannedBed, found: Coverage) -> list[Gap]:
    """List the gaps, the largest first: nodes that touch, by sides or corners, are one."""
    from scipy import ndimage

    label, number = ndimage.label(found.gap, np.ones((3, 3)))
    if not number:
        return []
    cell = bed.step[0] * bed.step[1]
    inward = ndimage.distance_transform_edt(np.pad(label > 0, 1))[1:-1, 1:-1]
    sizes = np.bincount(label.ravel(), minlength=number + 1)[1:]
    places = ndimage.maximum_position(inward, label, np.arange(1, number + 1))
    return [Gap(x=float(bed.x[places[k][1]]), y=float(bed.y[places[k][0]]), area=float(sizes[k] * cell))
            for k in np.argsort(-sizes, kind="stable")]
