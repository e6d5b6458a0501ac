"""What readers of survey lines find in a file, and the record it makes: blocks of pings, padded alike.

A reader gives a `AssembledLine` once and a `Ping` after the other; `dataset` puts them together. Angles are radians,
metres are metres and times are seconds of the line by then; a reader converts at its border.

Casts of survey lines, as the record takes them.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime, timezone

import numpy as np
import xarray as xr

from mitsonar.hydrography.record import VARIABLES, variable

SLOWEST, FASTEST = 300.0, 3000.0   # [m/s]


def cast_of(nodes: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Return depths, increasing, and sound speeds, of nodes (K, 2) [m], [m/s] in any order."""
    if nodes is None:
        raise ValueError("it has no cast of sound speed.")
    nodes = nodes[np.isfinite(nodes).all(1)]
    nodes = nodes[(nodes[:, 1] > SLOWEST) & (nodes[:, 1] < FASTEST)]
    nodes = nodes[np.unique(nodes[:, 0], return_index=True)[1]]
    if not len(nodes):
        raise ValueError("its cast of sound speed is empty.")
    return nodes[:, 0], nodes[:, 1]


MOST_BEAMS = 4096                  # soundings of a ping, more than any echo sounder has
MOST_SECTORS = 64
DEEPEST, FARTHEST = 2e4, 1e5       # [m] of soundings, from the surface and from the ship
MOST_BYTES = 1 << 32               # of the samples of a water column that are held at once
MOTION = ("time", "x", "y", "depth", "roll", "pitch", "heading")
PING = ("time", "x", "y", "depth", "roll", "pitch", "heading")
SECTOR = ("frequency", "delay", "angle", "pulse_length", "bandwidth", "source_level_db", "absorption_db")


@dataclass(frozen=True, kw_only=True, eq=False)
class AssembledLine:
    """Hold what pings share."""

    sonar: str
    title: str
    start: float  # [s]: of time 0 since 1970, UTC
    crs: str | None
    origin: tuple[float, float] | None  # (2,) [m]: easting and northing of x = y = 0
    cast_depth: np.ndarray  # (D,) [m/s]
    cast_sound_speed: np.ndarray  # (D,) [m/s]
    transmit_offset: np.ndarray  # (3,) [rad]
    transmit_mounting: np.ndarray  # (3,) [rad]
    receive_offset: np.ndarray  # (R, 3) [rad]: of every receiving head
    receive_mounting: np.ndarray  # (R, 3) [rad]: of every receiving head
    motion: dict[str, np.ndarray]  # (M,): time, x, y, depth, roll, pitch, heading
    backscatter: str  # corrections of backscatter, and where the cast is from
    profile: str  # corrections of backscatter, and where the cast is from
    beams: int  # most of a ping
    sectors: int  # most of a ping
    column_beams: int = 0  # most of a ping
    column_samples: int = 0  # most of a ping
    left_out: str = ""  # clause on what of the file the record has no room for


@dataclass(frozen=True, kw_only=True, eq=False)
class LineColumn:
    """Hold the water column of a ping."""

    angle: np.ndarray  # (C,) [Hz]
    start: np.ndarray  # (C,) [Hz]
    rate: np.ndarray  # (C,) [Hz]
    sector: np.ndarray  # (C,)
    count: np.ndarray  # (C,): samples of each beam
    level_db: np.ndarray  # [dB]: beam after beam


@dataclass(frozen=True, kw_only=True, eq=False)
class Ping:
    """Hold one ping of one head."""

    place: dict[str, float]  # time, x, y, depth, roll, pitch, heading of the reference point
    head_sound_speed: float  # [m/s]
    head: int  # number of the receiving head, from 0
    sectors: dict[str, np.ndarray]  # (S,)
    soundings: dict[str, np.ndarray]  # (B,): by the names of the record's variables
    column: LineColumn | None = field(default=None)


