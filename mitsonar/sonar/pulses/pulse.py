"""A pulse as a complex envelope around a carrier, in time and in frequency.

    p(t) = Re{ s_b(t) e^{i 2π f0 t} }                                  moving    s_b(η t) e^{i 2π f0 (η - 1) t}

f0 -> ``frequency``, T -> ``duration``, η -> ``doppler``, the two-way factor (c + v)/(c - v). The envelope begins at
time 0 and ends after T; it is one of those of `pulses` times a window.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial
from typing import Any, TypeAlias

import numpy as np
from numpy.fft import fftfreq, fftshift, ifftshift
from numpy.typing import ArrayLike

from mitsonar.device.lazy import module_alone

Window: TypeAlias = str | tuple     # of scipy.signal.get_window
DESCRIBED = ("cw", "lfm", "hfm")   # kinds of pulses that numbers describe
WINDOW_NODES = 8193                # of a window's table: linear between them is good to 1e-7
STEPS_PER_CYCLE = 32               # of Simpson's rule at the highest frequency in sight: -90 dB
BAND_GRID = 64                     # frequencies per 1/T where -3 dB points are sought
LENGTH_GRID = 4                    # enough for ∫|S|⁴ df: the compressed pulse lasts 2T
SKIRTS = 64                        # of the spectrum that are kept [1/T]


@dataclass(frozen=True, kw_only=True, eq=False)
class Pulse:
    """A transmitted waveform; made by `pulses.cw`, `.lfm`, `.hfm` or `.sampled`.

    Attributes
    ----------
    kind : str
    frequency : float [Hz]
        Carrier, to which the complex envelope refers.
    duration : float [s]
    window : None, str or tuple
        Window of ``scipy.signal.get_window`` over the duration; None is rectangular.
    modulation : callable
        Function from time (N,) [s] within the pulse to the complex envelope (N,) before the window.
    sweep : (float, float) or None [Hz]
        First and last frequency of a sweep relative to the carrier; None for other pulses.
    finest : float [Hz]
        Greatest distance of the envelope's instantaneous frequency from the carrier.
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
        """Plain values that `pulses.pulse_of` makes this pulse of again; None of a sampled one."""
        if self.kind not in DESCRIBED:
            return None
        window = list(self.window) if isinstance(self.window, tuple) else self.window
        sweep = {} if self.sweep is None else {"bandwidth": self.sweep[1] - self.sweep[0]}
        return {"kind": self.kind, "frequency": self.frequency, "duration": self.duration, **sweep, "window": window}

    # ------------------------------------------------------------------------------------------------ in time
    def envelope(self, time: ArrayLike, doppler: float = 1.0) -> np.ndarray:
        """Return the complex envelope s_b of an echo whose first instant arrives at time 0.

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
        """Return the envelope at times n / `sampling_rate`, from 0 to the pulse's end; complex (N,)."""
        count = int(np.floor(self.duration / doppler * sampling_rate * (1 + 1e-12))) + 1
        return self.envelope(np.arange(count) / sampling_rate, doppler)

    def replica(self, window: Window | None = None) -> Pulse:
        """Return the pulse a matched filter correlates with: this one, shaded once more by `window`."""
        return self if window is None else replace(self, modulation=self._shape, window=window)

    def _shape(self, own: np.ndarray) -> np.ndarray:
        return self.modulation(own) * _window_values(self.window, own / self.duration)

    def pieces(self, count: int) -> list[tuple[float, Pulse]]:
        """Cut the pulse into pieces of equal length.

        Returns
        -------
        list of (float, Pulse)
            Beginning of each piece [s], and the piece, with the carrier's phase at its beginning and the band of the
            whole pulse.
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
        """Return nodes [s] over the pulse and weights [s] of Simpson's rule for frequencies up to `highest` [Hz]."""
        steps = 2 * int(np.ceil(0.5 * max(STEPS_PER_CYCLE * self.duration * highest, 256)))
        weight = np.full(steps + 1, 2 / 3)
        weight[1::2], weight[[0, -1]] = 4 / 3, 1 / 3
        return np.linspace(0, self.duration, steps + 1), weight * self.duration / steps

    # ------------------------------------------------------------------------------------------------ in frequency
    def spectrum(self, sampling_rate: float, samples: int, doppler: float = 1.0) -> np.ndarray:
        """Return the Fourier transform of the envelope on the grid of an FFT.

        Parameters
        ----------
        sampling_rate : float [Hz]
        samples : int
            Length of the FFT.
        doppler : float [-]

        Returns
        -------
        complex (samples,) [-]
            ``sampling_rate`` ∫ s_b(t) e^{-i2πft} dt in the order of ``numpy.fft.fftfreq``: scaled as that of a train
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
        """∫|s_b|² dt [s], the effective length of an uncompressed pulse in a reverberation equation."""
        return self._overlap(self)

    def compressed_length(self, window: Window | None = None) -> float:
        """Return the effective length of the pulse after a matched filter of unit gain.

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

    def _overlap(self, replica: Pulse) -> float:
        time, weight = self._simpson(self.finest)
        return float(np.sum(weight * self._shape(time) * np.conj(replica._shape(time))).real)

    def _power_spectrum(self, per_duration: int) -> tuple[np.ndarray, np.ndarray]:
        """Return rising frequencies [Hz], `per_duration` to 1/T, and |S|² [s²] well beyond the skirts."""
        rate = 2 * self.finest + SKIRTS / self.duration
        samples = int(np.ceil(rate * self.duration * per_duration))
        power = np.abs(self.spectrum(rate, samples) / rate) ** 2
        return fftshift(fftfreq(samples, 1 / rate)), fftshift(power)


@lru_cache(maxsize=16)
def _window_table(window: Window) -> np.ndarray:
    try:
        windows = module_alone("scipy.signal", "windows/_windows.py")
        return np.asarray(windows.get_window(window, WINDOW_NODES, fftbins=False))
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
    zoom_fft = module_alone("scipy.signal", "_czt.py").ZoomFFT
    zoom = zoom_fft(len(time), [lowest, lowest + sampling_rate], samples, fs=1 / time[1], endpoint=False)
    result = ifftshift(sampling_rate * zoom(values))
    result.flags.writeable = False
    return result
