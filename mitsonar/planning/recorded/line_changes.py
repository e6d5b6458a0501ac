"""Changes of a recorded line before it is reduced again: tide, ellipsoid heights, navigation, delayed heave.

Navigation that counts seconds of a week without saying which (SBET) is put into the week of the line. Whether its clock
is GPS time or UTC, the line's own positions decide: at 4 m/s they are 72 m apart.
"""
from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import xarray as xr

from mitsonar.device.earth import Frame, origin, system
from mitsonar.device.files import FilePath
from mitsonar.hydrography.reduction.attitude import PlatformMotion
from mitsonar.hydrography.reduction.heights import by_ellipsoid, by_tide, navigated, with_heave
from mitsonar.io.grids.separation import Separation
from mitsonar.io.tracks import posmv, tides, tracks
from mitsonar.io.tracks.gps_time import EPOCH, WEEK, ahead, date, instant
from mitsonar.io.tracks.navigation import Navigation, Waypoints
from mitsonar.io.tracks.tides import Tide

__all__ = ["LineChanges"]

FAR = 100.0                        # [m] rms from the line's own positions, above which navigation is of another line
ALIKE = 0.5                        # ratio of distances above which the clock is not decided


@dataclass(frozen=True, kw_only=True, eq=False)
class LineChanges:
    """Changes of a line; None leaves the line's own.

    Parameters
    ----------
    tide : Tide or float [m] or None
        Water level above the datum.
    separation : Separation or None
        Height of the datum above the ellipsoid; None: as the line states it.
    heights : {"tide", "gnss"} or None
    navigation, heave : path or None
        Track in place of the line's own, and a record with delayed heave.
    words : list of str
        Remarks, which are appended.
    """

    tide: Tide | float | None = None
    separation: Separation | None = None
    heights: str | None = None
    navigation: FilePath | None = None
    heave: FilePath | None = None
    words: list[str] = field(default_factory=list)

    def __post_init__(self):
        if self.tide is not None and self.heights == "gnss":
            raise ValueError("a tide and heights by gnss are both given; heights above the ellipsoid need no tide, "
                             "leave one of them out.")

    def __bool__(self) -> bool:
        return any(value is not None for value in (self.tide, self.separation, self.heights, self.navigation,
                                                   self.heave))

    def of(self, block: xr.Dataset) -> xr.Dataset:
        """Return a block of pings with the changes; reduce it again for its soundings."""
        if self.navigation is not None:
            motion, height = self._navigation(block)
            block = navigated(block, motion, height)
        if self.heave is not None:
            block = with_heave(block, lambda times: self._deeper(times + _start(block)))
        if self.tide is not None:
            block = by_tide(block, lambda times: self._level(times, block))
        if self.heights == "gnss":
            block = by_ellipsoid(block, lambda x, y: self._apart(x, y, block))
        elif self.separation is not None:
            raise ValueError("a separation is given, and depths are reduced by a tide; give --heights gnss, too.")
        return block

    def _level(self, times: np.ndarray, block: xr.Dataset) -> np.ndarray:
        tide = self.tide
        if not isinstance(tide, Tide):
            return np.full(times.shape, tide)
        if not tide.dated:
            return tide.over(0.0, float(times.max())).at(times)
        dates = times + _start(block)
        return tide.over(float(dates.min()), float(dates.max())).at(dates)

    def _apart(self, x: np.ndarray, y: np.ndarray, block: xr.Dataset) -> np.ndarray:
        if self.separation is not None:
            return self.separation.at(x, y, _frame(block))
        if "separation" not in block:
            raise ValueError("the line states no separation of its datum from the ellipsoid; give --separation.")
        return block["separation"].values

    @cached_property
    def _loaded(self) -> Navigation:
        found = tracks.load(self.navigation or "")
        if isinstance(found, Waypoints) or not found.geographic:
            raise ValueError(f"the navigation {self.navigation} has no times or no latitudes; give a track with both.")
        return found

    @cached_property
    def _heave(self) -> posmv.DelayedHeave:
        return posmv.delayed_heave(self.heave or "")

    def _navigation(self, block: xr.Dataset) -> tuple[PlatformMotion, np.ndarray | None]:
        """Return the motion of another record in seconds after the line's start, and its heights."""
        found, frame, start = self._loaded, _frame(block), _start(block)
        if frame is None:
            raise ValueError("the line has no place on Earth, so that no navigation belongs to it.")
        seconds = _dated(found.time, start, found.week) - start
        time = block["ping_time"].values
        some = _about(seconds, time, ahead(start) + 5, start)
        place, convergence = frame.project(found.y[some], found.x[some])
        heading = np.zeros(some.sum()) if found.heading is None else found.heading[some] - convergence
        if found.heading is None:
            raise ValueError(f"the navigation {self.navigation} has no heading; give one with attitude.")
        motion = PlatformMotion(time=seconds[some] - self._lead(seconds[some], place, block), x=place[:, 0],
                                y=place[:, 1], depth=np.zeros(some.sum()), roll=found.roll[some],
                                pitch=found.pitch[some], heading=heading)
        return motion, None if found.height is None else found.height[some]

    def _lead(self, seconds: np.ndarray, place: np.ndarray, block: xr.Dataset) -> float:
        """Return by how many seconds a clock is ahead of UTC: 0, or the leap seconds of GPS time."""
        time, own = block["ping_time"].values, np.stack([block["ping_x"].values, block["ping_y"].values], -1)

        def apart(lead: float) -> float:
            there = np.stack([np.interp(time + lead, seconds, axis) for axis in place.T], -1)
            return float(np.sqrt(np.mean(np.sum((there - own) ** 2, -1))))

        leads = (0.0, ahead(_start(block))) if self._loaded.week else (0.0,)
        far = {lead: apart(lead) for lead in leads}
        lead = self._clock[0] if self._clock else min(far, key=lambda one: far[one])
        if far[lead] > FAR:
            raise ValueError(f"the navigation {self.navigation} is {far[lead]:.0f} m from the line's own positions; "
                             "give the navigation of this line.")
        if not self._clock:
            self._clock.append(lead)
            other = "".join(f", in {'UTC' if lead else 'GPS time'} {far[one]:.3g} m" for one in leads if one != lead)
            clock = f" in {'GPS time' if lead else 'UTC'}" if other else ""
            self.words.append(f"the navigation{clock} is {far[lead]:.3g} m rms from the line's positions{other}")
            if other and far[lead] > ALIKE * max(far.values()):
                self.words.append("the positions do not decide its clock")
        return lead

    @cached_property
    def _clock(self) -> list[float]:
        """Return the lead of the navigation's clock, once it is known: that of the first block is that of all."""
        return []

    def _deeper(self, dates: np.ndarray) -> np.ndarray:
        """Return by how much deeper the reference point was at dates [s] by the delayed heave."""
        heave = self._heave
        time = _dated(heave.time, float(dates[0]), heave.week)
        if dates.min() < time[0] or dates.max() > time[-1]:
            raise ValueError(f"the delayed heave {self.heave} lasts from {date(time[0])} to {date(time[-1])}, and the "
                             f"line's motion from {date(dates.min())} to {date(dates.max())}; log it for some minutes "
                             "beyond the line.")
        return np.interp(dates, time, heave.at_once - heave.delayed)


