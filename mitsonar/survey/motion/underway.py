"""Times and directions in which echoes come back to a sonar that moves and turns between transmission and reception.

An echo sent at time 0 from the place O and scattered at O + D n meets the moving sonar at the time t:

    t = τ + (|w| - D) / c_0,    w = D n - d(t),    d(t) = Σ_k d_k t^k,    ρ(t) = Σ_k r_k t^k

τ -> ``delay``, two-way time of a sonar that stands still; n -> ``towards``, direction from O of the bent return leg;
D -> ``distance``; d_k and r_k -> ``displacement`` and ``turn`` of `sonar.trajectory`. The echo comes from w / |w|,
turned back in the body's frame by the body's rotation vector ρ(t).

In water of one sound speed this is exact, elsewhere exact to first order in d. The missing second order, the change of
the wave front's curvature by bending, is some hundredths of |d|² / 2 D: 1.6 ns at 85 m and 8 knots in summer water. The
return leg has the strength and the shadow of the leg to O.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.device.rotations import rotated
from mitsonar.device.types import Vector
from mitsonar.propagation.returns.moved_ends import detour
from mitsonar.propagation.returns.travel import evaluated
from mitsonar.sonar.motion.trajectory import NEGLIGIBLE, PingTravel, polynomials

from ..survey import Survey

SHORTEST = 1e-9                    # [s]: least travel time
TIMES, DEPRESSIONS = (0.125, 0.375, 0.625, 0.875, 1.0), (0.0, 0.5, 1.0)
GROUP_WIDTH, MOST_GROUPS = 0.25, 32    # beam widths by which mean shifts within a group differ; number of groups
SHIFTS = 9                         # largest number of shifts that represent a group
APART = 0.05                       # beam widths between these shifts


@dataclass(frozen=True, kw_only=True)
class PingReception:
    """Times and directions of reception of echoes."""

    delay: mi.Float64  # (R,) [s]: from transmission to reception
    towards: Vector  # (R,)


class Underway:
    """Motion within the pings of a survey."""

    def __init__(self, travel: PingTravel, survey: Survey | None = None):
        travel, self._survey = travel.trimmed(), survey
        self._duration = travel.duration
        # without turns, as on a straight course, the device needs no look-up
        self._displacement, self._turn = (powers if (travel.reach(powers) > NEGLIGIBLE).any() else powers[:, :0]
                                        for powers in (travel.displacement, travel.turn))

    @classmethod
    def of(cls, survey: Survey, duration: float) -> Underway:
        """Return the motion of a survey's pings for a duration [s]; of a sonar that is stepped, as planned at first."""
        return cls(survey.planned.trajectory.during(survey.planned.track.time, duration), survey)

    @property
    def moves(self) -> bool:
        """Return True if the sonar moves or turns within any ping."""
        return self._displacement.shape[1] + self._turn.shape[1] > 0

    def motion(self, ping: np.ndarray) -> PingMotion | None:
        """Return the motion of a block of pings (B,) on the device, None if the sonar stands still."""
        if self._survey is None or self._survey.passage.latest is None:
            displacement, turn = self._displacement[ping], self._turn[ping]
        else:
            displacement, turn = self._latest(ping)
        if not displacement.shape[1] + turn.shape[1]:
            return None
        return PingMotion(displacement, turn, self._duration)

    def _latest(self, ping: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the powers of the latest stepped ping; kernels stay if it needs no more of them than the plan."""
        assert self._survey is not None
        voyage = self._survey.voyage
        own = Underway(voyage.trajectory.during(voyage.track.time[ping], self._duration))
        displacement, turn = (np.pad(powers, [(0, 0), (0, max(planned.shape[1] - powers.shape[1], 0)), (0, 0)])
                              for powers, planned in ((own._displacement, self._displacement), (own._turn, self._turn)))
        return displacement, turn

    def drift(self, sound_speed: float) -> float:
        """Return the largest distance [m] that the sonar moves while sound travels one metre out and back [-]."""
        time = self._duration * np.linspace(0.05, 1, 20)
        moved = np.linalg.norm(polynomials(self._displacement, time), axis=-1)
        return float((moved / time).max(initial=0)) * 2 / sound_speed

    @property
    def largest_turn(self) -> float:
        """Return the largest angle [rad] by which the sonar turns within a ping."""
        return float(np.linalg.norm(polynomials(self._turn, self._duration * np.linspace(0, 1, 9)), axis=-1).max())

    def _in_body(self, rotation: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return times [s], and displacements and turns (ping, time, 3) along the body's axes."""
        time = self._duration * np.array(TIMES)
        moved, turned = (polynomials(powers, time) @ rotation for powers in (self._displacement, self._turn))
        return time, moved, turned

    def along_shifts(self, rotation: np.ndarray, sound_speed: float,
                     width: float) -> tuple[np.ndarray, list[np.ndarray]]:
        """Return the group (P, 2) of each ping and side, and the shifts (S,) of the cosine u along the body in each.

        A shift is the change of u between transmission and reception, and rays are drawn to suit both. Pings and sides
        of about the same shifts are a group, which shares a table of rays.
        """
        # rotation (P, 3, 3); sound_speed [m/s]; width of the beam in u [-]
        if not self.moves:
            return np.zeros((len(rotation), 2), np.uint32), [np.zeros(1)]
        shift, mean = self._along(rotation, sound_speed)
        step = max(GROUP_WIDTH * width, np.ptp(mean) / (MOST_GROUPS - 1))
        _, group = np.unique(np.round(mean / step), return_inverse=True)
        group = group.reshape(mean.shape).astype(np.uint32)
        groups = []
        for number in range(int(group.max()) + 1):
            shifts = np.quantile(np.moveaxis(shift, 2, 1)[group == number], np.linspace(0, 1, SHIFTS))
            groups.append(shifts[np.r_[True, np.diff(np.round(shifts / (APART * width))) > 0]])
        return group, groups

    def groups_of(self, ping: np.ndarray, rotation: np.ndarray, sound_speed: float, width: float) -> np.ndarray:
        """Return the groups (B, 2) of a stepped ping: those of the planned pings and sides of about its shifts."""
        # ping (B,); rotation (B, 3, 3); the rest as of `along_shifts`
        assert self._survey is not None
        planned = self._survey.planned.track.rotation()
        group, _ = self.along_shifts(planned, sound_speed, width)
        displacement, turn = self._latest(ping)
        own = Underway(PingTravel(displacement=displacement, turn=turn, duration=self._duration))
        mean = own._along(rotation, sound_speed)[1] if own.moves else np.zeros((len(ping), 2))
        known = self._along(planned, sound_speed)[1].ravel() if self.moves else np.zeros(group.size)
        return group.ravel()[np.argmin(abs(mean[..., None] - known), axis=-1)]

    def _along(self, rotation: np.ndarray, sound_speed: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the shifts of u (P, time, side, depression) between transmission and reception; their means (P, side).
        """
        time, moved, turned = self._in_body(rotation)
        side, depression = np.array([-1.0, 1.0])[:, None], np.array(DEPRESSIONS)
        aside, down = side * np.cos(depression), np.sin(depression) + 0 * side
        # (ping, time, side, depression)
        shift = (turned[..., 2, None, None] * aside - turned[..., 1, None, None] * down
                 - (moved[..., 0] / (0.5 * sound_speed * time))[..., None, None])
        return shift, shift.mean((1, 3))

    def aside_shifts(self, rotation: np.ndarray, sound_speed: float, depressions: Sequence[float]) -> np.ndarray:
        """Return the shifts of the athwart cosine of directions ahead between transmission and reception."""
        # rotation (P, 3, 3); sound_speed [m/s]; depressions (D,) [rad] -> (P, time, D)
        if not self.moves:
            return np.zeros(1)
        time, moved, turned = self._in_body(rotation)
        ahead, down = np.cos(depressions), np.sin(depressions)
        return (turned[..., 0, None] * down - turned[..., 2, None] * ahead
                - (moved[..., 1] / (0.5 * sound_speed * time))[..., None])


class PingMotion:
    """Motion of a block's pings, looked up by a ping's number within the block."""

    def __init__(self, displacement: np.ndarray, turn: np.ndarray, duration: float):
        # displacement (B, K, 3) [m/s^k]; turn (B, K, 3) [rad/s^k]; duration [s]
        self._lib, self._duration = arrays_of(mi.Float), dr.opaque(mi.Float, duration)
        self._powers = displacement.shape[1], turn.shape[1]
        rows = np.concatenate([displacement, turn], 1)
        rows = np.concatenate([rows, np.zeros((*rows.shape[:2], 1))], 2)
        self._table = upload(mi.Float, rows.astype(np.float32))
        dr.eval(self._table)

    def receive(self, ping: mi.UInt32, towards: Vector, distance: mi.Float, delay: mi.Float64,
                sound_speed: mi.Float) -> PingReception:
        """Return the times and directions in which echoes come back."""
        # ping, towards (R,); distance (R,) [m]; delay (R,) [s]; sound_speed (R,) [m/s]
        moves, turns = self._powers
        rows = self._rows(ping)
        time = mi.Float(delay)
        if moves:
            leg = rows[:moves], towards, distance, sound_speed
            _, later = self._later(*leg, time)
            # at constant velocity, l(t) = l(τ) t / τ solves t = τ + l(t); otherwise the second step multiplies the
            # error by the ratio of platform speed to sound speed
            way, later = self._later(*leg, time + later / (1 - later / dr.maximum(time, SHORTEST)))
            time += later
            towards, delay = dr.normalize(way), delay + mi.Float64(later)
        if turns:
            towards = mi.Vector3f(*rotated(towards, self._at(rows[moves:], time), back=True))
        return PingReception(delay=delay, towards=towards)

    def moved(self, ping: mi.UInt32, time: mi.Float) -> mi.Vector3f:
        """Return the displacements d(t) [m] at times [s]."""
        rows = self._rows(ping)[:self._powers[0]]
        return self._at(rows, time) if rows else mi.Vector3f(0)

    def turned(self, ping: mi.UInt32, time: mi.Float) -> mi.Vector3f:
        """Return the rotation vectors ρ(t) [rad] at times [s]."""
        rows = self._rows(ping)[self._powers[0]:]
        return self._at(rows, time) if rows else mi.Vector3f(0)

    def _rows(self, ping: mi.UInt32) -> list[mi.Vector3f]:
        """Return the powers of displacement and turn."""
        count = sum(self._powers)
        rows = [dr.gather(self._lib.Array4f, self._table, ping * count + k) for k in range(count)]
        return [mi.Vector3f(row[0], row[1], row[2]) for row in rows]

    def _later(self, rows, towards, distance, sound_speed, time):
        """Return w at a time, and the delay [s] of an echo along it after its arrival at O."""
        way, _, later = detour(towards, distance, self._at(rows, time))
        return way, later / sound_speed

    def _at(self, rows, time):
        """Return polynomials of the rows at times [s]."""
        return mi.Vector3f(*evaluated(rows, dr.clip(time, 0, self._duration)))
