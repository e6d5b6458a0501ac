"""Compress pulses to their delay by a matched filter.

    m(t) = ∫ y(t + u) s_r*(u) du / ∫ s_b(u) s_r*(u) du,        s_r(u) = s_b(u) w(u)

s_b -> ``pulse``, w -> ``window`` of the replica: 1 maximises the signal to noise ratio, a taper lowers the side lobes
of a sweep. An echo of amplitude a and delay τ peaks at τ with the value a. Without a window, noise of spectral level N0
has the power N0 / E after the filter, E the pulse's energy (Turin 1960, IRE Trans. Inf. Theory 6, 311).
"""
from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft

from mitsonar.sonar.pulses.pulse import Pulse, Window

from .reception import band_filter, check_record, padded_length


@dataclass(frozen=True, kw_only=True, eq=False)
class ReplicaSpectra:
    """Spectra of a matched filter at the F frequencies of an FFT."""

    frequency: np.ndarray  # (F,) [Hz]: from the carrier
    replica: np.ndarray  # (F,): conjugate of the replica's
    echo: np.ndarray  # (F,): of a filtered echo, that came through the receiver's filter

    @cached_property
    def gain(self) -> float:
        """Return the peak of a filtered echo of amplitude 1."""
        return np.mean(self.echo).real


def replica_spectra(pulse: Pulse, sampling_rate: float, length: int, window: Window | None = None,
                    doppler: float = 1.0) -> ReplicaSpectra:
    """Return the spectra of the filter matched to a pulse, over an FFT of some length."""
    frequency = fft.fftfreq(length, 1 / sampling_rate)
    replica = np.conj(pulse.replica(window).spectrum(sampling_rate, length, doppler))
    echo = pulse.spectrum(sampling_rate, length, doppler) * replica * band_filter(frequency, sampling_rate)
    return ReplicaSpectra(frequency=frequency, replica=replica, echo=echo)


def matched_filter(signals: ArrayLike, pulse: Pulse, sampling_rate: float, window: Window | None = None,
                   doppler: float = 1.0) -> np.ndarray:
    """Compress the pulses in baseband signals.

    Parameters
    ----------
    signals : complex (..., S)
        Baseband signals on the carrier of the pulse.
    pulse : Pulse
    sampling_rate : float [Hz]
    window : None, str or tuple
        Window of ``scipy.signal.get_window`` over the replica's duration.
    doppler : float [-]
        Two-way factor of the replica.

    Returns
    -------
    complex (..., S)
        Compressed signals on the same time axis; complex64 stays complex64.

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
    """Return the factor of the spectra of padded records."""
    check_record(pulse, sampling_rate, samples, doppler)
    length = padded_length(samples, pulse.duration / doppler, sampling_rate)
    spectra = replica_spectra(pulse, sampling_rate, length, window, doppler)
    return spectra.replica / spectra.gain


def compression(pulse: Pulse, sampling_rate: float) -> tuple[float, float]:
    """Return length [s] and noise bandwidth [Hz] of a compressed pulse at a sampling rate [Hz]."""
    length = padded_length(1, pulse.duration, sampling_rate)
    spectrum = np.abs(pulse.spectrum(sampling_rate, length)) ** 2
    through = spectrum * band_filter(fft.fftfreq(length, 1 / sampling_rate), sampling_rate)
    gain = np.mean(through)
    return (float(np.mean(through ** 2) / gain ** 2 / sampling_rate),
            float(np.mean(spectrum) / gain ** 2 * sampling_rate))


def rms_bandwidth(pulse: Pulse, sampling_rate: float) -> float:
    """Return the rms frequency [Hz] of a compressed pulse's power at a sampling rate [Hz]: B / √12 for an even band B.
    """
    length = padded_length(1, pulse.duration, sampling_rate)
    frequency = fft.fftfreq(length, 1 / sampling_rate)
    through = np.abs(pulse.spectrum(sampling_rate, length)) ** 2 * band_filter(frequency, sampling_rate)
    return float(np.sqrt(np.sum(frequency ** 2 * through ** 2) / np.sum(through ** 2)))
