"""Voyage of a sonar whose poses are given ping by ping: between transmission and reception it moves on steadily.

    P(t) = P + (t - t_0) v,    R(t) = exp([(t - t_0) ω]×) R

P, R, v and ω -> position, attitude, velocity and turn rate at the transmission, at the time t_0.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from mitsonar.device.rotations import attitude_of, rotation_matrix

from .track import FIELDS, Track
from .trajectory import Lead, Trajectory, Voyage

SAME, SAME_RATE = 1e-9, 1e-7       # [s], [m], [rad]; [m/s], [rad/s]: of a planned pose; rates are differences


@dataclass(frozen=True, kw_only=True, eq=False)
class Steady(Lead):
    """A pose that moves and turns at constant rates."""

    time: float  # [s]
    position: np.ndarray  # (3,) [m]
    attitude: np.ndarray  # (3,) [rad]: roll, pitch, heading
    velocity: np.ndarray  # (3,) [m/s], scene frame
    turn_rate: np.ndarray  # (3,) [rad/s], scene frame

    def at(self, times: np.ndarray, since: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        later = (np.asarray(times, float) - self.time)[..., None]
        position = self.position + later * self.velocity
        if not self.turn_rate.any():
            return position, np.broadcast_to(self.attitude, position.shape).copy()
        from scipy.spatial.transform import Rotation

        turned = Rotation.from_rotvec((later * self.turn_rate).reshape(-1, 3)).as_matrix()
        return position, attitude_of((turned @ rotation_matrix(*self.attitude)).reshape(*position.shape, 3))


class RepeatedTrack(Track):
    """Track whose rows are all the pose of its last ping: numbers of pings count on, and nothing grows with them."""

    def __init__(self, track: Track, ping: int):
        for name in FIELDS:
            row = getattr(track, name)[0]
            object.__setattr__(self, name, np.broadcast_to(row, (ping + 1, *row.shape)))

    def rotation(self, ping: np.ndarray | slice = slice(None)) -> np.ndarray:
        """Return the rotation from body to scene; all pings have that of the last."""
        last = rotation_matrix(self.roll[0], self.pitch[0], self.heading[0])
        return np.broadcast_to(last, (len(self.time[ping]), 3, 3))


class StepVoyage(Voyage):
    """Voyage of one ping; see `RepeatedTrack`."""

    @cached_property
    def rates(self) -> tuple[np.ndarray, np.ndarray]:
        """Return velocity and angular velocity at the transmission, (P, 3) each."""
        velocity, turn_rate = self.trajectory.rates(self.track.time[-1:])
        rows = self.track.pings, 3
        return np.broadcast_to(velocity[0], rows), np.broadcast_to(turn_rate[0], rows)


@dataclass(frozen=True, kw_only=True, eq=False)
class SteppedPing:
    """Latest ping of a sonar that is stepped."""

    ping: int
    track: Track  # of this ping alone
    trajectory: Trajectory  # while its echoes arrive
    turn_rate: float  # [rad/s]
    depth_below: float  # [m]: seabed below the sonar
    row: int | None = None  # number of the planned ping that has this pose
    _voyages: dict = field(default_factory=dict)

    @property
    def time(self) -> float:
        """Return the time of the transmission [s]."""
        return float(self.track.time[0])

    @property
    def place(self) -> np.ndarray:
        """Return east and north of the transmission (2,) [m]."""
        return self.track.position[0, :2]

    def voyage(self, make: Callable[[SteppedPing], Voyage]) -> Voyage:
        """Return the voyage that a function makes of this ping; it is made once."""
        if make not in self._voyages:
            self._voyages[make] = make(self)
        return self._voyages[make]


class Stepping:
    """Latest ping of a sonar that is stepped, and the objects that were moved; all surveys of the sonar share it."""

    def __init__(self) -> None:
        self.latest: SteppedPing | None = None             # None before the first one
        self.moved: dict[str, Trajectory] = {}             # by the names of the objects


def voyage_of(ping: SteppedPing, later: float = 0.0) -> StepVoyage:
    """Return the voyage of the sonar itself, or of one at its place that sends `later` [s]."""
    track = ping.trajectory.track(ping.track.time + later) if later else ping.track
    return StepVoyage(track=RepeatedTrack(track, ping.ping), trajectory=ping.trajectory)


def planned_row(voyage: Voyage, *, time: float, position: np.ndarray, attitude: np.ndarray, velocity: np.ndarray,
                turn_rate: np.ndarray) -> int | None:
    """Return the number of the planned ping that has a pose, to within rounding; None if there is none."""
    track = voyage.track
    row = int(np.argmin(abs(track.time - time)))
    turned = attitude - [getattr(track, name)[row] for name in ("roll", "pitch", "heading")]
    turned[2] = (turned[2] + np.pi) % (2 * np.pi) - np.pi
    away = np.concatenate([[track.time[row] - time], track.position[row] - position, turned])
    rates = np.concatenate([voyage.velocity[row] - velocity, voyage.turn_rate[row] - turn_rate])
    return row if np.all(abs(away) <= SAME) and np.all(abs(rates) <= SAME_RATE) else None
