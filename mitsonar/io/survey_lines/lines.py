"""What the writers of a line of soundings share: its blocks, its start, its place on Earth, its pings one by one.

    since 1970 = start + time                    latitude, longitude = on the globe (x, y)
    true heading = heading from the y axis + convergence of the meridians there

What the formats of soundings hold of the record, for the words on what they do not.
"""
from __future__ import annotations

import datetime
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from mitsonar.hydrography.record import VARIABLES, check
from mitsonar.version import __version__

from ..tracks.navigation import Frame

SOUNDINGS = frozenset({
    "cast_depth", "cast_sound_speed", "transmit_offset", "receive_offset", "transmit_mounting", "receive_mounting",
    "motion_time", "motion_x", "motion_y", "motion_depth", "motion_roll", "motion_pitch", "motion_heading",
    "ping_time", "ping_x", "ping_y", "ping_depth", "ping_roll", "ping_pitch", "ping_heading", "head_sound_speed",
    "sector_frequency", "sector_delay", "sector_angle", "sector_pulse_length", "sector_bandwidth",
    "sector_source_level_db", "sector_absorption_db", "travel_time", "angle", "transmit_angle", "sector", "depth",
    "x", "y", "across_track", "along_track", "detection", "quality", "uncertainty", "horizontal_uncertainty",
    "backscatter_db", "snippet_rate", "snippet_start", "snippet_db", "head",
})
COLUMN = frozenset({"column_angle", "column_sector", "column_start", "column_rate", "column_level_db"})


Blocks = xr.Dataset | Iterable[xr.Dataset]
Place = tuple[float, float]                # latitude and longitude [degrees]
Ping = dict[str, Any]                      # a ping's variables by name, without the dimension ping
NOWHERE: Place = (0.0, 0.0)
_NEVER_LOST = ("valid",)


@dataclass(frozen=True, kw_only=True)
class Written:
    """Say what went into a file."""

    pings: int
    soundings: int  # valid ones
    words: tuple[str, ...] = ()  # what the format cannot hold, and what had to be settled for it


@dataclass(frozen=True, kw_only=True, eq=False)
class LineToWrite:
    """Hold what all pings of a line share."""

    first: xr.Dataset  # its first block
    start: float  # [s]: since 1970, UTC, of time 0
    frame: Frame  # where x = y = 0 lies
    placed: str  # in words, where that is not from the scene's own coordinate system

    def array(self, name: str) -> np.ndarray:
        """Return a variable that is not of pings."""
        return np.asarray(self.first[name].values, float)

    @property
    def receivers(self) -> tuple[np.ndarray, np.ndarray]:
        """Lever arms (R, 3) [m] and mountings (R, 3) [rad] of the receive arrays, one or those of several heads."""
        if "head_receive_offset" in self.first:
            return self.array("head_receive_offset"), self.array("head_receive_mounting")
        return self.array("receive_offset")[None], self.array("receive_mounting")[None]

    @property
    def sonar(self) -> str:
        """Its name."""
        return str(self.first.attrs.get("sonar") or "multibeam")

    def provenance(self) -> str:
        """Say in one sentence where the line comes from."""
        about = {name: self.first.attrs.get(name)
                 for name in ("title", "scene", "seed", "preset", "profile", "backscatter")}
        said = "; ".join(f"{name}: {value}" for name, value in about.items() if value is not None)
        return f"written by mitsonar {__version__}; {said}"


def check_asked(place: Place | None, start: str | None) -> None:
    """Check that ``place`` lies on Earth and ``start`` is a date; raises `ValueError` as `line_of`."""
    if place is not None:
        _checked(place)
    if start is not None:
        _seconds(start)


def line_of(blocks: Blocks, *, place: Place | None = None,
            start: str | None = None) -> tuple[LineToWrite, Iterator[xr.Dataset]]:
    """Open a line of soundings that comes block by block."""
    # place [degrees]
    check_asked(place, start)          # before a ping is made
    some = iter([blocks] if isinstance(blocks, xr.Dataset) else blocks)
    for first in some:
        check(first)
        if first.sizes["ping"]:
            break
    else:
        raise ValueError("there are no soundings: no ping was given.")
    if not first.sizes[first["motion_time"].dims[0]]:
        raise ValueError("the line has no motion: motion_time is empty; give that of the platform.")
    crs = first.attrs.get("crs") or None
    if crs is None:
        frame, placed = Frame.about(*_checked(place or NOWHERE)), _placed(place)
    elif place is not None:
        raise ValueError(f"the line lies in {crs}, so its place is known; leave place out.")
    else:
        try:
            east, north = np.asarray(first.attrs.get("origin", (0.0, 0.0)), float).tolist()
        except (TypeError, ValueError):
            raise ValueError(f"the line's origin is {first.attrs['origin']!r}; give easting and northing.") from None
        frame, placed = Frame(crs=str(crs), origin=(float(east), float(north))), ""
    since = _seconds(first.attrs.get("start") if start is None else start)
    line = LineToWrite(first=first, start=since, frame=frame, placed=placed)
    return line, _alike(first, some)


