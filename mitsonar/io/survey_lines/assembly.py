"""Parts of a line of soundings that file readers return, and the record assembled from them in blocks of pings.

A reader returns one `AssembledLine`, then `Ping` after `Ping`; `dataset` pads and joins them. Readers convert at their
border: angles are radians here, lengths metres and times seconds after the start of the line. Soundings of files that
state angles and times alone are placed by `hydrography.reduction`.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timezone
from functools import cached_property

import numpy as np
import xarray as xr

from mitsonar.hydrography.record import VARIABLES, variable
from mitsonar.hydrography.reduction.attitude import PlatformMotion
from mitsonar.hydrography.reduction.resounding import resounded

SLOWEST, FASTEST = 300.0, 3000.0   # [m/s]
MOST_BEAMS = 4096                  # soundings of a ping, more than any echo sounder has
MOST_SECTORS = 64
DEEPEST, FARTHEST = 2e4, 1e5       # [m] of soundings, from the surface and from the ship
MOST_BYTES = 1 << 32               # of the water column samples that are held at once
POSE = ("time", "x", "y", "depth", "roll", "pitch", "heading")
PLACES = ("depth", "x", "y", "across_track", "along_track")
MEASURED = ("travel_time", "angle", "transmit_angle")
REDUCTION = ("places by mitsonar, from travel times and angles of the file: rays through the cast, with the head's "
             "sound speed at the arrays and the ship's way while echoes arrive")
LEVELS = ("tide", "ping_height", "separation")
SECTOR = ("frequency", "delay", "angle", "pulse_length", "bandwidth", "source_level_db", "absorption_db")


@dataclass(frozen=True, kw_only=True, eq=False)
class LineCast:
    """Cast in the file of a line."""

    time: float  # [s]: since 1970, UTC, from which on the line uses the cast
    place: tuple[float, float] | None  # latitude and longitude [degrees]; None if the file states none
    nodes: np.ndarray  # (K, 2) [m], [m/s]: in any order

    @classmethod
    def at(cls, time: float, latitude: float, longitude: float, nodes: np.ndarray) -> LineCast:
        """Return a cast; latitude and longitude may be no place on Earth, or both 0 for none."""
        on_earth = abs(latitude) <= 90 and abs(longitude) <= 360 and (latitude, longitude) != (0.0, 0.0)
        return cls(time=time, place=(latitude, longitude) if on_earth else None, nodes=nodes)


def cast_of(nodes: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Return increasing depths and sound speeds of nodes (K, 2) [m], [m/s] in any order."""
    if nodes is None:
        raise ValueError("it has no cast of sound speed.")
    nodes = nodes[np.isfinite(nodes).all(1)]
    nodes = nodes[(nodes[:, 1] > SLOWEST) & (nodes[:, 1] < FASTEST)]
    nodes = nodes[np.unique(nodes[:, 0], return_index=True)[1]]
    if not len(nodes):
        raise ValueError("its cast of sound speed is empty.")
    return nodes[:, 0], nodes[:, 1]


