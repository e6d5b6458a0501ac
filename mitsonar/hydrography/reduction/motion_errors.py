"""Errors of motion sensors, of satellite positions and of the lever arms between them.

    sensor(t) = true(t - latency) + bias + n(t),     n(t) = σ √(2/K) Σ_k cos(2π f_k t + φ_k)

f_k drawn from a Cauchy distribution of half width 1/(2πT), so that n has the variance σ² and the correlation
exp(-|τ| / T), is defined at any time and has no steps.

Lever arms lead from the reference point: a to the antenna, m to the motion sensor. e is the stated arm less the true
one, R the attitude and R' that of the sensors, L and L_p the ages of the motion and of the positions, and the third row
of a vector points down. The reference point P is then believed at

    P'(t) = P(t - L_p) + R(t - L_p) a - R'(t) (a + e_a)                                             position and height
    depth'(t) = depth(t - L) + (R(t - L) m - R'(t) (m + e_m) + e_m)_down                                          heave

so that, with a right attitude, the place is off by -R e_a, the height by (R e_a)_down, and the depth by the induced
heave (e_m - R e_m)_down: e_x sin θ - e_y cos θ sin φ for errors forward and to starboard, θ the pitch and φ the roll.
On an even keel, where the draft is measured, it is 0.
"""
from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .attitude import PlatformMotion, turned

LINES = 64                         # K
FASTEST = 5.0                      # [Hz]: errors of real sensors vary more slowly
NO_ARM = (0.0, 0.0, 0.0)
Arm = tuple[float, ...]            # forward, starboard, down


@dataclass(frozen=True, kw_only=True)
class MotionErrors:
    """Errors of attitude, heave, position, lever arms and of the level that depths are reduced to."""

    roll_bias: float = 0.0  # [rad]
    pitch_bias: float = 0.0  # [rad]
    heading_bias: float = 0.0  # [rad]
    latency: float = 0.0  # [s]: age of attitude and heave when they are stamped
    position_latency: float = 0.0  # [s]: age of position and height likewise
    attitude_noise: float = 0.0  # [rad] rms, of roll and of pitch
    heading_noise: float = 0.0  # [rad] rms
    draft_error: float = 0.0  # [m]: assumed minus true depth of the reference point
    heave_noise: float = 0.0  # [m] rms, of the depth
    position_noise: float = 0.0  # [m] rms, of x and of y
    height_noise: float = 0.0  # [m] rms, of heights above the ellipsoid
    correlation: float = 5.0  # [s]: T
    antenna: Arm = NO_ARM  # [m]: true lever arm, forward, starboard, down
    antenna_error: Arm = NO_ARM  # [m]: stated minus true
    motion_sensor: Arm = NO_ARM  # [m]: true lever arm
    motion_sensor_error: Arm = NO_ARM  # [m]
    offset_error: Arm = NO_ARM  # [m]: of the sonar's arrays
    tide_error: float = 0.0  # [m]: of the water level in use
    separation_error: float = 0.0  # [m]: of the separation in use

    def added(self, time: np.ndarray, seed: int) -> dict[str, np.ndarray]:
        """Return bias and noise at times (M,) [s]: (M,) [m], [rad] for x, y, depth, roll, pitch, heading and height."""
        spread = {"x": self.position_noise, "y": self.position_noise, "depth": self.heave_noise,
                  "roll": self.attitude_noise, "pitch": self.attitude_noise, "heading": self.heading_noise,
                  "height": self.height_noise}
        bias = {"depth": self.draft_error, "roll": self.roll_bias, "pitch": self.pitch_bias,
                "heading": self.heading_bias}
        return {name: bias.get(name, 0.0) + self._noise(time, rms, seed, stream)
                for stream, (name, rms) in enumerate(spread.items())}

    def sensed(self, late: PlatformMotion, fixed: PlatformMotion, seed: int) -> SensedMotion:
        """Return the motion by the sensors, from the true one at the ages of motion and of positions; times are stamps.
        """
        added = self.added(late.time, seed)
        attitude = {name: getattr(late, name) + added[name] for name in ("roll", "pitch", "heading")}
        place = np.stack([fixed.x, fixed.y, fixed.depth], -1)
        depth = late.depth + added["depth"]
        if any(self.antenna) or any(self.antenna_error):
            place = place + _turned(self.antenna, fixed) - turned(
                np.add(self.antenna, self.antenna_error), **attitude)
        if any(self.motion_sensor) or any(self.motion_sensor_error):
            stated = turned(np.add(self.motion_sensor, self.motion_sensor_error), **attitude)
            depth = depth + _turned(self.motion_sensor, late)[:, 2] - stated[:, 2] + self.motion_sensor_error[2]
        motion = replace(late, x=place[:, 0] + added["x"], y=place[:, 1] + added["y"], depth=depth, **attitude)
        return SensedMotion(motion=motion, rise=added["height"] - place[:, 2])

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


@dataclass(frozen=True, kw_only=True, eq=False)
class SensedMotion:
    """Motion by the sensors, and the height of the reference point by satellites."""

    motion: PlatformMotion
    rise: np.ndarray  # (M,) [m], above the datum of the depths; the separation makes it a height above the ellipsoid


def _turned(arm: Arm, motion: PlatformMotion) -> np.ndarray:
    """Return a lever arm at the attitudes of a motion: (M, 3) east, north, down."""
    return turned(np.asarray(arm, float), motion.roll, motion.pitch, motion.heading)
