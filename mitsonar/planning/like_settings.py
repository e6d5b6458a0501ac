"""Settings of a `multibeam` sensor that a recorded line tells: sectors, beams, lever arms, mounting."""
from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

from mitsonar.units import deg_from_radians, khz_from_hertz

WIDEST = 170.0                     # [degrees] of a swath


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Hold them."""

    preset: str  # whose frequencies are nearest
    pings: int  # cycles of transmissions
    ping_rate: float  # [Hz]
    rows: tuple[tuple[str, str, str], ...]  # of XML
    head_depth: float  # [m]: mean depth of the transmit array
    words: tuple[str, ...] = ()  # clauses on what of the line the scene leaves out


def settings_of(soundings: xr.Dataset, presets: Mapping[str, Mapping[str, Any]]) -> Settings:
    """Take the settings out of a line: those of its most frequent mode, by the sectors' frequencies.

    Two heads that look aside become one that looks down, between them, and sees what both see.
    """
    modes = Counter(_mode(soundings, ping) for ping in np.flatnonzero(soundings["valid"].values.any(1)))
    mode = modes.most_common(1)[0][0] if modes else ()
    some = [ping for ping in range(soundings.sizes["ping"]) if soundings["valid"].values[ping].any()
            and _mode(soundings, ping) == mode]
    one = soundings.isel(ping=some)
    preset = _nearest(mode, presets)
    offset, heads = soundings["transmit_offset"].values, "head" in soundings
    each = soundings["head_receive_mounting" if heads else "receive_mounting"].values.reshape(-1, 3)
    places = soundings["head_receive_offset" if heads else "receive_offset"].values.reshape(-1, 3)
    number = one["head"].values if heads else np.zeros(one.sizes["ping"], int)
    mounting, between = each.mean(0) * ((0, 1, 1) if heads else (1, 1, 1)), places.mean(0) - offset
    sent, swaths = _cycles(soundings)
    arm = Rotation.from_euler("YX", np.stack([one["ping_pitch"].values, one["ping_roll"].values], -1)).apply(offset)
    depth = float(np.mean(one["ping_depth"].values + arm[:, 2]))
    beams = round(np.median(one["valid"].values.sum(1)) * len(each))
    vertical = one["angle"].values - (one["ping_roll"].values + each[number, 0])[:, None]
    swath = min(2 * deg_from_radians(float(np.nanmedian(np.nanmax(np.abs(vertical), axis=1)))), WIDEST)
    rows: list[tuple[str, str, str]] = [
        ("integer", "beams", str(max(beams, 2))), ("float", "swath_deg", f"{swath:.4g}"),
        ("string", "beam_spacing", _spacing(np.sort(vertical, axis=1))),
        ("string", "receive_place", _words(between)), ("string", "mounting_deg", _words(deg_from_radians(mounting)))]
    if mode:
        rows += _sectors(one, vertical, swath)
        if not any(name == "source_level_db" for _, name, _ in rows):         # the file does not tell it
            rows.append(("string", "source_level_db", _words(presets[preset]["source_level_db"][:1])))
    rows.append(("integer", "swaths", str(swaths)))
    if swaths == 2:
        heard = soundings.isel(ping=soundings["valid"].values.any(1))
        along = np.nanmedian(heard["transmit_angle"].values, axis=1) + heard["ping_pitch"].values
        rows.append(("float", "swath_step_deg", f"{2 * deg_from_radians(float(np.std(along))):.4g}"))
    rate = (sent.size - 1) / max(sent[-1] - sent[0], 1e-3) if sent.size > 1 else 1.0
    return Settings(preset=preset, pings=sent.size, ping_rate=float(rate), rows=tuple(rows), head_depth=depth,
                    words=tuple(_words_on(modes, swaths, each)))


def _words_on(modes, swaths, mountings):
    """Say what settings of pings and heads are not in the scene."""
    (mode, count), *others = modes.most_common() or [((), 0)]
    if len(others) == 1 and swaths == 2:
        yield (f"both swaths are sent at {_kilohertz(mode)}, though the line's other swath is at "
               f"{_kilohertz(others[0][0])}")
    elif others:
        left = "; ".join(_kilohertz(other) for other, _ in others)
        yield (f"the line has pings of {1 + len(others)} modes, and the scene has that of {count} of {modes.total()}, "
               f"at {_kilohertz(mode)}: left out are {left}; the bed and its strengths are of all")
    if len(mountings) > 1:
        turned = " and ".join(f"{angle:.1f}" for angle in deg_from_radians(mountings[:, 0]))
        yield (f"{len(mountings)} receive arrays, rolled by {turned} degrees, became one between them that looks down "
               "and sees what all of them see")


def _kilohertz(mode):
    """Word the frequencies of a mode."""
    return "/".join(f"{frequency:.4g}" for frequency in khz_from_hertz(np.array(mode))) + " kHz"


def _cycles(soundings):
    """Return the times of cycles, and how many swaths most have: a second one is sent before the first is heard."""
    time, heads = soundings["ping_time"].values, soundings.sizes.get("receive_head", 1)
    first = np.diff(time, prepend=-np.inf) > 0.5 * np.nanmin(soundings["travel_time"].values)
    return time[first], 2 if time.size >= 1.5 * first.sum() * heads else 1


def _nearest(mode, presets):
    """Name the preset whose mean frequency is nearest, in octaves."""
    if not mode:
        return next(iter(presets))
    wanted = khz_from_hertz(np.mean(mode))
    return min(presets, key=lambda name: abs(np.log(np.mean(presets[name]["frequency_khz"]) / wanted)))


def _mode(soundings, ping):
    row = soundings["sector_frequency"].values[ping]
    return tuple(row[np.isfinite(row)])


def _spacing(vertical):
    """Say what grows more evenly from beam to beam: the angle, or the distance on a level bed."""
    def unevenness(values: np.ndarray) -> float:
        steps = np.diff(values, axis=1)
        steps = steps[np.isfinite(steps)]
        return float(np.std(steps) / np.mean(steps)) if steps.size and np.mean(steps) > 0 else np.inf

    return "distance" if unevenness(np.tan(vertical)) < unevenness(vertical) else "angle"


def _sectors(one, vertical, swath):
    """Return the rows of lists, from port to starboard: sectors that soundings were made with."""
    number = np.where(one["valid"].values, one["sector"].values, -1)
    middles = {int(sector): np.nanmedian(vertical[number == sector]) for sector in np.unique(number[number >= 0])}
    order = sorted(middles, key=lambda sector: middles[sector])
    edges = [0.5 * (_end(vertical, number == left, np.max) + _end(vertical, number == right, np.min))
             for left, right in zip(order, order[1:])]
    edges = np.clip(deg_from_radians(np.array(edges)), -swath / 2, swath / 2)
    tilt = one["sector_angle"].values + (one["ping_pitch"].values + float(one["transmit_mounting"][1]))[:, None]

    def column(values: np.ndarray) -> np.ndarray:
        return np.median(values, axis=0)[order]

    delay = column(one["sector_delay"].values)
    rows = {"frequency_khz": khz_from_hertz(column(one["sector_frequency"].values)),
            "pulse_ms": 1e3 * column(one["sector_pulse_length"].values), "sector_edges_deg": edges,
            "sector_tilt_deg": deg_from_radians(column(tilt)), "sector_delay_ms": 1e3 * (delay - delay.min()),
            "source_level_db": column(one["sector_source_level_db"].values)}
    yield from (("string", name, _words(values)) for name, values in rows.items() if np.isfinite(values).all())
    yield "string", "pulse", "cw"


def _end(vertical, some, last):
    """Return where a sector ends, the median of pings."""
    return np.median([last(row[there]) for row, there in zip(vertical, some) if there.any()])


def _words(values):
    return ", ".join(f"{value:.6g}" for value in np.asarray(values) + 0.0)
