"""Pulses as complex envelopes around a carrier, which begin at time 0 and end after their duration.

    p(t) = Re{ s_b(t) e^{i 2π f0 t} }
    cw    s_b = w(t)                                  lfm   s_b = w(t) e^{iπ (B/T) (t - T/2)²}
    hfm   s_b = w(t) e^{i(φ(t) - 2π f0 t)},           φ = -2πK ln(1 - (f2 - f1) t / (f2 T)),  K = f1 f2 T/(f2 - f1)
    moving    s_b(η t) e^{i 2π f0 (η - 1) t}

f0 -> ``frequency``, B -> ``bandwidth`` (f1, f2 = f0 -+ B/2), T -> ``duration``, w -> ``window``, η -> ``doppler``, the
two-way factor (c + v)/(c - v). |s_b| = 1 is the source level, rms: no factor √2 (e.g. Urick 1983, ch. 2; hyperbolic
sweeps: Kroszczynski 1969, Proc. IEEE 57, 1260).
"""
from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .pulse import Pulse, Window

FINER = 16                         # a sampled waveform is brought to this many times its rate, then splined


def cw(frequency: float, duration: float, window: Window | None = None) -> Pulse:
    """Make a pulse of constant frequency.

    Parameters
    ----------
    frequency : float [Hz]
    duration : float [s]
    window : None, str or tuple

    Returns
    -------
    Pulse
        Pulse of -3 dB bandwidth 0.886 / duration without a window.

    Raises
    ------
    ValueError
        If a number is not finite and above 0, the pulse lasts less than a cycle, or scipy knows no such window.
    """
    return Pulse(kind="cw", frequency=float(frequency), duration=float(duration), window=window, modulation=_constant)


def lfm(frequency: float, bandwidth: float, duration: float, window: Window | None = None) -> Pulse:
    """Make a linear sweep from frequency - bandwidth/2 to frequency + bandwidth/2; a negative bandwidth sweeps down.

    Parameters
    ----------
    frequency : float [Hz]
        In the middle of the sweep.
    bandwidth : float [Hz]
    duration : float [s]
    window : None, str or tuple

    Returns
    -------
    Pulse

    Raises
    ------
    ValueError
        As `cw`, and if the sweep is empty or reaches 0 Hz.
    """
    half = _half_sweep("lfm", frequency, bandwidth)
    return Pulse(kind="lfm", frequency=float(frequency), duration=float(duration), window=window,
                 modulation=partial(_linear, rate=2 * half / duration, middle=0.5 * duration),
                 sweep=(-half, half), finest=abs(half))


def hfm(frequency: float, bandwidth: float, duration: float, window: Window | None = None) -> Pulse:
    """Make a hyperbolic sweep, whose shape motion only shifts in time; arguments and errors as `lfm`.

    Returns
    -------
    Pulse
        Of period rising or falling linearly from 1/(frequency - bandwidth/2) to 1/(frequency + bandwidth/2).
    """
    half = _half_sweep("hfm", frequency, bandwidth)
    first, last = frequency - half, frequency + half
    return Pulse(kind="hfm", frequency=float(frequency), duration=float(duration), window=window,
                 modulation=partial(_hyperbolic, carrier=float(frequency), cycles=first * last * duration / (2 * half),
                                    stretch=2 * half / (last * duration)), sweep=(-half, half), finest=abs(half))


def sampled(frequency: float, samples: ArrayLike, sampling_rate: float) -> Pulse:
    """Make a pulse of any waveform from samples of its complex envelope.

    Parameters
    ----------
    frequency : float [Hz]
        Carrier of the complex envelope.
    samples : complex (N,)
        Samples from the first instant of the pulse to its last; 1 is the source level.
    sampling_rate : float [Hz]

    Returns
    -------
    Pulse
        Pulse of duration (N - 1) / sampling_rate.

    Raises
    ------
    ValueError
        If there are fewer than two samples, or any is not finite.

    Notes
    -----
    Between samples the waveform is band-limited, to 1e-3 below 0.4 sampling_rate away from abrupt ends.
    """
    samples = np.asarray(samples, complex)
    if samples.ndim != 1 or len(samples) < 2 or not np.all(np.isfinite(samples)):
        raise ValueError(f"sampled pulse: got samples of shape {samples.shape}; give two or more finite complex "
                         "numbers in one dimension.")
    if not (np.isfinite(sampling_rate) and sampling_rate > 0):
        raise ValueError(f"sampled pulse: sampling_rate is {sampling_rate} Hz; give a finite number above 0.")
    from scipy.interpolate import CubicSpline
    from scipy.signal import resample_poly

    fine = resample_poly(samples, FINER, 1, window=("kaiser", 9.0), padtype="line")
    count = FINER * (len(samples) - 1) + 1
    spline = CubicSpline(np.arange(count) / (FINER * sampling_rate), fine[:count])
    return Pulse(kind="sampled", frequency=float(frequency), duration=float((len(samples) - 1) / sampling_rate),
                 modulation=spline, finest=0.5 * float(sampling_rate))


PULSES = {"cw": cw, "lfm": lfm, "hfm": hfm}  # those that numbers in a scene describe


def pulse_of(numbers: dict[str, Any]) -> Pulse:
    """Make a pulse from its ``numbers``.

    Parameters
    ----------
    numbers : dict
        ``kind``, ``frequency`` [Hz], ``duration`` [s], ``bandwidth`` [Hz] of a sweep, ``window``.

    Raises
    ------
    ValueError
        If they describe no pulse.
    """
    try:
        arguments = {name: value for name, value in numbers.items() if name != "kind"}
        if isinstance(arguments.get("window"), list):
            arguments["window"] = tuple(arguments["window"])
        return PULSES[numbers["kind"]](**arguments)
    except (AttributeError, KeyError, TypeError):          # no mapping, no such kind, or no such numbers
        raise ValueError(f"{numbers} describe no pulse; give kind ({', '.join(PULSES)}), frequency, duration, window, "
                         "and of a sweep bandwidth.") from None


def _constant(time: np.ndarray) -> np.ndarray:
    return np.ones(np.shape(time), complex)


def _linear(time: np.ndarray, rate: float, middle: float) -> np.ndarray:
    return np.exp(1j * np.pi * rate * (time - middle) ** 2)


def _hyperbolic(time: np.ndarray, carrier: float, cycles: float, stretch: float) -> np.ndarray:
    return np.exp(-2j * np.pi * (cycles * np.log1p(-stretch * time) + carrier * time))


def _half_sweep(kind: str, frequency: float, bandwidth: float) -> float:
    if not (np.isfinite(bandwidth) and bandwidth != 0 and abs(bandwidth) < 2 * frequency):
        raise ValueError(f"{kind} pulse: bandwidth is {bandwidth} Hz around {frequency} Hz; give one whose sweep stays "
                         "above 0 Hz, negative to sweep down, or use a cw pulse.")
    return 0.5 * float(bandwidth)
