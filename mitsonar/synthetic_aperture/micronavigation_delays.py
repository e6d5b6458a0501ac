"""Delays and coherence of pairs of phase centres, in windows of range.

    x(r) = s(τ(r)) e^(i2π f₀ τ(r))                             both signals, laid on the same points of the bed
    c(l) = Σ x₂(r + l) x₁*(r) / √(Σ|x₁|² Σ|x₂|²)               over a window
    Δτ   = 2 l̂ / c  (envelope)      or      -arg c(0) / (2π f₀)  (phase, once Δτ is less than half a cycle)

τ(r) -> ``delays``, as far as they are known; Δτ is what they are off.
"""
from __future__ import annotations

import numpy as np
from scipy import fft
from scipy.interpolate import CubicSpline

__all__ = ["correlated", "finer", "laid_on_ground", "lagged"]

FINER = 8                          # times the sampling rate, before interpolation by cubics: 1e-4 of the signal
LAGS_FINER = 4


def finer(signal: np.ndarray) -> np.ndarray:
    """Give signals (..., S) at 8 times their rate, by Fourier's series."""
    count = signal.shape[-1]
    spectrum = fft.fftshift(fft.fft(signal, axis=-1), axes=-1)
    wide = np.zeros((*signal.shape[:-1], FINER * count), complex)
    start = FINER * count // 2 - count // 2
    wide[..., start:start + count] = spectrum
    return FINER * fft.ifft(fft.ifftshift(wide, axes=-1), axis=-1)


def laid_on_ground(signal: np.ndarray, channel: np.ndarray, first: float, rate: float, node_range: np.ndarray,
                   delays: np.ndarray, slant_range: np.ndarray, frequency: float) -> np.ndarray:
    """Take signals at the delays of points, the carrier's phase of the way there taken out.

    Parameters
    ----------
    signal : complex (rx, S)
        From `finer`.
    channel : (Q,) int
    first, rate : float [s], [Hz]
        Of the signal's samples as they were before `finer`.
    node_range : (K,) [m]
    delays : (Q, K) [s]
    slant_range : (N,) [m]

    Returns
    -------
    complex (Q, N)
    """
    delay = CubicSpline(node_range, delays, axis=-1)(slant_range)
    place = np.clip((delay - first) * rate * FINER, 1.0, signal.shape[-1] - 3.0)
    whole = np.floor(place).astype(np.int64)
    part = place - whole
    taps = (-part * (part - 1) * (part - 2) / 6, (part + 1) * (part - 1) * (part - 2) / 2,
            -(part + 1) * part * (part - 2) / 2, (part + 1) * part * (part - 1) / 6)
    value = sum(tap * signal[channel[:, None], whole + k - 1] for k, tap in enumerate(taps))
    return value * np.exp(2j * np.pi * np.mod(frequency * delay, 1.0))


def correlated(first: np.ndarray, second: np.ndarray, windows: int) -> np.ndarray:
    """Give the complex coherence (Q, W) of signals (Q, N) in W windows, without a lag."""
    one, two = (part[:, :part.shape[1] // windows * windows].reshape(len(part), windows, -1)
                for part in (first, second))
    power = np.sum(np.abs(one) ** 2, -1) * np.sum(np.abs(two) ** 2, -1)
    return np.sum(two * np.conj(one), -1) / np.sqrt(np.maximum(power, 1e-300))


def lagged(first: np.ndarray, second: np.ndarray, windows: int, most: int) -> tuple[np.ndarray, np.ndarray]:
    """Find by how many samples (Q, W) the second signal comes late, at most `most`, and the coherence there."""
    size = first.shape[1] // windows
    one, two = (part[:, :size * windows].reshape(len(part), windows, size) for part in (first, second))
    length = fft.next_fast_len(2 * size)
    product = fft.fft(two, length) * np.conj(fft.fft(one, length))
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
    power = np.sum(np.abs(one) ** 2, -1) * np.sum(np.abs(two) ** 2, -1)
    return late, top / np.sqrt(np.maximum(power, 1e-300))
