"""What an interferometric sidescan measures of a ping: level, angle and coherence for every bin of either side."""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .survey import InterferometricSurvey

__all__ = ["Measurement", "measured_rows"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Measurement:
    """Of a ping; arrays (B,), port's bins from the last to the first, then starboard's.

    Attributes
    ----------
    valid : bool
        Coherent enough, and within the sector.
    sector : int32
        0 of port, 1 of starboard.
    time : [s]
        Of the bins' middles, after the transmission.
    sine : [-]
        Along the rows' axis, by the true sound speed at the head.
    sine_deviation : [-]
    coherence : [-]
    phase : [rad]
    power : [µPa²]
        Mean of the rows over the window.
    level : [µPa²]
        Mean over the bin of the sum of the rows' powers.
    """

    valid: np.ndarray
    sector: np.ndarray
    time: np.ndarray
    sine: np.ndarray
    sine_deviation: np.ndarray
    coherence: np.ndarray
    phase: np.ndarray
    power: np.ndarray
    level: np.ndarray

    def by_side(self, values: np.ndarray) -> np.ndarray:
        """Give values (B,) as (side, bin), both from the first bin on."""
        half = len(values) // 2
        return np.stack([values[:half][::-1], values[half:]])


def measured_rows(survey: InterferometricSurvey, signals: tuple[np.ndarray, np.ndarray]) -> Measurement:
    """Compare the rows of both sides, signals (rows, samples) [µPa] each."""
    per_bin = survey.per_bin
    found, levels = [], []
    for rows in signals:
        found.append(survey.rows.angles(rows, per_bin=per_bin, window=survey.window, looks=_looks(survey),
                                        relative_bandwidth=survey.relative_bandwidth))
        levels.append((np.abs(rows) ** 2).sum(0, dtype=float).reshape(survey.bins, per_bin).mean(1))

    def both(name: str) -> np.ndarray:
        return _joined(*(getattr(one, name) for one in found))

    coherence = both("coherence")
    return Measurement(
        valid=both("inside") & (coherence >= survey.least_coherence), time=_joined(survey.time, survey.time),
        sector=np.repeat(np.arange(2, dtype=np.int32), survey.bins), sine=both("sine"), coherence=coherence,
        sine_deviation=both("deviation"), phase=both("phase"), power=both("power"), level=_joined(*levels))


def _looks(survey: InterferometricSurvey) -> float:
    """Independent samples in a window, 1 or more."""
    return max(1.0, survey.window / (survey.sides[0].sampling_rate * survey.pulse_length))


def _joined(port: np.ndarray, starboard: np.ndarray) -> np.ndarray:
    return np.concatenate([port[::-1], starboard])


