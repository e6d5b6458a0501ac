"""Parts that the writers of a line of soundings share: start, position on Earth, and pings one by one.

    since 1970 = start + time                    latitude, longitude = position on the globe of (x, y)
    true heading = heading from the y axis + convergence of the meridians there
"""
from __future__ import annotations

import datetime
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from mitsonar.device.earth import Frame, origin
from mitsonar.hydrography.record import VARIABLES, as_written, check
from mitsonar.version import __version__

# Variables that formats of soundings hold; those of heights, of a water column, of a line of several heads.
SOUNDINGS = frozenset({
    "cast_depth", "cast_sound_speed", "transmit_offset", "receive_offset", "transmit_mounting", "receive_mounting",
    "motion_time", "motion_x", "motion_y", "motion_depth", "motion_roll", "motion_pitch", "motion_heading",
    "ping_time", "ping_x", "ping_y", "ping_depth", "ping_roll", "ping_pitch", "ping_heading", "head_sound_speed",
    "sector_frequency", "sector_delay", "sector_angle", "sector_pulse_length", "sector_bandwidth",
    "sector_source_level_db", "sector_absorption_db", "valid", "travel_time", "angle", "transmit_angle", "sector",
    "depth", "x", "y", "across_track", "along_track", "detection", "quality", "uncertainty", "horizontal_uncertainty",
    "backscatter_db", "snippet_rate", "snippet_start", "snippet_db", "head", "written_backscatter_db",
    "written_snippet_db",
})
HEIGHTS = frozenset({"tide", "ping_height"})
COLUMN = frozenset({"column_angle", "column_sector", "column_start", "column_rate", "column_level_db",
                    "column_recorded_db"})
HEADS = frozenset({"head_receive_offset", "head_receive_mounting"})
RESPONSE = frozenset({"normal_incidence_db", "oblique_incidence_db"})      # of formats after Kongsberg's

Blocks = xr.Dataset | Iterable[xr.Dataset]
Place = tuple[float, float]                # latitude and longitude [degrees]
Ping = dict[str, Any]                      # a ping's variables by name, without the dimension ping
NOWHERE: Place = (0.0, 0.0)
NO_SYSTEM = "x and y are metres of the scene, which names no coordinate system"


@dataclass(frozen=True, kw_only=True)
class Written:
    """Summary of a written file."""

    pings: int
    soundings: int  # valid ones
    words: tuple[str, ...] = ()  # remarks: contents that the format cannot hold, assumptions made for it


@dataclass(frozen=True, kw_only=True, eq=False)
class LineToWrite:
    """Content that all pings of a line share."""

    first: xr.Dataset  # the first block
    start: float  # [s]: of time 0, since 1970, UTC
    frame: Frame  # position of x = y = 0
    placed: str  # remark on that position if the scene has no coordinate system, else ""

    def array(self, name: str) -> np.ndarray:
        """Return a variable that has no dimension ping."""
        return np.asarray(self.first[name].values, float)

    @property
    def receivers(self) -> tuple[np.ndarray, np.ndarray]:
        """Lever arms (R, 3) [m] and mountings (R, 3) [rad] of the receive arrays, one per head."""
        if "head_receive_offset" in self.first:
            return self.array("head_receive_offset"), self.array("head_receive_mounting")
        return self.array("receive_offset")[None], self.array("receive_mounting")[None]

    @property
    def sonar(self) -> str:
        """Name of the sonar."""
        return str(self.first.attrs.get("sonar") or "multibeam")

    @property
    def datum(self) -> str:
        """Name of the vertical datum, "" if the line has none."""
        return str(self.first.attrs.get("vertical_datum") or "")

    def provenance(self) -> str:
        """Return one sentence on the origin of the line."""
        about = {name: self.first.attrs.get(name)
                 for name in ("title", "scene", "seed", "preset", "profile", "backscatter")}
        return f"written by mitsonar {__version__}; " + "; ".join(
            f"{name}: {value}" for name, value in about.items() if value is not None)

    def remarks(self, name: str, held: frozenset[str], empty: int, *others: str) -> tuple[str, ...]:
        """Return remarks on what a format does not hold: ``held`` are its variables, ``empty`` counts empty pings."""
        lost = ", ".join(variable for variable in VARIABLES
                         if variable in self.first.variables and variable not in held)
        return tuple(text for text in (
            self.placed, f"{empty} ping{'s' if empty > 1 else ''} without beams left out" if empty else "",
            f"{name} has no room for {lost}: write a .nc to keep them" if lost else "",
            "strengths are those that the instrument writes; backscatter_db, of the bed, is in a .nc only"
            if "written_backscatter_db" in self.first else "", *others,
            f"snippets lack snippet_rate, so {name} holds none" if "snippet_db" in self.first
            and "snippet_rate" not in self.first else "") if text)


