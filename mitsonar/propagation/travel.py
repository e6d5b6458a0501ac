"""How a platform goes on while echoes come in, as legs of rays need it: polynomials in the time since the transmission.

    D(t) = Σ_k d_k t^k,    v = dD/dt,    R(t) = exp([r(t)]×),    r(t) = Σ_k r_k t^k,    ω ≈ dr/dt,    k = 1 ... K

d_k -> ``displacement``, r_k -> ``turn``, as of `sonar.trajectory.PingTravel`; scene coordinates. ω is right but for
r × dr/dt / 2, a hundredth of it while the platform turns by a degree: it decides how an element moves during the
fraction of a millisecond that an echo takes from the array's centre to it.

Written once for NumPy and Dr.Jit numbers.
"""
from __future__ import annotations

from collections.abc import Sequence

import drjit as dr
import numpy as np

from ..device.record import Record
from ..device.types import Numbers, Triple

__all__ = ["REST", "Travel", "rotated", "steady"]


class Travel(Record):
    """The way of a platform after one transmission.

    Attributes
    ----------
    displacement, turn : tuple of K triples [m/s^k], [rad/s^k]
        Plain numbers, or opaque Float64; none where the platform is at rest.
    duration : number [s]
        Up to when the polynomials hold; later it goes straight on.
    """

    displacement: Sequence[Triple]
    turn: Sequence[Triple]
    duration: Numbers

    def moved(self, time: Numbers) -> tuple[Numbers, Numbers, Numbers]:
        """Give D(t): triple [m]."""
        return self._at(self.displacement, time)

    def velocity(self, time: Numbers) -> tuple[Numbers, Numbers, Numbers]:
        """Give v(t): triple [m/s]."""
        return self._slope(self.displacement, time)

    def turned(self, time: Numbers) -> tuple[Numbers, Numbers, Numbers]:
        """Give r(t): triple [rad]."""
        return self._at(self.turn, time)

    def turn_rate(self, time: Numbers) -> tuple[Numbers, Numbers, Numbers]:
        """Give ω(t): triple [rad/s]."""
        return self._slope(self.turn, time)

    def _at(self, coefficients: Sequence[Triple], time: Numbers) -> tuple[Numbers, Numbers, Numbers]:
        inside = self._inside(time)
        value = [_zero(time)] * 3
        for row in reversed(coefficients):
            value = [(part + d) * inside for part, d in zip(value, row)]
        if len(coefficients) > 1:
            value = [part + v * (time - inside) for part, v in zip(value, self._slope(coefficients, inside))]
        return tuple(value)

    def _slope(self, coefficients: Sequence[Triple], time: Numbers) -> tuple[Numbers, Numbers, Numbers]:
        inside = self._inside(time)
        value = [_zero(time)] * 3
        for power in range(len(coefficients), 0, -1):
            value = [part * inside + power * d for part, d in zip(value, coefficients[power - 1])]
        return tuple(value)

    def _inside(self, time: Numbers) -> Numbers:
        if len(self.displacement) <= 1:
            return time
        return dr.minimum(time, self.duration) if dr.is_jit_v(time) else np.minimum(time, self.duration)


REST = Travel(displacement=(), turn=(), duration=0.0)


def steady(velocity: Triple, turn_rate: Triple = (0.0, 0.0, 0.0)) -> Travel:
    """Make the way at one velocity [m/s] and one angular velocity [rad/s], triples."""
    return Travel(displacement=(tuple(velocity),), turn=(tuple(turn_rate),), duration=np.inf)


def rotated(vector: Triple, rotation: Triple, back: bool = False) -> tuple[Numbers, Numbers, Numbers]:
    """Turn a vector by a rotation vector [rad], or back: triples (Rodrigues)."""
    (x, y, z), (rx, ry, rz) = vector, rotation
    square = rx * rx + ry * ry + rz * rz
    xp = dr if dr.is_jit_v(square) else np
    angle = xp.sqrt(square + 1e-30)
    kx, ky, kz = rx / angle, ry / angle, rz / angle
    sine, cosine = xp.sin(angle), xp.cos(angle)
    sine = -sine if back else sine
    along = (kx * x + ky * y + kz * z) * (1 - cosine)
    return (x * cosine + (ky * z - kz * y) * sine + kx * along, y * cosine + (kz * x - kx * z) * sine + ky * along,
            z * cosine + (kx * y - ky * x) * sine + kz * along)


def _zero(time: Numbers) -> Numbers:
    """Zero of a number's kind, which a kernel leaves out."""
    return type(time)(0) if dr.is_jit_v(time) else 0.0 * time
