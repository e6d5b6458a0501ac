"""Pulses as complex envelopes around a carrier, which begin at time 0 and end after their duration.

    p(t) = Re{ s_b(t) e^{i 2π f0 t} }
    cw    s_b = w(t)                                  lfm   s_b = w(t) e^{iπ (B/T) (t - T/2)²}
    hfm   s_b = w(t) e^{i(φ(t) - 2π f0 t)},           φ = -2πK ln(1 - (f2 - f1) t / (f2 T)),  K = f1 f2 T/(f2 - f1)
    moving    s_b(η t) e^{i 2π f0 (η - 1) t}

f0 -> ``frequency``, B -> ``bandwidth`` (f1, f2 = f0 -+ B/2), T -> ``duration``, w -> ``window``, η -> ``doppler``, the
two-way factor (c + v)/(c - v). |s_b| = 1 is the source level, rms: no factor √2 (e.g. Urick 1983, ch. 2; hyperbolic
sweeps: Kroszczynski 1969, Proc. IEEE 57, 1260).
"""
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.fft import fftfreq, fftshift, ifftshift
from scipy.interpolate import CubicSpline
from scipy.signal import ZoomFFT, get_window, resample_poly

__all__ = ["PULSES", "Pulse", "cw", "hfm", "lfm", "pulse_of", "sampled"]

Window: TypeAlias = str | tuple     # of scipy.signal.get_window
WINDOW_NODES = 8193                # of a window's table: linear between them is good to 1e-7
STEPS_PER_CYCLE = 32               # of Simpson's rule at the highest frequency in sight: -90 dB
BAND_GRID = 64                     # frequencies per 1/T where -3 dB points are sought
LENGTH_GRID = 4                    # enough for ∫|S|⁴ df: the compressed pulse lasts 2T
SKIRTS = 64                        # of the spectrum that are kept [1/T]
FINER = 16                         # a sampled waveform is brought to this many times its rate, then splined


