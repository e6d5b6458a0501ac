"""Image of a rotating head: a row over range for every ping, that is, for every step of the head.

    level = 10 log10 of the mean of |m|² over the samples of a bin,   m -> the compressed signal [µPa]

The mean level and the truth of every bin come from an energy record of the same beam (`survey.sector_scan`).
"""
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from mitsonar.sonar.motion.track import Track

from . import picture
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
          attrs: Mapping[str, Any], first: int = 0) -> xr.Dataset:
    """Return the image of a run from drawn and expected powers (P, bins) [µPa²] of pings from the first number on."""
    return picture.picture(
        "sector_scan", DIMS,
        {"level": picture.entry(DIMS, picture.levels(power), "dB re 1 µPa", "echo level"),
         "mean_level": picture.entry(DIMS, picture.levels(expected), "dB re 1 µPa",
                                     "echo level without speckle and noise")},
        record, bins=picture.bins_of(time, sound_speed, attrs.get("pulse")),
        pings=picture.pings_of(turns.platform, depth_below, first), whose=" of the platform",
        rows={"bearing": picture.entry("ping", turns.bearing, "rad", _CLOCKWISE[turns.mount == "forward"]),
              "turn": picture.entry("ping", turns.turn, "1", "turn of the head, or sweep across its sector")},
        labels=labels, class_of=class_of,
        attrs={**attrs, "mount": turns.mount, "tilt": float(turns.tilt), "sector": float(turns.sector)})


_CLOCKWISE = ("bearing of the beam from the bow, clockwise seen from above",
              "bearing of the beam from straight up, clockwise looking ahead")
