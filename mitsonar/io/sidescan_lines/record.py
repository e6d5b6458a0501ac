"""Dataset of a recorded sidescan, as `mitsonar.io.sidescan_lines.read` returns it.

Dimensions: ``ping``, ``side`` (port, starboard, or the one that the file has) and ``sample`` (nearest first, padded
with zeros). Values are those of the file: neither its gain nor its scale is known, so that only ratios over short
ranges are meaningful. The number that the recorder's converter had is amplitude · 2^-weight. Values that the file does
not hold are NaN. Roll is positive starboard down, pitch bow up, heave up. Headings are from true north where positions
are in degrees.

Attributes: ``format``, ``source`` (name of the file), ``bits`` and ``sample_type`` of a sample, ``frequency`` [Hz] or
None, ``channel_numbers`` that were read, ``channels`` (all of the file, each with number, side, frequency and name),
``geographic`` (positions in degrees), ``lost_pings``, ``left_out`` (what the file holds besides), ``navigation_from``
(where positions and attitude come from) and texts of the file: ``recording_program``, ``sonar``, ``note``.
"""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from mitsonar.device.record_table import RecordTable, rows

__all__ = ["SIDES", "VARIABLES", "SideChannel", "chosen", "dataset", "is_recorded"]

SIDES = ("port", "starboard")
MOST_BYTES = 4_000_000_000         # of the samples in memory
MOST_LOST = 10_000                 # pings; where numbers jump farther, the recorder counts anew
USUAL_SPEED = 1500.0               # [m/s], where the file has no sound speed
MOST_NAMED = 8                     # channels in a sentence
_PING, _SIDE = ("ping",), ("ping", "side")

VARIABLES = RecordTable([
    *rows("ping", _PING, True,
          ("ping_time", "f8", "s", "of the ping, after 1970-01-01 UTC"),
          ("ping_number", "i8", "1", "as the recorder counts"),
          ("lost", "i8", "1", "pings that are missing before this one, by the recorder's numbers"),
          ("altitude", "f8", "m", "of the sonar above the bed"),
          ("sensor_depth", "f8", "m", "of the sonar below the surface"),
          ("heading", "f8", "rad", "clockwise from north"),
          ("pitch", "f8", "rad", "bow up"),
          ("roll", "f8", "rad", "starboard down"),
          ("heave", "f8", "m", "up"),
          ("speed", "f8", "m/s", "over ground"),
          ("sound_speed", "f8", "m/s", "that the recorder worked with")),
    *rows("ping", _PING, False,
          ("longitude", "f8", "degrees", "of the sonar, else of the ship, WGS 84"),
          ("latitude", "f8", "degrees", "likewise"),
          ("x", "f8", "m", "easting of the sonar, else of the ship"),
          ("y", "f8", "m", "northing likewise")),
    *rows("side", _SIDE, True,
          ("samples", "i8", "1", "number of samples of the ping; the rest of a row is padding"),
          ("sample_interval", "f8", "s", "from sample to sample"),
          ("sample_start", "f8", "s", "at which the first sample begins, after the transmission"),
          ("slant_range", "f8", "m", "at the end of the last sample"),
          ("weight", "i8", "1", "exponent of the scale: the converter's number is amplitude · 2^-weight")),
    *rows("side", _SIDE, False,
          ("gain_code", "i8", "1", "gain of the recorder, in its own code"),
          ("initial_gain_code", "i8", "1", "likewise, at the transmission"),
          ("processing_flags", "i8", "1", "of XTF: 4 for a gain over range"),
          ("pulse_length", "f8", "s", "of the transmission"),
          ("pulse_start_frequency", "f8", "Hz", "of the transmission"),
          ("pulse_end_frequency", "f8", "Hz", "of the transmission"),
          ("source_level_percent", "f8", "%", "of the transmission, as set by the operator")),
])


@dataclass(frozen=True, kw_only=True)
class SideChannel:
    """Channel of a file.

    Attributes
    ----------
    number : int
        Number of the channel in its format.
    side : str
        One of `SIDES`.
    frequency : float or None [Hz]
        Middle of its band, None if the file does not hold it.
    name : str
        Name in the file.
    """

    number: int
    side: str
    frequency: float | None
    name: str = ""

    def words(self) -> str:
        """Return number, side and frequency as text."""
        return f"{self.number} ({self.side}{'' if self.frequency is None else f', {self.frequency / 1e3:g} kHz'})"


def is_recorded(record: xr.Dataset) -> bool:
    """Return True for the dataset of a recorded sidescan."""
    return "amplitude" in record and "sample" in record.dims


