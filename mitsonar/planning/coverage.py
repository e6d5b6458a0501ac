"""Coverage of planned swaths: number of lines that see each node of the bed, and density of soundings.

A node at s along a line and r beside it is seen if r lies within the swath, and if no bed nearer to the line hides the
node, that is, if the angle θ(r) of its ray is the largest so far. With N beams, n pings per second and the speed v, the
soundings per square metre are

    N / (2 Θ) |dθ/dr| n / v    of beams at even angles         N / (r_port + r_starboard) n / v    at even distances

Θ -> ``half_angle``, N -> ``beams``, n -> ``rate``. A sonar without a stated rate pings as soon as the echo of its
farthest beam is back.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .area import LineFrame
from .bed import PlannedBed
from .lines import MOST_SAMPLES, Edges, Segment, swath_edges
from .rays import SwathRays

_REPEATED = 1e-9                   # [rad]: tolerance below the largest angle so far


@dataclass(frozen=True, kw_only=True)
class SwathSonar:
    """Properties of the sonar that a plan needs."""

    swath: float  # [rad]: between the outermost beams
    beams: int = 256  # soundings per ping
    rate: float = np.inf  # [1/s]: highest ping rate
    head_depth: float = 0.0  # [m]
    max_range: float = np.inf  # [m]
    even: str = "angle"  # spacing of beams: "angle" or "distance"
    name: str = ""
    beam_width: float | None = None  # [rad]: of the transmit beam, along the track

    def __post_init__(self):
        if not 0 < self.swath < np.pi:
            raise ValueError(f"the swath is {np.rad2deg(self.swath):g} degrees; give more than 0 and less than 180.")
        if not 1 <= self.beams <= 100_000:
            raise ValueError(f"the sonar has {self.beams} beams; give 1 to 100000.")
        if not self.rate > 0:
            raise ValueError(f"the sonar pings {self.rate:g} times a second; give more than 0.")
        if not (self.head_depth >= 0 and self.max_range > 0):
            raise ValueError(f"the sonar's head is {self.head_depth:g} m deep and its range is {self.max_range:g} m; "
                             "give a depth of 0 or more and a range above 0.")
        if self.beam_width is not None and not 0 < self.beam_width < np.pi:
            raise ValueError(f"the transmit beam is {np.rad2deg(self.beam_width):g} degrees wide; give more than 0 and "
                             "less than 180.")
        if self.even not in ("angle", "distance"):
            raise ValueError(f'the beam spacing is even in {self.even!r}; choose "angle" or "distance".')

    def narrowed(self, swath: float) -> SwathSonar:
        """Return the sonar with the beams within a swath [rad]."""
        angles = 0.5 * np.array([swath, self.swath])
        narrow, wide = angles if self.even == "angle" else np.tan(angles)
        return replace(self, swath=swath, beams=max(round(self.beams * float(narrow / wide)), 1))


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedTrack:
    """Segment with its swath at stations s (S,) [m], and the depth under the sonar [m] and ping rate [1/s] there."""

    segment: Segment
    s: np.ndarray
    edges: Edges
    depth: np.ndarray
    rate: np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class Coverage:
    """Nodes (Y, X) to be covered, the number of lines that see each, and the density of soundings [1/m²]."""

    wanted: np.ndarray
    times: np.ndarray
    density: np.ndarray

    @property
    def gap(self) -> np.ndarray:
        """Return a mask of the wanted nodes that no line sees."""
        return self.wanted & (self.times == 0)

    def share(self, times: int = 1) -> float:
        """Return the share of the wanted nodes that at least ``times`` lines see."""
        return float(np.count_nonzero(self.times[self.wanted] >= times) / max(np.count_nonzero(self.wanted), 1))


@dataclass(frozen=True, kw_only=True)
class Gap:
    """Gap in the coverage: x and y [m] of its innermost node, and its area [m²]."""

    x: float
    y: float
    area: float


def track(bed: PlannedBed, rays: SwathRays, sonar: SwathSonar, frame: LineFrame, segment: Segment, sound_speed: float,
          step: float) -> PlannedTrack:
    """Return a segment with its swath, at stations about ``step`` [m] apart; ``sound_speed`` [m/s] at the head."""
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
             speed: float, wanted: np.ndarray) -> Coverage:
    """Count the lines and soundings at the wanted nodes (Y, X) of a bed, at a vessel speed [m/s]."""
    row, column = np.nonzero(wanted)
    along, across = frame.along_across(bed.x[column], bed.y[row])
    order = np.argsort(across)
    along, across = along[order], across[order]
    times, density = np.zeros(along.size, np.uint16), np.zeros(along.size, np.float32)
    for line in tracks:
        sides = np.array([-line.edges.port.max(), line.edges.starboard.max()])
        low, high = np.searchsorted(across, line.segment.offset + sides)
        # a node stands for its whole cell
        half = 0.5 * max(bed.step)
        near = low + np.flatnonzero((along[low:high] >= line.s[0] - half) & (along[low:high] <= line.s[-1] + half))
        s, r = along[near], across[near] - line.segment.offset
        within = np.abs(r) <= np.where(r < 0, np.interp(s, line.s, line.edges.port),
                                       np.interp(s, line.s, line.edges.starboard))
        near, s, r = near[within], s[within], r[within]
        if near.size:
            soundings = _sounded(bed, rays, sonar, frame, line, speed, s, r)
            times[near] += soundings > 0
            density[near] += soundings
    counts = np.zeros(wanted.shape, np.uint16), np.zeros(wanted.shape, np.float32)
    for grid, values in zip(counts, (times, density)):
        grid[row[order], column[order]] = values
    return Coverage(wanted=wanted, times=counts[0], density=counts[1])


def _sounded(bed, rays, sonar, frame, line, speed, s, r):
    """Return the soundings per square metre at points s along and r beside a line; 0 where nearer bed hides them."""
    farthest = max(line.edges.port.max(), line.edges.starboard.max(), 1e-6)
    number = int(np.clip(farthest / min(bed.step), 16, MOST_SAMPLES))
    side = np.linspace(-farthest, farthest, 2 * number + 1)
    depth = bed.depth_at(*frame.place(line.s[:, None], line.segment.offset + side))
    angle = rays.angle(np.abs(side) + 0 * depth, depth)
    hidden = np.zeros(angle.shape, bool)
    for half in (np.s_[:, number:], np.s_[:, number::-1]):
        hidden[half] = angle[half] < np.maximum.accumulate(angle[half], axis=1) - _REPEATED
    if sonar.even == "angle":
        signed = np.where(side < 0, -angle, angle)
        spread = sonar.beams / sonar.swath * np.abs(np.gradient(signed, side, axis=1))
    else:
        spread = np.broadcast_to((sonar.beams / np.maximum(line.edges.width, 1e-6))[:, None], angle.shape)
    spread = np.where(hidden, 0.0, spread * (line.rate / speed)[:, None])
    step = line.s[1] - line.s[0] if line.s.size > 1 else 1.0
    i = np.clip(np.rint((s - line.s[0]) / step).astype(int), 0, line.s.size - 1)
    j = np.clip(np.rint((r + farthest) / (side[1] - side[0])).astype(int), 0, side.size - 1)
    return spread[i, j]


def gaps(bed: PlannedBed, covered: Coverage) -> list[Gap]:
    """Return the gaps, the largest first; nodes that touch by sides or corners form one gap."""
    from scipy import ndimage

    label, number = ndimage.label(covered.gap, np.ones((3, 3)))
    if not number:
        return []
    cell = bed.step[0] * bed.step[1]
    inward = ndimage.distance_transform_edt(np.pad(label > 0, 1))[1:-1, 1:-1]
    sizes = np.bincount(label.ravel(), minlength=number + 1)[1:]
    places = ndimage.maximum_position(inward, label, np.arange(1, number + 1))
    return [Gap(x=float(bed.x[places[k][1]]), y=float(bed.y[places[k][0]]), area=float(sizes[k] * cell))
            for k in np.argsort(-sizes, kind="stable")]
