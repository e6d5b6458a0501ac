"""PairedPings of pings of two lines of one track, and values of one line at the soundings of the other.

A real ping is paired with the simulated ping that is nearest in time, or, if the lines have no common time, nearest in
place. Values of a ping are interpolated across its track; travel times by what they exceed the straight way,

    t(a) = 2 / c [h(a) + sqrt(a² + z(a)²)],        h = t c / 2 - sqrt(a² + z²)

with a across track and z below the reference point, so that the curvature of a level bed's times costs nothing.
"""
from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timezone

import numpy as np
import xarray as xr

HOLE = 4.0                         # times the median distance of soundings across track: no value between them
APART = 0.5                        # of the depth: pings farther apart are no pair
NEAR = 2.0                         # times the distance of pings, for pairs by place
OTHER = 0.1                        # share by which another mode's frequencies differ


@dataclass(frozen=True, kw_only=True, eq=False)
class PairedPings:
    """Paired pings of a real and a simulated line."""

    real: np.ndarray  # (P,): numbers of pings
    simulated: np.ndarray  # (P,)
    by: str  # time or place
    seconds: float  # median distance in time; NaN if paired by place
    metres: float  # median distance of the transmit arrays; NaN if the frames differ
    others: int  # real pings at frequencies that the simulated line has not, which were left out


def paired(real: xr.Dataset, simulated: xr.Dataset) -> PairedPings:
    """Return the paired pings of two lines; raise `ValueError` without two pairs."""
    lines = real, simulated
    pings = [np.flatnonzero(line["valid"].values.any(1)) for line in lines]
    alike = _alike(real, simulated)[pings[0]]
    others = int((~alike).sum()) if alike.sum() > 1 else 0
    if others:
        pings[0] = pings[0][alike]
    for line, some, name in zip(lines, pings, ("real", "simulated")):
        if some.size < 2:
            raise ValueError(f"the {name} line {line.attrs.get('title', '')!r} has {some.size} of {line.sizes['ping']} "
                             "pings with soundings; a comparison takes two or more.")
    times = [_start(line) + line["ping_time"].values[some] for line, some in zip(lines, pings)]
    places = [_places(line)[some] for line, some in zip(lines, pings)]
    same, other_head = same_frame(real, simulated), _other_head(lines, pings)
    slack = max(float(np.median(np.diff(np.unique(part)))) if np.unique(part).size > 1 else 1.0 for part in times)
    depth = float(np.nanmedian(real["depth"].values[real["valid"].values]))
    if times[0][0] - slack <= times[1][-1] and times[1][0] - slack <= times[0][-1]:
        apart = np.abs(times[0][:, None] - times[1]) + other_head
        nearest = apart.argmin(1)
        kept, by = apart.min(1) <= slack, "time"
    elif same:
        apart = np.linalg.norm(places[0][:, None] - places[1], axis=-1) + other_head
        nearest = apart.argmin(1)
        step = max(float(np.median(np.linalg.norm(np.diff(part, axis=0), axis=-1))) for part in places)
        kept, by = apart.min(1) <= max(NEAR * step, 0.1), "place"
    else:
        raise ValueError(_no_pings(times, "they have no common time, and their coordinate systems differ"))
    metres = np.linalg.norm(places[0] - places[1][nearest], axis=-1)
    if same:
        kept &= metres <= APART * depth
    if kept.sum() < 2:
        raise ValueError(_no_pings(times, f"pings nearest by {by} are {np.median(metres):.4g} m apart" if same else
                                   "their times differ by more than a ping interval"))
    seconds = np.abs(times[0] - times[1][nearest])[kept]
    return PairedPings(real=pings[0][kept], simulated=pings[1][nearest[kept]], by=by,
                 seconds=float(np.median(seconds)) if by == "time" else np.nan,
                 metres=float(np.median(metres[kept])) if same else np.nan, others=others)


def _other_head(lines, pings):
    """Return infinity (real, simulated) for pings of different heads of two lines of several heads, else 0."""
    if not all("head" in line for line in lines):
        return 0.0
    heads = [line["head"].values[some] for line, some in zip(lines, pings)]
    return np.where(heads[0][:, None] == heads[1], 0.0, np.inf)