def uniform_cast(speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Return depths and sound speeds of water of one speed [m/s], for files without a cast."""
    return cast_of(np.array([[0.0, speed], [DEEPEST, speed]]))


def check_counts(name: str, beams: int, sectors: int = 0) -> None:
    """Check the stated numbers of beams and sectors of a ping before memory is reserved for them."""
    if beams > MOST_BEAMS or sectors > MOST_SECTORS:
        raise ValueError(f"{name} has {beams} beams and {sectors} sectors, more than {MOST_BEAMS} and {MOST_SECTORS}; "
                         "it is damaged.")


@dataclass(frozen=True, kw_only=True, eq=False)
class AssembledLine:
    """Content that all pings of a line share."""

    sonar: str
    title: str
    start: float  # [s]: of time 0 since 1970, UTC
    crs: str | None
    origin: tuple[float, float] | None  # [m]: easting and northing of x = y = 0
    cast_depth: np.ndarray  # (D,) [m]
    cast_sound_speed: np.ndarray  # (D,) [m/s]
    transmit_offset: np.ndarray  # (3,) [m]
    transmit_mounting: np.ndarray  # (3,) [rad]
    receive_offset: np.ndarray  # (R, 3) [m]: of every receiving head
    receive_mounting: np.ndarray  # (R, 3) [rad]: of every receiving head
    motion: dict[str, np.ndarray]  # (M,): POSE
    backscatter: str  # corrections applied to the backscatter
    profile: str  # source of the cast
    beams: int  # largest number in a ping, as the next three
    sectors: int
    column_beams: int = 0
    column_samples: int = 0
    snippet_samples: int = 0
    left_out: str = ""  # contents of the file that the record cannot hold
    placed: bool = True  # soundings have places in the file, not angles and times alone
    levels: tuple[str, ...] = ()  # of LEVELS, those that the file states
    datum: str = ""  # vertical datum
    heights: str = ""  # "gnss" if depths follow from heights above the ellipsoid

    @cached_property
    def platform(self) -> PlatformMotion:
        """Motion that places soundings, made once for all blocks."""
        return PlatformMotion(**{name: self.motion[name] for name in POSE})


@dataclass(frozen=True, kw_only=True, eq=False)
class LineColumn:
    """Water column of a ping."""

    angle: np.ndarray  # (C,) [rad]
    start: np.ndarray  # (C,) [s]
    rate: np.ndarray  # (C,) [Hz]
    sector: np.ndarray  # (C,)
    count: np.ndarray  # (C,): samples of each beam
    level_db: np.ndarray  # [dB]: beam after beam


@dataclass(frozen=True, kw_only=True, eq=False)
class LineSnippets:
    """Snippets of a ping."""

    rate: float  # [Hz]
    start: np.ndarray  # (B,) [s]: of the first sample, after the sector's transmission
    count: np.ndarray  # (B,): samples of each beam
    level_db: np.ndarray  # [dB]: beam after beam


@dataclass(frozen=True, kw_only=True, eq=False)
class Ping:
    """One ping of one receiving head."""

    place: dict[str, float]  # POSE of the reference point
    head_sound_speed: float  # [m/s]
    head: int  # number of the receiving head, from 0
    sectors: dict[str, np.ndarray]  # (S,)
    soundings: dict[str, np.ndarray]  # (B,): by the names of the record's variables
    column: LineColumn | None = None
    snippets: LineSnippets | None = None
    levels: dict[str, float] = field(default_factory=dict)  # [m], by names of LEVELS


@np.errstate(invalid="ignore", over="ignore")      # invalid soundings may hold NaN and infinity
def dataset(line: AssembledLine, pings: Sequence[Ping]) -> xr.Dataset:
    """Assemble the record of a block of pings."""
    values: dict[str, np.ndarray] = {
        "cast_depth": line.cast_depth, "cast_sound_speed": line.cast_sound_speed,
        "transmit_offset": line.transmit_offset, "transmit_mounting": line.transmit_mounting,
        "receive_offset": line.receive_offset[0], "receive_mounting": line.receive_mounting[0]}
    values |= {f"motion_{name}": line.motion[name] for name in POSE}
    values |= {f"ping_{name}": np.array([ping.place[name] for ping in pings]) for name in POSE}
    values |= {name: np.array([ping.levels.get(name, np.nan) for ping in pings]) for name in line.levels}
    values["head_sound_speed"] = np.array([ping.head_sound_speed for ping in pings])
    values |= {f"sector_{name}": _padded([ping.sectors[name] for ping in pings], (line.sectors,), np.nan)
               for name in SECTOR}
    if pings and "offset" in pings[0].sectors:
        values["sector_offset"] = _padded([ping.sectors["offset"] for ping in pings], (line.sectors, 3), np.nan)
    if len(line.receive_offset) > 1:
        values["head"] = np.array([ping.head for ping in pings])
        values |= {"head_receive_offset": line.receive_offset, "head_receive_mounting": line.receive_mounting}
    if not line.placed:
        pings = [replace(ping, soundings=_unplaced(ping.soundings)) for ping in pings]
    names = list(pings[0].soundings) if pings else [
        name for name, about in VARIABLES.items() if about.group == "sounding" and about.needed]
    usable = _usable if line.placed else _measured
    valid = _padded([usable(ping.soundings) for ping in pings], (line.beams,), False)
    values["valid"] = valid
    for name in names:
        if name != "valid":
            real = VARIABLES[name].dtype.startswith("f")
            rows = _padded([ping.soundings[name] for ping in pings], (line.beams,), np.nan if real else 0)
            values[name] = np.where(valid, rows, np.nan) if real else rows
    if line.column_beams:
        values |= _columns(line, pings)
    if line.snippet_samples:
        values |= _snippets(line, pings)
    attributes = {"sonar": line.sonar, "title": line.title, "crs": line.crs, "preset": None, "profile": line.profile,
                  "start": datetime.fromtimestamp(line.start, timezone.utc).isoformat().replace("+00:00", "Z"),
                  "backscatter": line.backscatter}
    if not line.placed:
        attributes["reduction"] = REDUCTION
    attributes |= {name: text for name, text in (("left_out", line.left_out), ("vertical_datum", line.datum),
                                                 ("heights", line.heights)) if text}
    if line.crs is not None:
        attributes["origin"] = line.origin
    record = xr.Dataset({name: variable(name, value) for name, value in values.items()}, attrs=attributes)
    return record if line.placed else resounded(record, motion=line.platform)


def _usable(soundings):
    """Return a mask of soundings that are valid and have a position, a travel time and an angle."""
    placed = (np.abs(soundings["depth"]) < DEEPEST) & np.isfinite(soundings["x"]) & np.isfinite(soundings["y"])
    near = np.hypot(soundings["across_track"], soundings["along_track"]) < FARTHEST
    return soundings["valid"] & placed & near & _known(soundings["travel_time"]) & _known(soundings["angle"])


def _measured(soundings):
    """Return a mask of soundings that are valid and have a travel time and angles."""
    return soundings["valid"] & np.logical_and.reduce([np.isfinite(soundings[name]) for name in MEASURED])


def _unplaced(soundings):
    """Return soundings with places that are still unknown."""
    return soundings | {name: np.full(soundings["valid"].size, np.nan) for name in PLACES}


def _known(values):
    """Return a mask of finite values; all are kept if a ping has none, since formats may leave the values out."""
    finite = np.isfinite(values)
    return finite if finite.any() else ~np.isinf(values)


def _padded(rows, shape, filling):
    """Stack rows of different lengths (B, ...) to (P, B, ...)."""
    padded = np.full((len(rows), *shape), filling)
    for ping, row in enumerate(rows):
        padded[ping, :len(row)] = row
    return padded


def _check_room(what: str, shape: tuple[int, int, int]) -> None:
    size = 4 * np.prod(shape, dtype=float)
    if size > MOST_BYTES:
        raise ValueError(f"{what} of {shape[0]} pings of {shape[1]} beams of {shape[2]} samples takes "
                         f"{1e-9 * size:.3g} GB; read fewer pings at a time, or leave it out (water_column=False).")


def _snippets(line, pings):
    """Return the variables of the snippets."""
    shape = (len(pings), line.beams, line.snippet_samples)
    _check_room("the snippets", shape)
    level, samples = np.full(shape, np.nan, np.float32), np.arange(line.snippet_samples)
    for number, ping in enumerate(pings):
        if (snippets := ping.snippets) is not None:
            level[number, :snippets.count.size][samples < snippets.count[:, None]] = snippets.level_db
    return {"snippet_rate": np.array([ping.snippets.rate if ping.snippets else np.nan for ping in pings]),
            "snippet_start": _padded([ping.snippets.start if ping.snippets else np.zeros(0) for ping in pings],
                                     (line.beams,), np.nan), "snippet_db": level}


def _columns(line, pings):
    """Return the variables of the water column."""
    shape = (len(pings), line.column_beams, line.column_samples)
    _check_room("the water column", shape)
    rows = {"angle": np.nan, "start": np.nan, "rate": np.nan, "sector": 0}
    empty = np.zeros(0)
    values = {f"column_{name}": _padded([getattr(ping.column, name) if ping.column else empty for ping in pings],
                                        shape[1:2], filling) for name, filling in rows.items()}
    level = np.full(shape, np.nan, np.float32)
    samples = np.arange(line.column_samples)
    for number, ping in enumerate(pings):
        if (column := ping.column) is not None:
            level[number, :column.count.size][samples < column.count[:, None]] = column.level_db
    return {**values, "column_level_db": level}
