"""Motion of a platform while echoes come in: polynomials in the time since the transmission.

    D(t) = Σ_k d_k t^k,    v = dD/dt,    R(t) = exp([r(t)]×),    r(t) = Σ_k r_k t^k,    ω ≈ dr/dt,    k = 1 ... K

d_k -> ``displacement``, r_k -> ``turn``, as of `sonar.trajectory.PingTravel`; scene coordinates. ω is right but for
r × dr/dt / 2, a hundredth of it while the platform turns by a degree: it decides how an element moves during the
fraction of a millisecond that an echo takes from the array's centre to it.

Written once for NumPy and Dr.Jit numbers.
"""
from __future__ import annotations

from collections.abc import Callable, Sequence

import drjit as dr
import numpy as np

from mitsonar.device.types import Numbers, Record, Triple


class Travel(Record):
    """The way of a platform after one transmission."""

    displacement: Sequence[Triple]  # [m/s^k]: K triples of plain numbers or opaque Float64; none at rest
    turn: Sequence[Triple]  # [rad/s^k]: likewise
    duration: Numbers  # [s]: end of the time in which the polynomials hold
    end_velocity: Triple  # [m/s]: at that time; the platform keeps it from then on
    end_turn_rate: Triple  # [rad/s]: dr/dt at that time, kept likewise

    @classmethod
    def within(cls, displacement: np.ndarray, turn: np.ndarray, duration: float,
               number: Callable[[float], Numbers] = float) -> Travel:
        """Make the way of one ping of a `PingTravel`, (K, 3) each, from its numbers as `number` converts them."""
        ends = [_slope(powers, duration) for powers in (displacement, turn)]
        moves, turns, (velocity, turn_rate) = (tuple(tuple(map(number, row)) for row in rows)
                                               for rows in (displacement, turn, ends))
        return cls(displacement=moves, turn=turns, duration=number(duration), end_velocity=velocity,
                   end_turn_rate=turn_rate)

    def moved(self, time: Numbers) -> tuple[Numbers, Numbers, Numbers]:
        """Return D(t): triple [m]."""
        return self._at(self.displacement, self.end_velocity, time)

    def velocity(self, time: Numbers) -> tuple[Numbers, Numbers, Numbers]:
        """Return v(t): triple [m/s]."""
        return _slope(self.displacement, self._inside(time))

    def turned(self, time: Numbers) -> tuple[Numbers, Numbers, Numbers]:
        """Return r(t): triple [rad]."""
        return self._at(self.turn, self.end_turn_rate, time)

    def turn_rate(self, time: Numbers) -> tuple[Numbers, Numbers, Numbers]:
        """Return ω(t): triple [rad/s]."""
        return _slope(self.turn, self._inside(time))

    def _at(self, coefficients: Sequence[Triple], end: Triple, time: Numbers) -> tuple[Numbers, Numbers, Numbers]:
        inside = self._inside(time)
        value = evaluated(coefficients, inside)
        if len(coefficients) > 1:
            beyond = time - inside
            value = tuple(part + v * beyond for part, v in zip(value, end))
        return value

    def _inside(self, time: Numbers) -> Numbers:
        if len(self.displacement) <= 1:
            return time
        return dr.minimum(time, self.duration) if dr.is_jit_v(time) else np.minimum(time, self.duration)


REST = Travel(displacement=(), turn=(), duration=0.0, end_velocity=(0.0, 0.0, 0.0), end_turn_rate=(0.0, 0.0, 0.0))


def steady(velocity: Triple, turn_rate: Triple = (0.0, 0.0, 0.0)) -> Travel:
    """Make the way at one velocity [m/s] and one angular velocity [rad/s], triples."""
    return Travel(displacement=(tuple(velocity),), turn=(tuple(turn_rate),), duration=np.inf,
                  end_velocity=tuple(velocity), end_turn_rate=tuple(turn_rate))


def evaluated(coefficients: Sequence[Triple], time: Numbers) -> tuple[Numbers, Numbers, Numbers]:
    """Return Σ_k p_k t^k, k = 1 ... K, of triples p_k: a triple."""
    value = [_zero(time)] * 3
    for row in reversed(coefficients):
        value = [(part + d) * time for part, d in zip(value, row)]
    return tuple(value)


def _slope(coefficients: Sequence[Triple] | np.ndarray, time: Numbers) -> tuple[Numbers, Numbers, Numbers]:
    """Derivatives of polynomials without a constant term: a triple."""
    value = [_zero(time)] * 3
    for power in range(len(coefficients), 0, -1):
        value = [part * time + power * d for part, d in zip(value, coefficients[power - 1])]
    return tuple(value)


def _zero(time: Numbers) -> Numbers:
    """Zero of a number's kind, which a kernel leaves out."""
    return type(time)(0) if dr.is_jit_v(time) else 0.0 * time
