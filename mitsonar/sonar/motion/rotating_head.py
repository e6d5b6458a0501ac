"""A head that turns a single beam about an axis: where the beam looks at any time, seen from the platform.

    R_head(t) = R(t) M Rz(± β(t)) Ry(-δ),      β(t) = β_p + ω_p (t - t_p)             while ping p's echoes come in

R -> the platform's attitude (`trajectory`), M -> the ``mount``: its third column is the axis that the head turns about,
its first the bearing 0; β -> the bearing, δ -> the ``tilt`` out of the plane that the beam turns in, towards where the
head points. Forward of the head's own frame is along the beam, starboard is the way it turns, and down is across.

A bearing counts clockwise: seen from above, from the bow, for a head that points down or up; seen looking ahead, from
straight up, for one that points forward. A head that points up turns against its axis (the minus sign), so that its
bearings count clockwise from above as well.
"""
from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mitsonar.device.rotations import attitude_of, rotation_matrix

from .stepping import RepeatedTrack, SteppedPing, StepVoyage
from .track import FIELDS, Track
from .trajectory import Trajectory, Voyage

# name -> columns forward (bearing 0), aside and axis, body frame; and the sign of a turn about that axis
MOUNTS = {"down": (np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]]).T, 1.0),
          "up": (np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]]).T, -1.0),
          "forward": (np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]]).T, 1.0)}
WHOLE = 1e-6                       # of a step: a sector that lacks less of it has it


@dataclass(frozen=True, kw_only=True)
class HeadSweep:
    """The bearings of a head's pings."""

    first: float  # [rad]: bearing of the first ping
    step: float  # [rad]: from ping to ping, above 0
    sector: float  # [rad]: from the first bearing to the last one
    back_and_forth: bool  # whether the head goes back as it came

    @property
    def endless(self) -> bool:
        """Return True if the head turns in full circles."""
        return self.sector >= 2 * np.pi * (1 - 1e-12) and not self.back_and_forth

    @property
    def pings_per_turn(self) -> int:
        """Return the number of pings of a turn, or of one way across the sector."""
        steps = self.sector / self.step
        return int(np.ceil(steps - WHOLE)) if self.endless else int(np.floor(steps + WHOLE)) + 1

    def turn(self, ping: np.ndarray) -> np.ndarray:
        """Return the number of the turn, or of the way across the sector, that pings (P,) belong to."""
        if self.endless:
            return np.floor((np.asarray(ping) + WHOLE) * self.step / (2 * np.pi)).astype(int)
        return np.asarray(ping) // self.pings_per_turn

    def bearing(self, ping: np.ndarray) -> np.ndarray:
        """Return the bearings of pings (P,) [rad], which run on past a full circle."""
        return self.first + self.step * self._place(ping)

    def onward(self, ping: np.ndarray) -> np.ndarray:
        """Return the turns of the head from pings (P,) to the next ones [rad], without its return to the start."""
        change = self._place(np.asarray(ping) + 1) - self._place(ping)
        return self.step * (change if self.back_and_forth else np.ones_like(change))

    def _place(self, ping: np.ndarray) -> np.ndarray:
        """Return the steps from the first bearing, (P,)."""
        if self.endless:
            return np.asarray(ping, float)
        turn, place = np.divmod(np.asarray(ping), self.pings_per_turn)
        backwards = self.back_and_forth & (turn % 2 == 1)
        return np.where(backwards, self.pings_per_turn - 1 - place, place).astype(float)


@dataclass(frozen=True, kw_only=True)
class RotatingHead:
    """A head and how it turns."""

    mount: str  # where it points
    tilt: float  # [rad]: of the beam, out of the plane it turns in, towards where the head points
    sweep: HeadSweep
    turns_on: bool  # whether it turns on while echoes come in

    @property
    def mounted(self) -> np.ndarray:
        """Return M (3, 3), whose columns are bearing 0, aside, and the axis of rotation, in the platform's frame."""
        return MOUNTS[self.mount][0]

    def rotation(self, bearing: np.ndarray) -> np.ndarray:
        """Return the rotation from the head's frame to the platform's at bearings (...) [rad]: (..., 3, 3)."""
        frame, sign = MOUNTS[self.mount]
        beta = sign * np.asarray(bearing, float)
        sine, cosine, zero = np.sin(beta), np.cos(beta), np.zeros(np.shape(beta))
        turned = np.stack([np.stack([cosine, -sine, zero], -1), np.stack([sine, cosine, zero], -1),
                           np.stack([zero, zero, zero + 1], -1)], -2)
        c, s = np.cos(self.tilt), np.sin(self.tilt)
        return frame @ turned @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])


