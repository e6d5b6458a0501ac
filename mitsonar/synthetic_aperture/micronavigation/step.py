"""Step between two overlapping pings: delays and coherence in windows of range, and the motion that explains them.

    x(r) = s(τ(r)) e^(i2π f₀ τ(r))                             both signals, laid on the same points of the bed
    c(l) = Σ x₂(r + l) x₁*(r) / √(Σ|x₁|² Σ|x₂|²)               over a window
    Δτ   = 2 l̂ / c  (envelope)      or      -arg c(0) / (2π f₀)  (phase, once Δτ is less than half a cycle)

    y_q = Δτ_q = [∂τ/∂(sway, heave, yaw)]_q x + ε_q,        x̂ = (AᵀW A + P⁻¹)⁻¹ (AᵀW y - P⁻¹ x₀)
    W⁻¹_qq' = (R_jj' R_ii' - R_ji' R_j'i) / (2 N γ_q γ_q' (2π f₀)²)            of pairs q = (i, j), q' = (i', j')
    |γ_q| = γ₀ T(d_q + surge)                                                   T: van Cittert and Zernike

τ(r) -> ``delays`` by the present trajectory, Δτ their error; R -> theoretical coherence of two channels: T of the
distance of their phase centres, times γ₀ for different channels; N -> looks of a window; P -> ``Trust`` in navigation;
x₀ -> the correction made so far. The covariance of errors is that of products of circular Gaussian signals; its
diagonal is the bound of Cramér and Rao.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import fft, optimize
from scipy.interpolate import CubicSpline

from .pairs import Correction, PingPairs

FINER = 8                          # times the sampling rate, before cubic interpolation, which errs by 1e-4
LAGS_FINER = 4
LEAST, HIGHEST = 0.05, 0.9995      # range of coherences that errors are computed from
PHASE_FLOOR = 1e-4                 # [rad], error of every phase by interpolation, whatever its coherence


def finer(signal: np.ndarray) -> np.ndarray:
    """Return signals (..., S) at 8 times their rate, by a Fourier series."""
    count = signal.shape[-1]
    spectrum = fft.fftshift(fft.fft(signal, axis=-1), axes=-1)
    wide = np.zeros((*signal.shape[:-1], FINER * count), complex)
    start = FINER * count // 2 - count // 2
    wide[..., start:start + count] = spectrum
    return FINER * fft.ifft(fft.ifftshift(wide, axes=-1), axis=-1)


def laid_on_ground(signal: np.ndarray, channel: np.ndarray,  # (rx, S); (Q,)
                   first: float, rate: float,  # [s]; [Hz]
                   node_range: np.ndarray, delays: np.ndarray,  # (K,) [m]; (Q, K) [s]
                   slant_range: np.ndarray, frequency: float) -> np.ndarray:  # (N,) [m]; [Hz]
    """Return the signals (Q, N) at the delays of points, without the carrier's phase of the path."""
    delay = CubicSpline(node_range, delays, axis=-1)(slant_range)
    place = np.clip((delay - first) * rate * FINER, 1.0, signal.shape[-1] - 3.0)
    whole = np.floor(place).astype(np.int64)
    part = place - whole
    taps = (-part * (part - 1) * (part - 2) / 6, (part + 1) * (part - 1) * (part - 2) / 2,
            -(part + 1) * part * (part - 2) / 2, (part + 1) * part * (part - 1) / 6)
    value = sum(tap * signal[channel[:, None], whole + k - 1] for k, tap in enumerate(taps))
    return value * np.exp(2j * np.pi * np.mod(frequency * delay, 1.0))


