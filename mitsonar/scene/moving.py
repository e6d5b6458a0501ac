"""Moving objects: what stands where at a ping.

An object stands where the sound of the ping meets it, at the time t1 after the transmission,

    t1 = T(|P(t + t1) - P_0|),      T(R) = R <1/c>

P -> the object's position, P_0 the sonar's at the transmission, <1/c> the mean slowness between their depths. The
straight way errs by g² R³ / 24 c³ (Fermat): a tenth of a microsecond at 100 m in a gradient g of 0.1 1/s, in which an
object of 3 m/s moves by 0.4 µm. A vertex v of the object's own frame (x starboard, y ahead, z up) stands at

    P + R E v,      R of roll, pitch and heading as in `device.rotations`, E its change of axes.

Sound meets other points of the body a little earlier or later, which echoes correct to first order (`echo_shift`).
"""
from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from mitsonar.device.rotations import NORTH_EAST_DOWN, rotation_matrix
from mitsonar.sonar.motion.gait import Gait, Swung
from mitsonar.sonar.motion.stepping import Stepping
from mitsonar.sonar.motion.track import Track
from mitsonar.sonar.motion.trajectory import Trajectory
from mitsonar.water.profile import SoundSpeedProfile
from mitsonar.water.waters import Waters

from .sea import Sea, SeaStand

STEPS = 3                          # iterations of t1; each multiplies its error by the ratio of speeds, 1/500
DEPTHS = 17                        # at which the slowness between two depths is averaged


