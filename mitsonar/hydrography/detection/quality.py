"""Compute the standard deviations of detections, and Lurton's quality factor.

Speckle spreads both kinds of detection. σ_f -> rms duration of the footprint's echo without the pulse, T = ∫|χ|² dt ->
length of the compressed pulse χ, taken as Gaussian; the smeared intensity has the correlation time s = T/√π.

Amplitude: the centre of gravity of |Σ a_k χ(t - t_k)|², a_k complex Gaussian with the footprint's density p, has

    σ_t² = ∬ p(τ1) p(τ2) ((τ1 + τ2)/2)² ρ²(τ1 - τ2) dτ1 dτ2 = (σ_f²/2) / √(1 + 2 σ_f²/s²)

ρ -> autocorrelation of the pulse. A footprint far longer than the pulse has σ_f²/(2 N) with N = √2 σ_f/s independent
echoes, one far shorter σ_f²/2.

Phase: the phase difference at the axis has the deviation σ_φ and crosses zero with the slope dφ/dt:

    σ_t = σ_φ / |dφ/dt|        σ_φ² = (1 - γ²)/(2 γ² N) for N echoes of coherence γ (Rodríguez and Martin 1992)

Detections take σ_φ from the scatter about the fitted line, which includes noise and decorrelation by the pulse length.

Quality (Lurton and Augustin 2010, IEEE J. Oceanic Eng. 35, 852): q = log10(t / σ_t), also that of depth over its
deviation: 2 is 1 % of depth, 3 is 0.1 %.
"""
from __future__ import annotations

import numpy as np

GAUSSIAN_WIDTH = 2 * np.sqrt(2 * np.log(2))       # -3 dB width over standard deviation


def pulse_deviation(pulse_length: float | np.ndarray) -> float | np.ndarray:
    """Return the rms duration [s] of |χ|², a Gaussian with the integral ``pulse_length`` [s]."""
    return pulse_length / np.sqrt(2 * np.pi)


def correlation_time(pulse_length: float) -> float:
    """Return s [s]; the squared correlation of echoes is exp(-τ²/2s²)."""
    return pulse_length / np.sqrt(np.pi)


def gravity_deviation(footprint: np.ndarray, pulse_length: float) -> np.ndarray:
    """Return the standard deviation of a centre of gravity due to speckle."""
    # footprint (B,) [s]; pulse_length [s] -> (B,) [s]
    return footprint * np.sqrt(0.5 / echoes_side_by_side(footprint, pulse_length))


def angle_deviation(beam: np.ndarray, footprint: np.ndarray, pulse_length: float) -> np.ndarray:
    """Return the standard deviation of an amplitude echo's centre about the beam's mean direction."""
    # beam (B,) [rad] -> (B,) [rad]
    return beam * np.sqrt(0.5 / echoes_side_by_side(footprint, pulse_length))


def echoes_side_by_side(footprint: np.ndarray, pulse_length: float) -> np.ndarray:
    """Return the number of independent echoes in a footprint's echo, at least 1."""
    return np.sqrt(1 + 2 * (footprint / correlation_time(pulse_length)) ** 2)


def coherent_phase_deviation(coherence: np.ndarray, echoes: np.ndarray) -> np.ndarray:
    """Return the standard deviation [rad] of the mean phase difference of echoes (Rodríguez and Martin 1992)."""
    return np.sqrt((1 - coherence ** 2) / (2 * coherence ** 2 * echoes))


def quality_factor(time: np.ndarray, deviation: np.ndarray) -> np.ndarray:
    """Return log10(t / σ_t), -inf where the deviation is infinite."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(np.isfinite(deviation) & (time > 0), np.log10(time / deviation), -np.inf)
