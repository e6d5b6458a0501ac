"""What two overlapping pings say of the way between them.

    y_q = Δτ_q = [∂τ/∂(sway, heave, yaw)]_q x + ε_q,        x̂ = (AᵀW A + P⁻¹)⁻¹ (AᵀW y - P⁻¹ x₀)
    W⁻¹_qq' = (R_jj' R_ii' - R_ji' R_j'i) / (2 N γ_q γ_q' (2π f₀)²)            of pairs q = (i, j), q' = (i', j')
    |γ_q| = γ₀ T(d_q + surge)                                                   T: van Cittert and Zernike

R -> coherence of two channels by theory: T of their phase centres' distance, times γ₀ where they are two; N -> looks of
a window; P -> what navigation is trusted to, ``Trust``; x₀ -> what was corrected already. The errors' covariance is
that of products of circular Gaussian signals; its diagonal is the bound of Cramér and Rao.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import optimize

from .micronavigation_pairs import Correction, Pairs

__all__ = ["Found", "Trust", "fitted_surge", "least_squares", "phase_covariance", "slants"]

LEAST, HIGHEST = 0.05, 0.9995      # coherence that errors are told from
PHASE_FLOOR = 1e-4                 # [rad] of every phase, whatever its coherence: interpolation


@dataclass(frozen=True, kw_only=True)
class Trust:
    """Standard deviations of what navigation says of the way from one ping to the next.

    Attributes
    ----------
    surge, sway, heave : float [m]
    yaw : float [rad]
    """

    surge: float = 0.01
    sway: float = 0.05
    heave: float = 0.002
    yaw: float = 0.005

    def __post_init__(self):
        for name in ("surge", "sway", "heave", "yaw"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ValueError(f"the trust in {name} is a standard deviation of {value}; give a finite number above "
                                 "0")


@dataclass(frozen=True, kw_only=True)
class Found:
    """What a step is found to be.

    Attributes
    ----------
    correction : Correction
    deviation : Correction
        Standard deviations, by theory.
    slant, slant_deviation : (W,) [m]
        Towards the bed at every window, of the correction and what it leaves over.
    coherence, expected : (Q, W), (Q,)
        As measured, and by theory without noise.
    apart : (Q,) [m]
        Of the pairs' phase centres along the array, with the correction.
    pairs : Pairs
    """

    correction: Correction
    deviation: Correction
    slant: np.ndarray
    slant_deviation: np.ndarray
    coherence: np.ndarray
    expected: np.ndarray
    apart: np.ndarray
    pairs: Pairs


def fitted_surge(coherence: np.ndarray, apart: np.ndarray, theory: Callable[[np.ndarray], np.ndarray], looks: float,
                 known: float, trust: float) -> tuple[float, float, float]:
    """Fit γ₀ T(d + surge) to coherences.

    Parameters
    ----------
    coherence : (Q,)
    apart : (Q,) [m]
        With the surge `known` so far.
    theory : callable(d) -> T
    looks : float
        Of each coherence.
    known, trust : float [m]

    Returns
    -------
    surge, deviation : float [m]
        Less what is known; errors of pairs are taken as independent.
    strength : float
        γ₀.
    """
    spread = np.maximum((1 - np.clip(coherence, LEAST, HIGHEST) ** 2) / np.sqrt(2 * looks), 1e-4)

    def misfit(x: np.ndarray) -> np.ndarray:
        return np.append((x[0] * theory(apart + x[1]) - coherence) / spread, (known + x[1]) / trust)

    scale = float(np.ptp(apart)) or trust
    fit = optimize.least_squares(misfit, [min(coherence.max(), HIGHEST), 0.0], x_scale=[1.0, 0.1 * scale],
                                 bounds=([0.0, -3 * trust], [1.0, 3 * trust]))
    covariance = np.linalg.pinv(fit.jac.T @ fit.jac)
    return float(fit.x[1]), float(np.sqrt(covariance[1, 1])), float(fit.x[0])


def phase_covariance(pairs: Pairs, chosen: np.ndarray, surge: float, theory: Callable[[np.ndarray], np.ndarray],
                     strength: float, looks: float) -> np.ndarray:
    """Give the covariance of the phases of chosen pairs in one window, (Q, Q) [rad²]."""
    here, there = pairs.centre_first[chosen], pairs.centre_second[chosen] + surge
    first, second = pairs.first[chosen], pairs.second[chosen]
    strength = min(strength, HIGHEST)

    def alike(one: np.ndarray, two: np.ndarray, same: np.ndarray | bool) -> np.ndarray:
        return np.where(same, 1.0, strength * theory(two[None, :] - one[:, None]))

    crossed = alike(there, here, False)                                       # (j, i')
    own = np.maximum(np.diagonal(crossed), LEAST)
    covariance = (alike(there, there, second[:, None] == second) * alike(here, here, first[:, None] == first)
                  - crossed * crossed.T) / (2 * looks * np.multiply.outer(own, own))
    return covariance + PHASE_FLOOR ** 2 * np.eye(len(chosen))


def least_squares(late: np.ndarray, change: np.ndarray, weight: np.ndarray, known: Correction, trust: Trust
                  ) -> tuple[np.ndarray, np.ndarray]:
    """Estimate sway, heave and yaw beside what is known of them, and their covariance.

    Parameters
    ----------
    late : (Q, W) [s]
    change : (Q, W, 3) [s/m, s/m, s/rad]
    weight : (W, Q, Q) [1/s²]
    known : Correction
    trust : Trust

    Returns
    -------
    (3,), (3, 3)
    """
    design, delay = np.moveaxis(change, 1, 0), np.moveaxis(late, 1, 0)[..., None]
    prior = np.diag([trust.sway ** -2.0, trust.heave ** -2.0, trust.yaw ** -2.0])
    normal = np.sum(np.swapaxes(design, 1, 2) @ weight @ design, 0) + prior
    right = np.sum(np.swapaxes(design, 1, 2) @ weight @ delay, 0)[:, 0]
    right = right - prior @ np.array([known.sway, known.heave, known.yaw])
    covariance = np.linalg.inv(normal)
    return covariance @ right, covariance


def slants(late: np.ndarray, change: np.ndarray, weight: np.ndarray, sound_speed: float, trust: Trust
           ) -> tuple[np.ndarray, np.ndarray]:
    """Give how far (W,) [m] the way to the bed is shorter than believed, window by window with a yaw of its own.

    Returns
    -------
    shorter, deviation : (W,) [m]
    """
    shorter, deviation = np.empty(late.shape[1]), np.empty(late.shape[1])
    for number in range(late.shape[1]):
        design = np.stack([np.full(len(late), -2 / sound_speed), change[:, number, 2]], -1)
        normal = design.T @ weight[number] @ design + np.diag([0.0, trust.yaw ** -2.0])
        covariance = np.linalg.inv(normal)
        shorter[number] = (covariance @ (design.T @ weight[number] @ late[:, number]))[0]
        deviation[number] = np.sqrt(covariance[0, 0])
    return shorter, deviation
