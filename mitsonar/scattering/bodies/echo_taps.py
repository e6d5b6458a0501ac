"""Echo of a target as a series of delayed taps, fitted to its scattering function.

    f(frequency) ≈ Σ_k w_k e^(-i2π frequency t_k)

t_k -> ``delay``, evenly spaced, slightly closer than 1 / width of the pulse's spectrum; w_k is fitted by least squares
over that spectrum. Each tap is an echo of its own, delayed by t_k. A sum of delayed echoes, at elements, in beams or
along a moving track, is therefore the pulse convolved with the target's impulse response.
"""
from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy

from .scattering_functions import ScatteringFunction

CLOSER = 1.3                       # taps per 1 / width
LEFT_OUT = 1e-7                    # share of the echo's energy cut off at either end
MARGIN = 5                         # taps beyond either end
RIDGE = 1e-9                       # relative to the diagonal: keeps taps small that the spectrum does not determine
LOWEST = 0.05                      # lowest frequency over the carrier
FEWEST, MOST_SAMPLES = 256, 8192   # samples of the spectrum in which the echo's length is searched
MOST_TAPS = 1500                   # later ringing is left out, so resonances narrower than 1 / length are lost
AT_ONCE = 256                      # directions in a batch
CARRIER_ALONE = 0.05               # bandwidth over the carrier where no pulse is known
COVERED = 1e-9                     # relative rounding allowed at a table's ends


@dataclass(frozen=True, kw_only=True)
class ReceivedBand:
    """Frequencies that a sonar receives."""

    frequency: float  # [Hz]: carrier
    low: float  # [Hz]: lower end of the pulse's band
    high: float  # [Hz]: upper end
    width: float  # [Hz]: width about the carrier, spectral skirts included

    @classmethod
    def about(cls, frequency: float) -> ReceivedBand:
        """Return a narrow band about a carrier [Hz]."""
        return cls(frequency=frequency, low=frequency, high=frequency, width=CARRIER_ALONE * frequency)

    @property
    def ends(self) -> tuple[float, float]:
        """Return the lowest and highest frequency [Hz], skirts included."""
        return max(self.frequency - 0.5 * self.width, LOWEST * self.frequency), self.frequency + 0.5 * self.width


@dataclass(frozen=True, kw_only=True, eq=False)
class EchoTaps:
    """Taps of a target."""

    function: ScatteringFunction
    sound_speed: float  # [m/s]
    frequency: np.ndarray  # (F,) [Hz]
    delay: np.ndarray  # (K,) [s]
    inverse: np.ndarray  # (K, F): matrix from f to tap weights
    share: np.ndarray  # (K,): share of each tap in the echo's energy, over the example directions
    strength: float  # [m²]: |f|² over the pulse's band, mean over the example directions

    @classmethod
    def of(cls, function: ScatteringFunction, band: ReceivedBand, sound_speed: float) -> EchoTaps:
        """Fit the taps of a scattering function for a sound speed [m/s]."""
        return _taps(function, band, float(sound_speed))

    def weights(self, incident: np.ndarray, scattered: np.ndarray) -> np.ndarray:
        """Return w, complex (R, K) [m], for directions of travel (R, 3) in the target's axes."""
        parts = [self.function.form(self.frequency, incident[first:first + AT_ONCE], scattered[first:first + AT_ONCE],
                                    self.sound_speed) @ self.inverse.T for first in range(0, len(incident), AT_ONCE)]
        return np.concatenate(parts) if parts else np.zeros((0, len(self.delay)), complex)


@lru_cache(maxsize=256)
def _taps(function: ScatteringFunction, band: ReceivedBand, sound_speed: float) -> EchoTaps:
    low, high = function.covered
    if low * (1 - COVERED) > band.low or high * (1 + COVERED) < band.high:
        raise ValueError(f"a scattering function covers {low / 1e3:g} to {high / 1e3:g} kHz, and the pulse's band is "
                         f"{band.low / 1e3:g} to {band.high / 1e3:g} kHz; extend the table.")
    lowest, highest = band.ends
    spacing = 1 / (CLOSER * (highest - lowest))
    first, last = _span(function, lowest, highest, sound_speed, MOST_TAPS * spacing)
    numbers = np.arange(int(np.floor(first / spacing)) - MARGIN, int(np.ceil(last / spacing)) + MARGIN + 1)
    delay = numbers[:MOST_TAPS] * spacing
    frequency = np.linspace(lowest, highest, max(3 * len(delay), 64))
    phases = np.exp(-2j * np.pi * frequency[:, None] * delay)
    normal = phases.conj().T @ phases
    factor = scipy.linalg.cho_factor(normal + RIDGE * len(frequency) * np.eye(len(delay)))
    inverse = scipy.linalg.cho_solve(factor, phases.conj().T)
    values = function.form(frequency, *function.examples(), sound_speed)
    energy = np.sum(np.abs(values @ inverse.T) ** 2, axis=0)
    in_band = (frequency >= band.low) & (frequency <= band.high)
    if not in_band.any():
        in_band[np.argmin(np.abs(frequency - 0.5 * (band.low + band.high)))] = True
    return EchoTaps(function=function, sound_speed=sound_speed, frequency=frequency, delay=delay, inverse=inverse,
                    share=energy / energy.sum(), strength=float(np.mean(np.abs(values[:, in_band]) ** 2)))


def _span(function: ScatteringFunction, lowest: float, highest: float, sound_speed: float,
          longest: float) -> tuple[float, float]:
    """Return begin and end [s] of the echo relative to the target's origin: the `longest` [s] with most energy."""
    directions = function.examples()
    count = max(FEWEST, int(4 * function.latest(sound_speed) * (highest - lowest)))
    while True:
        step = (highest - lowest) / count
        frequency = lowest + step * np.arange(count)
        values = function.form(frequency, *directions, sound_speed) * np.hanning(count)
        energy = np.sum(np.abs(np.fft.ifft(values, axis=-1)) ** 2, axis=0)
        energy /= energy.sum()
        # a sampled spectrum makes the echo periodic in time
        length = min(int(np.ceil(longest * step * count)), count)
        cumulative = np.cumsum(np.concatenate([[0.0], energy, energy]))
        start = int(np.argmax(np.round(cumulative[length:length + count] - cumulative[:count], 9)))
        within = np.cumsum(np.roll(energy, -start)[:length])
        first, last = (int(np.searchsorted(within, part)) for part in (LEFT_OUT, within[-1] - LEFT_OUT))
        if last - first < 0.5 * count or count >= MOST_SAMPLES:
            begin = (start + first) % count
            begin = begin - count if begin >= 0.5 * count else begin
            return begin / (step * count), (begin + last - first) / (step * count)
        count *= 2
