"""#MWC, the water column of a ping in KMALL: beams of samples in steps of half a decibel.

    level = value / 2 - offset      value -128 to 127; one offset a file, after its first ping's loudest sample

No gain over range is applied (0 log R). A beam's first sample lies at its number over the rate after its sector's
transmission: starts are told to half a sample.
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
TOP = 50.0                                 # dB, where the first ping's loudest sample goes; 63.5 is full
LAST = 65_535


@dataclass(frozen=True, kw_only=True, eq=False)
class KongsbergColumn:
    """Hold a ping's water column as files have it."""

    rate: float  # [Hz]
    angle: np.ndarray  # (W,) [rad]
    vertical_deg: np.ndarray  # (W,) [degrees]: from the vertical, positive to port
    sector: np.ndarray  # (W,): sector, number of the first sample, samples
    start: np.ndarray  # (W,): sector, number of the first sample, samples
    count: np.ndarray  # (W,): sector, number of the first sample, samples
    values: list[np.ndarray]
    outside: tuple[int, int]  # samples that are louder and quieter than the steps reach

    def nearest(self, angle: np.ndarray) -> np.ndarray:
        """Return the number (B,) of the beam next to angles (B,)."""
        return np.argmin(np.abs(self.angle[None] - angle[:, None]), axis=1)


def offset_of(ping: Ping) -> int | None:
    """Return the offset [dB] that suits a ping's water column; None where it has no sample."""
    level = ping.get("column_level_db")
    if level is None or not np.isfinite(level).any():
        return None
    return int(np.clip(np.rint(TOP - float(level[np.isfinite(level)].max())), -128, 127))


def column_of(line: LineToWrite, ping: Ping, offset: int | None) -> KongsbergColumn | None:
    """Take a ping's water column; None where there is none."""
    if offset is None or not np.isfinite(ping["column_level_db"]).any():
        return None
    there = np.isfinite(ping["column_angle"])
    angle, level, rates = ping["column_angle"][there], ping["column_level_db"][there], ping["column_rate"][there]
    if rates.size and not np.allclose(rates, rates[0], rtol=1e-6):
        raise ValueError(f"beams of the water column have rates from {rates.min():g} to {rates.max():g} Hz, KMALL has "
                         "one a ping; write a .nc, or keep no water column.")
    rate = float(rates[0]) if rates.size else 0.0
    finite = np.isfinite(level)
    first = np.where(finite.any(axis=1), np.argmax(finite, axis=1), 0)
    end = np.where(finite.any(axis=1), level.shape[1] - np.argmax(finite[:, ::-1], axis=1), 0)
    start = np.maximum(np.rint(np.nan_to_num(ping["column_start"][there]) * rate + first), 0).astype(int)
    if angle.size and (start + end - first).max() > LAST:
        raise ValueError(f"the water column ends after sample {LAST}, the last that KMALL can count; write a .nc.")
    steps = np.rint(2 * (level + offset))
    whole = np.where(finite, np.clip(steps, -128, 127), -128).astype(np.int8)
    return KongsbergColumn(rate=rate, angle=angle, vertical_deg=np.degrees(from_vertical(line, ping, angle)),
                  sector=ping["column_sector"][there], start=start, count=end - first,
                  values=[row[begin:stop] for row, begin, stop in zip(whole, first, end)],
                  outside=(int((steps[finite] > 127).sum()), int((steps[finite] < -128).sum())))


def water_column(line: LineToWrite, passage: LinePassage, ping: Ping, number: int, sounder: int,
                 column: KongsbergColumn, *,
                 offset: int) -> bytes:
    """Return a ping's #MWC."""
    sectors = ping["sector_frequency"].size
    parts = [struct.pack("<2H", 1, 1), struct.pack("<2H8B", *body(ping, number).values()),
             struct.pack("<3Hhf", 12, sectors, 16, 0, float(ping["ping_depth"] - passage.draught))]
    parts += [struct.pack("<3fHh", np.degrees(tilt), frequency, 0.0, index, 0)
              for index, (tilt, frequency) in enumerate(zip(ping["sector_angle"], ping["sector_frequency"]))]
    parts.append(struct.pack("<2H3Bb2f", 16, column.angle.size, 16, 0, 0, offset, column.rate,
                             float(ping["head_sound_speed"])))
    detected = _detected(ping, column)
    parts += [struct.pack("<f4Hf", angle, start, min(round(heard), LAST), sector, values.size, heard) + values.tobytes()
              for angle, start, sector, values, heard in zip(column.vertical_deg, column.start, column.sector,
                                                             column.values, detected.tolist())]
    return datagram("MWC", VERSION, sounder, float(ping["since"]), b"".join(parts))


def _detected(ping, column):
    """Samples to the sounding next to each beam, 0 where none is as near as the next beam."""
    valid = ping["valid"]
    if not valid.any() or not column.angle.size:
        return np.zeros(column.angle.size)
    apart = np.abs(ping["angle"][valid][None] - column.angle[:, None])
    spacing = np.abs(np.gradient(column.angle)) if column.angle.size > 1 else np.full(1, np.inf)
    found = ping["travel_time"][valid][np.argmin(apart, axis=1)] * column.rate
    return np.where(apart.min(axis=1) <= spacing, found, 0.0)
