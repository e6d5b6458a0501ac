"""How a sonar rocks on its way: narrow-band random roll, pitch, yaw and heave.

Each of the four is a sum of sinusoids

    a(t) = rms √(2/N) Σ_n cos(2π f_n t + φ_n),    f_n from a normal density about 1/period,  φ_n uniform

which for large N is a Gaussian process with that spectrum (Rice, Mathematical Analysis of Random Noise, 1944,
section 2.8). One f_n stands in each N-th part of the density; the mean square over a long time is rms², whatever the
seed.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

__all__ = ["RandomMotion"]

_LINES = 32
_RELATIVE_WIDTH = 0.15             # standard deviation of the frequencies about 1 / period, relative
_NAMES = ("roll", "pitch", "yaw", "heave")


@dataclass(frozen=True, kw_only=True)
class RandomMotion:
    """Hold how strongly a platform rocks, how slowly, and which realisation.

    Parameters
    ----------
    roll, pitch, yaw : float [rad]
        Root mean squares.
    heave : float [m]
        Root mean square.
    period : float [s]
        About which the motion's spectrum lies.
    seed : int
        The same seed gives the same motion.

    Raises
    ------
    ValueError
        If a root mean square is negative, the period is not positive, or a number is not finite.
    """

    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    heave: float = 0.0
    period: float = 8.0
    seed: int = 0

    def __post_init__(self):
        for name in (*_NAMES, "period"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0 and (value > 0 or name != "period")):
                raise ValueError(f"random motion: {name} is {value!r}; give a finite number "
                                 f"{'above 0' if name == 'period' else 'of 0 or more'}.")

    @property
    def moves(self) -> bool:
        """Whether the platform rocks at all."""
        return any(getattr(self, name) for name in _NAMES)

    def at(self, times: ArrayLike) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Realise the motion.

        Parameters
        ----------
        times : array (...) [s]

        Returns
        -------
        values, rates : dict of array (...)
            Of "roll", "pitch", "yaw" [rad, rad/s] and "heave" [m, m/s].
        """
        from scipy.special import ndtri

        times = np.asarray(times, dtype=np.float64)
        values, rates = {}, {}
        for number, name in enumerate(_NAMES):
            rng = np.random.default_rng([int(self.seed), number])
            share = (np.arange(_LINES) + rng.uniform(0.05, 0.95, _LINES)) / _LINES
            omega = 2 * np.pi / self.period * (1 + _RELATIVE_WIDTH * ndtri(share))
            phase = rng.uniform(0, 2 * np.pi, _LINES)
            values[name], rates[name] = np.zeros_like(times), np.zeros_like(times)
            scale = getattr(self, name) * np.sqrt(2 / _LINES)
            if scale:
                for line, start in zip(omega, phase):      # line by line: memory as of one
                    values[name] += scale * np.cos(line * times + start)
                    rates[name] -= scale * line * np.sin(line * times + start)
        return values, rates
