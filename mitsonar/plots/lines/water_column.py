"""Water column of a line: the fan of one ping with its soundings, and all pings as a curtain along the track.

A pixel at a place below the head lies between the rays of two beams, which pass its depth at x_1 <= x < x_2 after the
times t_1 and t_2. Its power is interpolated linearly between both beams, each at its own sample of the interpolated
time; samples shorter than a pixel are averaged first. Bent rays, and sectors sent one after the other, are thus drawn
correctly.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy import ndimage

from mitsonar.hydrography.reduction.ray_paths import (
    ATTITUDE,
    HELD,
    SEVERAL,
    RayHead,
    head_of,
    launches,
    layer_sums,
    receiving_axes,
    used_profile,
)
from mitsonar.imaging.gain import Tvg, display_gain
from mitsonar.units import db_from_power, power_from_db
from mitsonar.water.profile import SoundSpeedProfile

from ..images.gain import heard_to

SIZE = 860                         # pixels of the longer side of the fan
BELOW, ASIDE = 1.3, 1.12           # extent of pictures over that of the soundings, if samples go farther
CURTAIN_BELOW = 1.5
CURTAIN_ROWS = 600
LEAST_DOWN = 0.05                  # downward component of a unit vector: flatter beams are left out
DYNAMIC_DB, LEAST_DB = 70.0, 20.0  # most and least range of the colours
FAINT, BRIGHT = 5.0, 99.9          # percentiles of the first and the last colour
Box = tuple[float, float, float]
COLUMN = ("column_angle", "column_sector", "column_start", "column_rate", "column_level_db")
_SAMPLED = [*COLUMN, "sector_angle", "sector_absorption_db", "travel_time", *ATTITUDE]
BLOCK = 32                         # pings read together


@dataclass(frozen=True, kw_only=True)
class ColumnFan:
    """Water column of one ping as a picture."""

    image: np.ndarray  # [dB], from the head's depth down
    extent: tuple[float, float, float, float]  # [m]: across from the reference point, and below the surface
    gain: str  # formula of the applied gain
    box: Box  # [m]: extent from the head to port (negative), to starboard and down


@dataclass(frozen=True, kw_only=True)
class Curtain:
    """Water column of all pings over range."""

    edges: np.ndarray  # edges of the pings: times [s], or numbers if times do not increase
    timed: bool  # True if edges are times
    slant_range: np.ndarray  # [m]: edges of the rows
    nadir: np.ndarray  # (rows, P) [dB]: mean power of the beam nearest to the vertical
    largest: np.ndarray  # (rows, P) [dB]: largest level of any beam
    bottom: np.ndarray  # (P,) [m]: slant range of the sounding nearest to the vertical
    gain: str


@dataclass(frozen=True, kw_only=True)
class _ColumnBeams:
    """Samples of the usable beams of a ping, from port to starboard."""

    towards: np.ndarray            # (B, 3) unit vectors
    start: np.ndarray              # (B,) [s]
    rate: np.ndarray               # (B,) [Hz]
    level: np.ndarray              # (B, S) [dB]; not finite where there is no sample
    ends: np.ndarray               # (B,) [s] of the last samples
    absorption: float              # [dB/m]


def has_column(line: xr.Dataset) -> bool:
    """Return True if a line has a water column."""
    return set(COLUMN) <= set(line) and line["column_level_db"].size > 0


def fan_of_ping(line: xr.Dataset, ping: int, *, bend: bool = True, tvg: Tvg = "recorder",
                box: Box | None = None) -> ColumnFan:
    """Return the water column of a ping as a picture across its track; `box` [m] sets its extent."""
    head = head_of(line, ping)
    beams = _beams(line, ping, head)
    if beams.start.size < 2:
        raise ValueError(f"ping {ping} has {beams.start.size} beams of the water column that look down and have "
                         "samples; a fan takes two.")
    profile = used_profile(line, head) if bend else SoundSpeedProfile.constant(head.sound_speed)
    level = np.hypot(beams.towards[:, 0], beams.towards[:, 1])
    edges, ways, times = layer_sums(profile, head.depth, level / head.sound_speed, 0.5 * float(beams.ends.max()))
    aside = np.divide(beams.towards[:, 1], level, out=np.ones_like(level), where=level > 0)
    box = _box(line.isel(ping=ping), head, beams, edges, ways * aside[:, None], times) if box is None else box
    cell = max(box[1] - box[0], box[2]) / SIZE
    x = np.arange(box[0], box[1], cell) + 0.5 * cell
    depth = np.arange(0, box[2], cell) + 0.5 * cell
    gain, words = _held_gain(beams, head, tvg)
    samples = 2 * cell / head.sound_speed * float(np.median(beams.rate))                # in a pixel
    power = _averaged(power_from_db(beams.level + gain), int(samples))
    image = np.full((depth.size, x.size), np.nan)
    passed = [np.array([np.interp(head.depth + depth, edges, part, right=np.nan) for part in parts])
              for parts in (ways * aside[:, None], times)]
    for row, (places, after) in enumerate(zip(passed[0].T, passed[1].T, strict=True)):
        image[row] = _row(x, places, 2 * after, beams, power)
    return ColumnFan(image=db_from_power(image), gain=words, box=box,
                     extent=(head.across + x[0] - 0.5 * cell, head.across + x[-1] + 0.5 * cell,
                             head.depth + depth[-1] + 0.5 * cell, head.depth))


def _sampled(line: xr.Dataset) -> list[str]:
    """Return the names of the variables needed to draw the samples of a ping."""
    return [*_SAMPLED, *(name for name in SEVERAL if name in line)]


def _beams(line: xr.Dataset, ping: int, head: RayHead) -> _ColumnBeams:
    record = line[_sampled(line)].isel(ping=ping)
    level = record["column_level_db"].values
    start, rate, angle = (record[f"column_{name}"].values.astype(float) for name in ("start", "rate", "angle"))
    echo = record["travel_time"].values[np.isfinite(record["travel_time"].values)]
    receive = receiving_axes(line, ping, head, np.array([np.median(echo) if echo.size else 0.0]))
    steered = np.append(record["sector_angle"].values, 0.0)                     # the last is for unknown sectors
    number = record["column_sector"].values
    towards = launches(head, angle, steered[np.where((number >= 0) & (number < steered.size - 1), number, -1)], receive)
    known = np.isfinite(level)
    use = (towards[:, 2] > LEAST_DOWN) & known.any(1) & np.isfinite(start) & (rate > 0)
    order = np.flatnonzero(use)[np.argsort(np.arctan2(towards[use, 1], towards[use, 2]), kind="stable")]
    level, start, rate, known = level[order], start[order], rate[order], known[order]
    last = level.shape[1] - known[:, ::-1].argmax(1)
    absorption = record["sector_absorption_db"].values
    absorption = absorption[np.isfinite(absorption) & (absorption >= 0)]
    return _ColumnBeams(towards=towards[order], start=start, rate=rate, level=level, ends=start + last / rate,
                        absorption=float(absorption.mean()) if absorption.size else 0.0)


def _gain(time: np.ndarray, beams: _ColumnBeams, head: RayHead, tvg: Tvg) -> tuple[np.ndarray, str]:
    """Return the gain [dB] at two-way times (...), and its formula."""
    away = xr.Dataset(coords={"range": 0.5 * head.sound_speed * time.ravel()},
                      attrs={"absorption_db": beams.absorption})
    gain, words = display_gain(away, tvg)
    return gain.reshape(time.shape), words


def _held_gain(beams: _ColumnBeams, head: RayHead, tvg: Tvg) -> tuple[np.ndarray, str]:
    """Return the gain (B, S) of the samples, constant from where noise hides the bed, and its formula."""
    time = beams.start[:, None] + np.arange(beams.level.shape[1]) / beams.rate[:, None]
    gain, words = _gain(time, beams, head, tvg)
    shared = int(np.isfinite(beams.level).all(0).sum())
    if not words or not shared or not np.isfinite(beams.level[:, :shared]).all():
        return gain, words
    held = heard_to(beams.level[:, :shared], gain[0, :shared])
    if held == shared:
        return gain, words
    return np.minimum(gain, gain[:, held:held + 1]), f"{words} to {0.5 * head.sound_speed * time[0, held]:.2g} m"


def _box(one: xr.Dataset, head: RayHead, beams: _ColumnBeams, edges: np.ndarray, ways: np.ndarray,
         times: np.ndarray) -> Box:
    """Return the extent of the picture to port, to starboard and below the head [m]."""
    within = times <= 0.5 * beams.ends[:, None]
    below = float((np.where(within, edges, 0) - head.depth).max())
    port, starboard = float(np.nanmin(np.where(within, ways, 0))), float(np.nanmax(np.where(within, ways, 0)))
    there = one["valid"].values.astype(bool) & np.isfinite(one["depth"].values) & np.isfinite(
        one["across_track"].values)
    if there.any():
        depth, across = one["depth"].values[there] - head.depth, one["across_track"].values[there] - head.across
        below = min(below, BELOW * max(float(depth.max()), 1e-3))
        least = 0.3 * below                                  # soundings on one side only must not hide the other side
        port = max(port, min(ASIDE * float(across.min()), -least))
        starboard = min(starboard, max(ASIDE * float(across.max()), least))
    return port, max(starboard, port + 1e-3), max(below, 1e-3)


def _averaged(power: np.ndarray, width: int) -> np.ndarray:
    """Return powers (B, S) averaged over the `width` samples of a pixel."""
    if width < 2:
        return power
    known = np.isfinite(power)
    total, count = (ndimage.uniform_filter1d(part, width, axis=1, mode="constant")
                    for part in (np.where(known, power, 0), known.astype(float)))
    return np.where(known, total / np.maximum(count, 1e-9), np.nan)


def _row(x: np.ndarray, places: np.ndarray, times: np.ndarray, beams: _ColumnBeams, power: np.ndarray) -> np.ndarray:
    """Return powers at places x of one depth, which the beams' rays pass at `places` after two-way `times`."""
    there = np.flatnonzero(np.isfinite(places) & np.isfinite(times))
    if there.size < 2:
        return np.full(x.size, np.nan)
    places = np.maximum.accumulate(places[there])
    at = np.interp(x, places, np.arange(there.size), left=np.nan, right=np.nan)
    time = np.interp(x, places, times[there])
    inside = np.isfinite(at)
    first = np.clip(np.nan_to_num(at).astype(int), 0, there.size - 2)
    share = np.nan_to_num(at) - first
    total, weight = np.zeros(x.size), np.zeros(x.size)
    for beam, part in ((there[first], 1 - share), (there[first + 1], share)):
        sample = np.rint((time - beams.start[beam]) * beams.rate[beam]).astype(np.int64)
        found = power[beam, np.clip(sample, 0, power.shape[1] - 1)]
        use = inside & (sample >= 0) & (sample < power.shape[1]) & np.isfinite(found)
        total += np.where(use, part * found, 0)
        weight += np.where(use, part, 0)
    with np.errstate(invalid="ignore"):
        return np.where(weight > 0, total / weight, np.nan)


