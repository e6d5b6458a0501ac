"""Scattered lobe of a surface with a power-law roughness spectrum, by the lowest-order small-slope approximation.

    σ_rough = |A|² / (2π ΔK_z²) ∫_0^∞ J0(ΔK r) exp(-ΔK_z² D(r) / 2) r dr,      A = k² a / 2,      D(r) = C² r^2α
            = |a|² / (8π s²) (b s²)^(-1/α) F(q),      q = b s² d^(-α),      b = C² k^(2 - 2α) / 2

    d = ΔK² / k²,   s = ΔK_z / k = sin θ_i + sin θ_s,   F(q) = q^(1/α) I(q, α)  (I: see rough_interface),  α = γ/2 - 1
    C² = 2π w2 Γ(2 - α) 2^(-2α) / [α (1 - α) Γ(1 + α)]

d -> ``shift``, s -> ``shift_z``, k -> ``wavenumber``; w2, γ of the spectrum w2 K^-γ. The amplitude a is that of the
material below (`fluid`). F is 2π times the density of a two-dimensional stable law: flat where q is large, about the
specular direction, and proportional to q^(1 + 1/α), the perturbation limit, far from it.
"""
import functools
from collections.abc import Callable
from types import ModuleType

import numpy as np
import scipy

from mitsonar.device.types import Numbers

SMALLEST = 1e-9                    # over k: keeps specular and grazing limits finite, accurate to 1e-9
MOST = 80.0                        # exponent: exact forward grazing has no bound, and float32 ends at 88


def log_roughness(module: ModuleType, wavenumber: Numbers, w2: Numbers, alpha: Numbers) -> Numbers:
    """Return ln b [-]: half the structure function over a length of 1/k, times k²."""
    x = alpha - 0.5
    square, series = x * x, 0.0
    for coefficient in reversed(_odd_powers()):
        series = series * square + coefficient
    return (module.log(np.pi * w2 / (alpha * (1 - alpha))) + x * series - float(2 * np.log(2)) * alpha
            + (2 - 2 * alpha) * module.log(wavenumber))


@functools.cache
def _odd_powers() -> list[float]:
    """Return the coefficients of ln Γ(2 - α) - ln Γ(1 + α) in odd powers of α - 1/2."""
    return [-2 * float(scipy.special.polygamma(2 * n, 1.5)) / float(np.prod(np.arange(1.0, 2 * n + 2)))
            for n in range(12)]


def lobe_factor(module: ModuleType, log_lobe: Callable[[Numbers, Numbers], Numbers], shift: Numbers, shift_z: Numbers,
                wavenumber: Numbers, w2: Numbers, gamma: Numbers) -> Numbers:
    """Return σ_rough over |a|² [-]."""
    # wavenumber [rad/m]
    alpha = 0.5 * gamma - 1
    s = module.maximum(shift_z, SMALLEST)
    log_core = log_roughness(module, wavenumber, w2, alpha) + 2 * module.log(s)
    log_q = log_core - alpha * module.log(shift + SMALLEST**2)
    exponent = log_lobe(log_q, alpha) - log_core / alpha
    return module.exp(module.minimum(exponent, MOST)) / (8 * np.pi * s * s)