@dataclass(frozen=True, kw_only=True, eq=False)
class HeadTrajectory(Trajectory):
    """Follow a head on its platform; its attitude is that of the beam."""

    head: RotatingHead
    times: np.ndarray  # (P,) [s]: of the pings' transmissions
    interval: float  # [s]: from the last ping to the one that would follow
    first: int = 0  # number of the first ping
    reach: np.ndarray = field(default_factory=lambda: np.zeros(3))  # (3,) [m]

    @property
    def platform(self) -> Trajectory:
        """Return the trajectory of the place where the head is mounted, with the attitude of the platform."""
        return Trajectory(lead=self.lead, motion=self.motion, offset=self.offset, tide=self.tide)

    def carried(self, offset: np.ndarray) -> HeadTrajectory:
        """Return the track of another point of the head, `offset` (3,) [m] along the beam, aside, and across."""
        return HeadTrajectory(lead=self.lead, motion=self.motion, offset=self.offset, tide=self.tide,
                              head=self.head, times=self.times, interval=self.interval, first=self.first,
                              reach=self.reach + np.asarray(offset, float))

    def bearing(self, times: np.ndarray, since: np.ndarray) -> np.ndarray:
        """Return the bearings [rad] at times (...) [s] after the transmissions `since` (...) [s]."""
        ping, sweep = self.first + np.arange(len(self.times)), self.head.sweep
        middle = 0.5 * (self.times[1:] + self.times[:-1])
        number = np.searchsorted(middle, since)
        rate = np.zeros(len(ping))
        if self.head.turns_on:
            rate = sweep.onward(ping) / np.append(np.diff(self.times), self.interval)
        return sweep.bearing(ping)[number] + rate[number] * (times - self.times[number])

    def pose(self, times: np.ndarray, since: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Return position (..., 3) [m] and attitude (..., 3) [rad] of the beam; as `Trajectory.pose`."""
        times = np.asarray(times, float)
        since = times if since is None else np.broadcast_to(since, times.shape)
        position, attitude = super().pose(times, since)
        rotation = rotation_matrix(*np.moveaxis(attitude, -1, 0)) @ self.head.rotation(self.bearing(times, since))
        return position + rotation @ self.reach, attitude_of(rotation)


def turned_voyage(voyage: Voyage, head: RotatingHead, interval: float, first: int = 0) -> Voyage:
    """Return the voyage of a head on a platform, whose pings are the platform's, by rule an interval [s] apart.

    Its track has the attitude of the beam at each transmission; `first` is the number of its first ping.
    """
    platform, times = voyage.trajectory, voyage.track.time
    trajectory = HeadTrajectory(lead=platform.lead, motion=platform.motion, offset=platform.offset,
                                tide=platform.tide, head=head, times=times, interval=interval, first=first)
    roll, pitch, heading = np.moveaxis(trajectory.pose(times)[1], -1, 0)
    return Voyage(trajectory=trajectory, track=Track(time=times, position=voyage.track.position, roll=roll, pitch=pitch,
                                                     heading=heading))


def stepped_voyage(ping: SteppedPing, *, planned: Voyage, head: RotatingHead, interval: float) -> StepVoyage:
    """Return the voyage of a head at a stepped ping, whose number sets its bearing; the planned one at its poses."""
    if ping.row == ping.ping:
        track = Track(**{name: getattr(planned.track, name)[ping.ping:ping.ping + 1] for name in FIELDS})
        return StepVoyage(track=RepeatedTrack(track, ping.ping), trajectory=planned.trajectory)
    turned = turned_voyage(Voyage(track=ping.track, trajectory=ping.trajectory), head, interval, ping.ping)
    return StepVoyage(track=RepeatedTrack(turned.track, ping.ping), trajectory=turned.trajectory)
