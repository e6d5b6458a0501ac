"""The picture of an interferometric sidescan: levels, phases and angles of both sides over range, with their truth.

    level = 10 log10 of the mean over a bin of Σ_k |z_k|²       z_k -> the compressed signal of row k [µPa]

The true depth of a bin is the mean of bed and objects that echoes come from at its time, weighted by their energies;
what is measured beside it errs by phases, by layover, by refraction and by motion.
"""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from mitsonar.sonar.motion.track import Track
from mitsonar.units import db_from_power

from . import truth
from .energy_record import EnergyRecord
from .fan import NOTHING_DB, SHORTEST_SHADOW, runs_of

DIMS = ("ping", "side", "range")


@dataclass(frozen=True, kw_only=True, eq=False)
class Measured:
    """What is measured of pings, arrays (ping, side, bin), and NaN where no sounding is valid unless said otherwise."""

    power: np.ndarray  # [µPa²]: of all bins
    phase: np.ndarray  # of all bins
    coherence: np.ndarray  # of all bins
    valid: np.ndarray
    angle: np.ndarray  # [rad]: below the horizontal, from the vertical plane through the course outwards
    depth: np.ndarray  # [m]
    x: np.ndarray  # [m]
    y: np.ndarray  # [m]
    across_track: np.ndarray  # [m]
    uncertainty: np.ndarray  # [m]


def image(made: Measured, record: EnergyRecord, *, track: Track, time: np.ndarray, sound_speed: float,
          depth_below: np.ndarray, labels: Mapping[int, str], class_of: Mapping[int, int],
          attrs: Mapping[str, Any]) -> xr.Dataset:
    """Make the dataset of a run."""
    # time [s]; sound_speed [m/s]; depth_below (P,) [m]; labels [int, str]; class_of [int, int]
    rays, share = record.echoes_in_beam, record.truth.share
    empty = runs_of(rays == 0, SHORTEST_SHADOW)
    shadow = (empty & np.logical_or.accumulate(rays > 0, -1)).astype(np.uint8)
    label = np.where(empty | ~share.any(-2), 0, share.argmax(-2) + 1).astype(np.uint32)
    seen = truth.variables(record.truth, label, class_of, DIMS)

    def entry(values: np.ndarray, units: str, long_name: str, dims: tuple[str, ...] = DIMS) -> tuple:
        kept = np.asarray(values)
        return dims, kept.astype(np.float32) if kept.dtype == np.float64 and dims == DIMS else kept, {
            "units": units, "long_name": long_name}

    along = ("ping",)
    return xr.Dataset(
        {"level": entry(np.maximum(db_from_power(np.maximum(made.power, 1e-30)), NOTHING_DB), "dB re 1 µPa",
                        "echo level, of all rows"),
         "phase": entry(made.phase, "rad", "of the highest row less that of the lowest"),
         "coherence": entry(made.coherence, "1", "of the rows"),
         "valid": entry(made.valid, "1", "whether there is a sounding"),
         "angle": entry(made.angle, "rad", "where the echo comes from, below the horizontal"),
         "depth": entry(made.depth, "m", "as measured, below the still surface"),
         "true_depth": entry(record.depth, "m", "mean depth of bed and objects that the echoes come from"),
         "error": entry(made.depth - record.depth, "m", "depth - true_depth"),
         "uncertainty": entry(made.uncertainty, "m", "of the depth, standard deviation by theory"),
         "across_track": entry(made.across_track, "m", "as measured, from the reference point, starboard"),
         "point_x": entry(made.x, "m", "as measured, east"),
         "point_y": entry(made.y, "m", "as measured, north"),
         **seen,
         "shadow": entry(shadow, "1", "nothing arrives, after the first return"),
         "rays": entry(rays, "1", "scatterers around, of the ground truth")},
        coords={
            "ping": entry(np.arange(track.pings), "1", "ping number", along),
            "side": ("side", ["port", "starboard"], {"long_name": "side of the platform"}),
            "shape": ("shape", list(labels.values()), {"long_name": "shapes in the order of their labels"}),
            "range": entry(0.5 * sound_speed * time, "m", "slant range at the head's sound speed", ("range",)),
            "time": entry(time, "s", "two-way travel time", ("range",)),
            "ping_time": entry(np.array(track.time), "s", "time of transmission", along),
            **{axis: entry(np.array(column), "m", words, along)
               for axis, column, words in zip("xyz", track.position.T, ("east", "north", "up, the sea surface is 0"))},
            "roll": entry(np.array(track.roll), "rad", "roll, starboard down", along),
            "pitch": entry(np.array(track.pitch), "rad", "pitch, nose up", along),
            "heading": entry(np.array(track.heading), "rad", "heading, clockwise from north", along),
            "altitude": entry(np.array(depth_below, float), "m", "height above the seabed", along)},
        attrs={"sonar": "interferometric", **attrs, "sound_speed": float(sound_speed),
               "bin_width": float(0.5 * sound_speed * (time[-1] - time[0]) / max(len(time) - 1, 1)),
               "labels": {str(number): name for number, name in labels.items()}})