def check_asked(place: Place | None, start: str | None) -> None:
    """Check that ``place`` lies on Earth and ``start`` is a date; raises `ValueError` as `line_of`."""
    if place is not None:
        _checked(place)
    if start is not None:
        _seconds(start)


def line_of(blocks: Blocks, *, place: Place | None = None,     # (latitude, longitude) [degrees]
            start: str | None = None) -> tuple[LineToWrite, Iterator[xr.Dataset]]:
    """Return what the pings of a line share, and its blocks, checked one by one as they are taken."""
    check_asked(place, start)          # before a ping is computed
    remaining = iter([blocks] if isinstance(blocks, xr.Dataset) else blocks)
    for first in remaining:
        check(first)
        if first.sizes["ping"]:
            break
    else:
        raise ValueError("there are no soundings: no ping was given.")
    if not first.sizes[first["motion_time"].dims[0]]:
        raise ValueError("the line has no motion: motion_time is empty; give the motion of the platform.")
    crs = first.attrs.get("crs") or None
    if crs is None:
        frame = Frame.about(*_checked(place or NOWHERE))
        placed = "" if place is not None else ("the scene names no coordinate system, so x = y = 0 is put at latitude "
                                               "0, longitude 0 (set another place with --place)")
    elif place is not None:
        raise ValueError(f"the line lies in {crs}, so its place is known; leave place out.")
    else:
        frame, placed = Frame(crs=str(crs), origin=origin(first.attrs, "origin", "the line")), ""
    since = _seconds(first.attrs.get("start") if start is None else start)
    return LineToWrite(first=first, start=since, frame=frame, placed=placed), _alike(first, remaining)


def pings(line: LineToWrite, block: xr.Dataset, *, apart: bool = False) -> Iterator[Ping]:
    """Yield the pings of a block without padding and with their positions on Earth.

    Each has the variables of the record; beams without an angle and sectors without a frequency are left out. Added are
    ``beam`` (number in the record), ``since`` [s since 1970], ``ping_latitude``, ``ping_longitude``, ``latitude`` and
    ``longitude`` (of beams; NaN where there is no sounding) [degrees], ``true_heading`` [rad], ``level`` [m] of the
    water above the datum, 0 without a tide, and ``below_surface`` [m] of the reference point. ``apart`` keeps the bed's
    strengths apart from the written ones.
    """
    block = block if apart else as_written(block)
    arrays = {str(name): value.values for name, value in block.variables.items() if value.dims[:1] == ("ping",)}
    of_beams = {name for name in arrays if block[name].dims[1:2] == ("beam",)}
    of_sectors = {name for name in arrays if block[name].dims[1:2] == ("transmission",)}
    latitude, longitude, convergence = line.frame.on_globe(np.stack([arrays["ping_x"], arrays["ping_y"]], -1))
    valid = arrays["valid"]
    beam_latitude, beam_longitude = np.full(valid.shape, np.nan), np.full(valid.shape, np.nan)
    if valid.any():
        beam_latitude[valid], beam_longitude[valid], _ = line.frame.on_globe(
            np.stack([arrays["x"][valid], arrays["y"][valid]], -1))
    for number in range(block.sizes["ping"]):
        ping: Ping = {name: value[number] for name, value in arrays.items()}
        ping |= {"latitude": beam_latitude[number], "longitude": beam_longitude[number]}
        formed = np.isfinite(ping["angle"]) & np.isfinite(ping["transmit_angle"])
        ping["beam"] = np.arange(formed.size)
        for name in (*of_beams, "latitude", "longitude", "beam"):
            ping[name] = ping[name][formed]
        sent = np.flatnonzero(np.isfinite(ping["sector_frequency"]))
        sectors = 1 + int(sent[-1]) if sent.size else 1
        for name in of_sectors:
            ping[name] = np.nan_to_num(ping[name][:sectors])
        ping["sector"] = np.clip(ping["sector"], 0, sectors - 1)
        level = float(np.nan_to_num(ping.get("tide", 0.0)))
        ping |= {"level": level, "below_surface": float(ping["ping_depth"]) + level,
                 "since": line.start + ping["ping_time"], "ping_latitude": latitude[number],
                 "ping_longitude": longitude[number], "true_heading": ping["ping_heading"] + convergence[number]}
        yield ping


