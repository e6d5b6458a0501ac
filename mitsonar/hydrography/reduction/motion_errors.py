"""Errors of motion sensors.

    sensor(t) = true(t - latency) + bias + n(t),     n(t) = σ √(2/K) Σ_k cos(2π f_k t + φ_k)

f_k drawn from a Cauchy distribution of half width 1/(2πT), so that n has the variance σ² and the correlation
exp(-|τ| / T), is defined at any time and has no steps.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LINES = 64                         # K
FASTEST = 5.0                      # [Hz]: errors of real sensors vary more slowly


@dataclass(frozen=True, kw_only=True)
class MotionErrors:
    """Errors of attitude, heave and position."""

    roll_bias: float = 0.0  # [rad]
    pitch_bias: float = 0.0  # [rad]
    heading_bias: float = 0.0  # [rad]
    latency: float = 0.0  # [s]: age of attitude and heave when they are stamped
    attitude_noise: float = 0.0  # [rad] rms, of roll and of pitch
    heading_noise: float = 0.0  # [rad] rms
    draft_error: float = 0.0  # [m]: assumed minus true depth of the reference point
    heave_noise: float = 0.0  # [m] rms, of the depth
    position_noise: float = 0.0  # [m] rms, of x and of y
    correlation: float = 5.0  # [s]: T

    def added(self, time: np.ndarray, seed: int) -> dict[str, np.ndarray]:
        """Return bias and noise at times (M,) [s]: (M,) [m], [rad] for x, y, depth, roll, pitch and heading."""
        spread = {"x": self.position_noise, "y": self.position_noise, "depth": self.heave_noise,
                  "roll": self.attitude_noise, "pitch": self.attitude_noise, "heading": self.heading_noise}
        bias = {"depth": self.draft_error, "roll": self.roll_bias, "pitch": self.pitch_bias,
                "heading": self.heading_bias}
        return {name: bias.get(name, 0.0) + self._noise(time, rms, seed, stream)
                for stream, (name, rms) in enumerate(spread.items())}

    def _noise(self, time: np.ndarray, rms: float, seed: int, stream: int) -> np.ndarray:
        if not rms:
            return np.zeros(len(time))
        draw = np.random.default_rng([seed, stream, LINES])
        share = (np.arange(LINES) + draw.uniform(0.05, 0.95, LINES)) / LINES
        frequency = np.tan(np.pi * (share - 0.5)) / (2 * np.pi * self.correlation)
        frequency = np.clip(frequency, -FASTEST, FASTEST)
        phase = draw.uniform(0, 2 * np.pi, LINES)
        noise = np.zeros(len(time))
        for f, begin in zip(frequency, phase):
            noise += np.cos(2 * np.pi * f * time + begin)
        return rms * np.sqrt(2 / LINES) * noise