def column_window(*images: np.ndarray) -> tuple[float, float]:
    """Return the levels [dB] of the first and the last colour, which include the ring of side lobes under the bed."""
    shown = np.concatenate([image[np.isfinite(image)] for image in images])
    if not shown.size:
        return 0.0, 1.0
    low, high = np.percentile(shown, [FAINT, BRIGHT])
    return float(np.clip(low, high - DYNAMIC_DB, high - LEAST_DB)), float(high)


def curtain(line: xr.Dataset, tvg: Tvg = "recorder") -> Curtain:
    """Return the water column of all pings; only a block of pings is in memory at a time."""
    pings, still = line.sizes["ping"], line[[name for name in (*HELD, *SEVERAL) if name in line]].load()
    heads = [head_of(still, ping) for ping in range(pings)]
    reach, length = _reach(line, heads)
    rows = max(min(CURTAIN_ROWS, int(0.8 * reach / length)), 1)
    edges = np.linspace(0, reach, rows + 1)
    nadir, largest = np.full((2, rows, pings), np.nan)
    words = ""
    for ping, head in enumerate(heads):
        if ping % BLOCK == 0:
            block = line[_sampled(line)].isel(ping=slice(ping, ping + BLOCK)).load()
        beams = _beams(block, ping % BLOCK, head)
        if beams.start.size:
            down = int(np.argmax(beams.towards[:, 2]))
            nadir[:, ping], words = _by_row(beams, np.array([down]), head, edges, tvg)
            largest[:, ping], words = _by_row(beams, np.arange(beams.start.size), head, edges, tvg)
    if not np.isfinite(largest).any():
        raise ValueError("no ping has samples of the water column, so there is no curtain to draw.")
    time = line["ping_time"].values
    timed = bool(pings < 2 or (np.isfinite(time).all() and (np.diff(time) > 0).all()))
    return Curtain(edges=_edges_of(time if timed else np.arange(pings, dtype=float)), timed=timed, slant_range=edges,
                   nadir=db_from_power(nadir), largest=db_from_power(largest), bottom=_bottom(line, heads), gain=words)


