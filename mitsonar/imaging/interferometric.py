"""Image of an interferometric sidescan: levels, phases and angles of both sides over range, with their truth.

    level = 10 log10 of the mean over a bin of Σ_k |z_k|²       z_k -> the compressed signal of row k [µPa]

The true depth of a bin is the mean depth of the bed and objects that return its echoes, weighted by energy. The
measured depth differs from it by errors of phase, layover, refraction and motion.
"""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from mitsonar.sonar.motion.track import Track

from . import coordinates, truth
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
          attrs: Mapping[str, object]) -> xr.Dataset:
    """Return the image of a run."""
    label, shadow = coordinates.shadow_by_runs(record)

    def entry(values: np.ndarray, units: str, long_name: str) -> tuple:
        return coordinates.entry(DIMS, values.astype(np.float32) if values.dtype == np.float64 else values, units,
                                 long_name)

    return xr.Dataset(
        {"level": entry(coordinates.levels(made.power), "dB re 1 µPa", "echo level, of all rows"),
         "phase": entry(made.phase, "rad", "phase of the highest row less that of the lowest"),
         "coherence": entry(made.coherence, "1", "coherence of the rows"),
         "valid": entry(made.valid, "1", "1 for a valid sounding"),
         "angle": entry(made.angle, "rad", "direction of the echo, below the horizontal"),
         "depth": entry(made.depth, "m", "as measured, below the still surface"),
         "true_depth": entry(record.depth, "m", "mean depth of bed and objects that return the echoes"),
         "error": entry(made.depth - record.depth, "m", "depth - true_depth"),
         "uncertainty": entry(made.uncertainty, "m", "standard deviation of the depth by theory"),
         "across_track": entry(made.across_track, "m", "as measured, from the reference point, starboard"),
         "point_x": entry(made.x, "m", "as measured, east"),
         "point_y": entry(made.y, "m", "as measured, north"),
         **truth.variables(record.truth, label, class_of, DIMS),
         "shadow": entry(shadow, "1", "no echo arrives, after the first return"),
         "rays": entry(record.echoes_in_beam, "1", "scatterers of the ground truth")},
        coords={
            "ping": coordinates.entry("ping", np.arange(track.pings), "1", "ping number"),
            "side": ("side", ["port", "starboard"], {"long_name": "side of the platform"}),
            **coordinates.of_bins(labels, 0.5 * sound_speed * time, time),
            **coordinates.of_pings(track, depth_below)},
        attrs={"sonar": "interferometric", **attrs, "sound_speed": float(sound_speed),
               "bin_width": float(0.5 * sound_speed * (time[-1] - time[0]) / max(len(time) - 1, 1)),
               "labels": {str(number): name for number, name in labels.items()}})