def correlated(first: np.ndarray, second: np.ndarray, windows: int) -> np.ndarray:
    """Return the complex coherence (Q, W) of signals (Q, N) in W windows, without a lag."""
    left, right = (part[:, :part.shape[1] // windows * windows].reshape(len(part), windows, -1)
                for part in (first, second))
    power = np.sum(np.abs(left) ** 2, -1) * np.sum(np.abs(right) ** 2, -1)
    return np.sum(right * np.conj(left), -1) / np.sqrt(np.maximum(power, 1e-300))


def lagged(first: np.ndarray, second: np.ndarray, windows: int, most: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the lateness (Q, W) of the second signal in samples, within -most ... most, and the coherence there."""
    size = first.shape[1] // windows
    left, right = (part[:, :size * windows].reshape(len(part), windows, size) for part in (first, second))
    length = fft.next_fast_len(2 * size)
    product = fft.fft(right, length) * np.conj(fft.fft(left, length))
    half = length // 2
    wide = np.zeros((*product.shape[:-1], LAGS_FINER * length), complex)
    wide[..., :half], wide[..., half - length:] = product[..., :half], product[..., half:]
    lags = LAGS_FINER * fft.ifft(wide)
    reach = np.arange(-most * LAGS_FINER, most * LAGS_FINER + 1)
    height = np.abs(lags[..., reach])
    best = np.clip(height.argmax(-1), 1, len(reach) - 2)
    below, top, above = (np.take_along_axis(height, (best + step)[..., None], -1)[..., 0] for step in (-1, 0, 1))
    bent = below - 2 * top + above
    late = (reach[best] + 0.5 * (below - above) / np.where(bent < 0, bent, np.inf)) / LAGS_FINER
    power = np.sum(np.abs(left) ** 2, -1) * np.sum(np.abs(right) ** 2, -1)
    return late, top / np.sqrt(np.maximum(power, 1e-300))


@dataclass(frozen=True, kw_only=True)
class Trust:
    """Standard deviations of the navigation from one ping to the next."""

    surge: float = 0.01  # [m]
    sway: float = 0.05  # [m]
    heave: float = 0.002  # [m]
    yaw: float = 0.005  # [rad]

    def __post_init__(self):
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value > 0):
                raise ValueError(f"the trust in {name} is {value}; give a standard deviation above 0")


@dataclass(frozen=True, kw_only=True)
class SurgeEstimate:
    """Estimated step from one ping to the next."""

    correction: Correction
    deviation: Correction  # theoretical standard deviations
    slant: np.ndarray  # (W,) [m], towards the bed, of the correction and its residual, for every window
    slant_deviation: np.ndarray  # (W,) [m], its standard deviation
    coherence: np.ndarray  # (Q, W), measured
    expected: np.ndarray  # (Q, W), theoretical, without noise
    apart: np.ndarray  # (Q,) [m], distance of the pairs' phase centres along the array, with the correction
    pairs: PingPairs


def fitted_surge(coherence: np.ndarray, apart: np.ndarray,  # (Q,); (Q,) [m]
                 theory: Callable[[np.ndarray], np.ndarray], looks: float,
                 known: float, trust: float) -> tuple[float, float, float]:  # [m]
    """Return surge [m], its standard deviation [m] and γ₀, by a fit of γ₀ T(d + surge) to coherences."""
    spread = np.maximum((1 - np.clip(coherence, LEAST, HIGHEST) ** 2) / np.sqrt(2 * looks), 1e-4)

    def misfit(x: np.ndarray) -> np.ndarray:
        return np.append((x[0] * theory(apart + x[1]) - coherence) / spread, (known + x[1]) / trust)

    scale = float(np.ptp(apart)) or trust
    fit = optimize.least_squares(misfit, [min(coherence.max(), HIGHEST), 0.0], x_scale=[1.0, 0.1 * scale],
                                 bounds=([0.0, -3 * trust], [1.0, 3 * trust]))
    covariance = np.linalg.pinv(fit.jac.T @ fit.jac)
    return float(fit.x[1]), float(np.sqrt(covariance[1, 1])), float(fit.x[0])


def phase_covariance(pairs: PingPairs, chosen: np.ndarray, surge: float, theory: Callable[[np.ndarray], np.ndarray],
                     strength: float, looks: float) -> np.ndarray:
    """Return the covariance of the phases of chosen pairs in one window, (Q, Q) [rad²]."""
    here, there = pairs.centre_first[chosen], pairs.centre_second[chosen] + surge
    first, second = pairs.first[chosen], pairs.second[chosen]
    strength = min(strength, HIGHEST)

    def alike(start: np.ndarray, end: np.ndarray, same: np.ndarray | bool) -> np.ndarray:
        return np.where(same, 1.0, strength * theory(end[None, :] - start[:, None]))

    crossed = alike(there, here, False)                                       # (j, i')
    own = np.maximum(np.diagonal(crossed), LEAST)
    covariance = (alike(there, there, second[:, None] == second) * alike(here, here, first[:, None] == first)
                  - crossed * crossed.T) / (2 * looks * np.multiply.outer(own, own))
    return covariance + PHASE_FLOOR ** 2 * np.eye(len(chosen))


def least_squares(late: np.ndarray, change: np.ndarray,  # (Q, W) [s]; (Q, W, 3) [s/m, s/m, s/rad]
                  weight: np.ndarray,  # (W, Q, Q) [1/s²]
                  known: Correction, trust: Trust) -> tuple[np.ndarray, np.ndarray]:
    """Return sway, heave and yaw (3,), estimated from delays and from `known`, and their covariance."""
    design, delay = np.moveaxis(change, 1, 0), np.moveaxis(late, 1, 0)[..., None]
    prior = np.diag([trust.sway ** -2.0, trust.heave ** -2.0, trust.yaw ** -2.0])
    normal = np.sum(np.swapaxes(design, 1, 2) @ weight @ design, 0) + prior
    right = np.sum(np.swapaxes(design, 1, 2) @ weight @ delay, 0)[:, 0]
    right = right - prior @ np.array([known.sway, known.heave, known.yaw])
    covariance = np.linalg.inv(normal)
    return covariance @ right, covariance


def slants(late: np.ndarray, change: np.ndarray, weight: np.ndarray, sound_speed: float, trust: Trust
           ) -> tuple[np.ndarray, np.ndarray]:
    """Return the decrease (W,) [m] of the distance to the bed, each window with its own yaw, and its deviation."""
    shorter, deviation = np.empty(late.shape[1]), np.empty(late.shape[1])
    for number in range(late.shape[1]):
        design = np.stack([np.full(len(late), -2 / sound_speed), change[:, number, 2]], -1)
        normal = design.T @ weight[number] @ design + np.diag([0.0, trust.yaw ** -2.0])
        covariance = np.linalg.inv(normal)
        shorter[number] = (covariance @ (design.T @ weight[number] @ late[:, number]))[0]
        deviation[number] = np.sqrt(covariance[0, 0])
    return shorter, deviation
