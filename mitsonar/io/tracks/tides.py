"""Tides from files: CSV, with a header and one line per reading, and the tables of `tide_tables`.

    time,height
    2026-05-01T10:00:00Z,1.32
    2026-05-01T10:06:00Z,1.35

``time`` as ISO 8601 (UTC where no offset is given), or in seconds after the first ping of a track; ``height`` [m] of
the water level above the datum, z = 0. A cubic spline joins the readings.
"""
from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mitsonar.device.files import FilePath, check_readable
from mitsonar.sonar.motion.trajectory import SmoothCurve

from ..casts import text
from ..scene_files import tables
from . import tide_tables
from .gps_time import date

HIGHEST = 20.0                     # [m]: no tide on Earth reaches farther from its mean
DATED = 1e8                        # [s] above which times count from 1970


@dataclass(frozen=True, kw_only=True, eq=False)
class Tide:
    """Heights of the water level as in their file.

    Parameters
    ----------
    name : str
        File, for messages.
    time : array (N,) [s]
        Strictly increasing times, two or more: since 1970, or after the first ping.
    height : array (N,) [m]
        Water level above the datum.
    """

    name: str
    time: np.ndarray
    height: np.ndarray

    @property
    def dated(self) -> bool:
        """Return True if times count from 1970."""
        return bool(self.time[0] > DATED)

    def over(self, first: float, last: float) -> SmoothCurve:
        """Return the water level [m] by the clock of a track.

        Parameters
        ----------
        first, last : float [s]
            Times of the track's first and last ping.

        Returns
        -------
        SmoothCurve

        Raises
        ------
        ValueError
            If the readings do not cover the pings, or have dates and the track has none.
        """
        if self.dated and not first > DATED:
            raise ValueError(f"the tide {self.name} has dates, and the times of the track begin at {first:g} s; give "
                             "the track dates, or the tide seconds after the first ping.")
        time = self.time if self.dated else self.time + first
        if self.dated and not (time[0] <= first and last <= time[-1]):
            raise ValueError(f"the tide {self.name} lasts from {date(time[0])} to {date(time[-1])}, and the pings from "
                             f"{date(first)} to {date(last)}; give the tide of these hours.")
        if not (time[0] <= first and last <= time[-1]):
            raise ValueError(f"the tide {self.name} lasts from {time[0] - first:.6g} to {time[-1] - first:.6g} s after "
                             f"the first ping, and the pings last until {last - first:.6g} s; give readings before "
                             "the first and after the last ping.")
        return SmoothCurve(time, self.height)


def load(path: FilePath) -> Tide:
    """Read a tide.

    Parameters
    ----------
    path : str or path
        A CSV file with the columns named above, or another table, as in `tide_tables`.

    Returns
    -------
    Tide

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If a column is missing, a field is not a finite number (the line is named), time does not increase, there are
        fewer than two readings, or a height is none of a tide.
    """
    check_readable(path, "the tide", "a table of times and heights")
    try:
        found = tide_tables.read(text.read_lines(Path(path)) or ())
    except ValueError as error:
        raise ValueError(f"cannot read the tide {path}: {error}") from None
    if found is not None:
        lines, time, shown = found.lines, np.array(found.time), [f"{one:.3f}" for one in found.time]
        height = found.factor * tables.floats(path, lines, "height", found.height)
    else:
        lines, time, height, shown = _plain(path)
    if len(time) < 2:
        raise ValueError(f"cannot read the tide {path}: it has {'one reading' if len(time) else 'no readings'}; give "
                         "one before the first and one after the last ping.")
    if (back := np.flatnonzero(np.diff(time) <= 0)).size:
        row = int(back[0]) + 1
        raise ValueError(f"{path}, line {lines[row]}: the time {shown[row]} is not later than {shown[row - 1]} before "
                         "it; sort the readings and drop repeated times.")
    if (far := np.flatnonzero(abs(height) > HIGHEST)).size:
        raise ValueError(f"{path}, line {lines[far[0]]}: height is {height[far[0]]:g} m, and no tide is more "
                         f"than {HIGHEST:g} m from its datum; give heights in metres above the datum of the bed.")
    return Tide(name=str(path), time=time, height=height)


def _plain(path: FilePath) -> tuple[list[int], np.ndarray, np.ndarray, list[str]]:
    """Return numbers of lines, times [s], heights [m] and the times as written of a CSV file."""
    names, lines, rows = tables.records(path, "tide")
    for name in ("time", "height"):
        if names.count(name) != 1:
            raise ValueError(f"cannot read the tide {path}: the header has {', '.join(names)}; it needs the columns "
                             "time and height, once each.")
    texts = {name: [row[names.index(name)].strip() for row in rows] for name in ("time", "height")}
    return (lines, tables.times(path, lines, "time", texts["time"]),
            tables.floats(path, lines, "height", texts["height"]), texts["time"])