def _reach(line: xr.Dataset, heads: list[RayHead]) -> tuple[float, float]:
    """Return the depth of the curtain and the length of its longest samples [m]."""
    rate, start = line["column_rate"].values, line["column_start"].values
    known = np.isfinite(start) & (rate > 0)
    if not known.any():
        return 1.0, 1.0
    speed = float(np.median([head.sound_speed for head in heads]))
    reach = 0.5 * speed * float((start[known] + line.sizes["column_sample"] / rate[known]).max())
    below = line["depth"].values[line["valid"].values.astype(bool)]
    below = below[np.isfinite(below)]
    if below.size:
        reach = min(reach, CURTAIN_BELOW * max(float(below.max()) - min(head.depth for head in heads), 1e-3))
    return max(reach, 1e-3), 0.5 * speed / float(rate[known].min())


def _by_row(beams: _ColumnBeams, chosen: np.ndarray, head: RayHead, edges: np.ndarray,
            tvg: Tvg) -> tuple[np.ndarray, str]:
    """Return the mean power in each row, with gain, of the strongest of the chosen beams, and the gain's formula."""
    rows, words = edges.size - 1, ""
    samples = np.arange(beams.level.shape[1])
    best = np.full(rows, -np.inf)
    timing = np.stack([beams.start[chosen], beams.rate[chosen]], 1)
    for start, rate in np.unique(timing, axis=0):
        same = beams.level[chosen[(timing == (start, rate)).all(1)]]
        level = np.fmax.reduce(np.where(np.isposinf(same), np.nan, same), axis=0)
        time = start + samples / rate
        row = np.searchsorted(edges, 0.5 * head.sound_speed * time, side="right") - 1
        use = np.isfinite(level) & (row >= 0) & (row < rows)
        gain, words = _gain(time, beams, head, tvg)
        count = np.bincount(row[use], minlength=rows)
        with np.errstate(invalid="ignore"):
            mean = np.bincount(row[use], power_from_db(level[use] + gain[use]), rows) / count
        best = np.where(count > 0, np.maximum(best, np.nan_to_num(mean)), best)
    return np.where(np.isfinite(best), best, np.nan), words


def _bottom(line: xr.Dataset, heads: list[RayHead]) -> np.ndarray:
    steep = np.abs(line["across_track"].values) / np.maximum(line["depth"].values, 1e-3)
    there = line["valid"].values.astype(bool) & np.isfinite(steep) & np.isfinite(line["travel_time"].values)
    nearest = np.where(there, steep, np.inf).argmin(1)
    pings = np.arange(nearest.size)
    speed = np.array([head.sound_speed for head in heads])
    time = line["travel_time"].values[pings, nearest]
    return np.where(there[pings, nearest] & (steep[pings, nearest] < 0.3), 0.5 * speed * time, np.nan)


def _edges_of(middle: np.ndarray) -> np.ndarray:
    if middle.size < 2:
        return (middle[0] if np.isfinite(middle[0]) else 0.0) + np.array([-0.5, 0.5])
    between = 0.5 * (middle[1:] + middle[:-1])
    return np.concatenate([[2 * middle[0] - between[0]], between, [2 * middle[-1] - between[-1]]])
