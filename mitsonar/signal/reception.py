"""Turn impulse responses into element signals: pulse, Doppler, transmit beam, absorption across the band.

    y(t) = Σ_j a_j s_b((t - τ_j) η) e^{i2πf0 (η - 1)(t - τ_j)} e^{-i2πf0 τ_j}      =>      Y(f) = H(f) S_η(f) F(f)
    h'(t) = Σ_e w_e h_e(t - d_e) e^{-i2πf0 d_e}                                         one transmission of an array
    h''(t): every echo filtered by 10^{-(α(f0 + f) - α(f0)) c t / 20}                  t the echo's own two-way time

h -> ``response``, whose echoes a_j e^{-i2πf0 τ_j} δ(t - τ_j) include the phase of the carrier and the absorption at f0;
s_b -> ``pulse``, η -> ``doppler``, w, d -> ``weight``, ``delay`` of transmit elements, α -> ``absorption_db``. F is the
receiver's filter: 1 up to 0.4 of the sampling rate, falling as cos² to 0 at 0.5, so that echoes ring for a few samples
only. All convolutions are padded and do not wrap round.
"""
from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import ArrayLike

from mitsonar.sonar.pulses.pulse import Pulse
from mitsonar.units import amplitude_from_db

GUARD = 64                         # samples an echo may ring beyond its ends
FLAT = 0.4                         # edge of the flat band, as a share of the sampling rate
LEAST_SHARE = 0.9                  # least sampling rate, as a share of the band
INTERPOLATION_ERROR = 1e-4         # relative error of the amplitude between two filters


def band_filter(frequency: np.ndarray, sampling_rate: float) -> np.ndarray:
    """Return the receiver's filter F, (N,) [-], at frequencies (N,) [Hz] from the carrier."""
    skirt = np.clip((np.abs(frequency) / sampling_rate - FLAT) / (0.5 - FLAT), 0, 1)
    return np.cos(0.5 * np.pi * skirt) ** 2


def occupied_band(pulse: Pulse) -> float:
    """Return the width [Hz] of the band around the carrier that a pulse occupies."""
    return 2 * max(-pulse.band[0], pulse.band[1])


def least_rate(pulse: Pulse, doppler: float = 1.0) -> float:
    """Return the lowest sampling rate [Hz] of a record of a pulse's echoes: nine tenths of the band.

    Instruments whose samples are as long as their range resolution have this rate. The receiver's filter prevents
    aliasing but removes the ends of the band: an echo of a sweep loses 0.6 dB of its energy at a rate equal to the
    band, 1.0 dB at nine tenths of it, and nothing at 1.25 times the band.
    """
    return LEAST_SHARE * (occupied_band(pulse) * doppler + 2 * pulse.frequency * abs(doppler - 1.0))


def check_record(pulse: Pulse, sampling_rate: float, samples: int, doppler: float = 1.0) -> None:
    """Raise ValueError for records that a pulse does not fit into."""
    needed = least_rate(pulse, doppler)
    if sampling_rate < needed * (1 - 1e-9):
        moved = "" if doppler == 1.0 else f" times the Doppler factor {doppler:.6g}"
        raise ValueError(f"sampling rate is {sampling_rate:g} Hz, below the band of {occupied_band(pulse):g} Hz of the "
                         f"pulse{moved}; give {needed:g} Hz or more, best about {pulse.suggested_sampling_rate:g} Hz.")
    if pulse.duration / doppler > samples / sampling_rate:
        raise ValueError(f"pulse lasts {pulse.duration / doppler:g} s, longer than the record of {samples} samples = "
                         f"{samples / sampling_rate:g} s; shorten the pulse or lengthen the record.")


def received(response: ArrayLike, pulse: Pulse, sampling_rate: float, doppler: float = 1.0) -> np.ndarray:
    """Return the signals that elements receive.

    Parameters
    ----------
    response : complex (..., S)
        Impulse responses in baseband of the pulse's carrier; an echo of amplitude 1 is one sample of height 1.
    pulse : Pulse
    sampling_rate : float [Hz]
    doppler : float [-]
        Two-way factor of all echoes of the response.

    Returns
    -------
    complex (..., S)
        Signals on the same time axis for a source level of 0 dB: multiply them by ``amplitude_from_db`` of the source
        level. complex64 stays complex64.

    Raises
    ------
    ValueError
        If the sampling rate is below the pulse's band, or the pulse outlasts the record.
    """
    return received_classes(np.asarray(response)[None], pulse, sampling_rate, (doppler,))


