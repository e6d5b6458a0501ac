"""Grids for focused images: points of the bed, in rows along a heading and columns to starboard of it.

    ground    x = x_0 + a sin ψ + g cos ψ,    y = y_0 + a cos ψ - g sin ψ,    g = s
    slant     the same with g = ± sqrt(s² - h²): s is the distance from a straight line at height h over the points

ψ -> ``heading``, (x_0, y_0) -> ``origin``, a -> ``along_track``, s -> ``across_track``, positive to starboard. Points
of a slant grid with |s| < h lie straight below the line, in the water.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from mitsonar.sonar.pulses.pulses import pulse_of

from .motion import ApertureMotion

__all__ = ["Grid", "circle_grid", "default_grid", "ground_grid", "slant_grid", "strip_grid"]

Bed = float | np.ndarray | Callable[[np.ndarray, np.ndarray], np.ndarray]
MOST_POINTS = 1 << 28
CIRCLE = np.pi                     # [rad], least turn of a circular track
ROUND_POINTS = 512                 # most points a side of a circle's default grid


@dataclass(frozen=True, kw_only=True, eq=False)
class Grid:
    """Points of a focused image.

    Attributes
    ----------
    kind : {"ground", "slant"}
    origin : (float, float) [m]
        East and north.
    heading : float [rad]
        Direction of the rows, clockwise from north.
    along_track : (A,) [m]
    across_track : (C,) [m]
        Distance to starboard; in a slant grid the distance from the line, negative to port.
    ground : (C,) [m]
        Horizontal distance to starboard.
    depth : float32 (A, C) [m]
    """

    kind: str
    origin: tuple[float, float]
    heading: float
    along_track: np.ndarray
    across_track: np.ndarray
    ground: np.ndarray
    depth: np.ndarray

    def __post_init__(self) -> None:
        shape = len(self.along_track), len(self.across_track)
        if min(shape) < 1 or shape[0] * shape[1] > MOST_POINTS:
            raise ValueError(f"the grid has {shape[0]} by {shape[1]} points; give 1 to {MOST_POINTS:,} in all")
        if self.depth.shape != shape:
            raise ValueError(f"the grid has {shape} points, and its depths have the shape {self.depth.shape}; give one "
                             "for every point")
        numbers = *self.origin, self.heading, self.along_track.sum(), self.ground.sum(), self.depth.sum()
        if not np.all(np.isfinite(numbers)):
            raise ValueError("a grid's origin, heading, axes and depths must be finite; check the bed's extent too")

    @property
    def x(self) -> np.ndarray:
        """East (A, C) [m]."""
        return (self.origin[0] + self.along_track[:, None] * np.sin(self.heading)
                + self.ground * np.cos(self.heading))

    @property
    def y(self) -> np.ndarray:
        """North (A, C) [m]."""
        return (self.origin[1] + self.along_track[:, None] * np.cos(self.heading)
                - self.ground * np.sin(self.heading))


def _axes(first: tuple[str, tuple[float, float]], second: tuple[str, tuple[float, float]],
          spacing: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return both axes; points are counted before an axis is made."""
    counts = [_count(*axis, step) for axis, step in zip((first, second), spacing, strict=True)]
    if counts[0] * counts[1] > MOST_POINTS:
        raise ValueError(f"the grid has {counts[0]} by {counts[1]} points; give 1 to {MOST_POINTS:,} in all")
    along, across = (between[0] + step * np.arange(count)
                     for (_, between), step, count in zip((first, second), spacing, counts, strict=True))
    return along, across


def _count(name: str, between: tuple[float, float], spacing: float) -> int:
    first, last = between
    if not (np.all(np.isfinite([spacing, first, last])) and spacing > 0 and last >= first):
        raise ValueError(f"the grid's {name} goes from {first:g} to {last:g} m in steps of {spacing:g} m; give a first "
                         "that is not above the last, and a step above 0")
    count = np.floor((last - first) / spacing * (1 + 1e-12)) + 1
    if count > MOST_POINTS:
        raise ValueError(f"the grid's {name} has {count:.3g} points; give {MOST_POINTS:,} at most")
    return int(count)