class Mover(Protocol):
    """Course of a moving object; `sonar.motion.trajectory.Trajectory` is one."""

    def pose(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return position (..., 3) [m], z up, and attitude (..., 3) [rad], roll, pitch, heading, at times (...) [s]."""
        ...

    def rates(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return velocity (P, 3) [m/s] and angular velocity (P, 3) [rad/s], scene frame, at times (P,) [s]."""
        ...


@runtime_checkable
class MovingShape(Protocol):
    """Shape that moves."""

    known: tuple[float, float]  # [s]: first and last time of the mover
    begin: float | None  # [s]: time of the mover at the first ping; None: the mover keeps the time of the sonar's track
    poses: np.ndarray  # (K, V, 3) [m]: vertices in the object's own frame, in one pose or in those of a gait
    parts: tuple[MovingPart, ...]  # which keep their form, in the order of their vertices

    @property
    def mover(self) -> Trajectory:
        """Return the course of the shape."""
        ...

    def id(self) -> str:
        """Return the name of the shape."""
        ...


def moving_shape(shape: object) -> MovingShape | None:
    """Return a shape that moves; None for others."""
    return shape if isinstance(shape, MovingShape) else None


@dataclass(frozen=True, kw_only=True, eq=False)
class MovingPart:
    """Part of a moving shape that keeps its form: all of a shape that has no gait."""

    shape: MovingShape
    first: int  # number of its first vertex
    rest: np.ndarray  # (V, 3) [m]: vertices in the object's own frame, in the first pose
    gait: Gait | None = None

    @property
    def known(self) -> tuple[float, float]:
        """Return the first and last time of the mover [s]."""
        return self.shape.known

    @property
    def begin(self) -> float | None:
        """Return the time of the mover at the first ping [s], as of the shape."""
        return self.shape.begin

    @property
    def mover(self) -> Mover:
        """Return the course of the part."""
        return self.following(self.shape.mover)

    def following(self, course: Trajectory) -> Mover:
        """Return the course of the part of an object on another course."""
        return course if self.gait is None else Swung.of(course, self.gait)

    def id(self) -> str:
        """Return the name of the shape."""
        return self.shape.id()


class Stand(NamedTuple):
    """Place and motion of an object as the sound of a ping meets it, scene frame."""

    position: np.ndarray           # (3,) [m]
    rotation: np.ndarray           # (3, 3): from the object's own frame
    velocity: np.ndarray           # (3,) [m/s]
    turn_rate: np.ndarray          # (3,) [rad/s]
    met: float                     # [s] after the transmission

    def placed(self, points: np.ndarray) -> np.ndarray:
        """Return points (N, 3) [m] of the object's own frame in the scene."""
        return points @ self.rotation.T + self.position

    def turned(self, directions: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return directions (N, 3) of the object's own frame, at points of it, in the scene."""
        return directions @ self.rotation.T

    def fastest(self, points: np.ndarray) -> float:
        """Return the largest speed of points (N, 3) of the own frame [m/s], at most."""
        return float(np.linalg.norm(self.velocity)
                     + np.linalg.norm(self.turn_rate) * np.linalg.norm(points, axis=1).max())


@dataclass(frozen=True, kw_only=True, eq=False)
class Movements:
    """Stands of what moves in a scene, at the pings of a track: the objects, then the sea surface."""

    shapes: tuple[MovingPart, ...]
    track: Track  # planned
    waters: Waters
    stepping: Stepping | None = None  # of a sonar that is stepped
    sea: Sea | None = None  # None: the surface has no waves

    def key(self, ping: int) -> tuple[object, ...]:
        """Return what the stands at a ping follow from, for comparisons."""
        stepping = self.stepping
        return (ping,) if stepping is None else (ping, stepping.latest, *stepping.moved.values())

    def at(self, ping: int) -> list[Stand | SeaStand]:
        """Return the stands of all that moves at a ping; raise `ValueError` if it is beyond the track of an object."""
        stepping = self.stepping
        if stepping is None or stepping.latest is None:
            profile, sonar = self.waters.at(ping).profile, self.track.position[ping]
            return [*(_stand(shape.mover, float(self.time(shape, ping)), sonar, profile) for shape in self.shapes),
                    *self._sea_at(float(self.track.time[ping]), sonar, profile)]
        latest, profile = stepping.latest, self.waters.of_step(stepping.latest).column.profile
        stands: list[Stand | SeaStand] = []
        for shape in self.shapes:
            moved, time = stepping.moved.get(shape.id()), latest.time
            mover = None if moved is None else shape.following(moved)
            if mover is None:
                mover, (first, last) = shape.mover, shape.known
                if shape.begin is not None:
                    time = shape.begin + (time - self.track.time[0])
                if not first - 1e-9 <= time <= last + 1e-9:
                    raise ValueError(f'the track of the moving shape "{shape.id()}" lasts from {first:g} to {last:g} '
                                     f"s, and this ping is at {time:g} s of it; move the object yourself, or give it "
                                     "a longer track")
            stands.append(_stand(mover, float(time), latest.track.position[0], profile))
        return [*stands, *self._sea_at(float(latest.time), latest.track.position[0], profile)]

    def _sea_at(self, time: float, sonar: np.ndarray, profile: SoundSpeedProfile) -> list[SeaStand]:
        """Return the stand of the sea surface, if it has a mesh that moves."""
        stand = None if self.sea is None else self.sea.stand(time, sonar, profile)
        return [] if stand is None else [stand]

    def time(self, shape: MovingShape | MovingPart, ping: int | slice = slice(None)) -> np.ndarray:
        """Return the times [s] of an object's mover at a ping, or at all pings (P,)."""
        time = self.track.time[ping]
        return time if shape.begin is None else shape.begin + (time - self.track.time[0])

    def check(self) -> None:
        """Raise `ValueError` if an object's track does not cover all pings."""
        for shape in self.shapes:
            time, (first, last) = self.time(shape), shape.known
            for ping, what in ((0, "begins after the first"), (-1, "ends before the last")):
                if not first - 1e-9 <= time[ping] <= last + 1e-9:
                    raise ValueError(f'the track of the moving shape "{shape.id()}" {what} ping: it lasts from '
                                     f"{first:g} to {last:g} s, and that ping is at {time[ping]:g} s. Give a longer "
                                     "track or fewer pings, or set begin, the track's time at the first ping")

    def box(self, shape: MovingShape) -> tuple[np.ndarray, np.ndarray]:
        """Return the corners (3,) [m] of a box that holds an object at all pings, as it stands at the transmissions."""
        position, attitude = shape.mover.pose(self.time(shape))
        low, high = shape.poses.min((0, 1)), shape.poses.max((0, 1))
        corner = np.array([[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]]
                           for i in (0, 1) for j in (0, 1) for k in (0, 1)])
        turn = rotation_matrix(*np.moveaxis(attitude, -1, 0)) @ NORTH_EAST_DOWN
        points = (np.einsum("pij,kj->pki", turn, corner) + position[:, None]).reshape(-1, 3)
        return points.min(0), points.max(0)

    def depth_range(self) -> tuple[float, float]:
        """Return the least and the greatest depth that anything that moves reaches at any ping [m]."""
        spans = [] if self.sea is None else [(-self.sea.waves.crest, self.sea.waves.crest)]
        for shape in self.shapes:
            depth = -shape.mover.pose(self.time(shape))[0][..., 2]
            reach = float(np.linalg.norm(shape.rest, axis=1).max(initial=0))
            spans.append((float(depth.min()) - reach, float(depth.max()) + reach))
        return min(low for low, _ in spans), max(high for _, high in spans)


def _stand(mover: Mover, time: float, sonar: np.ndarray, profile: SoundSpeedProfile) -> Stand:
    """Return the stand of one object for sound that leaves a sonar (3,) [m] at a time [s] of its mover."""
    position, attitude = mover.pose(np.array(time))
    # the mean slowness hardly changes with the millimetres that the object sinks meanwhile
    slowness = float(np.mean(1 / profile.at(-np.linspace(sonar[2], position[2], DEPTHS))))
    met = 0.0
    for _ in range(STEPS):
        met = float(np.linalg.norm(position - sonar)) * slowness
        position, attitude = mover.pose(np.array(time + met))
    velocity, turn_rate = mover.rates(np.array([time + met]))
    return Stand(position=position, rotation=rotation_matrix(*attitude) @ NORTH_EAST_DOWN, velocity=velocity[0],
                 turn_rate=turn_rate[0], met=met)

