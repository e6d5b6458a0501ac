"""Absorption across the band for every echo at its own time, by slightly complex taps.

    e^{-κ(f) t} = e^{-κ(f) t_m} e^{-κ(f) (t - t_m)},         κ (t - t_m) = (a0 + a1 ν + a2 ν²) n                   (1)
    e^{-a1 n ν - a2 n ν²} ≈ 1 + c1 ν + c2 ν² + c3 ν³:        ν e^{-i2πνx} = (i/2π) d/dx e^{-i2πνx}                 (2)
    taps  k + c1 (i/2π) k' - c2 k''/(4π²) - c3 i k'''/(8π³),                                        k(x) the echo's bell

κ -> loss beyond that at the carrier [Np/s] of two-way time (`reception.excess_loss_rate`), ν frequency in cycles a
sample, n samples after the record's middle t_m. What absorbs at t_m is a filter of the whole record; (2) is left, and
small. No transform is added: a product with ν is a derivative with respect to the echo's place, and a bell has its own.
"""
from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import drjit as dr
import numpy as np
from numpy.polynomial import Polynomial

from mitsonar.device.types import ArrayTypes, Float

from ..impulses import Bell

DEGREE = 9                         # of the polynomials of taps, whose third derivative is used


@dataclass(frozen=True, kw_only=True, eq=False)
class AbsorptionTerms:
    """κ of the module, a polynomial of frequency."""

    rate: np.ndarray  # (3,) [Np a sample]: a0, a1, a2
    middle: float  # [samples]: column of the record's middle

    def tap_weights(self, lib: ArrayTypes, bell: Bell, column: Float, x: Float) -> list[tuple[Float, Float]]:
        """Return real and imaginary part of the taps of an echo x in [0, 1) after the second one, at a column."""
        a0, a1, a2, middle = (dr.opaque(lib.Float, value) for value in (*self.rate, self.middle))
        n = column - middle
        a1, a2 = a1 * n, a2 * n
        level = dr.exp(-a0 * n)
        first = level * -a1 * (0.5 / np.pi)
        second = level * dr.fma(0.5 * a1, a1, -a2) * (-0.25 / np.pi ** 2)
        third = level * a1 * dr.fma(a1, a1 * (-1 / 6), a2) * (-0.125 / np.pi ** 3)
        weights, x = [], x - 0.5
        for tap in _derivatives(bell):
            k = [_horner(lib, x, series) for series in tap]
            weights.append((dr.fma(second, k[2], level * k[0]), dr.fma(third, k[3], first * k[1])))
        return weights


def absorption_terms(rate: np.ndarray, frequency: np.ndarray, weight: np.ndarray, middle: float) -> AbsorptionTerms:
    """Fit (1) where a pulse has its energy."""
    # rate (F,) [Np a sample]; frequency (F,) [cycles a sample]; weight (F,) [-]; middle [samples]
    fit = Polynomial.fit(frequency, rate, 2, domain=[-1, 1], w=np.sqrt(weight))
    return AbsorptionTerms(rate=np.append(fit.coef, [0, 0])[:3], middle=middle)


@lru_cache
def _derivatives(bell: Bell) -> list[list[np.ndarray]]:
    """Return polynomials of the four taps for an echo x = -1/2..1/2 off their middle, and three derivatives."""
    x = 0.5 * np.cos(np.pi * (np.arange(400) + 0.5) / 400)
    taps = (Polynomial.fit(x, bell.impulse(tap - (bell.taps - 1) / 2 - x), DEGREE, domain=[-1, 1])
            for tap in range(bell.taps))
    return [[tap.deriv(order).coef if order else tap.coef for order in range(4)] for tap in taps]


def _horner(lib: ArrayTypes, x: Float, series: np.ndarray) -> Float:
    total = lib.Float(float(series[-1]))
    for coefficient in series[-2::-1]:
        total = dr.fma(total, x, lib.Float(float(coefficient)))
    return total
