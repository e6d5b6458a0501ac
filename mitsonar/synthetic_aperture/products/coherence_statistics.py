"""Estimated coherence: windows, chance and bias.

    γ̂ = Σ s₂ s₁* / √(Σ |s₁|² Σ |s₂|²)                                             over a window
    |γ̂|² ~ Beta(1 + K, L - 1),      K ~ NegativeBinomial(L, γ²)                    the density of Touzi and others
    p(φ) = (1 - γ²)^L [ Γ(L+½) β / (2√π Γ(L) (1 - β²)^(L+½)) + F(L, 1; ½; β²) / 2π ],     β = γ cos φ

γ -> ``coherence``, L -> ``looks``: independent samples within the window. The mixture is the series of the density's
hypergeometric function, term by term; it holds for any L above 1 without overflow.

    L = n² / Σ_ij |ρ(i - j)|²,      ρ the correlation of neighbouring samples of the image

References
----------
Touzi, Lopes, Bruniquel and Vachon (1999), IEEE Trans. Geosci. Remote Sens. 37, 135: density and bias of |γ̂|.
Lee, Hoppel, Mango and Miller (1994), IEEE Trans. Geosci. Remote Sens. 32, 1017: density of the phase.
"""
from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft, ndimage, optimize, special
from scipy.interpolate import PchipInterpolator

from .coherence import phase_deviation

__all__ = ["coherence_at", "coherence_chance", "independent_looks", "mean_coherence", "phase_spread",
           "unbiased_coherence", "windowed_coherence"]

HIGHEST = 0.995                    # coherence; above, the bias is negligible and no series is needed
SPREADS = 12.0                     # standard deviations of the negative binomial
NODES, TABLE = 24, 2049
PHASES = 2049


def windowed_coherence(first: np.ndarray, second: np.ndarray, window: tuple[int, int]) -> np.ndarray:
    """Estimate the complex coherence of two images in windows.

    Parameters
    ----------
    first, second : complex (along, across)
    window : (int, int)
        Samples along and across.

    Returns
    -------
    complex (along, across)
        Its phase is that of `second` minus that of `first`. NaN where a window has no power or holds a NaN.

    Raises
    ------
    ValueError
        If the shapes of the images differ or the window does not fit in.
    """
    if first.ndim != 2 or first.shape != second.shape:
        raise ValueError(f"images of one shape are compared, and these have {first.shape} and {second.shape}")
    if any(not 1 <= part <= size for part, size in zip(window, first.shape)) or np.prod(window) < 2:
        raise ValueError(f"the window has {window[0]} x {window[1]} samples, and the images {first.shape[0]} x "
                         f"{first.shape[1]}; give one of two samples or more that fits in")
    known = np.isfinite(first) & np.isfinite(second)
    left, right = (np.where(known, part, 0).astype(np.complex128) for part in (first, second))
    product = right * np.conj(left)
    mean = _mean(product.real, window) + 1j * _mean(product.imag, window)
    power = _mean(np.abs(left) ** 2, window) * _mean(np.abs(right) ** 2, window)
    complete = ndimage.minimum_filter(known, window, mode="nearest")
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(complete & (power > 0), mean / np.sqrt(power), np.nan)


def independent_looks(picture: np.ndarray, window: tuple[int, int]) -> float:
    """Return the number of independent looks in a window of speckle.

    Parameters
    ----------
    picture : complex (along, across)
        Mostly even speckle. The correlation of its neighbours is measured, whatever its carrier.
    window : (int, int)
    """
    filled = np.where(np.isfinite(picture), picture, 0)
    level = _mean(np.abs(filled) ** 2, (min(32, filled.shape[0]), min(32, filled.shape[1])))
    even = filled / np.maximum(np.sqrt(level), 1e-300)
    shape = [fft.next_fast_len(count + size) for count, size in zip(even.shape, window)]
    lagged = fft.ifft2(np.abs(fft.fft2(even, shape)) ** 2)
    step, aside = (np.arange(1 - size, size) for size in window)
    pairs = np.multiply.outer(*(count - np.abs(lag) for count, lag in zip(even.shape, (step, aside))))
    correlation = lagged[np.ix_(step, aside)] / pairs / np.mean(np.abs(even) ** 2)
    weight = np.multiply.outer(*(size - np.abs(lag) for size, lag in zip(window, (step, aside))))
    return float(np.prod(window) ** 2 / np.sum(weight * np.abs(correlation) ** 2))


