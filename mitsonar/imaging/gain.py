"""Time-varied gain for display: makes an even seabed look even, without changing the data.

    target   40 log R + 2 a R                         two-way spherical spreading and absorption
    seabed   30 log R + 2 a R - 20 log sin(grazing)   the ensonified area grows with R; Lambert's law falls with sin²
    recorder 30 log R + 2 a R                         as in recorders: bed far away or at grazing angles is darker
    angle    -L(angle)                                mean dependence on angle: the bed's law and the beam pattern
    counts   none                                     what the instrument's recorder wrote, with its own gain

R -> ``range`` [m], a -> ``absorption_db`` [dB/m]; sin(grazing) = altitude / R over a level bed, if the
altitude is known. L(angle) is the median level over the pings of a side at an angle from nadir, acos(altitude / R);
survey software calls it angle-varying gain.
"""
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
import xarray as xr

from mitsonar.units import NOTHING_DB

Tvg = Literal["seabed", "target", "recorder", "counts"] | None      # gain of a picture
SPREADING = {"seabed": 30, "target": 40, "recorder": 30}      # [dB] per log R
LOWEST_SINE = np.sin(np.deg2rad(1.0))  # below 1 degree a gain would raise only noise
ANGLE_STEP_DEG = 1.0               # [degrees]: width of an angle class


def absorption_of(attrs: Mapping[str, object]) -> float:
    """Return a record's absorption [dB/m], 0 if absent; `ValueError` if it is not a number of 0 or more."""
    value = attrs.get("absorption_db") or 0.0
    if not isinstance(value, (int, float)) or not 0 <= value < np.inf:
        raise ValueError(f"the record's absorption_db is {value!r}; it takes a number of 0 or more.")
    return float(value)


def display_gain(dataset: xr.Dataset, tvg: Tvg) -> tuple[np.ndarray, str]:
    """Return the gain [dB] to add to the levels of a picture, and its formula as text."""
    slant_range = np.maximum(np.asarray(dataset["range"].values, float), 1e-3)[None]
    absorption = 2 * absorption_of(dataset.attrs) * slant_range
    if tvg is None:
        return np.zeros_like(slant_range), ""
    if tvg not in SPREADING:
        raise ValueError(f"the display gain is {tvg!r}; use 'seabed', 'target', 'recorder' or None, or 'counts' for a "
                         "picture with recorded counts.")
    gain, words = SPREADING[tvg] * np.log10(slant_range) + absorption, f" + {SPREADING[tvg]} log R + 2αR"
    if tvg != "seabed" or "altitude" not in dataset.coords:
        return gain, words
    altitude = np.asarray(dataset["altitude"].values, float).reshape(-1, 1)
    sine = np.clip(np.where(np.isfinite(altitude), altitude, np.inf) / slant_range, LOWEST_SINE, 1)
    return gain - 20 * np.log10(sine), f"{words} − 20 log sin θ"


@dataclass(frozen=True, kw_only=True, eq=False)
class AngleGain:
    """Gain that makes the median level of a sidescan equal at all angles from nadir."""

    middles: np.ndarray  # (S, A) [dB]: median level of each side and degree
    typical: np.ndarray  # (S,) [dB]: median of each side

    @classmethod
    def of(cls, dataset: xr.Dataset) -> "AngleGain":
        """Return the gain from a record's ``level`` (ping, side, range) and ``altitude`` (ping)."""
        level = dataset["level"].transpose("ping", "side", "range").values
        step, below = _angle_steps(dataset)
        number = step.astype(np.int64)
        middles, typical = np.zeros((level.shape[1], round(90 / ANGLE_STEP_DEG) + 1)), np.zeros(level.shape[1])
        for side in range(level.shape[1]):
            levels = level[:, side]
            known = below & np.isfinite(levels) & (levels > NOTHING_DB)
            if known.any():
                medians = _medians(number[known], levels[known], middles.shape[1])
                at = np.flatnonzero(np.isfinite(medians))
                middles[side] = np.interp(np.arange(medians.size), at, medians[at])
                typical[side] = np.median(levels[known])
        return cls(middles=middles, typical=typical)

    def gain(self, dataset: xr.Dataset) -> np.ndarray:
        """Return the gain (P, S, N) [dB] for any pings of the record; 0 in the water column."""
        step, below = _angle_steps(dataset)
        # interpolated, since steps would show as a seam at every degree
        at = np.arange(self.middles.shape[1]) + 0.5
        return np.stack([np.where(below, typical - np.interp(step, at, middles), 0)
                         for middles, typical in zip(self.middles, self.typical, strict=True)], 1)


def _angle_steps(dataset):
    """Return the angles of bins from nadir (P, N) in steps, and a mask of the bins below the water column."""
    altitude = np.asarray(dataset["altitude"].values, float)[:, None]
    slant_range = np.maximum(np.asarray(dataset["range"].values, float), 1e-3)[None]
    below = slant_range > altitude                                    # False if the altitude is unknown
    angle = np.rad2deg(np.arccos(np.clip(np.where(below, altitude / slant_range, 1), 0, 1)))
    return angle / ANGLE_STEP_DEG, below


def _medians(group, values, groups):
    """Return the median of the values of every group; NaN for empty groups."""
    order = np.argsort(group, kind="stable")
    group, values = group[order], values[order]
    middles = np.full(groups, np.nan)
    starts = np.flatnonzero(np.diff(group, prepend=-1))
    for first, last in zip(starts, [*starts[1:], group.size], strict=True):
        middles[group[first]] = np.median(values[first:last])
    return middles
