"""Integral over the structure function of a rough interface: the shape of its scattered lobe.

    I(q, α) = ∫_0^∞ J0(u) exp(-q u^2α) u du

q -> ``q`` (roughness over the shift of the transverse wavenumber), α -> ``alpha`` = γ/2 - 1, γ the spectral exponent.
I grows as q, the perturbation limit, where q is small, and falls as q^(-1/α), the specular lobe, where q is large:

    I -> q α 2^(1 + 2α) Γ(1 + α) / Γ(1 - α)                I -> q^(-1/α) Γ(1/α) / 2α

In between it is computed on u = s e^(iφ), where both factors decay, as Re ∫ H0(s e^iφ) exp(-q s^2α e^2iαφ) e^2iφ s ds
(the trapezoidal rule in ln s), once per α at nodes in ln q. A cubic spline through ln I joins the nodes, and
straight lines (the two limits) continue it at both ends, so that I has continuous slopes everywhere.
"""
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import scipy

from mitsonar.device.types import Real

ALPHA_RANGE = (0.2, 0.95)          # where the table is accurate: γ = 2.4..3.9
SMALLEST_Q = 1e-7                  # the perturbation limit holds to 1e-7 below
STEP = 0.1                         # of the table, in ln q


def lobe_integral(q: Real, alpha: float) -> np.ndarray:
    """Return I(q, α) to 1e-6 of itself.

    Jackson and Richardson (2007), High-Frequency Seafloor Acoustics, chapter 13. The first call for an α builds its
    table.
    """
    log_q = np.log(q)
    return np.exp(log_lobe(log_q, alpha) - log_q / alpha)


def log_lobe(log_q: Real, alpha: float) -> np.ndarray:
    """Return ln F = ln q / α + ln I(q, α), which is bounded above, to 1e-6; see `lobe_integral`."""
    spline, low, high = _table(float(alpha))
    inside = np.clip(log_q, low, high)
    return spline(inside) + inside / alpha + np.where(log_q < low, 1 + 1 / alpha, 0.0) * (log_q - inside)


@lru_cache(maxsize=64)
def _table(alpha: float) -> tuple[Callable, float, float]:
    """Return the spline of ln I over ln q, and its ends."""
    from scipy.interpolate import CubicSpline

    # The lobe's first correction, relative, is Γ(2/α) / 4 Γ(1/α) q^(-1/α); the table ends where it is 1e-9.
    largest = (2.5e8 * scipy.special.gamma(2 / alpha) / scipy.special.gamma(1 / alpha)) ** alpha
    low, high = np.log(SMALLEST_Q), np.log(largest)
    log_q = np.linspace(low, high, int(np.ceil((high - low) / STEP)) + 1)
    phase = min(np.pi / 2, 0.9 * np.pi / (4 * alpha))
    log_s, step = np.linspace(-32.0, 5.0, 2400, retstep=True)
    s = np.exp(log_s)
    weight = scipy.special.hankel1(0, s * np.exp(1j * phase)) * np.exp(2j * phase) * s**2 * step
    decay = s ** (2 * alpha) * np.exp(2j * alpha * phase)
    value = [(weight * np.exp(-q * decay)).sum().real for q in np.exp(log_q)]
    slopes: Any = (1, 1.0), (1, -1 / alpha)
    return CubicSpline(log_q, np.log(value), bc_type=slopes), low, high