def _alike(real, simulated):
    """Return True for the real pings (ping,) whose frequencies the simulated line has, too."""
    known = simulated["sector_frequency"].values
    known = np.unique(known[np.isfinite(known)])
    asked = real["sector_frequency"].values
    if not known.size:
        return np.ones(len(asked), bool)
    nearest = np.abs(np.log(asked[..., None] / known)).min(-1)
    return (~(nearest > np.log(1 + OTHER))).all(1)


def same_frame(real: xr.Dataset, simulated: xr.Dataset) -> bool:
    """Return True if coordinates of both lines are of one coordinate system, or of none."""
    return (real.attrs.get("crs") or None) == (simulated.attrs.get("crs") or None)


def _no_pings(times, why):
    real, simulated = (" to ".join(datetime.fromtimestamp(part[k], timezone.utc).strftime("%Y-%m-%d %H:%M:%S")
                                   for k in (0, -1)) for part in times)
    return (f"the lines have no two common pings (real: {real}, simulated: {simulated}): {why}; give two records of "
            "one line.")


def _start(line):
    """Return the time 0 of a line [s] since 1970, UTC."""
    try:
        start = datetime.fromisoformat(str(line.attrs.get("start", "1970-01-01")).strip().removesuffix("Z"))
    except ValueError:
        raise ValueError(f"the start of the line is {line.attrs['start']!r}, which is no date; write it as "
                         "2026-05-01T10:00:00Z.") from None
    return start.replace(tzinfo=start.tzinfo or timezone.utc).timestamp()


def _places(line):
    """Return the places (ping, 2) of the transmit array of a level ship in the coordinate system."""
    ahead, aside, _ = line["transmit_offset"].values
    sine, cosine = np.sin(line["ping_heading"].values), np.cos(line["ping_heading"].values)
    arm = np.stack([ahead * sine + aside * cosine, ahead * cosine - aside * sine], -1)
    return np.stack([line["ping_x"].values, line["ping_y"].values], -1) + arm + np.array(_origin(line))


def _origin(line):
    """Return easting and northing of x = y = 0."""
    origin = line.attrs.get("origin")
    return (0.0, 0.0) if origin is None else tuple(origin)


def at_soundings(real: xr.Dataset, simulated: xr.Dataset, pairs: PairedPings) -> tuple[np.ndarray, np.ndarray]:
    """Return simulated depths [m] and travel times [s] at the real soundings of paired pings (P, beam)."""
    shape = pairs.real.size, real.sizes["beam"]
    depths, times = np.full(shape, np.nan), np.full(shape, np.nan)
    same, shift = same_frame(real, simulated), np.subtract(_origin(real), _origin(simulated))
    for row, (one, other) in enumerate(zip(pairs.real, pairs.simulated)):
        valid = real["valid"].values[one]
        if same:
            heading = float(simulated["ping_heading"][other])
            away = np.stack([real[name].values[one] - float(simulated[f"ping_{name}"][other]) for name in "xy"]
                            ) + shift[:, None]
            across = away[0] * np.cos(heading) - away[1] * np.sin(heading)
        else:
            across = real["across_track"].values[one]
        ping = simulated[["valid", "across_track", "depth", "travel_time", "ping_depth", "head_sound_speed"]].isel(
            ping=other)
        depths[row, valid], times[row, valid] = _across(ping, across[valid])
    return depths, times


def _across(ping, across):
    """Return depths and travel times of one ping at places across its track."""
    valid, half = ping["valid"].values, 0.5 * float(ping["head_sound_speed"])
    order = np.argsort(ping["across_track"].values[valid])
    at, depth, time = (ping[name].values[valid][order] for name in ("across_track", "depth", "travel_time"))
    above = float(ping["ping_depth"])
    excess = time * half - np.hypot(at, depth - above)
    found = np.interp(across, at, depth, np.nan, np.nan)
    times = (np.interp(across, at, excess, np.nan, np.nan) + np.hypot(across, found - above)) / half
    right = np.clip(np.searchsorted(at, across), 1, at.size - 1) if at.size > 1 else np.zeros(across.size, int)
    hole = at[right] - at[right - 1] > HOLE * np.median(np.diff(at)) if at.size > 1 else np.ones(across.size, bool)
    return np.where(hole, np.nan, found), np.where(hole, np.nan, times)
