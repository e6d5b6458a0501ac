"""Kaiser-Bessel bells: what an echo between two places of a grid is spread over, and how that is divided out again.

    k(x) = I₀(β √(1 - (2x/w)²)) / I₀(β),      K(ν) = (w / I₀(β)) sinh(√(β² - (πwν)²)) / √(β² - (πwν)²)

w -> ``taps``, x in places of the grid, ν in cycles a place. β is the best for signals of |ν| <= ``band`` (Beatty,
Nishimura & Pauly 2005, IEEE TMI 24, 799, eq. 5, with the ratio 1/2 : band as its oversampling).
"""
from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import i0

__all__ = ["Bell"]


@dataclass(frozen=True)
class Bell:
    """Kaiser-Bessel bell over four places.

    Attributes
    ----------
    band : float [cycles a place]
        Of the signals it serves, below 1/2.
    """

    band: float

    taps = 4

    @cached_property
    def shape(self) -> float:
        """Beatty's β."""
        ratio = 0.5 / self.band
        return np.pi * np.sqrt((self.taps / ratio) ** 2 * (ratio - 0.5) ** 2 - 0.8)

    def impulse(self, x: ArrayLike) -> np.ndarray:
        """Give k at x places from the echo."""
        inside = 1 - (2 * np.asarray(x, float) / self.taps) ** 2
        return np.where(inside > 0, i0(self.shape * np.sqrt(np.maximum(inside, 0))) / i0(self.shape), 0.0)

    def spectrum(self, frequency: ArrayLike) -> np.ndarray:
        """Give the Fourier transform of k at `frequency` [cycles a place]."""
        root = np.sqrt(self.shape ** 2 - (np.pi * self.taps * np.asarray(frequency, float)) ** 2 + 0j)
        near = np.abs(root) < 1e-6
        return np.real(np.where(near, 1.0, np.sinh(root) / np.where(near, 1, root))) * self.taps / i0(self.shape)
