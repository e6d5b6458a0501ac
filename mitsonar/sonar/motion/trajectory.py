"""Trajectory of a sonar: position and attitude at any time, also between pings.

    P(t) = L(t) + (h(t) + η(t)) ẑ + R(t) a,    R(t) = E Rz(ψ + ψ') Ry(θ + θ') Rx(φ + φ')       as in `device.rotations`

L, φ, θ, ψ -> the ``lead``; h, φ', θ', ψ' -> the ``motion``, exact at any time; η -> the ``tide``, on which whatever
keeps its depth below the water level rides; a -> the ``offset``. What was recorded
is joined by cubic splines (twice differentiable; off by 5/384 d⁴ times the fourth derivative for records d apart) and
goes on beyond its ends with the velocity and the rates it has there.

While the echoes of one ping come in, the way is a polynomial in the time t since the transmission,

    P(t) - P(0) = Σ_k d_k t^k,    R(t) R(0)ᵀ = exp([Σ_k r_k t^k]×),    k = 1 ... K

d_k -> ``displacement``, r_k -> ``turn`` of `PingTravel`, fitted through Chebyshev points. For a sinusoid of angular
frequency ω it errs by its amplitude times 2 (ωT/4)^(K+1) / (K+1)!: with K = 6, 1e-9 of it where T is an eighth of a
period, and 1 % where it is a period. K grows to 12 for a strum that swings twice, which is as fast as polynomials in
float32 follow.
"""
from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache, cached_property

import numpy as np

from mitsonar.device.rotations import rotation_matrix, rotation_vector

from .motion import RandomMotion
from .track import FIELDS, Track
from .waypoints import Course

POWERS = 6
KEPT = 4, 6, 12                    # powers, of a way that bends
NEGLIGIBLE = 1e-9                  # [m], [rad]: powers that stay below are none
STEP = 2e-4                        # [s] of differences
ROUNDED = 1.0                      # [s] over which a rate of turn grows where a course bends: no kink within a ping
MOST_TURN = 2.0                    # [rad] that a platform may turn while the echoes of a ping come in
MOST_SWINGS = 2.0                  # of a strum while the echoes of a ping come in


class SmoothCurve:
    """A spline through numbers at given times, with straight ends."""
    # time (N,) [s]; values (N, ...)

    def __init__(self, time: np.ndarray, values: np.ndarray):
        time, values = np.asarray(time, float), np.asarray(values, float)
        self._known = time, values
        self.first, self.last = float(time[0]), float(time[-1])
        self._shape = (1,) * (values.ndim - 1)

    @cached_property
    def _parts(self) -> tuple[Callable[[np.ndarray], np.ndarray], Callable[[np.ndarray], np.ndarray]]:
        """Return values and slopes as functions of times; SciPy's splines take long to import, and wait for use."""
        time, values = self._known
        if len(time) < 3:              # straight, bit for bit as the spline
            rise = np.subtract(*values[::-1]) / np.subtract(*time[::-1]) if len(time) == 2 else 0.0 * values[0]
            return lambda at: 0.0 + values[0] + np.multiply.outer(at - self.first, rise), lambda at: rise
        from scipy.interpolate import CubicSpline

        spline = CubicSpline(time, values, bc_type="not-a-knot")
        return spline, spline.derivative()

    def at(self, times: np.ndarray) -> np.ndarray:
        """Return the values at times (...) [s]: (..., *values.shape[1:])."""
        inside = np.clip(times, self.first, self.last)
        beyond = np.reshape(times - inside, np.shape(inside) + self._shape)
        spline, slope = self._parts
        return spline(inside) + beyond * slope(inside)