def changes(*, tide: str | float | None = None, separation: str | float | None = None, heights: str | None = None,
            navigation: FilePath | None = None, heave: FilePath | None = None, words: list[str]) -> LineChanges:
    """Return changes from names of files and numbers."""
    apart = None
    if separation is not None:
        apart = Separation(path=separation) if isinstance(separation, str) else Separation(constant=separation)
    return LineChanges(tide=tides.load(tide) if isinstance(tide, str) else tide, separation=apart, heights=heights,
                       navigation=navigation, heave=heave, words=words)


def _start(block: xr.Dataset) -> float:
    """Return the date [s] since 1970 of a line's time 0."""
    return instant(str(block.attrs.get("start", "1970-01-01")), "start of the line")


def _frame(block: xr.Dataset) -> Frame | None:
    """Return the place on Earth of a line."""
    crs = system(block.attrs)
    return None if crs is None else Frame(crs=crs, origin=origin(block.attrs, "origin", "the line"))


def _dated(time: np.ndarray, start: float, week: bool) -> np.ndarray:
    """Return times [s] since 1970; those of an unnamed week are put into that of a date."""
    if not week:
        return time
    return time + EPOCH + WEEK * round((start - EPOCH - float(time[len(time) // 2])) / WEEK)


def _about(seconds: np.ndarray, pings: np.ndarray, margin: float, start: float) -> np.ndarray:
    """Return True for samples about pings, both in seconds after the line's start."""
    some = (seconds >= pings.min() - margin) & (seconds <= pings.max() + margin)
    if not some.any():
        raise ValueError(f"the navigation lasts from {date(start + seconds[0])} to {date(start + seconds[-1])}, and "
                         f"the line's pings from {date(start + pings.min())} to {date(start + pings.max())}; give the "
                         "navigation of this line.")
    return some
