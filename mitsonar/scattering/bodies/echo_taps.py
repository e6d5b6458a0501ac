"""A target's answer as a few echoes, one after the other: what a scattering function does to a pulse.

    f(frequency) ≈ Σ_k w_k e^(-i2π frequency t_k)

t_k -> ``delay``, evenly spaced, some more of them than the pulse's spectrum is wide; w_k by least squares over that
spectrum. Each tap is an echo of its own, delayed by t_k: whatever sums echoes with their delays, at elements, in beams
or along a moving track, sums the pulse convolved with the target's answer.
"""
from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from .scattering_functions import ScatteringFunction

CLOSER = 1.3                       # taps per 1 / width
LEFT_OUT = 1e-7                    # of the echo's energy, at either end
MARGIN = 5                         # taps beyond either end
RIDGE = 1e-9                       # of the diagonal: keeps taps small where nothing asks for them
LOWEST = 0.05                      # of the carrier: frequencies from there on
FEWEST, MOST_SAMPLES = 256, 8192   # of a spectrum in which the echo's length is sought
MOST_TAPS = 1500                   # what rings on after them is left out: resonances finer than their inverse length
AT_ONCE = 256                      # directions
CARRIER_ALONE = 0.05               # of it: width where no pulse is known
COVERED = 1e-9                     # rounding of a table's ends


@dataclass(frozen=True, kw_only=True)
class HeardBand:
    """Frequencies that a sonar receives."""

    frequency: float  # [Hz]: carrier
    low: float  # [Hz]: of the pulse
    high: float  # [Hz]: of the pulse
    width: float  # [Hz]: about the carrier, with the skirts of its spectrum

    @classmethod
    def about(cls, frequency: float) -> HeardBand:
        """One of a carrier alone, with some room about it."""
        return cls(frequency=frequency, low=frequency, high=frequency, width=CARRIER_ALONE * frequency)

    @property
    def ends(self) -> tuple[float, float]:
        """Lowest and highest frequency with the skirts [Hz]."""
        return max(self.frequency - 0.5 * self.width, LOWEST * self.frequency), self.frequency + 0.5 * self.width


@dataclass(frozen=True, kw_only=True, eq=False)
class EchoTaps:
    """The taps of a target."""

    function: ScatteringFunction
    sound_speed: float  # [m/s]
    frequency: np.ndarray  # (F,) [Hz]
    delay: np.ndarray  # (K,) [s]
    inverse: np.ndarray  # (K, F): makes weights of f
    share: np.ndarray  # (K,): of its energy, over the examples
    strength: float  # [m²]: |f|² over the pulse's band, mean over the examples

    @classmethod
    def of(cls, function: ScatteringFunction, band: HeardBand, sound_speed: float) -> EchoTaps:
        """Make the taps of a scattering function."""
        # sound_speed [m/s]
        return _taps(function, band, float(sound_speed))

    def weights(self, incident: np.ndarray, scattered: np.ndarray) -> np.ndarray:
        """Return w, complex (R, K) [m], for directions of travel (R, 3) in the target's axes."""
        parts = [self.function.form(self.frequency, incident[first:first + AT_ONCE], scattered[first:first + AT_ONCE],
                                    self.sound_speed) @ self.inverse.T for first in range(0, len(incident), AT_ONCE)]
        return np.concatenate(parts) if parts else np.zeros((0, len(self.delay)), complex)


@lru_cache(maxsize=256)
def _taps(function: ScatteringFunction, band: HeardBand, sound_speed: float) -> EchoTaps:
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
    turned = np.exp(-2j * np.pi * frequency[:, None] * delay)
    normal = turned.conj().T @ turned
    inverse = cho_solve(cho_factor(normal + RIDGE * len(frequency) * np.eye(len(delay))), turned.conj().T)
    values = function.form(frequency, *function.examples(), sound_speed)
    energy = np.sum(np.abs(values @ inverse.T) ** 2, axis=0)
    heard = (frequency >= band.low) & (frequency <= band.high)
    if not heard.any():
        heard[np.argmin(np.abs(frequency - 0.5 * (band.low + band.high)))] = True
    return EchoTaps(function=function, sound_speed=sound_speed, frequency=frequency, delay=delay, inverse=inverse,
                    share=energy / energy.sum(), strength=float(np.mean(np.abs(values[:, heard]) ** 2)))


def _span(function: ScatteringFunction, lowest: float, highest: float, sound_speed: float,
          longest: float) -> tuple[float, float]:
    """When the echo begins and ends [s], about the target's origin: of `longest` [s] the part with most energy."""
    directions = function.examples()
    count = max(FEWEST, int(4 * function.latest(sound_speed) * (highest - lowest)))
    while True:
        step = (highest - lowest) / count
        frequency = lowest + step * np.arange(count)
        values = function.form(frequency, *directions, sound_speed) * np.hanning(count)
        energy = np.sum(np.abs(np.fft.ifft(values, axis=-1)) ** 2, axis=0)
        energy /= energy.sum()
        # the spectrum is that of an echo that goes round and round
        length = min(int(np.ceil(longest * step * count)), count)
        begun = np.cumsum(np.concatenate([[0.0], energy, energy]))
        start = int(np.argmax(np.round(begun[length:length + count] - begun[:count], 9)))
        within = np.cumsum(np.roll(energy, -start)[:length])
        first, last = (int(np.searchsorted(within, part)) for part in (LEFT_OUT, within[-1] - LEFT_OUT))
        if last - first < 0.5 * count or count >= MOST_SAMPLES:
            begin = (start + first) % count
            begin = begin - count if begin >= 0.5 * count else begin
            return begin / (step * count), (begin + last - first) / (step * count)
        count *= 2
