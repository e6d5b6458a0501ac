"""Settings of a `multibeam` sensor from a recorded line: sectors, beams, lever arms, mounting."""
from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from mitsonar.device.rotations import mounted
from mitsonar.units import deg_from_radians, khz_from_hertz
from mitsonar.water.absorption import absorption_db

WIDEST = 170.0                     # [degrees]: largest swath
WIDE_SHARE = 0.95                  # of the pings have no wider swath than the scene
USUAL = (400e3, 300e3, 200e3, 100e3, 70e3, 30e3, 12e3)          # [Hz]: of echo sounders (Lurton 2010, chapter 8)
MOST_LOSS_DB = 60.0                # both ways, of a frequency that a file does not state


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of a sensor after a recorded line."""

    preset: str  # with the nearest frequencies
    pings: int  # cycles of transmissions
    ping_rate: float  # [Hz]
    rows: tuple[tuple[str, str, str], ...]  # tag, name and value of XML elements
    head_depth: float  # [m]: mean depth of the transmit array
    chosen: np.ndarray  # (P,): numbers of the line's pings of this mode
    sectors: tuple[int, ...]  # the line's numbers of the scene's sectors, from port to starboard
    swaths: int
    words: tuple[str, ...] = ()  # clauses on the differences between line and scene


def settings_of(soundings: xr.Dataset, presets: Mapping[str, Mapping[str, Any]]) -> Settings:
    """Return the settings of the mode with most soundings of a line; a mode is a set of sector frequencies.

    Two tilted heads become one level head between them with the swath of both.
    """
    modes = Counter[tuple]()
    for ping, count in enumerate(soundings["valid"].values.sum(1)):
        modes.update({_mode(soundings, ping): int(count)} if count else {})
    mode = modes.most_common(1)[0][0] if modes else ()
    numbers = [ping for ping in range(soundings.sizes["ping"])
               if soundings["valid"].values[ping].any() and _mode(soundings, ping) == mode]
    chosen = soundings.isel(ping=numbers)
    usual = None if mode else _usual(soundings)
    preset = _nearest(mode if usual is None else (usual,), presets)
    offset, heads = soundings["transmit_offset"].values, "head" in soundings
    mountings = soundings["head_receive_mounting" if heads else "receive_mounting"].values.reshape(-1, 3)
    offsets = soundings["head_receive_offset" if heads else "receive_offset"].values.reshape(-1, 3)
    head = chosen["head"].values if heads else np.zeros(chosen.sizes["ping"], int)
    mounting, between = mountings.mean(0) * ((0, 1, 1) if heads else (1, 1, 1)), offsets.mean(0) - offset
    sent, swaths = _cycles(soundings)
    arm = mounted(offset, chosen["ping_roll"].values, chosen["ping_pitch"].values)
    depth = float(np.mean(chosen["ping_depth"].values + arm[:, 2]))
    beams = round(np.median(chosen["valid"].values.sum(1)) * len(mountings))
    vertical = chosen["angle"].values - (chosen["ping_roll"].values + mountings[head, 0])[:, None]
    widest = np.nanquantile(np.nanmax(np.abs(vertical), axis=1), WIDE_SHARE)
    swath = min(2 * deg_from_radians(float(widest)), WIDEST)
    rows: list[tuple[str, str, str]] = [
        ("integer", "beams", str(max(beams, 2))), ("float", "swath_deg", f"{swath:.4g}"),
        ("string", "beam_spacing", _spacing(np.sort(vertical, axis=1))),
        ("string", "receive_place", _words(between)), ("string", "mounting_deg", _words(deg_from_radians(mounting)))]
    if mode:
        rows += _sectors(chosen, vertical, swath)
        if not any(name == "source_level_db" for _, name, _ in rows):         # the file lacks it
            rows.append(("string", "source_level_db", _words(presets[preset]["source_level_db"][:1])))
    elif usual is not None:
        rows += _scaled(presets[preset], usual)
    rows.append(("integer", "swaths", str(swaths)))
    if swaths == 2:
        used = soundings.isel(ping=soundings["valid"].values.any(1))
        along = np.nanmedian(used["transmit_angle"].values, axis=1) + used["ping_pitch"].values
        rows.append(("float", "swath_step_deg", f"{2 * deg_from_radians(float(np.std(along))):.4g}"))
    rate = (sent.size - 1) / max(sent[-1] - sent[0], 1e-3) if sent.size > 1 else 1.0
    return Settings(preset=preset, pings=sent.size, ping_rate=float(rate), rows=tuple(rows), head_depth=depth,
                    chosen=np.array(numbers, int), sectors=tuple(_order(chosen, vertical)), swaths=swaths,
                    words=(*_words_on(modes, swaths, mountings), *_words_on_frequency(usual, preset)))


def _usual(soundings):
    """Return the highest usual frequency [Hz] whose absorption both ways is bearable at the longest echo."""
    way = float(np.nanmax(soundings["travel_time"].values)) * float(np.median(soundings["head_sound_speed"].values))
    return next((frequency for frequency in USUAL if way * float(absorption_db(frequency)) <= MOST_LOSS_DB), USUAL[-1])


def _scaled(preset, frequency):
    """Yield the rows of one sector of the preset's arrays in wavelengths: as many periods a pulse, driven alike."""
    if len(preset["frequency_khz"]) == 1 and np.isclose(1e3 * preset["frequency_khz"][0], frequency):
        return
    ratio = 1e3 * float(np.mean(preset["frequency_khz"])) / frequency
    values = {"frequency_khz": khz_from_hertz(frequency), "pulse_ms": ratio * np.mean(preset["pulse_ms"]),
              "sector_edges_deg": [], "sector_delay_ms": 0.0,
              "source_level_db": np.max(preset["source_level_db"]) + 20 * np.log10(ratio)}
    yield from (("string", name, _words(np.atleast_1d(value))) for name, value in values.items())
    yield "string", "pulse", "cw"


