"""Where a swath's beams and transmissions are steered to, ping by ping.

A beam listens along the angle θ from the vertical, to starboard, in the vertical plane across the track, and its echo
comes in at t_r = t + 2 h / (c cos θ). The sine on the receiving line of axis a_r, and that of a transmission towards
the sector's middle θ_k, tilted by φ forward of that plane, on the transmitting line of axis a_t, are

    s_r = a_r(t_r)·(ŝ sin θ + d̂ cos θ)          s_t = a_t(t)·(f̂ sin φ + (ŝ sin θ_k + d̂ cos θ_k) cos φ)           (1)

f̂, ŝ, d̂ -> forward, starboard and down, level, by the heading; where yaw is compensated, by the mean heading of 20 s
about the ping. Without compensation of roll beams keep their angles in the body; without that of pitch transmissions
keep their tilt from the head's own plane.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...sonar.sectors import Sector
from ...sonar.track import mounting_matrix, rotation_matrix
from ...sonar.trajectory import Trajectory

__all__ = ["Stabilised", "Swath"]

COURSE = np.linspace(-10, 10, 9)   # [s] about a ping, over which headings are averaged
STEEPEST = np.deg2rad(85.0)        # angle beyond which an echo's time is no longer foreseen
WIDEST = np.sin(np.deg2rad(89.0))  # sine that beams are steered to at most


@dataclass(frozen=True, kw_only=True)
class Stabilised:
    """Which motions the steering compensates."""

    roll: bool
    pitch: bool
    yaw: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class Swath:
    """What is steered, and how.

    Attributes
    ----------
    trajectory : Trajectory
        Of the sonar.
    mounting : (3,) [rad]
        Roll, pitch, heading of the head.
    stabilised : Stabilised
    """

    trajectory: Trajectory
    mounting: np.ndarray
    stabilised: Stabilised

    def receive_sines(self, sector: Sector, times: np.ndarray, depth: np.ndarray, sound_speed: float) -> np.ndarray:
        """Give s_r of (1) of a sector's beams at its transmissions.

        Parameters
        ----------
        sector : Sector
        times : (P,) [s]
            Of its transmissions.
        depth : (P,) [m]
            Bed below the sonar, as the instrument knows it.
        sound_speed : float [m/s]

        Returns
        -------
        (P, B)
        """
        angle = np.broadcast_to(sector.beams, (len(times), len(sector.beams)))
        if not self.stabilised.roll:
            in_body = np.stack([np.zeros_like(angle), np.sin(angle), np.cos(angle)], -1)
            return np.clip(in_body @ mounting_matrix(*self.mounting)[:, 1], -WIDEST, WIDEST)
        received = times[:, None] + 2 * depth[:, None] / (sound_speed * np.cos(np.clip(angle, -STEEPEST, STEEPEST)))
        axis = self._axes(received, times[:, None])[..., 1]
        _, starboard, down = self._frame(times)
        towards = np.sin(angle)[..., None] * starboard[:, None] + np.cos(angle)[..., None] * down[:, None]
        return np.clip(np.sum(axis * towards, -1), -WIDEST, WIDEST)

    def transmit_sines(self, sector: Sector, times: np.ndarray) -> np.ndarray:
        """Give s_t of (1) at a sector's transmissions (P,) [s]: (P,)."""
        if not self.stabilised.pitch:
            return np.full(len(times), np.sin(sector.tilt))
        forward, starboard, down = self._frame(times)
        across = np.sin(sector.middle) * starboard + np.cos(sector.middle) * down
        towards = np.sin(sector.tilt) * forward + np.cos(sector.tilt) * across
        return np.sum(self._axes(times, times)[..., 0] * towards, -1)

    def _axes(self, times: np.ndarray, since: np.ndarray) -> np.ndarray:
        """Head to scene at times (...): (..., 3, 3)."""
        _, attitude = self.trajectory.pose(times, np.broadcast_to(since, times.shape))
        return rotation_matrix(*np.moveaxis(attitude, -1, 0)) @ mounting_matrix(*self.mounting)

    def _frame(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """f̂, ŝ and d̂ at transmissions (P,), each (P, 3), scene."""
        _, attitude = self.trajectory.pose(times)
        heading = attitude[:, 2]
        if self.stabilised.yaw:
            around = times[:, None] + COURSE
            turned = self.trajectory.pose(around, np.broadcast_to(times[:, None], around.shape))[1][..., 2]
            heading = np.arctan2(np.sin(turned).mean(1), np.cos(turned).mean(1))
        level = np.zeros_like(heading)
        frame = rotation_matrix(level, level, heading)
        return frame[..., 0], frame[..., 1], frame[..., 2]
