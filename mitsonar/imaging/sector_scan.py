"""Image of a rotating head: a row over range for every ping, that is, for every step of the head.

    level = 10 log10 of the mean of |m|² over the samples of a bin,   m -> the compressed signal [µPa]

The mean level and the truth of every bin come from an energy record of the same beam (`survey.sector_scan`).
"""
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
import xarray as xr

from mitsonar.sonar.motion.track import Track

from . import coordinates, truth
from .energy_record import EnergyRecord

DIMS = ("ping", "range")


@dataclass(frozen=True, kw_only=True)
class Turns:
    """Directions of a head at its pings."""

    bearing: np.ndarray  # (P,) [rad]: relative to the platform, within ±π
    turn: np.ndarray  # (P,): number of the turn, or of the sweep across the sector
    platform: Track  # its attitude, and the position of the head
    mount: str
    tilt: float  # [rad]
    sector: float  # [rad]


def mean_power(compressed: np.ndarray, bins: int) -> np.ndarray:
    """Return the mean power [µPa²] of compressed signals (..., S) [µPa] in `bins` equal bins."""
    power = np.abs(compressed).astype(float) ** 2
    return power.reshape(*power.shape[:-1], bins, -1).mean(-1)


def image(power: np.ndarray, record: EnergyRecord, expected: np.ndarray, *, turns: Turns, time: np.ndarray,
          sound_speed: float, depth_below: np.ndarray, labels: Mapping[int, str], class_of: Mapping[int, int],
          attrs: Mapping[str, object]) -> xr.Dataset:
    """Return the image of a run from drawn and expected powers (P, bins) [µPa²]."""
    slant_range = 0.5 * sound_speed * time
    below = slant_range >= depth_below[:, None] - 2 * (slant_range[-1] / len(slant_range))
    label, shadow = coordinates.shadow_by_bins(record, below)

    entry, of_ping = partial(coordinates.entry, DIMS), partial(coordinates.entry, "ping")
    return xr.Dataset(
        {"level": entry(coordinates.levels(power), "dB re 1 µPa", "echo level"),
         "mean_level": entry(coordinates.levels(expected), "dB re 1 µPa", "echo level without speckle and noise"),
         **truth.variables(record.truth, label, class_of, DIMS),
         "depth": entry(record.depth, "m", "depth of the hits, weighted by echo energy"),
         "shadow": entry(shadow, "1", "no ray of the main lobe arrives, after the first bottom return"),
         "rays": entry(record.rays, "1", "rays that arrive")},
        coords={
            "ping": of_ping(np.arange(len(power)), "1", "ping number"),
            "bearing": of_ping(turns.bearing, "rad", _CLOCKWISE[turns.mount == "forward"]),
            "turn": of_ping(turns.turn, "1", "turn of the head, or sweep across its sector"),
            **coordinates.of_bins(labels, slant_range, time),
            **coordinates.of_pings(turns.platform, depth_below, " of the platform")},
        attrs={"sonar": "sector_scan", **attrs, "sound_speed": float(sound_speed), "mount": turns.mount,
               "tilt": float(turns.tilt), "sector": float(turns.sector),
               "bin_width": float(slant_range[-1] - slant_range[0]) / max(len(slant_range) - 1, 1),
               "labels": {str(number): name for number, name in labels.items()}})


_CLOCKWISE = ("bearing of the beam from the bow, clockwise seen from above",
              "bearing of the beam from straight up, clockwise looking ahead")