def _words_on_frequency(usual, preset):
    """Yield a clause on a frequency that the file does not state."""
    if usual is not None:
        yield (f"the file states no frequencies; the scene has {khz_from_hertz(usual):g} kHz, the highest usual one "
               f"whose absorption is below {MOST_LOSS_DB:g} dB at the longest echo, and arrays, pulse and source level "
               f"of {preset} scaled to it")


def _words_on(modes, swaths, mountings):
    """Yield clauses on the settings of pings and heads that the scene lacks."""
    (mode, count), *others = modes.most_common() or [((), 0)]
    if len(others) == 1 and swaths == 2:
        yield (f"both swaths are sent at {_kilohertz(mode)}, though the line's other swath is at "
               f"{_kilohertz(others[0][0])}")
    elif others:
        left = "; ".join(_kilohertz(other) for other, _ in others)
        yield (f"the line has pings of {1 + len(others)} modes; the scene takes the mode of {count} of {modes.total()} "
               f"soundings, {_kilohertz(mode)}, and leaves out {left}; the bed uses all pings, its strengths those of "
               "this mode")
    if len(mountings) > 1:
        turned = " and ".join(f"{angle:.1f}" for angle in deg_from_radians(mountings[:, 0]))
        yield (f"{len(mountings)} receive arrays, rolled by {turned} degrees, became one level array between them "
               "with the swath of all")


def _kilohertz(mode):
    """Return the frequencies of a mode as text."""
    return "/".join(f"{frequency:.4g}" for frequency in khz_from_hertz(np.array(mode))) + " kHz"


def _cycles(soundings):
    """Return the times of cycles, and the swaths per cycle: a second ping precedes the first echo."""
    time, heads = soundings["ping_time"].values, soundings.sizes.get("receive_head", 1)
    first = np.diff(time, prepend=-np.inf) > 0.5 * np.nanmin(soundings["travel_time"].values)
    return time[first], 2 if time.size >= 1.5 * first.sum() * heads else 1


def _nearest(mode, presets):
    """Return the preset whose mean frequency is nearest in octaves."""
    if not mode:
        return next(iter(presets))
    wanted = khz_from_hertz(np.mean(mode))
    return min(presets, key=lambda name: abs(np.log(np.mean(presets[name]["frequency_khz"]) / wanted)))


def _mode(soundings, ping):
    row = soundings["sector_frequency"].values[ping]
    return tuple(row[np.isfinite(row)])


def _spacing(vertical):
    """Return which grows more evenly from beam to beam: "angle", or "distance" on a level bed."""
    def unevenness(values: np.ndarray) -> float:
        steps = np.diff(values, axis=1)
        steps = steps[np.isfinite(steps)]
        return float(np.std(steps) / np.mean(steps)) if steps.size and np.mean(steps) > 0 else np.inf

    return "distance" if unevenness(np.tan(vertical)) < unevenness(vertical) else "angle"


def _order(pings, vertical):
    """Return the numbers of sectors with soundings from port to starboard."""
    number = np.where(pings["valid"].values, pings["sector"].values, -1)
    middles = {int(sector): np.nanmedian(vertical[number == sector]) for sector in np.unique(number[number >= 0])}
    return sorted(middles, key=lambda sector: middles[sector])


def _sectors(pings, vertical, swath):
    """Yield the rows of lists with an entry per sector used, from port to starboard."""
    number, order = np.where(pings["valid"].values, pings["sector"].values, -1), _order(pings, vertical)
    edges = [0.5 * (_end(vertical, number == left, np.max) + _end(vertical, number == right, np.min))
             for left, right in zip(order, order[1:])]
    edges = np.clip(deg_from_radians(np.array(edges)), -swath / 2, swath / 2)
    tilt = pings["sector_angle"].values + (pings["ping_pitch"].values + float(pings["transmit_mounting"][1]))[:, None]

    def column(values: np.ndarray) -> np.ndarray:
        return np.median(values, axis=0)[order]

    delay = column(pings["sector_delay"].values)
    rows = {"frequency_khz": khz_from_hertz(column(pings["sector_frequency"].values)),
            "pulse_ms": 1e3 * column(pings["sector_pulse_length"].values), "sector_edges_deg": edges,
            "sector_tilt_deg": deg_from_radians(column(tilt)), "sector_delay_ms": 1e3 * (delay - delay.min()),
            "source_level_db": column(pings["sector_source_level_db"].values)}
    yield from (("string", name, _words(values)) for name, values in rows.items() if np.isfinite(values).all())
    yield "string", "pulse", "cw"


def _end(vertical, within, last):
    """Return the end of a sector, as the median over pings."""
    return np.median([last(row[there]) for row, there in zip(vertical, within) if there.any()])


def _words(values):
    return ", ".join(f"{value:.6g}" for value in np.asarray(values) + 0.0)
