"""Survey plan: lines over an area, their order of sailing, the time they take, and the coverage of the swath.

The swath follows from bent rays (`planning.rays`) over the known bed (`planning.lines`). The time is

    (lines + run-ins + turns) / speed

where a turn is the shortest way with the vessel's radius from a line's end to the next run-in (`planning.turns`).
Cross lines check the other lines. They run across them, are sailed after them, and count for no coverage.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mitsonar.hydrography.reduction.uncertainty import Accuracies
from mitsonar.hydrography.survey_orders import ORDERS, SurveyOrder
from mitsonar.units import KNOT
from mitsonar.water.profile import SoundSpeedProfile

from .area import Area, LineFrame, corners, inside, inside_rows
from .bed import PlannedBed, heading_along_area, heading_along_contours
from .coverage import Coverage, Gap, PlannedTrack, SwathSonar, coverage, gaps, track
from .lines import Lattice, even_segments, fitted_segments, in_sailing_order, refuse_many
from .rays import SwathRays, swath_rays
from .turns import VesselTurn, turn
from .uncertainty.cast_errors import CastError, cast_error
from .uncertainty.error_budget import SwathBudget, swath_budget, useful_swath

Sailed = tuple[PlannedTrack, bool, LineFrame]          # True: sailed along the heading of the frame
SPACINGS = ("line", "shoalest", "mean")
MOST_STATIONS = 1000               # of a lattice, along lines
FINEST = 0.02                      # least distance of stations, relative to the swath width
MOST_OFFSETS = 20_000              # of a lattice, across lines


@dataclass(frozen=True, kw_only=True)
class Layout:
    """Settings of the layout of lines and of sailing."""

    spacing: float | None = None  # [m]: between lines; None: from the overlap
    overlap: float = 0.1  # of neighbouring swaths, relative to their width
    swath_at: str = "line"  # depth whose swath sets the spacing, one of SPACINGS
    heading: float | None = None  # [rad]: clockwise from north; None: best
    speed: float = 5 * KNOT  # [m/s]
    run_in: float = 50.0  # [m]: straight before each line
    turn_radius: float = 50.0  # [m]
    least_depth: float | None = None  # [m]: shoaler bed is excluded
    useful: bool = False  # keep the swath within the order
    cross: float | None = None  # spacings of lines between cross lines; None: no cross lines

    def __post_init__(self):
        if self.spacing is not None and not 0 < self.spacing < np.inf:
            raise ValueError(f"the spacing of lines is {self.spacing:g} m; it must be above 0.")
        if not 0 <= self.overlap < 1:
            raise ValueError(f"the overlap is {100 * self.overlap:g} %; give 0 to below 100 (lines with full overlap "
                             "never cover an area), or a spacing.")
        if self.swath_at not in SPACINGS:
            raise ValueError(f"the swath of the spacing is {self.swath_at!r}; choose one of {', '.join(SPACINGS)}.")
        if self.heading is not None and not np.isfinite(self.heading):
            raise ValueError("the heading is not a finite number; give degrees clockwise from north.")
        if not 0 < self.speed <= 100:
            raise ValueError(f"the speed is {self.speed / KNOT:g} knots; give above 0, at most {100 / KNOT:.0f}.")
        if self.cross is not None and not 0 < self.cross <= 1e4:
            raise ValueError(f"cross lines are asked for every {self.cross:g} spacings; give a number above 0, such as "
                             "15.")
        for name, value in (("run-in", self.run_in), ("turn radius", self.turn_radius),
                            ("least depth", self.least_depth or 0.0)):
            if not 0 <= value <= 1e5:
                raise ValueError(f"the {name} is {value:g} m; give 0 to 100000.")


@dataclass(frozen=True, kw_only=True, eq=False)
class SurveyLine:
    """Survey line as sailed."""

    number: int  # from 1, in the order of sailing
    heading: float  # [rad]
    run_in: np.ndarray  # (2,) [m]: x and y
    start: np.ndarray  # (2,) [m]: x and y
    end: np.ndarray  # (2,) [m]: x and y
    length: float  # [m]: from start to end
    track: PlannedTrack  # with its swath, along the heading of the plan
    turn: VesselTurn | None  # to the run-in of the next line sailed


@dataclass(frozen=True, kw_only=True, eq=False)
class SurveyPlan:
    """Planned lines, with the inputs of the plan and the coverage."""

    lines: tuple[SurveyLine, ...]
    cross_lines: tuple[SurveyLine, ...]
    budgets: tuple[SwathBudget, ...]  # at the shoalest, mean and deepest depth
    frame: LineFrame
    contours: bool | None  # True: heading along contours; False: along the area; None: as given
    area: Area | None  # None: the whole bed
    bed: PlannedBed  # around the area
    sonar: SwathSonar
    layout: Layout
    rays: SwathRays
    coverage: Coverage
    gaps: tuple[Gap, ...]  # the largest first
    refraction: tuple[CastError, ...]  # at the shoalest, mean and deepest depth
    order: SurveyOrder
    unknown: float  # share of the area without a depth
    shoal: float  # share of the area shoaler than ``least_depth``
    least_depth: float  # [m]

    def pings(self, line: SurveyLine) -> int:
        """Return the number of pings on a line."""
        s, rate = line.track.s, line.track.rate
        return int(np.sum(0.5 * (rate[1:] + rate[:-1]) * np.diff(s)) / self.layout.speed) + 1

    @property
    def sailed(self) -> tuple[SurveyLine, ...]:
        """Return all lines in the order of sailing."""
        return self.lines + self.cross_lines

    @property
    def depths(self) -> tuple[float, float, float]:
        """Return the shoalest, the mean and the deepest depth of the area [m]."""
        depth = self.bed.depth[self.coverage.wanted]
        return float(depth.min()), float(depth.mean(dtype=float)), float(depth.max())


def plan(bed: PlannedBed, profile: SoundSpeedProfile, sonar: SwathSonar, layout: Layout | None = None, *,
         area: Area | None = None, used: SoundSpeedProfile | None = None,
         order: SurveyOrder = ORDERS["1a"], accuracies: Accuracies | None = None) -> SurveyPlan:
    """Plan the lines of a survey."""
    layout = layout or Layout()
    least = sonar.head_depth + 1.0 if layout.least_depth is None else layout.least_depth
    asked, bed = _nodes(bed, area, sonar)
    deep = asked & ~(bed.known & (bed.depth < least))
    wanted = deep & bed.known
    if not wanted.any():
        deepest = float(bed.depth[asked & bed.known].max())
        raise ValueError(f"the area is nowhere deeper than {deepest:.3g} m, and bed shoaler than {least:.3g} m is "
                         "left out; set a smaller least depth, or choose another area.")
    area_depth = bed.depth[wanted]
    mean = float(area_depth.mean(dtype=float))
    depths = [depth for depth in dict.fromkeys((float(area_depth.min()), mean, float(area_depth.max())))
              if depth > sonar.head_depth]
    budgets = [swath_budget(profile, sonar, depth, accuracies or Accuracies(), order, layout.speed) for depth in depths]
    if layout.useful:
        sonar = sonar.narrowed(useful_swath(budgets, order))
    rays = swath_rays(profile, head_depth=sonar.head_depth, half_angle=0.5 * sonar.swath,
                      deepest=float(bed.depth.max()), max_range=sonar.max_range)
    width = 2 * float(rays.reach_at(mean))
    heading, contours = _heading(bed, wanted, width, layout, area)
    frame = LineFrame(heading=heading)
    lattice = _lattice(bed, deep, asked & ~deep, area, frame, width,
                       layout.spacing or 2 * float(rays.reach.max()) * (1 - layout.overlap))
    shortest = 2 * layout.run_in + np.pi * layout.turn_radius
    if layout.spacing is None and layout.swath_at == "line":
        segments = fitted_segments(bed, rays, lattice, layout.overlap, shortest)
    else:
        spacing = layout.spacing or (1 - layout.overlap) * 2 * float(rays.reach_at(
            mean if layout.swath_at == "mean" else float(area_depth.min())))
        if not spacing > 0:
            raise ValueError(f"the shoalest bed of the area is {float(area_depth.min()):.3g} m deep, where the sonar "
                             "has no swath; leave the shoal out of the area, or let the spacing follow each line.")
        segments = even_segments(lattice, spacing, shortest)
    step = max(*bed.step, FINEST * width)
    speed = float(profile.at(sonar.head_depth))
    tracks = [(track(bed, rays, sonar, frame, segment, speed, step), ahead, frame)
              for segment, ahead in in_sailing_order(segments)]
    covered = coverage(bed, rays, sonar, frame, [line for line, *_ in tracks], layout.speed, wanted)
    refraction = [] if used is None else [cast_error(profile, used, sonar.head_depth, depth, 0.5 * sonar.swath, order)
                                          for depth in depths]
    across: list[Sailed] = []
    if layout.cross is not None:
        offsets = np.unique([line.segment.offset for line, *_ in tracks])
        spacing = layout.cross * (float(np.median(np.diff(offsets))) if offsets.size > 1 else width)
        turned = LineFrame(heading=heading + 0.5 * np.pi)
        lattice = _lattice(bed, deep, asked & ~deep, area, turned, width, spacing)
        across = [(track(bed, rays, sonar, turned, segment, speed, step), ahead, turned)
                  for segment, ahead in in_sailing_order(even_segments(lattice, spacing, shortest))]
    lines = _lines([*tracks, *across], layout)
    return SurveyPlan(lines=lines[:len(tracks)], cross_lines=lines[len(tracks):], budgets=tuple(budgets),
                      frame=frame, contours=contours, area=area, bed=bed,
                      sonar=sonar, layout=layout, rays=rays, coverage=covered, gaps=tuple(gaps(bed, covered)),
                      refraction=tuple(refraction), order=order, least_depth=least,
                      unknown=np.count_nonzero(asked & ~bed.known) / np.count_nonzero(asked),
                      shoal=1 - np.count_nonzero(deep) / np.count_nonzero(asked))


def _nodes(bed: PlannedBed, area: Area | None, sonar: SwathSonar) -> tuple[np.ndarray, PlannedBed]:
    """Return a mask of the nodes in the area, and the bed around it."""
    if area is None:
        return _without_specks(bed.known), bed
    west, south, east, north = area.bounds
    covers = ", ".join(f"{value:.7g}" for value in (bed.x[0], bed.y[0], bed.x[-1], bed.y[-1]))
    outside = ValueError(f"the area (west {west:.7g}, south {south:.7g}, east {east:.7g}, north {north:.7g} m) lies "
                         f"where the bathymetry has no depth; it covers {covers}.")
    if west > bed.x[-1] or east < bed.x[0] or south > bed.y[-1] or north < bed.y[0]:
        raise outside
    deepest = float(bed.window(west, south, east, north).depth.max())
    margin = 1.5 * np.tan(min(0.5 * sonar.swath, np.deg2rad(85))) * deepest
    near = bed.window(west - margin, south - margin, east + margin, north + margin)
    within = inside(area, near.x, near.y)
    if not within.any():
        raise ValueError(f"the area is {area.area:.3g} m², and no node of the bathymetry ({near.step[0]:.3g} m apart) "
                         "lies in it; draw a larger area, or read the bathymetry at a finer resolution.")
    if not (within & near.known).any():
        raise outside
    return within, near


def _without_specks(known: np.ndarray) -> np.ndarray:
    """Return the known nodes with single holes closed, which cut no line, and single depths outside removed."""
    from scipy.ndimage import binary_closing, binary_opening

    # the closing treats nodes beyond the edge as known and would grow into them; the frame prevents that
    framed = np.pad(known, 3)
    closed = binary_closing(framed, np.ones((3, 3)), iterations=2)
    opened = binary_opening(closed, np.ones((3, 3)))
    kept = (opened if opened.any() else closed)[3:-3, 3:-3]
    return kept if (kept & known).any() else known


def _heading(bed: PlannedBed, wanted: np.ndarray, width: float, layout: Layout,
             area: Area | None) -> tuple[float, bool | None]:
    """Return the heading, and True if it follows contours, False if the area, None if given."""
    if layout.heading is not None:
        return float(layout.heading % (2 * np.pi)), None
    heading = heading_along_contours(bed, wanted, width)
    if heading is not None:
        return heading, True
    return heading_along_area(_outline(bed, wanted) if area is None else np.concatenate(corners(area))), False


def _outline(bed: PlannedBed, inside: np.ndarray) -> np.ndarray:
    """Return the first and the last node inside of every row, points (N, 2) [m] that span the same hull."""
    row = np.flatnonzero(inside.any(axis=1))
    first, last = np.argmax(inside[row], axis=1), inside.shape[1] - 1 - np.argmax(inside[row, ::-1], axis=1)
    return np.concatenate([np.stack([bed.x[column], bed.y[row]], -1) for column in (first, last)])


def _lattice(bed: PlannedBed, deep: np.ndarray, shoal: np.ndarray, area: Area | None, frame: LineFrame,
             width: float, spacing: float) -> Lattice:
    """Return nodes along and across the lines over the area without shoals, about as close as those of the bed.

    A swath width [m] has at most 50 nodes along the lines. ``spacing`` [m] is the widest possible spacing of lines.
    """
    places = _outline(bed, deep) if area is None else np.concatenate(corners(area))
    ends = np.stack(frame.along_across(*places.T))
    low, high = ends.min(1), ends.max(1)
    refuse_many((high[1] - low[1]) / max(spacing, 1e-9), spacing)
    step = max(min(bed.step), float(np.max(high - low)) / MOST_STATIONS)
    steps = max(step, FINEST * width), max(min(step, width / 8), float(high[1] - low[1]) / MOST_OFFSETS)
    number = [max(int(np.ceil(span / distance)) + 1, 3) for span, distance in zip(high - low, steps)]
    s, u = (np.linspace(*ends, size) for ends, size in zip(zip(low, high), number))
    # nodes on the border of the area count as inside
    inner = [middle + (axis - middle) * (1 - 1e-7) for axis, middle in zip((s, u), 0.5 * (low + high))]
    return Lattice(frame=frame, s=s, u=u, inside=_at(bed, deep, frame, *inner) if area is None else
                   inside_rows(area, frame, *inner) & ~_at(bed, shoal, frame, *inner))


def _at(bed: PlannedBed, grid: np.ndarray, frame: LineFrame, along: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Return the values of a mask (Y, X) at the nodes of a lattice (S, U); False beyond the mask."""
    row, column = np.rint(bed.places(*frame.place(along[:, None], across))).astype(int)
    there = (row >= 0) & (row < bed.y.size) & (column >= 0) & (column < bed.x.size)
    values = np.zeros(there.shape, bool)
    values[there] = grid[row[there], column[there]]
    return values


def _lines(tracks: Sequence[Sailed], layout: Layout) -> tuple[SurveyLine, ...]:
    """Return the lines with their run-ins and the turns between."""
    ends = []
    for line, ahead, frame in tracks:
        segment = line.segment
        along = np.array([segment.begin, segment.end] if ahead else [segment.end, segment.begin])
        places = np.stack(frame.place(along, np.full(2, segment.offset)), -1)
        heading = (frame.heading + (0 if ahead else np.pi)) % (2 * np.pi)
        forward = np.array([np.sin(heading), np.cos(heading)])
        ends.append((places[0] - layout.run_in * forward, *places, heading))
    lines = []
    for number, ((line, *_), (run_in, start, end, heading)) in enumerate(zip(tracks, ends), 1):
        after = None
        if number < len(ends):
            there, _, _, course = ends[number]
            after = turn(end, heading, there, course, layout.turn_radius)
        lines.append(SurveyLine(number=number, heading=heading, run_in=run_in, start=start, end=end,
                                length=float(np.hypot(*(end - start))), track=line, turn=after))
    return tuple(lines)
