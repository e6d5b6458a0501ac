"""From responses to signals and back: the transposes of what `survey.signals` makes of the sums over echoes.

    s = C D_τ (P A h + noise)       A absorption across the band, P pulse and receiver's filter, D_τ the receivers' own
                                    delays, C the samples that are kept

Everything but the noise is linear. Transposes are conjugate: Re⟨w, P A h⟩ = Re⟨A* P* w, h⟩.
"""
from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import fft

from mitsonar.signal.reception import GUARD, INTERPOLATION_ERROR, band_filter, excess_loss_rate, padded_length
from mitsonar.sonar.pulses.pulse import Pulse
from mitsonar.survey.pressure.array_survey import ArraySurvey
from mitsonar.survey.pressure.signals import SentPiece


def response_weights(weights: np.ndarray, survey: ArraySurvey, sent: SentPiece, factor: float,
                     speed: float) -> np.ndarray:
    """Return what signals' weights are of the responses of one Doppler class: A* P* w, complex64 (rx, samples)."""
    # speed [m/s]
    found = _received_transposed(weights, sent.pulse, survey.sampling_rate, factor)
    if survey.absorption_db is not None:
        found = _absorbed_transposed(found, survey.sampling_rate, survey.frequency, survey.absorption_db, speed,
                                     survey.start - sent.begin)
    return found


def delayed_transposed(weights: np.ndarray, delay: np.ndarray, sampling_rate: float, frequency: float) -> np.ndarray:
    """Return the transpose of `signal.reception.delayed`; arguments as of that."""
    return _shifted(weights, delay, sampling_rate, frequency, np.conj)


def later(signals: np.ndarray, delay: np.ndarray, sampling_rate: float, frequency: float) -> np.ndarray:
    """Return what signals (rx, samples) change by as their delay (rx,) [s] grows, per second."""
    return _shifted(signals, delay, sampling_rate, frequency, lambda turn: turn, rate=True)


def _shifted(signals: np.ndarray, delay: np.ndarray, sampling_rate: float, frequency: float,
             of_turn: Callable[[np.ndarray], np.ndarray], rate: bool = False) -> np.ndarray:
    samples = signals.shape[-1]
    length = padded_length(samples, float(np.max(np.abs(delay), initial=0)), sampling_rate)
    cycles = frequency + fft.fftfreq(length, 1 / sampling_rate)
    turn = of_turn(np.exp(-2j * np.pi * delay[:, None] * cycles))
    if rate:
        turn = turn * (-2j * np.pi * cycles)
    return fft.ifft(fft.fft(signals, length) * turn.astype(np.result_type(signals, np.complex64)))[..., :samples]


def _received_transposed(weights: np.ndarray, pulse: Pulse, sampling_rate: float, factor: float) -> np.ndarray:
    samples = weights.shape[-1]
    length = padded_length(samples, pulse.duration / factor, sampling_rate)
    transfer = band_filter(fft.fftfreq(length, 1 / sampling_rate), sampling_rate)
    transfer = transfer * pulse.spectrum(sampling_rate, length, factor)
    spectrum = fft.fft(weights, length)
    return fft.ifft(spectrum * np.conj(transfer).astype(spectrum.dtype), overwrite_x=True)[..., :samples]


def _absorbed_transposed(weights: np.ndarray, sampling_rate: float, frequency: float,
                         absorption_db: Callable[[np.ndarray], np.ndarray], speed: float, start: float) -> np.ndarray:
    """The transpose of `signal.reception.absorbed`: what was cut out last is put back first."""
    samples = weights.shape[-1]
    probe = np.linspace(-0.5, 0.5, 65) * sampling_rate
    fastest = np.abs(excess_loss_rate(probe, sampling_rate, frequency, absorption_db, speed)).max()
    steps = max(1, int(np.ceil(fastest * samples / sampling_rate / np.sqrt(8 * INTERPOLATION_ERROR))))
    step = -(-samples // steps)
    triangle = 1 - np.abs(np.arange(2 * step) / step - 1)
    length = fft.next_fast_len(2 * step + 2 * GUARD)
    rates = excess_loss_rate(fft.fftfreq(length, 1 / sampling_rate), sampling_rate, frequency, absorption_db, speed)
    rows = weights.shape[:-1]
    sums = np.zeros((*rows, samples + 3 * step + 2 * GUARD), weights.dtype)
    sums[..., step + GUARD:step + GUARD + samples] = weights
    found = np.zeros((*rows, samples + 3 * step), weights.dtype)
    for first in range(0, samples + step, step):
        heard = np.zeros((*rows, length), weights.dtype)
        heard[..., :2 * (step + GUARD)] = sums[..., first:first + 2 * (step + GUARD)]
        loss = np.exp(-rates * (start + first / sampling_rate))
        back = fft.ifft(fft.fft(heard) * loss.astype(np.real(heard).dtype))
        found[..., first:first + 2 * step] += (back[..., GUARD:GUARD + 2 * step] * triangle).astype(weights.dtype)
    return found[..., step:step + samples]