def coherence_chance(value: ArrayLike, coherence: float, looks: float) -> np.ndarray:
    """Return the probability that an estimate from `looks` looks lies below `value` for a true `coherence`."""
    weights, count = _mixture(coherence, looks)
    squared = np.clip(np.asarray(value, float), 0, 1)[..., None] ** 2
    return special.betainc(1 + count, looks - 1, squared) @ weights


def coherence_at(chance: float, coherence: float, looks: float) -> float:
    """Return the value below which estimates lie with the probability `chance`: the threshold of a test."""
    if not 0 < chance < 1:
        raise ValueError(f"chance is {chance}; give a probability above 0 and below 1")
    return float(optimize.brentq(lambda value: float(coherence_chance(value, coherence, looks)) - chance, 0, 1,
                                 xtol=1e-9))


def mean_coherence(coherence: float, looks: float) -> float:
    """Return the mean of estimates from `looks` looks; it is never below the coherence itself."""
    if coherence > HIGHEST:
        return float(coherence)
    weights, count = _mixture(coherence, looks)
    return float(np.exp(special.gammaln(count + 1.5) + special.gammaln(count + looks) - special.gammaln(count + 1)
                        - special.gammaln(count + looks + 0.5)) @ weights)


def unbiased_coherence(estimate: ArrayLike, looks: float) -> np.ndarray:
    """Return the coherence whose estimates have the mean `estimate`; 0 below the mean estimate of coherence 0."""
    nodes = np.append(HIGHEST * np.sin(np.linspace(0, 0.5 * np.pi, NODES)), 1.0)
    means = PchipInterpolator(nodes, [mean_coherence(node, looks) for node in nodes])
    fine = np.linspace(0, 1, TABLE)
    return np.interp(np.asarray(estimate, float), np.maximum.accumulate(means(fine)), fine)


def phase_spread(coherence: float, looks: float) -> float:
    """Return the standard deviation [rad] of the phase of a mean over looks, from its density."""
    if not 0 <= coherence <= 1 or looks < 1:
        raise ValueError(f"coherence is {coherence} and looks {looks}; give 0 to 1, and 1 or more")
    least = float(phase_deviation(coherence, looks))
    if least < 0.02:               # the density is normal, and too narrow for even steps
        return least
    phase = (np.arange(PHASES) + 0.5) * 2 * np.pi / PHASES - np.pi
    beta = coherence * np.cos(phase)
    left = np.log1p(-coherence ** 2) * looks
    first = (np.exp(left - (looks + 0.5) * np.log1p(-beta ** 2) + special.gammaln(looks + 0.5)
                    - special.gammaln(looks)) * beta / (2 * np.sqrt(np.pi)))
    density = first + np.exp(left) * special.hyp2f1(looks, 1, 0.5, beta ** 2) / (2 * np.pi)
    return float(np.sqrt(np.sum(phase ** 2 * density) / np.sum(density)))


def _mixture(coherence: float, looks: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the weights and numbers K of the mixture of beta densities."""
    if not 0 <= coherence < 1 or not looks > 1:
        raise ValueError(f"coherence is {coherence} and looks {looks}; give 0 to below 1, and more than 1")
    squared = min(coherence, HIGHEST) ** 2
    middle = looks * squared / (1 - squared)
    reach = SPREADS * np.sqrt(middle / (1 - squared)) + 60
    count = np.arange(max(int(middle - reach), 0), int(middle + reach) + 1, dtype=float)
    logarithm = special.gammaln(looks + count) - special.gammaln(count + 1) + special.xlogy(count, squared)
    weights = np.exp(logarithm - logarithm.max())
    return weights / weights.sum(), count


def _mean(values: np.ndarray, window: tuple[int, int]) -> np.ndarray:
    return ndimage.uniform_filter(values, window, mode="nearest")
