"""Bounds that a fit cannot cross, by a transformation: steps go through q, and x stays between.

    both      x = m + h tanh((q - m) / h),         m, h -> middle and half width
    one       x = b ± s ln(1 + exp(±(q - b) / s)), s -> the prior's deviation

Projection onto bounds would stop steps that are solved for all unknowns together; this leaves them smooth. Where x is
far from a bound x is q; the prior is normal in q.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["Bounds"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Bounds:
    """Limits of a parameter's numbers.

    Parameters
    ----------
    lower, upper : float
        May be infinite.
    scale : (n,) float
        s.
    """

    lower: float
    upper: float
    scale: np.ndarray

    def inside(self, free: np.ndarray) -> np.ndarray:
        """Give x of q (n,)."""
        if self._both:
            middle, half = self._middle
            return middle + half * np.tanh((free - middle) / half)
        sign, bound = self._one
        return free if sign == 0 else bound + sign * self.scale * np.logaddexp(0, sign * (free - bound) / self.scale)

    def slope(self, free: np.ndarray) -> np.ndarray:
        """Give dx/dq of q (n,)."""
        if self._both:
            middle, half = self._middle
            return 1 / np.cosh(np.clip((free - middle) / half, -300, 300)) ** 2
        sign, bound = self._one
        if sign == 0:
            return np.ones_like(free)
        return 0.5 * (1 + np.tanh(0.5 * sign * (free - bound) / self.scale))

    def deviation(self, free: np.ndarray, of_free: np.ndarray) -> np.ndarray:
        """Give that of x where q (n,) has the deviations (n,): half the way from one below to one above."""
        if not (self._both or self._one[0]):
            return of_free
        return 0.5 * (self.inside(free + of_free) - self.inside(free - of_free))

    def free(self, numbers: np.ndarray) -> np.ndarray:
        """Give q of x (n,) strictly between the bounds."""
        if self._both:
            middle, half = self._middle
            return middle + half * np.arctanh((numbers - middle) / half)
        sign, bound = self._one
        if sign == 0:
            return numbers
        above = sign * (numbers - bound) / self.scale
        return bound + sign * self.scale * (above + np.log(-np.expm1(-above)))

    @property
    def _both(self) -> bool:
        return bool(np.isfinite(self.lower) and np.isfinite(self.upper))

    @property
    def _middle(self) -> tuple[float, float]:
        return (self.lower + self.upper) / 2, (self.upper - self.lower) / 2

    @property
    def _one(self) -> tuple[int, float]:
        if np.isfinite(self.lower):
            return 1, self.lower
        return (-1, self.upper) if np.isfinite(self.upper) else (0, 0.0)