def formed(line: LineToWrite, blocks: Iterable[xr.Dataset], empty: list[float]) -> Iterator[Ping]:
    """Yield the pings of blocks that have beams; the times of others are added to ``empty``."""
    for ping in (ping for block in blocks for ping in pings(line, block)):
        if ping["valid"].size:
            yield ping
        else:
            empty.append(float(ping["since"]))


def cycled(line_pings: Iterable[Ping], receivers: np.ndarray) -> Iterator[Ping]:         # (R, 3) [m]
    """Yield pings with their place in a cycle: fans of other swaths and heads, sent before the first echo returns.

    Added are ``rate`` (of cycles [Hz]: the last has that of the one before, a single one 0), ``cycle`` (its number),
    ``fans``, ``fan``, ``swaths``, ``swath`` (aft first) and ``heads``; fans are counted by swath, then from port.
    """
    cycle: list[Ping] = []
    rate = number = 0.0
    port_first = np.argsort(np.argsort(receivers[:, 1], kind="stable"), kind="stable")
    for ping in line_pings:
        if cycle:
            first, apart = np.nanmin(cycle[0]["travel_time"], initial=np.inf), ping["since"] - cycle[0]["since"]
            if not 0 <= apart <= (0.5 * first if np.isfinite(first) else 0.0):
                rate = 1.0 / apart if apart > 0 else rate
                yield from _fans(cycle, port_first, rate, int(number))
                cycle, number = [], number + 1
        cycle.append(ping)
    yield from _fans(cycle, port_first, rate, int(number))


def _fans(cycle, port_first, rate, number):
    of_head: dict[int, list[int]] = {}
    side = [int(port_first[min(int(ping.get("head", 0)), len(port_first) - 1)]) for ping in cycle]
    for index, number_from_port in enumerate(side):
        of_head.setdefault(number_from_port, []).append(index)
    swath = {index: place for fans in of_head.values() for place, index in enumerate(
        sorted(fans, key=lambda index: float(np.mean(cycle[index]["sector_angle"]))))}
    order = sorted(range(len(cycle)), key=lambda index: (swath[index], side[index]))
    for index, ping in enumerate(cycle):
        yield ping | {"rate": rate, "cycle": number, "fans": len(cycle), "fan": order.index(index),
                      "swaths": max(map(len, of_head.values())), "swath": swath[index], "heads": len(port_first)}


def _alike(first: xr.Dataset, others: Iterable[xr.Dataset]) -> Iterator[xr.Dataset]:
    """Yield blocks with pings and check that each has the variables, sizes and motion of the first."""
    def sizes(block: xr.Dataset) -> dict:
        return {name: size for name, size in block.sizes.items() if name != "ping"}

    yield first
    for block in others:
        check(block)
        if not block.sizes["ping"]:
            continue
        if set(block.variables) != set(first.variables) or sizes(block) != sizes(first) or not np.array_equal(
                block["motion_time"].values, first["motion_time"].values):
            raise ValueError("a block of pings has other variables, beams, samples or motion than the first one; pad "
                             "them to the same, and give every block the motion of the whole line.")
        yield block


def _checked(place: Place) -> Place:
    latitude, longitude = place
    if not (-90 <= latitude <= 90 and -180 <= longitude <= 360):
        raise ValueError(f"place is {latitude:g}, {longitude:g}; give latitude and longitude in degrees.")
    return latitude, longitude


def _seconds(text: str | None) -> float:
    """Return seconds since 1970 of a date, which is UTC unless it names a zone."""
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
