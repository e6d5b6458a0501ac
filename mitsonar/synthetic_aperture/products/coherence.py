"""Coherence of two echoes of a rough bed: the factors that lower it.

    |γ| = γ_noise γ_aperture γ_shift γ_time
    γ_noise    = 1 / √((1 + 1/SNR₁)(1 + 1/SNR₂))
    γ_aperture = ∫ |D_t D_r|² e^(i2k d u) dθ / ∫ |D_t D_r|² dθ,      D = sinc(L u / λ),   u = sin θ
    γ_shift    = 1 - |Δf| / B,       Δf = f₀ tan(g) Δg;              or 1 - |δ| / (c / 2B) of two images δ apart

SNR -> ``snr`` (ratio of powers), d -> ``displacement`` of the phase centres along the track, L -> ``tx_length`` and
``rx_length``, λ -> ``wavelength``, k = 2π/λ, g -> ``grazing_angle``, Δg -> ``view_change``, f₀ -> ``frequency``, B ->
``bandwidth``, δ -> ``shift``. γ_time is the bed's own and is not modelled here.

The phase of a mean over L looks of coherence γ has a standard deviation of at least √((1 - γ²) / (2 L γ²)); a delay
estimated from envelopes has that over 2π β, β the rms bandwidth.

References
----------
Zebker and Villasenor (1992), IEEE Trans. Geosci. Remote Sens. 30, 950: the factors.
Goodman (1985), Statistical optics, ch. 5: the theorem of van Cittert and Zernike.
Bellettini and Pinto (2002), IEEE J. Oceanic Eng. 27, 780: displaced phase centres, and the accuracy of their delays.
Gatelli and others (1994), IEEE Trans. Geosci. Remote Sens. 32, 855: the shift of the spectrum.
Rodriguez and Martin (1992), IEE Proc. F 139, 147: the least deviation of the phase.
"""
from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

__all__ = ["aperture_coherence", "baseline_coherence", "beam_spread", "delay_deviation", "noise_coherence",
           "phase_deviation", "shift_coherence"]

DIRECTIONS = 4001                  # of the quadrature over the half circle
LEAST = 1e-6                       # coherence; below, the phase is random


def noise_coherence(snr: ArrayLike, other: ArrayLike | None = None) -> np.ndarray:
    """Return the coherence of two signals with independent noise.

    Parameters
    ----------
    snr : array [-]
        Signal to noise ratio of powers; infinite without noise.
    other : array or None [-]
        The same of the second signal. None: as of the first.
    """
    first = np.asarray(snr, float)
    second = first if other is None else np.asarray(other, float)
    if np.any(first < 0) or np.any(second < 0):
        raise ValueError("a ratio of signal to noise is below 0; give ratios of powers, not decibels")
    with np.errstate(divide="ignore"):
        return 1 / np.sqrt((1 + 1 / first) * (1 + 1 / second))


def aperture_coherence(displacement: ArrayLike, tx_length: float, rx_length: float, wavelength: float) -> np.ndarray:
    """Return the coherence of an even rough bed's echoes at two phase centres: the theorem of van Cittert and Zernike.

    Parameters
    ----------
    displacement : array [m]
        Distance of the two phase centres along the elements.
    tx_length, rx_length : float [m]
        Length of line elements along the track that look broadside.
    wavelength : float [m]

    Returns
    -------
    array [-]
        1 at no displacement; for two elements of equal length L nearly the cubic B-spline of 2 d / L.
    """
    sine, power = _beam(tx_length, rx_length, wavelength)
    phase = (4 * np.pi / wavelength) * np.asarray(displacement, float)[..., None] * sine
    return np.cos(phase) @ power / power.sum()


def beam_spread(tx_length: float, rx_length: float, wavelength: float) -> float:
    """Return the rms sine of the echoes' directions along the track; arguments as in `aperture_coherence`."""
    sine, power = _beam(tx_length, rx_length, wavelength)
    return float(np.sqrt(np.sum(sine ** 2 * power) / power.sum()))


def baseline_coherence(frequency: float, bandwidth: float, grazing_angle: ArrayLike, view_change: ArrayLike
                       ) -> np.ndarray:
    """Return the coherence of a level bed's echoes after a change of the grazing angle.

    Parameters
    ----------
    frequency, bandwidth : float [Hz]
        Centre and width of a flat spectrum.
    grazing_angle : array [rad]
    view_change : array [rad]
        Change of the grazing angle. If only the receivers differ, half the angle between them.
    """
    moved = np.abs(frequency * np.tan(np.asarray(grazing_angle, float)) * np.asarray(view_change, float))
    return np.maximum(1 - moved / _positive("bandwidth", bandwidth), 0.0)


def shift_coherence(shift: ArrayLike, bandwidth: float, sound_speed: float) -> np.ndarray:
    """Return the coherence of echoes of a flat spectrum with themselves, moved by `shift` [m] of slant range."""
    return np.abs(np.sinc(2 * np.asarray(shift, float) * _positive("bandwidth", bandwidth) / sound_speed))


def phase_deviation(coherence: ArrayLike, looks: ArrayLike) -> np.ndarray:
    """Return the least standard deviation [rad] of an interferometric phase from independent looks (Cramér and Rao).

    Notes
    -----
    Estimates reach it where it is small; at few looks or low coherence use `coherence_statistics.phase_spread`.
    """
    squared = np.maximum(np.asarray(coherence, float), LEAST) ** 2
    return np.sqrt(np.maximum(1 - squared, 0.0) / (2 * np.asarray(looks, float) * squared))


def delay_deviation(coherence: ArrayLike, looks: ArrayLike, frequency: float) -> np.ndarray:
    """Return the least standard deviation [s] of a delay between two signals.

    Parameters
    ----------
    coherence, looks
        As in `phase_deviation`.
    frequency : float [Hz]
        The carrier for a delay from the phase, the rms bandwidth (B / √12 of a flat spectrum) for one from envelopes.
    """
    return phase_deviation(coherence, looks) / (2 * np.pi * _positive("frequency", frequency))


def _beam(tx_length: float, rx_length: float, wavelength: float) -> tuple[np.ndarray, np.ndarray]:
    """Return sines of directions along the track, in even steps of their angle, and the two-way power of the beam."""
    if not (tx_length > 0 and rx_length > 0 and wavelength > 0):
        raise ValueError(f"the elements are {tx_length:g} and {rx_length:g} m long, the wavelength {wavelength:g} m; "
                         "give lengths above 0")
    sine = np.sin((np.arange(DIRECTIONS) + 0.5) * np.pi / DIRECTIONS - 0.5 * np.pi)
    return sine, (np.sinc(tx_length * sine / wavelength) * np.sinc(rx_length * sine / wavelength)) ** 2


def _positive(name: str, value: float) -> float:
    if not (np.isfinite(value) and value > 0):
        raise ValueError(f"{name} is {value}; give a finite number above 0")
    return value
