"""Image of an interferometric sidescan: levels, phases and angles of both sides over range, with their truth.

    level = 10 log10 of the mean over a bin of Σ_k |z_k|²       z_k -> the compressed signal of row k [µPa]

``depth``, the mean depth of the bed and objects that return the echoes of a bin, is true. ``measured_depth`` differs
from it by errors of phase, layover, refraction and motion.
"""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from mitsonar.sonar.motion.track import Track

from . import picture
from .energy_record import EnergyRecord

DIMS = ("ping", "side", "range")


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredRows:
    """Measurements of pings, arrays (ping, side, bin); NaN without a valid sounding unless stated otherwise."""

    power: np.ndarray  # [µPa²]: known for all bins
    phase: np.ndarray  # [rad]: known for all bins
    coherence: np.ndarray  # known for all bins
    valid: np.ndarray
    angle: np.ndarray  # [rad]: below the horizontal, from the vertical plane through the course outwards
    depth: np.ndarray  # [m]
    x: np.ndarray  # [m]
    y: np.ndarray  # [m]
    across_track: np.ndarray  # [m]
    uncertainty: np.ndarray  # [m]


def image(made: MeasuredRows, record: EnergyRecord, *, track: Track, time: np.ndarray, sound_speed: float,
          depth_below: np.ndarray, labels: Mapping[int, str], class_of: Mapping[int, int],
          attrs: Mapping[str, Any]) -> xr.Dataset:
    """Return the image of a run."""
    def entry(values: np.ndarray, units: str, long_name: str) -> picture.Entry:
        values = values.astype(np.float32) if values.dtype == np.float64 else values
        return picture.entry(DIMS, values, units, long_name)

    return picture.picture(
        "interferometric", DIMS,
        {"level": entry(picture.levels(made.power), "dB re 1 µPa", "echo level, of all rows"),
         "phase": entry(made.phase, "rad", "phase of the highest row less that of the lowest"),
         "coherence": entry(made.coherence, "1", "coherence of the rows"),
         "valid": entry(made.valid, "1", "1 for a valid sounding"),
         "angle": entry(made.angle, "rad", "direction of the echo, below the horizontal"),
         "measured_depth": entry(made.depth, "m", "as measured, below the still surface"),
         "measured_x": entry(made.x, "m", "as measured, east"),
         "measured_y": entry(made.y, "m", "as measured, north"),
         "measured_across_track": entry(made.across_track, "m", "as measured, from the reference point, starboard"),
         "uncertainty": entry(made.uncertainty, "m", "standard deviation of measured_depth by theory"),
         "error": entry(made.depth - record.depth, "m", "measured_depth - depth")},
        record, bins=picture.bins_of(time, sound_speed, attrs.get("pulse")), pings=picture.pings_of(track, depth_below),
        rows={"side": picture.SIDES}, labels=labels, class_of=class_of, attrs=attrs)