def pings(line: LineToWrite, block: xr.Dataset) -> Iterator[Ping]:
    """Return a block's pings one by one, without padding and with their places on Earth.

    Each has the record's variables, beams without an angle and sectors without a frequency left out. More are ``beam``
    (numbers in the record), ``since`` [s since 1970], ``ping_latitude``, ``ping_longitude``, ``latitude`` and
    ``longitude`` (of beams; NaN where there is no sounding) [degrees] and ``true_heading`` [rad].
    """
    arrays = {str(name): value.values for name, value in block.variables.items() if value.dims[:1] == ("ping",)}
    of_beams = {name for name in arrays if block[name].dims[1:2] == ("beam",)}
    of_sectors = {name for name in arrays if block[name].dims[1:2] == ("transmission",)}
    here = np.stack([arrays["ping_x"], arrays["ping_y"]], -1)
    latitude, longitude, convergence = line.frame.on_globe(here)
    valid = arrays["valid"]
    beam_latitude, beam_longitude = np.full(valid.shape, np.nan), np.full(valid.shape, np.nan)
    if valid.any():
        found = np.stack([arrays["x"][valid], arrays["y"][valid]], -1)
        beam_latitude[valid], beam_longitude[valid], _ = line.frame.on_globe(found)
    for number in range(block.sizes["ping"]):
        ping: Ping = {name: value[number] for name, value in arrays.items()}
        ping |= {"latitude": beam_latitude[number], "longitude": beam_longitude[number]}
        there = np.isfinite(ping["angle"]) & np.isfinite(ping["transmit_angle"])
        ping["beam"] = np.arange(there.size)
        for name in (*of_beams, "latitude", "longitude", "beam"):
            ping[name] = ping[name][there]
        sent = np.flatnonzero(np.isfinite(ping["sector_frequency"]))
        sectors = 1 + int(sent[-1]) if sent.size else 1
        for name in of_sectors:
            ping[name] = np.nan_to_num(ping[name][:sectors])
        ping["sector"] = np.clip(ping["sector"], 0, sectors - 1)
        ping |= {"since": line.start + ping["ping_time"], "ping_latitude": latitude[number],
                 "ping_longitude": longitude[number], "true_heading": ping["ping_heading"] + convergence[number]}
        yield ping


def rated(some: Iterable[Ping]) -> Iterator[tuple[Ping, float]]:
    """Yield pings with the rate [Hz] at which their cycles follow each other.

    Pings that are sent before the first echo is back, of a second swath or another head, are of one cycle. The last
    cycle has the rate of the one before; a single one has 0.
    """
    cycle: list[Ping] = []
    rate = 0.0
    for ping in some:
        if cycle:
            first, apart = np.nanmin(cycle[0]["travel_time"], initial=np.inf), ping["since"] - cycle[0]["since"]
            if not 0 <= apart <= (0.5 * first if np.isfinite(first) else 0.0):
                rate = 1.0 / apart if apart > 0 else rate
                yield from ((one, rate) for one in cycle)
                cycle = []
        cycle.append(ping)
    yield from ((one, rate) for one in cycle)


def rotation(roll: float, pitch: float, heading: float) -> np.ndarray:
    """Return the matrix (3, 3) from forward, starboard, down of a body to those of what it is turned in."""
    sr, cr, sp, cp, sh, ch = (turn(one) for one in (roll, pitch, heading) for turn in (np.sin, np.cos))
    return np.array([[ch * cp, ch * sp * sr - sh * cr, ch * sp * cr + sh * sr],
                     [sh * cp, sh * sp * sr + ch * cr, sh * sp * cr - ch * sr],
                     [-sp, cp * sr, cp * cr]])


def lost(line: LineToWrite, held: Iterable[str]) -> tuple[str, ...]:
    """Name the variables of a line that a format does not hold."""
    known = {*held, *_NEVER_LOST}
    return tuple(name for name in VARIABLES if name in line.first.variables and name not in known)


def left_out(empty: int) -> str:
    """Say how many pings had no beams."""
    return f"{empty} ping{'s' if empty > 1 else ''} without beams left out" if empty else ""


def _alike(first: xr.Dataset, others: Iterable[xr.Dataset]) -> Iterator[xr.Dataset]:
    yield first
    names, sizes = set(first.variables), _sizes(first)
    for block in others:
        check(block)
        if not block.sizes["ping"]:
            continue
        if set(block.variables) != names or _sizes(block) != sizes or not np.array_equal(
                block["motion_time"].values, first["motion_time"].values):
            raise ValueError("a block of pings has other variables, beams, samples or motion than the first one; pad "
                             "them to the same, and give every block the motion of the whole line.")
        yield block


def _sizes(block):
    return {name: size for name, size in block.sizes.items() if name != "ping"}


def _checked(place: Place) -> Place:
    latitude, longitude = place
    if not (-90 <= latitude <= 90 and -180 <= longitude <= 360):
        raise ValueError(f"place is {latitude:g}, {longitude:g}; give latitude and longitude in degrees.")
    return latitude, longitude


def _placed(place):
    if place is not None:
        return ""
    return "the scene names no coordinate system, so x = y = 0 is put at latitude 0, longitude 0 (--place says another)"


def _seconds(text: str | None) -> float:
    if text is None:
        return 0.0
    try:
        date = datetime.datetime.fromisoformat(str(text).strip().removesuffix("Z"))
    except ValueError:
        raise ValueError(f"the start is {text!r}; give a date and time such as 2026-05-01T10:00:00Z.") from None
    since = (date if date.tzinfo else date.replace(tzinfo=datetime.timezone.utc)).timestamp()
    if not 0 <= since < 2**32 - 86_400:
        raise ValueError(f"the start is {text!r}; give one between 1970 and 2106.")
    return since
