"""Pictures of all kinds of sonar: common coordinates, truth, shadows and attributes, built in one place.

    level = max(10 log10 p², NOTHING_DB)

A kind of sonar adds what it measures, and the coordinates of its own rows. ``depth``, ``seabed_x``, ``seabed_y`` and
``seabed_depth`` are true in every picture; places that an instrument measures are named ``measured_...``.
"""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from mitsonar.sonar.motion.track import Track
from mitsonar.sonar.pulses.pulses import pulse_of
from mitsonar.units import NOTHING_DB, db_from_power

from . import truth
from .energy_record import EnergyRecord
from .shadows import labels_of, shadows_of

Entry = tuple[Any, ...]            # variable in the form that xarray takes
SIDES = ("side", ["port", "starboard"], {"long_name": "side of the platform"})
PINGS = {"ping": ("1", "ping number"), "ping_time": ("s", "time of transmission"), "x": ("m", "east"),
         "y": ("m", "north"), "z": ("m", "up, the sea surface is 0"), "roll": ("rad", "roll{}, starboard down"),
         "pitch": ("rad", "pitch{}, nose up"), "heading": ("rad", "heading{}, clockwise from north"),
         "altitude": ("m", "height above the seabed")}


@dataclass(frozen=True, kw_only=True, eq=False)
class PictureBins:
    """Bins of a picture along time."""

    time: np.ndarray  # (bins,) [s]: two-way time of their middles
    length: float  # [s]
    sound_speed: float  # [m/s]: at the head
    pulse_length: float  # [s]: of the compressed pulse

    @property
    def slant_range(self) -> np.ndarray:
        """Return the slant ranges [m]."""
        return 0.5 * self.sound_speed * self.time

    @property
    def width(self) -> float:
        """Return the length of a bin in slant range [m]."""
        return float(0.5 * self.sound_speed * self.length)


def entry(dims: str | tuple[str, ...], values: object, units: str, long_name: str) -> Entry:
    """Return a variable in the form that xarray takes."""
    return dims, values, {"units": units, "long_name": long_name}


def levels(power: np.ndarray) -> np.ndarray:
    """Return the levels [dB re 1 µPa] of powers [µPa²], float32."""
    return np.maximum(db_from_power(power), NOTHING_DB).astype(np.float32)


def bins_of(time: np.ndarray, sound_speed: float, pulse: dict[str, Any] | None) -> PictureBins:
    """Return the bins with even times [s] of their middles; of a pulse by its numbers, or of an unknown one."""
    return PictureBins(time=time, length=float(time[-1] - time[0]) / max(len(time) - 1, 1),
                       sound_speed=float(sound_speed),
                       pulse_length=pulse_of(pulse).compressed_length() if pulse else 0.0)


def pings_of(track: Track, depth_below: np.ndarray, first: int = 0) -> dict[str, np.ndarray]:
    """Return numbers from the first on, times, positions, attitudes and heights over the bed [m] of a track's pings."""
    return {"ping": first + np.arange(track.pings), "ping_time": np.array(track.time),
            **{axis: np.array(column) for axis, column in zip("xyz", track.position.T)},
            **{name: np.array(getattr(track, name)) for name in ("roll", "pitch", "heading")},
            "altitude": np.array(depth_below, float)}


def picture(sonar: str, dims: tuple[str, ...], measured: Mapping[str, Entry], record: EnergyRecord, *,
            bins: PictureBins, pings: Mapping[str, np.ndarray], rows: Mapping[str, Entry], labels: Mapping[int, str],
            class_of: Mapping[int, int], attrs: Mapping[str, Any], whose: str = "") -> xr.Dataset:
    """Return a picture over dims (ping, ..., range): what was measured, the truth of the bins, and where they are.

    ``pings`` are the columns of `pings_of`, ``rows`` the coordinates of the kind; attitudes are those of ``whose``.
    """
    shadow = shadows_of(record, bin_length=bins.length, pulse_length=bins.pulse_length)
    columns = {name: entry("ping", pings[name], units, words.format(whose))
               for name, (units, words) in PINGS.items() if name in pings}
    return xr.Dataset(
        {**measured, **truth.variables(record.truth, labels_of(record), class_of, dims),
         "depth": entry(dims, record.depth, "m", "depth of the hits, weighted by echo energy"),
         "shadow": entry(dims, shadow, "1", "no ray of the main lobe arrives, after the first bottom return"),
         "rays": entry(dims, record.rays, "1", "rays that arrive")},
        coords={"ping": columns.pop("ping"), **rows,
                "shape": ("shape", list(labels.values()), {"long_name": "shapes in the order of their labels"}),
                "range": entry("range", bins.slant_range, "m", "slant range at the head's sound speed"),
                "time": entry("range", bins.time, "s", "two-way travel time"), **columns},
        attrs={"sonar": sonar, "seed": attrs["seed"], "sound_speed": float(bins.sound_speed), **attrs,
               "bin_width": bins.width, "labels": {str(number): name for number, name in labels.items()}})
