"""Noise of the sea and of the receivers in beams, drawn on the device.

Noise from all directions alike is plane waves whose sines are evenly distributed over -1..1: white on (frequency, row).
A receiver's own noise is white on (frequency, element), which over rows is a stationary process with the spectrum
V = Σ_n |w_n|² δ(ν - ν_n) / (Σ|w_n|)².

    N(f, r) = |S_r(f)| √(f_s L A ds/2) Σ_k k(k) g(f, r - k),       k = -1, 0, 1                     before the line
    N(f, ν) = |S_r(f)| √(f_s L O M V) g(f, ν)                                                       after it

A, O -> ``ambient``, ``own``; S_r the replica, L samples of an FFT, M rows of a period. Rows go through the bell, since
all will be divided by its spectrum. g is one of (±1 ± i)/√2, each as likely: a sample of a beam is a sum over all
frequencies, and so as good as Gaussian (Rice 1944, random phases), at a third of the cost of Gaussian g.

Parallel lines at the places y_m across them, with the weights v_m, are summed and receive less:

    A(s) = A Σ_mn v_m v_n J₀(2π (y_m - y_n) √(1 - s²) / λ) / (Σ|v|)²,       O Σ|v|² / (Σ|v|)²

the mean of their pattern over all directions with the sine s along them.
"""
from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType

import numpy as np
from scipy.special import j0

from mitsonar.device.arrays import reinterpreted
from mitsonar.device.chance import hashed
from mitsonar.device.types import Float, UInt32
from mitsonar.units import power_from_db

from ..noise import ElementNoise

SIGN = 1 << 31                     # bit of a number's sign
ROOT_HALF = int(np.float32(np.sqrt(0.5)).view(np.uint32))


@dataclass(frozen=True, kw_only=True)
class NoiseDensity:
    """Spectral densities of noise at one element, in the square of the unit of echoes."""

    ambient: float = 0.0  # [1/Hz]: from all directions alike
    own: float = 0.0  # [1/Hz]: of each receiver, independent of the others'
    across: tuple[float, ...] = (0.0,)  # [wavelengths]: places of parallel lines,
    weights: tuple[float, ...] = (1.0,)  # and their weights v

    def __post_init__(self):
        for name in ("ambient", "own"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0):
                raise ValueError(f"noise density: {name} is {value} per Hz; give a finite number of 0 or more.")
        if not (len(self.across) == len(self.weights) and any(self.weights)):
            raise ValueError(f"noise density: {len(self.across)} parallel lines have the weights {self.weights}; give "
                             "each one, and not 0 to all.")

    @classmethod
    def of(cls, noise: ElementNoise | None, source_level_db: float, across: tuple[float, ...] = (0.0,),
           weights: tuple[float, ...] = (1.0,)) -> NoiseDensity | None:
        """Return the density of elements' noise for echoes of a source level of 0 dB; None where there is no noise."""
        if noise is None:
            return None
        ambient, own = (0.0 if level is None else float(power_from_db(level) / power_from_db(source_level_db))
                        for level in (noise.ambient_db, noise.self_noise_db))
        return cls(ambient=ambient, own=own, across=across, weights=weights)

    def ambient_at(self, sine: np.ndarray) -> np.ndarray:
        """Return A(s) at sines (R,) along the lines [1/Hz]."""
        level = np.sqrt(np.maximum(1 - np.square(sine), 0))
        # even lines have few distances
        apart, which = np.unique(np.abs(np.subtract.outer(self.across, self.across)).round(9), return_inverse=True)
        share = np.bincount(which.ravel(), np.multiply.outer(self.weights, self.weights).ravel())
        total = j0(2 * np.pi * np.multiply.outer(level, apart)) @ share
        return self.ambient * np.maximum(total, 0) / np.abs(self.weights).sum() ** 2

    @property
    def own_of_lines(self) -> float:
        """Return what parallel lines together receive of their elements' own noise [1/Hz]."""
        return self.own * float(np.square(self.weights).sum() / np.abs(self.weights).sum() ** 2)


def random_phases(lib: ModuleType, index: UInt32, key: UInt32, count: int = 1) -> list[Float]:
    """Return one of (±1 ± i)/√2, or several, for numbers under a key: real and imaginary parts by turns."""
    bits = hashed(lib, index, key)
    return [reinterpreted(lib.Float, ((bits << (16 // count * part)) & SIGN) | ROOT_HALF) for part in range(2 * count)]
