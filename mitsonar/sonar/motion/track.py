"""Track of the sonar: position and attitude at every ping.

Attitudes turn a vector of the body (x forward, y starboard, z down) into the scene (x east, y north, z up) as
`rotation_matrix` of `device.rotations` says. Heading is clockwise from north, pitch positive nose up, roll positive
starboard side down; all in radians.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mitsonar.device.rotations import rotation_matrix

LATEST, FARTHEST = 1e11, 1e8       # [s], [m]: three thousand years, and more than once around the Earth
FIELDS = ("time", "position", "roll", "pitch", "heading")


@dataclass(frozen=True, eq=False, init=False)
class Track:
    """Hold time, position and attitude of the sonar, a row per ping.

    Parameters
    ----------
    time : array (P,) [s]
        Strictly increasing.
    position : array (P, 3) [m]
        x east, y north, z up; the sea surface is z = 0.
    roll, pitch, heading : array (P,) or float [rad]
        Attitude; a single number holds for all pings. Heading may run on past a full turn.

    Raises
    ------
    ValueError
        If shapes disagree, a number is not finite, time does not increase, |roll| > pi or |pitch| > pi/2; the first
        offending ping is named.

    Notes
    -----
    Arrays are copied to float64 and read-only; two tracks are equal when their numbers are.
    """

    time: np.ndarray
    position: np.ndarray
    roll: np.ndarray
    pitch: np.ndarray
    heading: np.ndarray

    def __init__(self, *, time: ArrayLike, position: ArrayLike, roll: ArrayLike, pitch: ArrayLike,
                 heading: ArrayLike):
        pings = (times := _array("time", time)).size
        if times.ndim != 1 or pings == 0:
            raise ValueError(f"track: time must be a list of at least one number, got shape {times.shape}.")
        for name, given in zip(FIELDS, (time, position, roll, pitch, heading)):
            value = _array(name, given)
            if name in ("roll", "pitch", "heading") and value.ndim == 0:
                value = np.full(pings, value)
            wanted = (pings, 3) if name == "position" else (pings,)
            if value.shape != wanted:
                raise ValueError(f"track: {name} has shape {value.shape}, but {pings} times need {wanted}.")
            value.flags.writeable = False
            object.__setattr__(self, name, value)
        self._check()

    def moved(self, position: np.ndarray, attitude: np.ndarray) -> Track:
        """Return the track with offsets added.

        Parameters
        ----------
        position : (P, 3) or (1, 3) [m]
            Scene coordinates.
        attitude : (P, 3) or (1, 3) [rad]
            Heading, pitch, roll.
        """
        heading, pitch, roll = np.stack([self.heading, self.pitch, self.roll]) + np.transpose(attitude)
        return Track(time=self.time, position=self.position + position, heading=heading, pitch=pitch, roll=roll)

    def _check(self) -> None:
        for name in FIELDS:
            _refuse(~np.isfinite(getattr(self, name)).reshape(self.time.size, -1).all(axis=1), name,
                    getattr(self, name), "remove or repair pings that are not finite numbers")
        _refuse(np.abs(self.time) > LATEST, "time", self.time, f"no time lies beyond +-{LATEST:g} s; check the units")
        _refuse(np.any(np.abs(self.position) > FARTHEST, axis=1), "position", self.position,
                f"no place on Earth lies beyond +-{FARTHEST:g} m; check the units")
        _refuse(np.r_[False, np.diff(self.time) <= 0], "time", self.time,
                "each ping must be later than the one before; sort them and drop repeated times")
        _refuse(np.abs(self.roll) > np.pi, "roll", self.roll, "it must lie within +-pi radians; convert degrees")
        _refuse(np.abs(self.pitch) > np.pi / 2, "pitch", self.pitch,
                "it must lie within +-pi/2 radians; convert degrees")

    @classmethod
    def straight(cls, *, start: ArrayLike, heading: float, speed: float, interval: float, pings: int, roll: float = 0.0,
                 pitch: float = 0.0) -> Track:
        """Make a level track of constant course and speed, the first ping at time 0.

        Parameters
        ----------
        start : array (3,) [m]
            Position of the first ping, scene frame.
        heading : float [rad]
            Course and heading, clockwise from north.
        speed : float [m/s]
            Speed over ground; 0 for a fixed sonar.
        interval : float [s]
            Time between pings.
        pings : int
            Number of pings.
        roll, pitch : float [rad]
            Constant roll and pitch.

        Returns
        -------
        Track

        Raises
        ------
        ValueError
            If a number is not finite, ``speed`` is negative, ``interval`` not positive or ``pings`` below 1.
        """
        if not (np.ndim(pings) == 0 and pings >= 1 and pings == int(pings)):
            raise ValueError(f"straight track: pings is {pings!r}; give a whole number of at least 1.")
        if not interval > 0:
            raise ValueError(f"straight track: interval is {interval!r} s; give the positive time between pings.")
        if not speed >= 0:
            raise ValueError(f"straight track: speed is {speed!r} m/s; give 0 or more (turn the heading to go back).")
        start = _array("start", start)
        if start.shape != (3,):
            raise ValueError(f"straight track: start has shape {start.shape}; give x, y and z [m].")
        if not np.isfinite([*start, heading, speed, interval]).all():
            raise ValueError(f"straight track: start {start}, heading {heading!r}, speed {speed!r} or interval "
                             f"{interval!r} is not finite; give finite numbers.")
        time = np.arange(int(pings)) * float(interval)
        course = np.array([np.sin(heading), np.cos(heading), 0.0])
        return cls(time=time, position=start + speed * time[:, None] * course, roll=roll, pitch=pitch, heading=heading)

    def rotation(self, ping: np.ndarray | slice = slice(None)) -> np.ndarray:
        """Return the rotation from body to scene at every ping.

        Parameters
        ----------
        ping : array (B,) or slice
            Numbers of pings. Default: all.

        Returns
        -------
        array (P, 3, 3) or (B, 3, 3)
            Its columns are the forward, starboard and down directions of the body in the scene; both frames are
            right-handed, so its determinant is 1.
        """
        return rotation_matrix(self.roll[ping], self.pitch[ping], self.heading[ping])

    def motion(self) -> tuple[np.ndarray, np.ndarray]:
        """Differentiate the track.

        Returns
        -------
        velocity : array (P, 3) [m/s]
            Scene frame.
        turn_rate : array (P, 3) [rad/s]
            ω of the body, scene frame: a point of the body at d moves with ω x d.

        Raises
        ------
        ValueError
            If there is only one ping.

        Notes
        -----
        Second-order differences; ω is the skew part of dR/dt Rᵀ.
        """
        if self.pings < 2:
            raise ValueError("track: a single ping has no motion; give at least two pings, or the velocity.")
        order = 2 if self.pings > 2 else 1
        velocity = np.gradient(self.position, self.time, axis=0, edge_order=order)
        rotation = self.rotation()
        spin = np.gradient(rotation, self.time, axis=0, edge_order=order) @ np.swapaxes(rotation, 1, 2)
        spin = 0.5 * (spin - np.swapaxes(spin, 1, 2))
        return velocity, np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], -1)

    def at(self, times: ArrayLike) -> Track:
        """Interpolate the track: position, roll and pitch linearly, heading the short way round.

        Parameters
        ----------
        times : array (Q,) or float [s]
            Strictly increasing, within the recorded span.

        Returns
        -------
        Track
            Of Q pings, heading in [0, 2 pi).

        Raises
        ------
        ValueError
            If a time lies outside the recorded span, or times do not increase.
        """
        times = np.atleast_1d(_array("times", times))
        outside = np.flatnonzero(~((times >= self.time[0]) & (times <= self.time[-1])))
        if outside.size:
            raise ValueError(f"track: asked for {times[outside[0]]:.6g} s, but it is recorded from "
                             f"{self.time[0]:.6g} s to {self.time[-1]:.6g} s; ask within that span.")
        position = np.stack([np.interp(times, self.time, axis) for axis in self.position.T], axis=-1)
        turn = 2 * np.pi
        heading = np.interp(times, self.time, np.unwrap(self.heading)) % turn
        heading[heading == turn] = 0  # the remainder of -1e-20 is rounded up to a whole turn
        return Track(time=times, position=position, roll=np.interp(times, self.time, self.roll),
                     pitch=np.interp(times, self.time, self.pitch), heading=heading)

    @property
    def pings(self) -> int:
        """Number of pings."""
        return self.time.size

    @property
    def length(self) -> float:
        """Length of the way, summed from ping to ping [m]."""
        return float(np.linalg.norm(np.diff(self.position, axis=0), axis=1).sum())

    @property
    def speed(self) -> float:
        """Mean speed along the way [m/s]; 0 for a single ping."""
        return self.length / float(self.time[-1] - self.time[0]) if self.pings > 1 else 0.0

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Track):
            return NotImplemented
        return all(np.array_equal(getattr(self, name), getattr(other, name)) for name in FIELDS)

    def __hash__(self) -> int:
        return hash(tuple((getattr(self, name) + 0.0).tobytes() for name in FIELDS))  # -0.0 equals 0.0


def _array(name: str, value: ArrayLike) -> np.ndarray:
    try:
        return np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"track: {name} must be numbers, got {value!r}.") from None


def _refuse(bad: np.ndarray, name: str, values: np.ndarray, remedy: str) -> None:
    """Raise for the first ping marked bad."""
    first = np.flatnonzero(bad)[:1]
    if first.size:
        raise ValueError(f"track: {name} of ping {first[0]} is {values[first[0]]}; {remedy}.")