def chosen(channels: Sequence[SideChannel], numbers: Sequence[int] | None, frequency: float | None
           ) -> tuple[tuple[SideChannel, ...], str]:
    """Return the channels to read, at most one a side, and a note on the others; raise `ValueError` if there are none.

    Without a choice, they are the first pair of the file.
    """
    if not channels:
        raise ValueError("it has no channel to port or starboard; give a sidescan's file.")
    every = ", ".join(channel.words() for channel in channels[:MOST_NAMED])
    if numbers is not None and frequency is not None:
        raise ValueError("channels and a frequency were asked for; give one of them.")
    if numbers is not None:
        by_number = {channel.number: channel for channel in channels}
        some = tuple(by_number[number] for number in numbers if number in by_number)
        if len(some) != len(numbers) or len({channel.side for channel in some}) != len(some) or not some:
            raise ValueError(f"channels {', '.join(map(str, numbers))} were asked for, and it has {every}; give at "
                             "most one of each side.")
        return tuple(sorted(some, key=lambda channel: SIDES.index(channel.side))), ""
    pairs: list[dict[str, SideChannel]] = []
    for channel in channels:
        if not pairs or channel.side in pairs[-1]:
            pairs.append({})
        pairs[-1][channel.side] = channel
    first = pairs[0]
    if frequency is not None:
        known = [(abs(value - frequency), number) for number, pair in enumerate(pairs)
                 for channel in pair.values() if (value := channel.frequency) is not None]
        if not known or min(known)[0] > 0.1 * frequency:
            raise ValueError(f"{frequency / 1e3:g} kHz was asked for, and it has {every}; choose one of these, or its "
                             "channels by number.")
        first = pairs[min(known)[1]]
    others = [channel.words() for pair in pairs if pair is not first for channel in pair.values()]
    return (tuple(first[side] for side in SIDES if side in first),
            f"channels {', '.join(others[:MOST_NAMED])}" if others else "")


def dataset(amplitude: Sequence[Sequence[np.ndarray]], sides: Sequence[str], columns: Mapping[str, np.ndarray],
            attrs: Mapping[str, object]) -> xr.Dataset:
    """Return the record of rows of samples, ``amplitude[side][ping]``, and of columns (ping,) and (ping, side)."""
    counts = np.array([[row.size for row in side] for side in amplitude]).T                  # (ping, side)
    widest, kind = int(counts.max()), np.result_type(*{row.dtype for side in amplitude for row in side})
    if widest < 2:
        raise ValueError("its pings have fewer than two samples; give a sidescan's file.")
    if (total := counts.size * widest * kind.itemsize) > MOST_BYTES:
        raise ValueError(f"its samples take {total / 1e9:.3g} GB, and at most {MOST_BYTES / 1e9:g} GB are read at "
                         "once; give a range of its pings, such as pings=slice(0, 1000).")
    samples = np.zeros((*counts.shape, widest), kind)
    for number, side in enumerate(amplitude):
        for ping, row in enumerate(side):
            samples[ping, number, :row.size] = row
    columns = {"samples": counts, "lost": _lost(columns["ping_number"]), **columns}
    interval, start = (_median(columns[name]) for name in ("sample_interval", "sample_start"))
    if not interval > 0:
        raise ValueError("no ping has a sample interval or a range; the file is damaged, or no sidescan's.")
    duration = np.where(counts > 0, columns["sample_start"] + counts * columns["sample_interval"], np.nan)
    speed = _median(columns["slant_range"] / np.where(duration > 0, duration, np.nan))
    speed, start = speed if speed > 0 else USUAL_SPEED / 2, start if start > 0 else 0.0
    return xr.Dataset(
        {"amplitude": (("ping", "side", "sample"), samples,
                       {"units": "1", "long_name": "as recorded, nearest sample first"}),
         **{name: VARIABLES.variable(name, values) for name, values in columns.items()}},
        coords={"ping": np.arange(len(counts)), "side": list(sides),
                "range": ("sample", speed * (start + (np.arange(widest) + 0.5) * interval),
                          {"units": "m", "long_name": "slant range of the middle of a sample, by the pings' medians"})},
        attrs={**attrs, "lost_pings": int(columns["lost"].sum()),
               "bits": 8 * kind.itemsize, "sample_type": str(kind)})


def _median(values):
    """Return the median of values that are finite, NaN if none is."""
    values = values[np.isfinite(values)]
    return float(np.median(values)) if values.size else np.nan


def _lost(number):
    """Return how many pings (P,) are missing before each, by numbers that usually grow by one step."""
    steps = np.diff(np.asarray(number, np.int64), prepend=number[:1])
    usual = max(int(np.percentile(steps[1:], 50, method="lower")) if steps.size > 1 else 1, 1)
    return np.where((steps > usual) & (steps < MOST_LOST * usual), steps // usual - 1, 0)


def known(values: np.ndarray, low: float, high: float, *, nothing: float | None = None, every: bool = False
          ) -> np.ndarray:
    """Return values as floats, NaN outside [low, high], where they are ``nothing``, and if ``every`` one is 0."""
    values = np.asarray(values).astype(float)
    inside = (values >= low) & (values <= high)
    if nothing is not None:
        inside &= values != nothing
    return np.where(inside & (not every or np.any(values)), values, np.nan)


def text(raw: bytes) -> str:
    """Return a text field up to its first zero."""
    return bytes(raw).split(b"\0")[0].decode("latin-1").strip()