def _finished(kind: str, origin: tuple[float, float], heading: float, along: np.ndarray, across: np.ndarray,
              ground: np.ndarray, bed: Bed) -> Grid:
    flat = Grid(kind=kind, origin=(float(origin[0]), float(origin[1])), heading=float(heading), along_track=along,
                across_track=across, ground=ground, depth=np.zeros((len(along), len(across)), np.float32))
    depth = np.asarray(bed(flat.x, flat.y) if callable(bed) else bed, np.float32)
    return replace(flat, depth=np.full(flat.depth.shape, depth, np.float32) if depth.ndim == 0 else depth)


def ground_grid(along_track: tuple[float, float], across_track: tuple[float, float], spacing: tuple[float, float],
                bed: Bed, *, origin: tuple[float, float] = (0.0, 0.0), heading: float = 0.0) -> Grid:
    """Make a grid on the bed.

    Parameters
    ----------
    along_track, across_track : (float, float) [m]
        First and last.
    spacing : (float, float) [m]
        Steps along and across.
    bed : float, array (A, C) or callable(x, y) [m]
        Depth of the points.
    origin : (float, float) [m]
        East and north.
    heading : float [rad]

    Raises
    ------
    ValueError
        If a number is not finite, an interval is empty, or there are too many points.
    """
    along, across = _axes(("along_track", along_track), ("across_track", across_track), spacing)
    return _finished("ground", origin, heading, along, across, across, bed)


def slant_grid(along_track: tuple[float, float], slant_range: tuple[float, float], spacing: tuple[float, float],
               depth: float, *, line_depth: float, side: int = 1, origin: tuple[float, float] = (0.0, 0.0),
               heading: float = 0.0) -> Grid:
    """Make a grid whose columns are even in the distance from a straight line.

    Parameters
    ----------
    along_track, slant_range, spacing : (float, float) [m]
    depth : float [m]
        Depth of the level bed on which the points lie.
    line_depth : float [m]
    side : {1, -1}
        Starboard, port.
    origin, heading
        Start and direction of the line.
    """
    along, slant = _axes(("along_track", along_track), ("slant_range", slant_range), spacing)
    if slant[0] < 0:
        raise ValueError(f"the slant grid begins at {slant[0]:g} m; give distances of 0 or more, and side=-1 for port")
    height = depth - line_depth
    ground = np.sqrt(np.maximum(slant ** 2 - height ** 2, 0.0))
    below = np.where(slant < abs(height), line_depth + np.sign(height) * slant, depth)
    if side < 0:
        slant, ground, below = -slant[::-1], -ground[::-1], below[::-1]
    return _finished("slant", origin, heading, along, slant, ground, np.broadcast_to(below, (len(along), len(slant))))


def default_grid(raw: xr.Dataset, *, spacing: tuple[float, float] | float | None = None, kind: str = "ground",
                 ping_time: np.ndarray | None = None) -> Grid:
    """Make the grid that fits a record: `circle_grid` if the track turns by half a circle, else `strip_grid`."""
    heading = np.asarray(raw["motion_heading"].values, float)
    if np.ptp(heading) >= CIRCLE:
        return circle_grid(raw, spacing=spacing, ping_time=ping_time)
    return strip_grid(raw, spacing=spacing, kind=kind, ping_time=ping_time)


def strip_grid(raw: xr.Dataset, *, spacing: tuple[float, float] | float | None = None, kind: str = "ground",
               ping_time: np.ndarray | None = None) -> Grid:
    """Make the grid of a strip: along the mean line from the first ping to the last, across as far as echoes reach.

    Parameters
    ----------
    raw : xarray.Dataset
        Raw echoes. They may hold one ping if `ping_time` names all.
    spacing : float, (float, float) or None [m]
        None: half the resolution, a quarter of the longer element along and c/4B across.
    kind : {"ground", "slant"}
    ping_time : (P,) [s] or None
        Times of all pings. None: those of the record.
    """
    if kind not in ("ground", "slant"):
        raise ValueError(f'the grid is "{kind}"; give "ground" or "slant"')
    times, place, speed = _seen(raw, ping_time)
    middle = place.mean(0)
    run = place[-1, :2] - place[0, :2]
    if not np.linalg.norm(run) > 0:
        raise ValueError("all pings are in one place, so that no strip can be laid; give a grid")
    way = np.linalg.svd(place[:, :2] - middle[:2], full_matrices=False)[2][0]
    way = way * np.sign(way @ run)
    along = (place[:, :2] - middle[:2]) @ way
    origin, heading = middle[:2] + along.min() * way, float(np.arctan2(way[0], way[1]))
    step = _spacing(raw, spacing, speed)
    nearest, farthest = _ranges(raw, speed)
    height = abs(float(raw.attrs["bed_depth"]) - middle[2])
    if farthest <= height:
        raise ValueError(f"the record ends at {farthest:.4g} m, above the bed {height:.4g} m below the track; "
                         "give a grid")
    side = -1 if raw.attrs["look"][1] < 0 else 1
    depth, lengths = float(raw.attrs["bed_depth"]), (0.0, float(np.ptp(along)))
    if kind == "slant":
        return slant_grid(lengths, (max(nearest, height), farthest), step, depth, line_depth=float(middle[2]),
                          side=side, origin=(origin[0], origin[1]), heading=heading)
    across = [np.sqrt(max(slant ** 2 - height ** 2, 0.0)) for slant in (nearest, farthest)]
    between = (across[0], across[1]) if side > 0 else (-across[1], -across[0])
    return ground_grid(lengths, between, step, depth, origin=(origin[0], origin[1]), heading=heading)


