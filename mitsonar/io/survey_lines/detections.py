"""Detections of a ping of sonars that state angles and travel times, and no places."""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsonar.hydrography.record import NOT_DETECTED

from .assembly import FASTEST, SECTOR, SLOWEST


@dataclass(frozen=True, kw_only=True, eq=False)
class DetectedPing:
    """Detections of a ping, each array (B,)."""

    travel_time: np.ndarray  # [s]
    angle: np.ndarray  # [rad]: at the receive array, positive to starboard
    steering: float  # [rad]: transmit angle, positive forward
    valid: np.ndarray
    method: np.ndarray  # BY_AMPLITUDE, BY_PHASE or NOT_DETECTED
    intensity: np.ndarray  # amplitude, not calibrated
    uncertainty: np.ndarray | None = None  # of the travel time, relative

    def soundings(self) -> dict[str, np.ndarray]:
        """Return the variables of the record."""
        count = self.travel_time.size
        valid = self.valid & (self.travel_time > 0)
        uncertainty = np.full(count, np.nan) if self.uncertainty is None else self.uncertainty
        return {"valid": valid, "travel_time": self.travel_time.astype(float), "angle": self.angle.astype(float),
                "transmit_angle": np.full(count, self.steering), "sector": np.zeros(count, int),
                "backscatter_db": _finite(20 * np.log10(self.intensity)),
                "detection": np.where(valid, self.method, NOT_DETECTED),
                "quality": _finite(-np.log10(uncertainty))}


def sector(steering: float, **values: float) -> dict[str, np.ndarray]:
    """Return the one sector of a ping, by the names of `SECTOR`; values that are not given are unknown."""
    known = dict.fromkeys(SECTOR, np.nan) | {"delay": 0.0, "angle": steering} | values
    return {name: np.array([float(value)]) for name, value in known.items()}


def checked_speed(speed: float, number: int) -> float:
    """Return a sound speed [m/s] at the head that water can have."""
    if not SLOWEST < speed < FASTEST:
        raise ValueError(f"its ping {number} has a sound speed of {speed:g} m/s; it is damaged.")
    return speed


def _finite(values):
    return np.where(np.isfinite(values), values, np.nan)
