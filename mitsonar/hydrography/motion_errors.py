"""What motion sensors say, beside what they measure.

    said(t) = true(t - latency) + bias + noise,     noise of variance σ² and correlation exp(-|τ| / T)
"""
from __future__ import annotations

from dataclasses import dataclass

__all__ = ["MotionErrors"]


@dataclass(frozen=True, kw_only=True)
class MotionErrors:
    """Errors of attitude, heave and position.

    Attributes
    ----------
    roll_bias, pitch_bias, heading_bias : float [rad]
    latency : float [s]
        By which attitude and heave are those of an earlier time.
    attitude_noise, heading_noise : float [rad]
        Of roll and of pitch, and of the heading; root mean squares.
    heave_noise, position_noise : float [m]
        Of the depth, and of x and of y.
    correlation : float [s]
        T.
    """

    roll_bias: float = 0.0
    pitch_bias: float = 0.0
    heading_bias: float = 0.0
    latency: float = 0.0
    attitude_noise: float = 0.0
    heading_noise: float = 0.0
    heave_noise: float = 0.0
    position_noise: float = 0.0
    correlation: float = 5.0