def received_classes(responses: ArrayLike, pulse: Pulse, sampling_rate: float,
                     doppler: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return the sum of signals with several Doppler factors, as `received` does for one.

    Parameters
    ----------
    responses : complex (K, ..., S)
        One response for each class of echoes.
    pulse : Pulse
    sampling_rate : float [Hz]
    doppler : (K,) [-]
        Factors from `doppler.doppler_classes`.

    Returns
    -------
    complex (..., S)
    """
    responses = np.asarray(responses)
    if len(responses) != len(doppler):
        raise ValueError(f"received: {len(responses)} responses for {len(doppler)} Doppler factors; give one of each.")
    samples = responses.shape[-1]
    for factor in doppler:
        check_record(pulse, sampling_rate, samples, factor)
    length = padded_length(samples, pulse.duration / min(doppler), sampling_rate)
    keep = band_filter(scipy.fft.fftfreq(length, 1 / sampling_rate), sampling_rate)
    total: np.ndarray | int = 0
    for response, factor in zip(responses, doppler):
        transfer = keep * pulse.spectrum(sampling_rate, length, factor)
        spectrum = scipy.fft.fft(response, length)
        total = total + spectrum * transfer.astype(spectrum.dtype)
    return scipy.fft.ifft(np.asarray(total), overwrite_x=True)[..., :samples]


def padded_length(samples: int, longest: float, sampling_rate: float) -> int:
    """Return the length of an FFT that holds a record of `samples` and a filter of `longest` [s] without wrapping."""
    return scipy.fft.next_fast_len(samples + int(np.ceil(longest * sampling_rate)) + 2 * GUARD)


def transposed(filtered: Callable[[np.ndarray], np.ndarray], weights: np.ndarray) -> np.ndarray:
    """Apply the conjugate transpose of a filter that is the same at all times to weights (..., S) of its output.

    Records reversed in time pass through the filter as weights pass through its transpose.
    """
    return np.conj(filtered(np.conj(weights[..., ::-1])))[..., ::-1]


def delayed(signals: ArrayLike, delay: ArrayLike, sampling_rate: float, frequency: float, *,
            rate: bool = False) -> np.ndarray:
    """Delay baseband signals by any fraction of a sample, carrier included.

    Parameters
    ----------
    signals : complex (..., S)
    delay : (...) [s]
        Delays, broadcast against the signals; positive is later.
    sampling_rate : float [Hz]
    frequency : float [Hz]
        Carrier; 0 shifts the envelope alone.
    rate : bool
        Return the derivative by the delay instead [1/s].

    Returns
    -------
    complex (..., S)
        Signals that are exact inside the band; samples from outside the record are 0.
    """
    signals, delay = np.asarray(signals), np.asarray(delay, float)
    samples = signals.shape[-1]
    spectrum, shift = _shifted(signals, delay, sampling_rate, frequency)
    if rate:
        spectrum *= -2j * np.pi * (frequency + scipy.fft.fftfreq(spectrum.shape[-1], 1 / sampling_rate))
    return scipy.fft.ifft(spectrum * shift, overwrite_x=True)[..., :samples]


def transmitted(response: ArrayLike, weight: ArrayLike, delay: ArrayLike, sampling_rate: float,
                frequency: float) -> np.ndarray:
    """Combine the responses of all transmit elements to that of one transmission, steered or focused.

    Parameters
    ----------
    response : complex (..., T, R, S)
        Responses of T transmit and R receive elements.
    weight : (T,) [-]
        Weights of the elements; 0 for an element that is dead or left out.
    delay : (T,) [s]
        Delay of each element's drive; positive is later.
    sampling_rate, frequency : float [Hz]

    Returns
    -------
    complex (..., R, S)
    """
    response, weight = np.asarray(response), np.asarray(weight)
    if weight.shape != response.shape[-3:-2] or np.shape(delay) != weight.shape:
        raise ValueError(f"transmission: {weight.shape} weights and {np.shape(delay)} delays for "
                         f"{response.shape[-3]} transmit elements; give one of each for every element.")
    samples = response.shape[-1]
    spectrum, shift = _shifted(response, np.asarray(delay, float)[:, None], sampling_rate, frequency)
    spectrum *= shift * weight[:, None, None].astype(shift.dtype)
    return scipy.fft.ifft(spectrum.sum(-3), overwrite_x=True)[..., :samples]


def _shifted(signals: np.ndarray, delay: np.ndarray, sampling_rate: float,
             frequency: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the padded spectrum of the signals, and the phases that delay it."""
    longest = float(np.max(np.abs(delay), initial=0))
    length = padded_length(signals.shape[-1], longest, sampling_rate)
    spectrum = scipy.fft.fft(signals, length)
    cycles = delay[..., None] * (frequency + scipy.fft.fftfreq(length, 1 / sampling_rate))
    return spectrum, np.exp(-2j * np.pi * cycles).astype(spectrum.dtype)


def absorbed(response: ArrayLike, sampling_rate: float, frequency: float,
             absorption_db: Callable[[np.ndarray], np.ndarray], sound_speed: float, start: float = 0.0, *,
             transposed: bool = False) -> np.ndarray:
    """Apply the absorption across the band to echoes that already include the loss at the carrier.

    Parameters
    ----------
    response : complex (..., S)
        Response before the pulse, so that each echo's own time counts.
    sampling_rate : float [Hz]
    frequency : float [Hz]
        Carrier.
    absorption_db : callable
        Function from frequency (N,) [Hz] to absorption (N,) [dB/m]; in a column of water, its mean over the depths
        passed.
    sound_speed : float [m/s]
        Mean along the path, whose length is sound_speed times the two-way time.
    start : float [s]
        Time of the first sample.
    transposed : bool
        Apply the conjugate transpose, to weights (..., S) of the result.

    Returns
    -------
    complex (..., S)

    Notes
    -----
    The record is cut by triangular windows that add to one; each piece passes through the filter of its middle. The
    loss is therefore interpolated linearly between filters; their number keeps the error below 1e-4 of the amplitude.
    Outside the flat band of the receiver's filter the loss returns to that of the carrier. Dispersion is left out.
    """
    response = np.asarray(response)
    response = response.astype(np.result_type(response, np.complex64), copy=False)
    real, samples = np.real(response).dtype, response.shape[-1]
    probe = np.linspace(-0.5, 0.5, 65) * sampling_rate
    rate = np.abs(_kept_rate(probe.tobytes(), sampling_rate, frequency, absorption_db, sound_speed)).max()
    # linear interpolation of exp(-κt) over steps Δ is wrong by (κΔ)²/8 at most, relative to it
    steps = max(1, int(np.ceil(rate * samples / sampling_rate / np.sqrt(8 * INTERPOLATION_ERROR))))
    step = -(-samples // steps)
    window = np.pad((1 - np.abs(np.arange(2 * step) / step - 1)).astype(real), GUARD)
    length = scipy.fft.next_fast_len(2 * step + 2 * GUARD)
    offset = scipy.fft.fftfreq(length, 1 / sampling_rate)
    rates = _kept_rate(offset.tobytes(), sampling_rate, frequency, absorption_db, sound_speed)
    edges = [(0, 0)] * (response.ndim - 1)
    source = np.pad(response, [*edges, (step + GUARD, 2 * step + GUARD)])   # begins so much before the record
    sums = np.zeros_like(source)
    for first in range(0, samples + step, step):                        # window rises from first - step, peaks at first
        cut = source[..., first:first + 2 * (step + GUARD)]
        loss = np.exp(-rates * (start + first / sampling_rate)).astype(real)
        spectrum = scipy.fft.fft(cut if transposed else cut * window, length)
        piece = scipy.fft.ifft(spectrum * loss)[..., :2 * (step + GUARD)]
        sums[..., first:first + 2 * (step + GUARD)] += piece * window if transposed else piece
    return sums[..., step + GUARD:step + GUARD + samples]


@lru_cache(maxsize=8)
def _kept_rate(offset: bytes, sampling_rate: float, frequency: float,
               absorption_db: Callable[[np.ndarray], np.ndarray], sound_speed: float) -> np.ndarray:
    """Return `excess_loss_rate` of float64 offsets, cached for the Doppler classes of a ping."""
    rates = excess_loss_rate(np.frombuffer(offset), sampling_rate, frequency, absorption_db, sound_speed)
    rates.setflags(write=False)
    return rates


def excess_loss_rate(offset: np.ndarray, sampling_rate: float, frequency: float,
                 absorption_db: Callable[[np.ndarray], np.ndarray], sound_speed: float) -> np.ndarray:
    """Return the loss beyond that at the carrier [Np/s of two-way time] at offsets [Hz] from it."""
    alpha = np.asarray(absorption_db(np.maximum(frequency + offset, 0.0)), float)
    excess = (alpha - float(absorption_db(np.array([frequency]))[0])) * band_filter(offset, sampling_rate)
    return np.log(amplitude_from_db(excess)) * sound_speed
