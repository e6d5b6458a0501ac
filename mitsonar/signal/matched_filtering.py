"""Matched filter: pulses compressed to their delay.

    m(t) = ∫ y(t + u) s_r*(u) du / ∫ s_b(u) s_r*(u) du,        s_r(u) = s_b(u) w(u)

s_b -> ``pulse``, w -> ``window`` of the replica: 1 gives the most signal to noise, a taper lowers the side lobes of a
sweep. An echo of amplitude a and delay τ peaks at τ with the value a. Without a window noise of spectral level N0
leaves with the power N0 / E, E the pulse's energy (Turin 1960, IRE Trans. Inf. Theory 6, 311).
"""
from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft

from mitsonar.sonar.pulses.pulse import Pulse, Window

from .reception import band_filter, check_record, padded_length


def matched_filter(signals: ArrayLike, pulse: Pulse, sampling_rate: float, window: Window | None = None,
                   doppler: float = 1.0) -> np.ndarray:
    """Compress the pulses in baseband signals.

    Parameters
    ----------
    signals : complex (..., S)
        On the carrier of the pulse.
    pulse : Pulse
    sampling_rate : float [Hz]
    window : None, str or tuple
        Of ``scipy.signal.get_window``, over the replica's duration.
    doppler : float [-]
        Two-way factor of the replica.

    Returns
    -------
    complex (..., S)
        On the same time axis; complex64 stays complex64.

    Raises
    ------
    ValueError
        If the sampling rate is below the pulse's band, the pulse outlasts the record, or the window is unknown.
    """
    signals = np.asarray(signals)
    replica = _replica(signals.shape[-1], pulse, sampling_rate, window, doppler)
    spectrum = fft.fft(signals, len(replica))
    return fft.ifft(spectrum * replica.astype(spectrum.dtype), overwrite_x=True)[..., :signals.shape[-1]]


def _replica(samples: int, pulse: Pulse, sampling_rate: float, window: Window | None, doppler: float) -> np.ndarray:
    """What multiplies the spectrum of padded records."""
    check_record(pulse, sampling_rate, samples, doppler)
    length = padded_length(samples, pulse.duration / doppler, sampling_rate)
    sent = pulse.spectrum(sampling_rate, length, doppler)
    replica = np.conj(pulse.replica(window).spectrum(sampling_rate, length, doppler))
    keep = band_filter(fft.fftfreq(length, 1 / sampling_rate), sampling_rate)
    return replica / np.mean(sent * replica * keep).real   # gain of an echo that came through the receiver's filter


def compression(pulse: Pulse, sampling_rate: float) -> tuple[float, float]:
    """Return how long a compressed pulse lasts, and how much noise it comes with, at a sampling rate."""
    # sampling_rate [Hz] -> length [s], bandwidth [Hz]
    length = padded_length(1, pulse.duration, sampling_rate)
    spectrum = np.abs(pulse.spectrum(sampling_rate, length)) ** 2
    through = spectrum * band_filter(fft.fftfreq(length, 1 / sampling_rate), sampling_rate)
    gain = np.mean(through)
    return (float(np.mean(through ** 2) / gain ** 2 / sampling_rate),
            float(np.mean(spectrum) / gain ** 2 * sampling_rate))


def rms_bandwidth(pulse: Pulse, sampling_rate: float) -> float:
    """Return the root mean square [Hz] of the frequencies of a compressed pulse's power; of an even band B it is B /
    √12.
    """
    # sampling_rate [Hz]
    length = padded_length(1, pulse.duration, sampling_rate)
    frequency = fft.fftfreq(length, 1 / sampling_rate)
    through = np.abs(pulse.spectrum(sampling_rate, length)) ** 2 * band_filter(frequency, sampling_rate)
    return float(np.sqrt(np.sum(frequency ** 2 * through ** 2) / np.sum(through ** 2)))