@np.errstate(invalid="ignore", over="ignore")      # of numbers that are none, in what is not valid
def dataset(line: AssembledLine, pings: Sequence[Ping]) -> xr.Dataset:
    """Put pings together."""
    values: dict[str, np.ndarray] = {
        "cast_depth": line.cast_depth, "cast_sound_speed": line.cast_sound_speed,
        "transmit_offset": line.transmit_offset, "transmit_mounting": line.transmit_mounting,
        "receive_offset": line.receive_offset[0], "receive_mounting": line.receive_mounting[0]}
    values |= {f"motion_{name}": line.motion[name] for name in MOTION}
    values |= {f"ping_{name}": np.array([ping.place[name] for ping in pings]) for name in PING}
    values["head_sound_speed"] = np.array([ping.head_sound_speed for ping in pings])
    values |= {f"sector_{name}": _padded([ping.sectors[name] for ping in pings], (line.sectors,), np.nan)
               for name in SECTOR}
    if pings and "offset" in pings[0].sectors:
        values["sector_offset"] = _padded([ping.sectors["offset"] for ping in pings], (line.sectors, 3), np.nan)
    if len(line.receive_offset) > 1:
        values["head"] = np.array([ping.head for ping in pings])
        values |= {"head_receive_offset": line.receive_offset, "head_receive_mounting": line.receive_mounting}
    names = list(pings[0].soundings) if pings else [
        name for name, about in VARIABLES.items() if about.group == "sounding" and about.needed]
    valid = _padded([_sane(ping.soundings) for ping in pings], (line.beams,), False)
    values["valid"] = valid
    for name in names:
        if name != "valid":
            kept = VARIABLES[name].dtype.startswith("f")
            rows = _padded([ping.soundings[name] for ping in pings], (line.beams,), np.nan if kept else 0)
            values[name] = np.where(valid, rows, np.nan) if kept else rows
    if line.column_beams:
        values |= _columns(line, pings)
    about = {"sonar": line.sonar, "title": line.title, "crs": line.crs, "preset": None, "profile": line.profile,
             "start": datetime.fromtimestamp(line.start, timezone.utc).isoformat().replace("+00:00", "Z"),
             "backscatter": line.backscatter}
    if line.left_out:
        about["left_out"] = line.left_out
    if line.crs is not None:
        about["origin"] = line.origin
    return xr.Dataset({name: variable(name, value) for name, value in values.items()}, attrs=about)


def _sane(soundings):
    """Say which soundings are valid and somewhere."""
    somewhere = (np.abs(soundings["depth"]) < DEEPEST) & np.isfinite(soundings["x"]) & np.isfinite(soundings["y"])
    near = np.hypot(soundings["across_track"], soundings["along_track"]) < FARTHEST
    return soundings["valid"] & somewhere & near & _known(soundings["travel_time"]) & _known(soundings["angle"])


def _known(values):
    """Say which numbers are there, unless a ping has none: formats may leave them out."""
    finite = np.isfinite(values)
    return finite if finite.any() else ~np.isinf(values)


def _padded(rows, shape, filling):
    """Stack rows of different length (B, ...) to (P, B, ...)."""
    padded = np.full((len(rows), *shape), filling)
    for ping, row in enumerate(rows):
        padded[ping, :len(row)] = row
    return padded


def _columns(line, pings):
    """Lay out the samples of water columns."""
    shape = (len(pings), line.column_beams, line.column_samples)
    if 4 * np.prod(shape, dtype=float) > MOST_BYTES:
        raise ValueError(f"the water column of {shape[0]} pings of {shape[1]} beams of {shape[2]} samples takes "
                         f"{4e-9 * np.prod(shape, dtype=float):.3g} GB; read fewer pings at a time, or leave it out "
                         "(water_column=False).")
    rows = {"angle": np.nan, "start": np.nan, "rate": np.nan, "sector": 0}
    empty = np.zeros(0)
    values = {f"column_{name}": _padded([getattr(ping.column, name) if ping.column else empty for ping in pings],
                                        shape[1:2], filling) for name, filling in rows.items()}
    level = np.full(shape, np.nan, np.float32)
    samples = np.arange(line.column_samples)
    for ping, one in enumerate(pings):
        if one.column is not None:
            level[ping, :one.column.count.size][samples < one.column.count[:, None]] = one.column.level_db
    return {**values, "column_level_db": level}