def circle_grid(raw: xr.Dataset, *, size: float | None = None, spacing: tuple[float, float] | float | None = None,
                ping_time: np.ndarray | None = None) -> Grid:
    """Make a square north-up grid about the middle of a circular track.

    Parameters
    ----------
    raw, ping_time
        As in `strip_grid`.
    size : float or None [m]
        Length of a side. None: the area within the beams of all pings, at most 512 points a side.
    spacing : float, (float, float) or None [m]
        None: an eighth of the wavelength.
    """
    times, place, speed = _seen(raw, ping_time)
    a = np.column_stack([2 * place[:, :2], np.ones(len(place))])
    fitted = np.linalg.lstsq(a, (place[:, :2] ** 2).sum(1), rcond=None)[0]
    radius = float(np.sqrt(max(fitted[2] + fitted[0] ** 2 + fitted[1] ** 2, 0.0)))
    wavelength = speed / raw.attrs["frequency"]
    step = (wavelength / 8, wavelength / 8) if spacing is None else _spacing(raw, spacing, speed)
    longest = max(raw.attrs["tx_length"], raw.attrs["rx_length"], wavelength)
    side = min(wavelength / longest * radius, ROUND_POINTS * min(step)) if size is None else size
    between = (-0.5 * side, 0.5 * side)
    return ground_grid(between, between, step, float(raw.attrs["bed_depth"]), origin=(fitted[0], fitted[1]))


def _seen(raw: xr.Dataset, ping_time: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the times of the pings, their places, and the mean sound speed from there to the bed."""
    times = np.asarray(raw["ping_time"].values if ping_time is None else ping_time, float)
    if times.ndim != 1 or len(times) < 2:
        raise ValueError(f"a grid needs two or more pings, got {times.size}; give a grid, or ping_time of all pings")
    if not np.all(np.isfinite(times)):
        raise ValueError("ping_time holds numbers that are not finite; leave those pings out")
    motion = ApertureMotion(raw)
    motion.check_covers(float(times.min()), float(times.max()))
    place = motion.place(times)
    # mean over the travel time to the bed: 1 / mean of 1 / c
    down = np.linspace(place[:, 2].mean(), float(raw.attrs["bed_depth"]), 101)
    speed = float(1 / np.mean(1 / np.interp(down, raw["cast_depth"].values, raw["cast_sound_speed"].values)))
    return times, place, speed


def _ranges(raw: xr.Dataset, speed: float) -> tuple[float, float]:
    """Return the slant ranges [m] of the first and last whole echo."""
    time, duration = raw["time"].values, float(raw.attrs["pulse"]["duration"])
    return max(0.5 * speed * float(time[0]), 0.0), 0.5 * speed * float(time[-1] - duration)


def _spacing(raw: xr.Dataset, spacing: tuple[float, float] | float | None, speed: float) -> tuple[float, float]:
    if spacing is None:
        longest = max(raw.attrs["tx_length"], raw.attrs["rx_length"], speed / raw.attrs["frequency"])
        return 0.25 * longest, 0.25 * speed / pulse_of(raw.attrs["pulse"]).bandwidth
    if isinstance(spacing, tuple):
        return spacing
    return float(spacing), float(spacing)
