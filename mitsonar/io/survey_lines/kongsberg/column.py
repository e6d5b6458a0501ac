"""Write #MWC, the water column of a ping in KMALL: samples in steps of half a decibel, beam after beam.

    level + 2 a R = value / 2 - offset      value -128 to 127; one offset a file, set by the first ping's loudest sample

a is the absorption of the beam's sector, which the format's gain always holds; its X log R is 0 log R. The time of a
beam's first sample after the transmission of its sector is its number over the sampling rate, so that starts are
rounded to half a sample.
"""
from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np

from ..directions import from_vertical
from ..lines import LineToWrite, Ping
from ..passage import LinePassage
from .kmall_sensors import body, datagram

VERSION = 2
TOP = 50.0                                 # dB, value of the first ping's loudest sample; 63.5 is the largest
LAST = 65_535


@dataclass(frozen=True, kw_only=True, eq=False)
class KongsbergColumn:
    """Water column of a ping in the terms of KMALL."""

    rate: float  # [Hz]
    angle: np.ndarray  # (W,) [rad]
    vertical_deg: np.ndarray  # (W,) [degrees]: from the vertical, positive to port
    sector: np.ndarray  # (W,)
    start: np.ndarray  # (W,): number of the first sample
    values: list[np.ndarray]  # samples of each beam
    outside: tuple[int, int]  # numbers of samples louder and quieter than the values reach


def offset_of(ping: Ping) -> int | None:
    """Return the offset [dB] that suits a ping's water column, or None if it has no sample."""
    if ping.get("column_level_db") is None or not np.isfinite(level := _gained(ping)).any():
        return None
    return int(np.clip(np.rint(TOP - float(level[np.isfinite(level)].max())), -128, 127))


def _gained(ping: Ping) -> np.ndarray:
    """Return the levels (W, sample) [dB] with the gain against absorption."""
    level, absorption = ping["column_level_db"], ping["sector_absorption_db"][ping["column_sector"]]
    time = ping["column_start"][:, None] + (np.arange(level.shape[1]) + 0.5) / ping["column_rate"][:, None]
    return level + absorption[:, None] * float(ping["head_sound_speed"]) * time          # R = c t / 2


def column_of(line: LineToWrite, ping: Ping, offset: int | None) -> KongsbergColumn | None:
    """Return a ping's water column, or None if it has none."""
    if offset is None or not np.isfinite(ping["column_level_db"]).any():
        return None
    formed = np.isfinite(ping["column_angle"])
    angle, level, rates = ping["column_angle"][formed], _gained(ping)[formed], ping["column_rate"][formed]
    if rates.size and not np.allclose(rates, rates[0], rtol=1e-6):
        raise ValueError(f"beams of the water column have rates from {rates.min():g} to {rates.max():g} Hz, but "
                         "KMALL has one a ping; write a .nc, or keep no water column.")
    rate = float(rates[0]) if rates.size else 0.0
    finite = np.isfinite(level)
    first = np.where(finite.any(axis=1), np.argmax(finite, axis=1), 0)
    end = np.where(finite.any(axis=1), level.shape[1] - np.argmax(finite[:, ::-1], axis=1), 0)
    start = np.maximum(np.rint(np.nan_to_num(ping["column_start"][formed]) * rate + first), 0).astype(int)
    if angle.size and (start + end - first).max() > LAST:
        raise ValueError(f"the water column ends after sample {LAST}, the last that KMALL can count; write a .nc.")
    steps = np.rint(2 * (level + offset))
    values = np.where(finite, np.clip(steps, -128, 127), -128).astype(np.int8)
    return KongsbergColumn(rate=rate, angle=angle, vertical_deg=np.degrees(from_vertical(line, ping, angle)),
                           sector=ping["column_sector"][formed], start=start,
                           values=[row[begin:stop] for row, begin, stop in zip(values, first, end)],
                           outside=(int((steps[finite] > 127).sum()), int((steps[finite] < -128).sum())))


def water_column(passage: LinePassage, ping: Ping, sounder: int, column: KongsbergColumn, offset: int) -> bytes:
    """Return the #MWC of a ping."""
    sectors = ping["sector_frequency"].size
    parts = [struct.pack("<2H", 1, 1), struct.pack("<2H8B", *body(ping).values()),
             struct.pack("<3Hhf", 12, sectors, 16, 0, ping["below_surface"] - passage.draught)]
    parts += [struct.pack("<3fHh", np.degrees(tilt), frequency, 0.0, index, 0)
              for index, (tilt, frequency) in enumerate(zip(ping["sector_angle"], ping["sector_frequency"]))]
    parts.append(struct.pack("<2H3Bb2f", 16, column.angle.size, 16, 0, 0, offset, column.rate,
                             float(ping["head_sound_speed"])))
    detected = _detected(ping, column)
    parts += [struct.pack("<f4Hf", angle, start, min(round(sample), LAST), sector, values.size, sample)
              + values.tobytes() for angle, start, sector, values, sample in zip(
                  column.vertical_deg, column.start, column.sector, column.values, detected.tolist())]
    return datagram("MWC", VERSION, sounder, float(ping["since"]), b"".join(parts))


def _detected(ping, column):
    """Return the sample number of the sounding nearest to each beam, 0 if all are farther than the next beam."""
    valid = ping["valid"]
    if not valid.any() or not column.angle.size:
        return np.zeros(column.angle.size)
    apart = np.abs(ping["angle"][valid][None] - column.angle[:, None])
    spacing = np.abs(np.gradient(column.angle)) if column.angle.size > 1 else np.full(1, np.inf)
    sample = ping["travel_time"][valid][np.argmin(apart, axis=1)] * column.rate
    return np.where(apart.min(axis=1) <= spacing, sample, 0.0)