@dataclass(frozen=True, kw_only=True, eq=False)
class Pulse:
    """A transmitted waveform; made by `cw`, `lfm`, `hfm` or `sampled`.

    Attributes
    ----------
    kind : str
    frequency : float [Hz]
        Carrier, to which the complex envelope refers.
    duration : float [s]
    window : None, str or tuple
        Of ``scipy.signal.get_window``, over the duration; None is rectangular.
    modulation : callable
        Time (N,) [s] within the pulse to the complex envelope (N,) before the window.
    sweep : (float, float) or None [Hz]
        First and last frequency of a sweep relative to the carrier, None for what does not sweep.
    finest : float [Hz]
        No instantaneous frequency of the envelope lies further from the carrier.
    """

    kind: str
    frequency: float
    duration: float
    window: Window | None = None
    modulation: Callable[[np.ndarray], np.ndarray] = field(repr=False)
    sweep: tuple[float, float] | None = None
    finest: float = 0.0

    def __post_init__(self):
        for name, unit in (("frequency", "Hz"), ("duration", "s")):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ValueError(f"{self.kind} pulse: {name} is {value} {unit}; give a finite number above 0.")
        if self.frequency * self.duration < 1:
            raise ValueError(f"{self.kind} pulse: {self.duration} s at {self.frequency} Hz is less than one cycle of "
                             f"the carrier; give a duration in seconds of {1 / self.frequency:.2g} or more.")
        if self.window is not None:
            _window_table(self.window)

    @property
    def numbers(self) -> dict[str, Any] | None:
        """Plain values that `pulse_of` makes this pulse of again; None of a sampled one."""
        if self.kind not in PULSES:
            return None
        window = list(self.window) if isinstance(self.window, tuple) else self.window
        sweep = {} if self.sweep is None else {"bandwidth": self.sweep[1] - self.sweep[0]}
        return {"kind": self.kind, "frequency": self.frequency, "duration": self.duration, **sweep, "window": window}

    # ------------------------------------------------------------------------------------------------ in time
    def envelope(self, time: ArrayLike, doppler: float = 1.0) -> np.ndarray:
        """Give the complex envelope s_b of an echo whose first instant arrives at time 0.

        Parameters
        ----------
        time : array [s]
        doppler : float [-]
            Two-way factor η.

        Returns
        -------
        complex array, shape of `time`
            Zero outside 0 .. duration / η.
        """
        time = np.asarray(time, float)
        own = time * doppler
        inside = (own >= 0) & (own <= self.duration)
        own = np.where(inside, own, 0.0)
        carrier = np.exp(2j * np.pi * self.frequency * (doppler - 1.0) * time)
        return np.where(inside, self._shape(own) * carrier, 0.0)

    def sampled_at(self, sampling_rate: float, doppler: float = 1.0) -> np.ndarray:
        """Give the envelope at times n / `sampling_rate`, from 0 to the pulse's end; complex (N,)."""
        count = int(np.floor(self.duration / doppler * sampling_rate * (1 + 1e-12))) + 1
        return self.envelope(np.arange(count) / sampling_rate, doppler)

    def replica(self, window: Window | None = None) -> "Pulse":
        """Give the pulse a matched filter correlates with: this one, shaded once more by `window`."""
        return self if window is None else replace(self, modulation=self._shape, window=window)

    def _shape(self, own: np.ndarray) -> np.ndarray:
        return self.modulation(own) * _window_values(self.window, own / self.duration)

    def pieces(self, count: int) -> list[tuple[float, "Pulse"]]:
        """Cut the pulse into pieces of equal length.

        Returns
        -------
        list of (float, Pulse)
            When each begins [s], and what is sent from then on: with the phase that the carrier has by then, and the
            band of the whole.
        """
        if count == 1:
            return [(0.0, self)]
        length = self.duration / count
        return [(number * length, replace(self, duration=length, window=None, sweep=self.band,
                                          modulation=partial(self._later, number * length)))
                for number in range(count)]

    def _later(self, start: float, own: np.ndarray) -> np.ndarray:
        own = np.minimum(own + start, self.duration)
        return self._shape(own) * np.exp(2j * np.pi * np.mod(self.frequency * start, 1.0))

    def _simpson(self, highest: float) -> tuple[np.ndarray, np.ndarray]:
        """Nodes [s] over the pulse and weights [s] of Simpson's rule for frequencies up to `highest` [Hz]."""
        steps = 2 * int(np.ceil(0.5 * max(STEPS_PER_CYCLE * self.duration * highest, 256)))
        weight = np.full(steps + 1, 2 / 3)
        weight[1::2], weight[[0, -1]] = 4 / 3, 1 / 3
        return np.linspace(0, self.duration, steps + 1), weight * self.duration / steps

    # ------------------------------------------------------------------------------------------------ in frequency
    def spectrum(self, sampling_rate: float, samples: int, doppler: float = 1.0) -> np.ndarray:
        """Give the Fourier transform of the envelope on the grid of an FFT.

        Parameters
        ----------
        sampling_rate : float [Hz]
        samples : int
            Length of the FFT.
        doppler : float [-]

        Returns
        -------
        complex (samples,) [-]
            ``sampling_rate`` ∫ s_b(t) e^{-i2πft} dt in the order of ``scipy.fft.fftfreq``: scaled as that of a train
            of samples, yet the true spectrum of the pulse between ∓ sampling_rate / 2, free of aliases, so neither
            energy nor delay depends on where the samples fall. Read only.

        Notes
        -----
        Simpson's rule over the pulse and a chirp-z transform; wrong by less than 1e-4 of the largest value.
        """
        return _spectrum(self, float(sampling_rate), int(samples), float(doppler))

    @cached_property
    def band(self) -> tuple[float, float]:
        """Lowest and highest frequency relative to the carrier [Hz]: of the sweep, or the -3 dB points."""
        if self.sweep is not None:
            return min(self.sweep), max(self.sweep)
        frequency, power = self._power_spectrum(BAND_GRID)
        power = power / power.max() - 0.5
        above = np.flatnonzero(power >= 0)

        def half_power(pair: np.ndarray) -> float:
            rising = pair[np.argsort(power[pair])]
            return float(np.interp(0, power[rising], frequency[rising]))

        return half_power(above[0] + np.array([-1, 0])), half_power(above[-1] + np.array([0, 1]))

    @property
    def bandwidth(self) -> float:
        """Width of `band` [Hz]."""
        return self.band[1] - self.band[0]

    @cached_property
    def energy(self) -> float:
        """∫|s_b|² dt [s]: what a pulse that is not compressed is worth in a reverberation equation."""
        return self._overlap(self)

    def compressed_length(self, window: Window | None = None) -> float:
        """Give the effective length of the pulse after a matched filter of unit gain.

        Parameters
        ----------
        window : None, str or tuple
            Of the replica, as in `signal.matched_filter`.

        Returns
        -------
        float [s]
            ∫|χ|² dt, χ the compressed pulse with peak 1: 1/B for a flat spectrum, 2T/3 for an unshaded CW pulse.
        """
        replica = self.replica(window)
        frequency, power = self._power_spectrum(LENGTH_GRID)
        _, other = replica._power_spectrum(LENGTH_GRID)
        return float(np.sum(power * other) * (frequency[1] - frequency[0]) / self._overlap(replica) ** 2)

    @property
    def suggested_sampling_rate(self) -> float:
        """1.5 (occupied band + 2 / duration) [Hz]: leaves the skirts of the spectrum room around the carrier."""
        return 1.5 * (2 * max(-self.band[0], self.band[1]) + 2 / self.duration)

    def _overlap(self, replica: "Pulse") -> float:
        time, weight = self._simpson(self.finest)
        return float(np.sum(weight * self._shape(time) * np.conj(replica._shape(time))).real)

    def _power_spectrum(self, per_duration: int) -> tuple[np.ndarray, np.ndarray]:
        """Frequencies [Hz], rising, `per_duration` to 1/T, and |S|² [s²] well beyond the skirts."""
        rate = 2 * self.finest + SKIRTS / self.duration
        samples = int(np.ceil(rate * self.duration * per_duration))
        power = np.abs(self.spectrum(rate, samples) / rate) ** 2
        return fftshift(fftfreq(samples, 1 / rate)), fftshift(power)


