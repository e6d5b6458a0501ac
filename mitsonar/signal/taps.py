"""Taps of the kernels of `impulses` on the device: how an echo between two samples is spread over the next ones.

    cosine, sine of 2πx by their series of half the angle, doubled                                 `turned`
    Kaiser-Bessel bell    polynomials in the echo's place between two samples, an even and an odd part for mirrored taps
    Peterson's kernel     sin(πx)/π once, over the distance to each tap, times the window there
"""
from functools import lru_cache

import drjit as dr
import numpy as np

from ..device.types import ArrayTypes, Float
from .bells import Bell
from .impulses import Kernel, Nearest, Peterson

__all__ = ["tap_weights", "turned"]

POLYNOMIAL = 5                     # degree of the taps of the Kaiser-Bessel bell: higher ones leave the error as it is


def tap_weights(lib: ArrayTypes, kernel: Kernel | Bell, x: Float) -> list[Float]:
    """Give the kernel's taps for an echo x in [0, 1) after the middle one."""
    if isinstance(kernel, Nearest):
        return [lib.Float(1)]
    if isinstance(kernel, Peterson):
        return _hann_sinc(lib, x, kernel.taps)
    x = x - 0.5
    pairs = [_even_and_odd(lib, x, coefficients) for coefficients in _bell(kernel)]
    return [even + odd for even, odd in pairs] + [even - odd for even, odd in reversed(pairs)]


def turned(lib: ArrayTypes, cycles: Float) -> tuple[Float, Float]:
    """Give cosine and sine of 2π cycles, to 1e-7: of half the angle by their series, then doubled."""
    x = (cycles - dr.round(cycles)) * np.pi
    x2 = x * x
    x4 = x2 * x2
    sine = x * dr.fma(x4, dr.fma(x4, lib.Float(1 / 362880), dr.fma(x2, lib.Float(-1 / 5040), lib.Float(1 / 120))),
                      dr.fma(x2, lib.Float(-1 / 6), lib.Float(1)))
    cosine = dr.fma(x4, dr.fma(x4, dr.fma(x2, lib.Float(-1 / 3628800), lib.Float(1 / 40320)),
                               dr.fma(x2, lib.Float(-1 / 720), lib.Float(1 / 24))),
                    dr.fma(x2, lib.Float(-0.5), lib.Float(1)))
    twice = sine + sine
    return dr.fma(-twice, sine, 1), twice * cosine


@lru_cache
def _bell(kernel: Bell) -> list[tuple[np.ndarray, np.ndarray]]:
    """Polynomials, even and odd part, of the bell's first two taps for an echo x = -1/2..1/2 off their middle."""
    x = 0.5 * np.cos(np.pi * (np.arange(200) + 0.5) / 200)
    fits = (np.polynomial.Polynomial.fit(x, kernel.impulse(tap - (kernel.taps - 1) / 2 - x), POLYNOMIAL, domain=[-1, 1])
            for tap in range(kernel.taps // 2))
    return [(fit.coef[0::2], fit.coef[1::2]) for fit in fits]


def _even_and_odd(lib: ArrayTypes, x: Float, coefficients: tuple[np.ndarray, np.ndarray]) -> tuple[Float, Float]:
    x2, parts = x * x, []
    for series in coefficients:
        total = lib.Float(float(series[-1]))
        for coefficient in series[-2::-1]:
            total = dr.fma(total, x2, lib.Float(float(coefficient)))
        parts.append(total)
    return parts[0], parts[1] * x


def _hann_sinc(lib: ArrayTypes, x: Float, taps: int) -> list[Float]:
    """Taps of the Peterson kernel for an echo x after tap taps/2 - 1."""
    turn = x * (1 / taps)
    cosine, sine = turned(lib, turn)
    wave = turned(lib, x * 0.5)[1] * (1 / np.pi)            # sin(πx)/π
    weights = []
    for tap in range(taps):
        whole = tap - (taps // 2 - 1)
        angle = 2 * np.pi * whole / taps
        window = 0.5 + 0.5 * dr.fma(cosine, lib.Float(np.cos(angle)), sine * float(np.sin(angle)))
        away = whole - x
        near = abs(away) < 1e-4
        # sin(π (whole - x)) = -(-1)^whole sin(πx)
        sinc = dr.select(near, 1, (wave if whole % 2 else -wave) / dr.select(near, 1, away))
        weights.append(window * sinc)
    return weights
