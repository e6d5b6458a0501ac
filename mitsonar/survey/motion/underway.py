"""A sonar that moves and turns between transmission and reception: when and from where its echoes come back.

An echo sent at time 0 from the place O is back at the time t at which the way from the point it comes from, at O + D n,
leads to where the sonar is then:

    t = τ + (|w| - D) / c_0,    w = D n - d(t),    d(t) = Σ_k d_k t^k,    ρ(t) = Σ_k r_k t^k

τ -> ``delay``, the two-way time had the sonar stood still; n -> ``towards``, where the bent return leg would leave O
for; D -> ``distance``; d_k and r_k -> ``displacement`` and ``turn`` of `sonar.trajectory`. The echo comes from w / |w|,
which in the body's frame is turned back by the body's rotation vector ρ(t).

In water of one sound speed this is exact. Elsewhere it is exact to first order in d. To second order it leaves out how
bending changes the curvature of the wave front, some hundredths of |d|² / 2 D: 1.6 ns at 85 m and 8 knots in a summer's
water. Strength and shadow of the return leg are taken to be those of the leg to O.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.device.types import Vector
from mitsonar.propagation.returns.travel import detour
from mitsonar.sonar.motion.trajectory import NEGLIGIBLE, PingTravel

SHORTEST = 1e-9                    # [s]: no way takes less time
TIMES, DEPRESSIONS = (0.125, 0.375, 0.625, 0.875, 1.0), (0.0, 0.5, 1.0)
GROUP_WIDTH, MOST_GROUPS = 0.25, 32    # of the beam, by which mean shifts within a group differ; groups at most
SHIFTS = 9                         # that stand for a group at most,
APART = 0.05                       # of the beam that these lie apart at least


@dataclass(frozen=True, kw_only=True)
class PingReception:
    """Hold times and directions of reception of echoes."""

    delay: mi.Float64  # (R,) [s]: from transmission to reception
    towards: Vector  # (R,)


class Underway:
    """Hold the motion within the pings of a survey."""

    def __init__(self, travel: PingTravel):
        travel = travel.trimmed()
        self._duration = travel.duration
        # where nothing turns, as on a straight course, the device has nothing to look up
        self._displacement, self._turn = (powers if (travel.reach(powers) > NEGLIGIBLE).any() else powers[:, :0]
                                        for powers in (travel.displacement, travel.turn))

    @property
    def moves(self) -> bool:
        """Return True if the sonar moves or turns within any ping."""
        return self._displacement.shape[1] + self._turn.shape[1] > 0

    def motion(self, ping: np.ndarray) -> PingMotion | None:
        """Return the motion of a block of pings (B,) on the device; None where there is none."""
        return PingMotion(self._displacement[ping], self._turn[ping], self._duration) if self.moves else None

    def drift(self, sound_speed: float) -> float:
        """Return the largest distance that the sonar moves while sound goes a metre out and back [-]."""
        time = self._duration * np.linspace(0.05, 1, 20)
        moved = np.linalg.norm(_evaluated(self._displacement, time), axis=-1)
        return float((moved / time).max(initial=0)) * 2 / sound_speed

    def along_shifts(self, rotation: np.ndarray, sound_speed: float,
                     width: float) -> tuple[np.ndarray, list[np.ndarray]]:
        """Return the shifts of the cosine u along the body between transmission and reception, by groups.

        Rays are drawn to suit both. Pings and sides of about the same shifts are a group, which shares a table of rays.
        """
        # rotation (P, 3, 3); sound_speed [m/s] -> group (P, 2), shifts (S,)
        if not self.moves:
            return np.zeros((len(rotation), 2), np.uint32), [np.zeros(1)]
        time = self._duration * np.array(TIMES)
        # (ping, time, 3), along the body's axes
        moved, turned = (_evaluated(powers, time) @ rotation for powers in (self._displacement, self._turn))
        side, depression = np.array([-1.0, 1.0])[:, None], np.array(DEPRESSIONS)
        aside, down = side * np.cos(depression), np.sin(depression) + 0 * side
        # (ping, time, side, depression)
        shift = (turned[..., 2, None, None] * aside - turned[..., 1, None, None] * down
                 - (moved[..., 0] / (0.5 * sound_speed * time))[..., None, None])
        mean = shift.mean((1, 3))
        step = max(GROUP_WIDTH * width, np.ptp(mean) / (MOST_GROUPS - 1))
        _, group = np.unique(np.round(mean / step), return_inverse=True)
        group = group.reshape(mean.shape).astype(np.uint32)
        found = []
        for number in range(int(group.max()) + 1):
            some = np.quantile(np.moveaxis(shift, 2, 1)[group == number], np.linspace(0, 1, SHIFTS))
            found.append(some[np.r_[True, np.diff(np.round(some / (APART * width))) > 0]])
        return group, found


    def aside_shifts(self, rotation: np.ndarray, sound_speed: float, depressions: Sequence[float]) -> np.ndarray:
        """Return the shifts of the cosine u of directions ahead between transmission and reception."""
        # rotation (P, 3, 3); sound_speed [m/s]; depressions [rad] -> (...)
        if not self.moves:
            return np.zeros(1)
        time = self._duration * np.array(TIMES)
        moved, turned = (_evaluated(powers, time) @ rotation for powers in (self._displacement, self._turn))
        ahead, down = np.cos(depressions), np.sin(depressions)
        return (turned[..., 0, None] * down - turned[..., 2, None] * ahead
                - (moved[..., 1] / (0.5 * sound_speed * time))[..., None])


class PingMotion:
    """Hold the motion of a block's pings: look-ups by a ping's number within the block."""
    # displacement (B, K, 3) [rad/s^k]; turn (B, K, 3) [rad/s^k]; duration [s]

    def __init__(self, displacement: np.ndarray, turn: np.ndarray, duration: float):
        self._lib, self._duration = arrays_of(mi.Float), dr.opaque(mi.Float, duration)
        self._powers = displacement.shape[1], turn.shape[1]
        rows = np.concatenate([displacement, turn], 1)
        rows = np.concatenate([rows, np.zeros((*rows.shape[:2], 1))], 2)
        self._table = upload(mi.Float, rows.astype(np.float32))
        dr.eval(self._table)

    def receive(self, ping: mi.UInt32, towards: Vector, distance: mi.Float, delay: mi.Float64,
                sound_speed: mi.Float) -> PingReception:
        """Return when and from where echoes come back."""
        # ping (R,); towards (R,); distance (R,) [m]; delay (R,) [s]; sound_speed (R,) [m/s]
        moves, turns = self._powers
        rows = [dr.gather(self._lib.Array4f, self._table, ping * (moves + turns) + k) for k in range(moves + turns)]
        rows = [mi.Vector3f(row[0], row[1], row[2]) for row in rows]
        time = mi.Float(delay)
        if moves:
            leg = rows[:moves], towards, distance, sound_speed
            _, later = self._later(*leg, time)
            # a steady sonar is later by a share of the time, l(t) = l(τ) t / τ, which solves t = τ + l(t); what an
            # unsteady one is off by then, the second step reduces by its speed over that of sound
            way, later = self._later(*leg, time + later / (1 - later / dr.maximum(time, SHORTEST)))
            time += later
            towards, delay = dr.normalize(way), delay + mi.Float64(later)
        if turns:
            towards = _turned_back(towards, self._at(rows[moves:], time))
        return PingReception(delay=delay, towards=towards)

    def _later(self, rows, towards, distance, sound_speed, time):
        """Return the way to where the sonar is at a time, w, and how much later an echo arrives along it than at O."""
        way, _, longer, whole = detour(towards, distance, self._at(rows, time))
        return way, longer / (whole * sound_speed)

    def _at(self, rows, time):
        """Return polynomials of the rows at times [s]."""
        time = dr.clip(time, 0, self._duration)
        value = rows[-1] * time
        for row in rows[-2::-1]:
            value = (value + row) * time
        return value


def _turned_back(v: Vector, rho: mi.Vector3f) -> Vector:
    """Return vectors turned by -|ρ| about ρ."""
    angle = dr.maximum(dr.norm(rho), 1e-6)
    sine, cosine = dr.sincos(0.5 * angle)
    axis = rho * (-sine / angle)
    twice = 2 * dr.cross(axis, v)
    return v + cosine * twice + dr.cross(axis, twice)


def _evaluated(powers: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Return polynomials (P, K, 3) at times (T,): (P, T, 3)."""
    return np.einsum("pkx,tk->ptx", powers, time[:, None] ** np.arange(1, powers.shape[1] + 1))