# ---------------------------------------------------------------------------------------------------- families
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
        Of -3 dB bandwidth 0.886 / duration without a window.

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
        Carrier that was taken out.
    samples : complex (N,)
        From the first instant of the pulse to its last; 1 is the source level.
    sampling_rate : float [Hz]

    Returns
    -------
    Pulse
        Of duration (N - 1) / sampling_rate.

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
    fine = resample_poly(samples, FINER, 1, window=("kaiser", 9.0), padtype="line")
    count = FINER * (len(samples) - 1) + 1
    spline = CubicSpline(np.arange(count) / (FINER * sampling_rate), fine[:count])
    return Pulse(kind="sampled", frequency=float(frequency), duration=float((len(samples) - 1) / sampling_rate),
                 modulation=spline, finest=0.5 * float(sampling_rate))


PULSES = {"cw": cw, "lfm": lfm, "hfm": hfm}  # those that numbers in a scene describe


def pulse_of(numbers: dict[str, Any]) -> Pulse:
    """Make a pulse of what its ``numbers`` said.

    Parameters
    ----------
    numbers : dict
        ``kind``, ``frequency`` [Hz], ``duration`` [s], ``bandwidth`` [Hz] of a sweep, ``window``.

    Raises
    ------
    ValueError
        If they describe no pulse.
    """
    arguments = {name: value for name, value in numbers.items() if name != "kind"}
    if isinstance(arguments.get("window"), list):
        arguments["window"] = tuple(arguments["window"])
    try:
        return PULSES[numbers["kind"]](**arguments)
    except (KeyError, TypeError):
        raise ValueError(f"{numbers} describe no pulse; give kind ({', '.join(PULSES)}), frequency, duration, window, "
                         "and of a sweep bandwidth.") from None


# ---------------------------------------------------------------------------------------------------- inside
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


@lru_cache(maxsize=16)
def _window_table(window: Window) -> np.ndarray:
    try:
        return np.asarray(get_window(window, WINDOW_NODES, fftbins=False))
    except (TypeError, ValueError) as error:
        raise ValueError(f"pulse window {window!r} is not one scipy can make ({error}); give a name such as 'hann', or "
                         "a tuple such as ('tukey', 0.1).") from None


def _window_values(window: Window | None, share: np.ndarray) -> np.ndarray | float:
    if window is None:
        return 1.0
    return np.interp(share, np.linspace(0, 1, WINDOW_NODES), _window_table(window))


@lru_cache(maxsize=8)
def _spectrum(pulse: Pulse, sampling_rate: float, samples: int, doppler: float) -> np.ndarray:
    shift = pulse.frequency * abs(doppler - 1.0)
    own, weight = pulse._simpson((0.5 * sampling_rate + shift) / doppler + pulse.finest)
    time = own / doppler
    values = pulse._shape(own) * np.exp(2j * np.pi * pulse.frequency * (doppler - 1.0) * time) * (weight / doppler)
    lowest = -(samples // 2) * sampling_rate / samples
    zoom = ZoomFFT(len(time), [lowest, lowest + sampling_rate], samples, fs=1 / time[1], endpoint=False)
    result = ifftshift(sampling_rate * zoom(values))
    result.flags.writeable = False
    return result