class Lead(ABC):
    """The course of a track, before random motion and lever arm."""

    @abstractmethod
    def at(self, times: np.ndarray, since: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return position (..., 3) [m] and attitude (..., 3) [rad]: roll, pitch, heading, which may run on."""
        # times (...) [s]; since (...) [s]


@dataclass(frozen=True, kw_only=True, eq=False)
class Recorded(Lead):
    """A track as it was recorded, or laid."""

    position: SmoothCurve  # (3,) [m]
    attitude: SmoothCurve  # (3,) [rad]: roll, pitch, heading
    height: SmoothCurve | None = None  # [m]: takes the place of z
    heave: SmoothCurve | None = None  # [m]: added to z

    @classmethod
    def through(cls, track: Track, **heights: SmoothCurve) -> Recorded:
        """Join the poses of a track."""
        attitude = np.stack([track.roll, track.pitch, np.unwrap(track.heading)], -1)
        return cls(position=SmoothCurve(track.time, track.position), attitude=SmoothCurve(track.time, attitude),
                   **heights)

    def at(self, times: np.ndarray, since: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        position = self.position.at(times)
        if self.height is not None:
            position[..., 2] = self.height.at(times)
        if self.heave is not None:
            position[..., 2] += self.heave.at(times)
        attitude = self.attitude.at(times)
        attitude[..., 2] %= 2 * np.pi
        return position, attitude


@dataclass(frozen=True, kw_only=True, eq=False)
class Sailed(Lead):
    """A course through way points, level, at one speed, heading along it; turns begin and end within a second."""

    course: Course
    speed: float  # [m/s]
    height: SmoothCurve  # [m]

    def at(self, times: np.ndarray, since: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if self.course.has_arcs:
            place, heading = self.course.rounded(self.speed * times, self.speed * ROUNDED)
        else:
            place, heading, _ = self.course.at(self.speed * times, on=self.speed * since)
        level = np.zeros(np.shape(times))
        return (np.concatenate([place, self.height.at(times)[..., None]], -1), np.stack([level, level, heading], -1))


@dataclass(frozen=True, kw_only=True, eq=False)
class Circled(Lead):
    """A level circle, sailed clockwise at one speed from its northernmost point on, heading along it."""

    middle: np.ndarray  # (3,) [m]
    radius: float  # [m]
    speed: float  # [m/s]

    def at(self, times: np.ndarray, since: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        bearing = self.speed * np.asarray(times, float) / self.radius
        level = np.zeros_like(bearing)
        outwards = np.stack([np.sin(bearing), np.cos(bearing), level], -1)
        return self.middle + self.radius * outwards, np.stack([level, level, bearing + 0.5 * np.pi], -1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Steered(Lead):
    """A course from a start at one speed, rate of climb and rate of turn, at a fixed roll and pitch."""

    start: np.ndarray  # (3,) [m]: at time 0
    attitude: np.ndarray  # (3,) [rad]: roll, pitch and heading at time 0; it swims along its heading
    speed: float  # [m/s], over the ground
    climb: float = 0.0  # [m/s], upwards
    turn_rate: float = 0.0  # [rad/s], clockwise

    def at(self, times: np.ndarray, since: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        times = np.asarray(times, float)
        half = 0.5 * self.turn_rate * times
        chord, bearing = self.speed * times * np.sinc(half / np.pi), self.attitude[2] + half
        moved = np.stack([chord * np.sin(bearing), chord * np.cos(bearing), self.climb * times], -1)
        turned = np.multiply.outer(2 * half, [0.0, 0.0, 1.0])
        return self.start + moved, self.attitude + turned


@dataclass(frozen=True, kw_only=True, eq=False)
class PingTravel:
    """Motion of a sonar while the echoes of its pings come in."""

    displacement: np.ndarray  # (P, K, 3) [m/s^k]: d_k of the module's equations, k = 1 ... K; scene frame
    turn: np.ndarray  # (P, K, 3) [rad/s^k]: r_k, likewise
    duration: float  # [s]: after the transmission, in which the polynomials hold

    def trimmed(self) -> PingTravel:
        """Return a copy without the highest powers that stay below 1e-9 m and rad; none for a platform at rest.

        Kernels are compiled for a number of powers. A moving platform that does not go straight ahead therefore keeps
        4 powers, which is usually enough, or 6 or 12; unneeded ones are 0.
        """
        worth = np.maximum(np.abs(self.displacement).max((0, 2)), np.abs(self.turn).max((0, 2)))
        count = int(np.max(np.flatnonzero(worth * self.duration ** np.arange(1, len(worth) + 1) > NEGLIGIBLE) + 1,
                           initial=0))
        spare = 0 if count < 2 else min(kept for kept in KEPT if kept >= count) - count
        displacement, turn = (np.pad(powers[:, :count], [(0, 0), (0, spare), (0, 0)])
                              for powers in (self.displacement, self.turn))
        return replace(self, displacement=displacement, turn=turn)

    def peak(self, coefficients: np.ndarray, order: int) -> np.ndarray:
        """Return the largest length of a derivative of polynomials (P, K, 3) until the end: (P,), by 17 times."""
        values = polynomials(coefficients, np.linspace(0, self.duration, 17), order)
        return np.linalg.norm(values, axis=-1).max(1, initial=0)

    def reach(self, coefficients: np.ndarray, order: int = 0) -> np.ndarray:
        """Return bounds (3,) of the components of polynomials (P, K, 3), or of a derivative, until the end."""
        return polynomials(np.abs(coefficients), np.array([self.duration]), order)[:, 0].max(0, initial=0)


def polynomials(coefficients: np.ndarray, times: np.ndarray, order: int = 0) -> np.ndarray:
    """Return Σ_k p_k t^k, k = 1 ... K, or a derivative, of coefficients (P, K, 3) at times (T,): (P, T, 3)."""
    powers = np.arange(1, coefficients.shape[1] + 1)
    scale = np.prod([np.maximum(powers - k, 0) for k in range(order)], axis=0)
    return np.einsum("tk,pkx->ptx", scale * times[:, None] ** np.maximum(powers - order, 0), coefficients)


@dataclass(frozen=True, kw_only=True, eq=False)
class Trajectory:
    """Course of a sonar with random motion and lever arm."""

    lead: Lead
    motion: RandomMotion = RandomMotion()
    offset: np.ndarray = field(default_factory=lambda: np.zeros(3))  # (3,) [m]
    tide: SmoothCurve | None = None  # [m]: water level above the datum; None: the lead has all of z

    def carried(self, offset: np.ndarray) -> Trajectory:
        """Follow another point of the body, `offset` (3,) [m] further forward, starboard, down."""
        return replace(self, offset=self.offset + np.asarray(offset, float))

    def pose(self, times: np.ndarray, since: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Return position (..., 3) [m] and attitude (..., 3) [rad]: roll, pitch, heading, which may run on."""
        # times (...) [s]; since (...) [s]
        times = np.asarray(times, float)
        position, attitude = self.lead.at(times, times if since is None else np.broadcast_to(since, times.shape))
        if self.motion.moves:
            values = self.motion.at(times)[0]
            attitude = attitude + np.stack([values[name] for name in ("roll", "pitch", "yaw")], -1)
            position = position + np.multiply.outer(values["heave"], [0.0, 0.0, 1.0])
            ahead = attitude[..., 2]
            for name, turned in (("surge", 0.0), ("sway", 0.5 * np.pi)):
                if getattr(self.motion, name):
                    way = np.stack([np.sin(ahead + turned), np.cos(ahead + turned), np.zeros_like(ahead)], -1)
                    position = position + values[name][..., None] * way
        if self.tide is not None:
            position = position + np.multiply.outer(self.tide.at(times), [0.0, 0.0, 1.0])
        if self.offset.any():
            position = position + rotation_matrix(*np.moveaxis(attitude, -1, 0)) @ self.offset
        return position, attitude

    def position(self, times: np.ndarray) -> np.ndarray:
        """Return the position (..., 3) [m] at times (...) [s], scene frame."""
        return self.pose(times)[0]

    def rotation(self, times: np.ndarray) -> np.ndarray:
        """Return the rotation from body to scene (..., 3, 3) at times (...) [s]."""
        return rotation_matrix(*np.moveaxis(self.pose(times)[1], -1, 0))

    def track(self, times: np.ndarray) -> Track:
        """Sample it, strictly increasing times (P,) [s]; raises `ValueError` where `Track` takes no such pose."""
        position, attitude = self.pose(times)
        roll, pitch, heading = np.moveaxis(attitude, -1, 0)
        return Track(time=times, position=position, roll=roll, pitch=pitch, heading=heading)

    def rates(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return velocity and angular velocity (P, 3) [m/s], [rad/s] at times (P,) [s], scene frame.

        Second-order forward differences, so that they hold for the reception.
        """
        times = np.asarray(times, float)
        position, attitude = self.pose(times + STEP * np.arange(3)[:, None], times)
        rotation = rotation_matrix(*np.moveaxis(attitude, -1, 0))
        near, far = (rotation_vector(rotation[k] @ np.swapaxes(rotation[0], -1, -2)) for k in (1, 2))
        velocity = (4 * (position[1] - position[0]) - (position[2] - position[0])) / (2 * STEP)
        return velocity, (4 * near - far) / (2 * STEP)

    def during(self, times: np.ndarray, duration: float) -> PingTravel:
        """Return the way on after transmissions at times (P,) [s] for a duration [s]: K = 6 powers, of a strum to 12.
        """
        times, duration = np.asarray(times, float), max(float(duration), 1e-6)
        swings = self.motion.fastest * duration
        if swings > MOST_SWINGS:
            raise ValueError(f"strum: the cable swings {swings:.2g} times while the echoes of a ping come in, "
                             f"{duration:.3g} s, and the motion within a ping is followed for {MOST_SWINGS:g}; give a "
                             f"strum_hz of at most {self.motion.strum_frequency * MOST_SWINGS / swings:.3g} or a "
                             "shorter range")
        points, fit = _fitted(POWERS + max(0, int(np.ceil(POWERS * (swings - 1)))))
        since = times[:, None]
        position, attitude = self.pose(since + np.append(0.0, duration * points), since)
        rotation = rotation_matrix(*np.moveaxis(attitude, -1, 0))
        turn = rotation_vector(rotation[:, 1:] @ np.swapaxes(rotation[:, :1], -1, -2))
        fastest = np.linalg.norm(turn, axis=-1).max(1, initial=0)
        if np.any(fastest > MOST_TURN):
            ping = int(np.argmax(fastest > MOST_TURN))
            raise ValueError(f"track: the sonar turns by {np.rad2deg(fastest[ping]):.0f} degrees while the echoes of "
                             f"ping {ping} come in, {duration:.3g} s; smooth the recorded attitude or take a shorter "
                             "range")
        fit = fit / duration ** np.arange(1, len(fit) + 1)[:, None]
        return PingTravel(displacement=np.einsum("kj,pjx->pkx", fit, position[:, 1:] - position[:, :1]),
                          turn=np.einsum("kj,pjx->pkx", fit, turn), duration=duration)


@dataclass(frozen=True, kw_only=True, eq=False)
class Voyage:
    """Hold the track of the pings, and the trajectory that it lies on."""

    track: Track
    trajectory: Trajectory

    @classmethod
    def of(cls, trajectory: Trajectory, times: np.ndarray) -> Voyage:
        """Sample a trajectory at the times (P,) [s] of the pings."""
        return cls(track=trajectory.track(times), trajectory=trajectory)

    @property
    def single(self) -> Voyage:
        """Return the voyage of the last ping alone."""
        rows = {name: getattr(self.track, name)[-1:] for name in FIELDS}
        return Voyage(track=Track(**rows), trajectory=self.trajectory)

    @cached_property
    def rates(self) -> tuple[np.ndarray, np.ndarray]:
        """Velocity [m/s] and angular velocity [rad/s] at the transmissions, (P, 3) each, scene frame."""
        return self.trajectory.rates(self.track.time)

    @property
    def velocity(self) -> np.ndarray:
        """At the transmissions, (P, 3) [m/s], scene frame."""
        return self.rates[0]

    @property
    def turn_rate(self) -> np.ndarray:
        """Angular velocity at the transmissions, (P, 3) [rad/s], scene frame."""
        return self.rates[1]


@cache
def _fitted(powers: int) -> tuple[np.ndarray, np.ndarray]:
    """Return Chebyshev points (N,) of a unit of time, and the matrix (K, N) from values there to K powers."""
    count = powers + 3
    points = 0.5 - 0.5 * np.cos(np.pi * (np.arange(1, count + 1) - 0.5) / count)
    return points, np.linalg.pinv(points[:, None] ** np.arange(1, powers + 1))
