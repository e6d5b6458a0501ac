"""A sonar that moves and turns between transmission and reception: where its echoes come back to.

An echo sent at time 0 from the place O is back at the time t at which the way from the point it comes from, at O + D n,
leads to where the sonar is then:

    t = τ + (|w| - D) / c_0,    w = D n - d(t),    d(t) = Σ_k d_k t^k,    ρ(t) = Σ_k r_k t^k

τ -> ``delay``, the two-way time had the sonar stood still; n -> ``towards``, where the bent return leg would leave O
for; D -> ``distance``; d_k and r_k -> ``displacement`` and ``turn`` of `sonar.trajectory`. The echo comes from w / |w|,
which the body sees turned back by its rotation vector ρ(t).

That is exact in water of one speed. Elsewhere it is to first order in d, and to second but for what bending does to the
curvature of the wave front, some hundredths of |d|² / 2 D: 1.6 ns at 85 m and 8 knots in a summer's water. Strength and
shadow of the return leg are those of the leg to O.
"""
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from ..device.arrays import arrays_of, upload
from ..sonar.trajectory import NEGLIGIBLE, PingTravel

__all__ = ["Motion", "Reception", "Underway"]

STEPS = 3                          # each is nearer by the speed over that of sound
TIMES, DEPRESSIONS = (0.125, 0.375, 0.625, 0.875, 1.0), (0.0, 0.5, 1.0)
KIND, KINDS = 0.25, 32             # of the beam that shifts of a kind differ by, unless that makes more kinds than this
SHIFTS = 9                         # that stand for a kind, and
SAME = 0.05                        # of the beam that they lie apart at least


@dataclass(frozen=True, kw_only=True)
class Reception:
    """How echoes are heard.

    Attributes
    ----------
    delay : Float64 (R,) [s]
        From transmission to reception.
    towards : Vector3f (R,)
        Unit: where they come from, in the frame that turns with the body and was the scene's at transmission.
    """

    delay: object
    towards: object


class Underway:
    """The motion within the pings of a survey.

    Parameters
    ----------
    travel : PingTravel
        Of all pings; the platform stops at its end.
    """

    def __init__(self, travel: PingTravel):
        travel = travel.trimmed()
        self.lasting = travel.duration
        # a course that is straight turns nothing: no look-ups for that
        self.displacement, self.turn = (powers if (travel.reach(powers) > NEGLIGIBLE).any() else powers[:, :0]
                                        for powers in (travel.displacement, travel.turn))

    def __bool__(self):
        return self.displacement.shape[1] + self.turn.shape[1] > 0

    def block(self, ping):
        """The motion of some pings (B,) on the device, as numbered in the block; None where there is none."""
        return Motion(self.displacement[ping], self.turn[ping], self.lasting) if self else None

    def drift(self, sound_speed):
        """How far the sonar moves while sound goes a metre out and back, at most [-]."""
        time = self.lasting * np.linspace(0.05, 1, 20)
        moved = np.linalg.norm(_evaluated(self.displacement, time), axis=-1)
        return float((moved / time).max(initial=0)) * 2 / sound_speed

    def shifts(self, rotation, sound_speed, width):
        """By how much the cosine u along the body changes until reception, for rays to be drawn by.

        Parameters
        ----------
        rotation : (P, 3, 3)
            From body to scene, at transmission.
        sound_speed : float [m/s]
        width : float [-]
            Of the beam, in u.

        Returns
        -------
        kind : (P, 2) uint32
            Of every ping and side: those with about the same shift are of one kind.
        shifts : list of (S,)
            What occurs in each kind, at some times and depression angles; 0 alone where the platform stands still.
        """
        if not self:
            return np.zeros((len(rotation), 2), np.uint32), [np.zeros(1)]
        time = self.lasting * np.array(TIMES)
        # (ping, time, 3), along the body's axes
        moved, turned = (_evaluated(powers, time) @ rotation for powers in (self.displacement, self.turn))
        side, depression = np.array([-1.0, 1.0])[:, None], np.array(DEPRESSIONS)
        aside, down = side * np.cos(depression), np.sin(depression) + 0 * side
        # (ping, time, side, depression)
        shift = (turned[..., 2, None, None] * aside - turned[..., 1, None, None] * down
                 - (moved[..., 0] / (0.5 * sound_speed * time))[..., None, None])
        mean = shift.mean((1, 3))
        step = max(KIND * width, np.ptp(mean) / (KINDS - 1))
        _, kind = np.unique(np.round(mean / step), return_inverse=True)
        kind = kind.reshape(mean.shape).astype(np.uint32)
        found = []
        for number in range(int(kind.max()) + 1):
            some = np.quantile(np.moveaxis(shift, 2, 1)[kind == number], np.linspace(0, 1, SHIFTS))
            found.append(some[np.r_[True, np.diff(np.round(some / (SAME * width))) > 0]])
        return kind, found


class Motion:
    """The motion of a block's pings: look-ups by number."""

    def __init__(self, displacement, turn, lasting):
        self.lib = arrays_of(mi.Float)
        self.lasting = dr.opaque(mi.Float, lasting)
        self.powers = displacement.shape[1], turn.shape[1]
        rows = np.concatenate([displacement, turn], 1)
        rows = np.concatenate([rows, np.zeros((*rows.shape[:2], 1))], 2)
        self.table = upload(mi.Float, rows.astype(np.float32))
        dr.eval(self.table)

    def receive(self, ping, towards, distance, delay, sound_speed):
        """Receive echoes.

        Parameters
        ----------
        ping : UInt32 (R,)
        towards : Vector3f (R,)
            Unit, where the return leg would leave the place of transmission for.
        distance : Float (R,) [m]
            From there to the point the echo comes from.
        delay : Float64 (R,) [s]
            Had the sonar stood still.
        sound_speed : Float (R,) [m/s]
            At the sonar.

        Returns
        -------
        Reception
        """
        moves, turns = self.powers
        rows = [dr.gather(self.lib.Array4f, self.table, ping * (moves + turns) + k) for k in range(moves + turns)]
        rows = [mi.Vector3f(row[0], row[1], row[2]) for row in rows]
        later, time = mi.Float(0), mi.Float(delay)
        if moves:
            for _ in range(STEPS):
                moved = self._at(rows[:moves], time)
                way = distance * towards - moved
                # |w| - D, without the difference of large numbers
                later = (dr.squared_norm(moved) - 2 * distance * dr.dot(towards, moved)) / (
                    (dr.norm(way) + distance) * sound_speed)
                time = mi.Float(delay) + later
            towards, delay = dr.normalize(way), delay + mi.Float64(later)
        if turns:
            towards = _turned_back(towards, self._at(rows[moves:], time))
        return Reception(delay=delay, towards=towards)

    def _at(self, rows, time):
        time = dr.clip(time, 0, self.lasting)
        value = rows[-1] * time
        for row in rows[-2::-1]:
            value = (value + row) * time
        return value


def _turned_back(v, rho):
    """Vectors turned by -|ρ| about ρ."""
    angle = dr.maximum(dr.norm(rho), 1e-6)
    sine, cosine = dr.sincos(0.5 * angle)
    axis = rho * (-sine / angle)
    twice = 2 * dr.cross(axis, v)
    return v + cosine * twice + dr.cross(axis, twice)


def _evaluated(powers, time):
    """Polynomials (P, K, 3) at times (T,): (P, T, 3)."""
    return np.einsum("pkx,tk->ptx", powers, time[:, None] ** np.arange(1, powers.shape[1] + 1))
