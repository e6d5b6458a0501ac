"""Measure arrival times of echoes of point targets in element signals, by envelopes and by phases.

A compressed echo of the delay τ is a χ(t - τ) e^(-i2πf₀τ), χ real at its peak. The peak of |·| determines τ to

    1 / (2π β √(2 S))          and the phase there, up to whole cycles, to          1 / (2π f₀ √(2 S))

β -> rms bandwidth, S -> signal to noise and reverberation at the peak (Woodward 1953, Probability and Information
Theory, ch. 6; Quazi 1981, IEEE Trans. ASSP 29, 527).
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import fft

from mitsonar.signal.matched_filtering import matched_filter, rms_bandwidth
from mitsonar.sonar.pulses.pulse import Pulse

FINER = 8                          # samples are made finer before peaks are looked for
WEAKEST = 4.0                      # power of a peak over its surroundings, below which there is none
FEWEST = 8                         # samples of a window


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredArrivals:
    """Arrival times of peaks; NaN where an echo is missing."""

    time: np.ndarray  # (P, K, E) [s]: of envelopes
    peak: np.ndarray  # (P, K, E): a e^(-i2πf₀τ)
    noise_ratio: np.ndarray  # (P, K, E) [-]: S
    bandwidth: float  # [Hz]: β
    frequency: float  # [Hz]

    def phase_time(self, near: np.ndarray) -> np.ndarray:
        """Return the delays of the phases that are nearest to given delays: (P, K, E) [s]."""
        cycles = -np.angle(self.peak) / (2 * np.pi)
        return (cycles + np.round(near * self.frequency - cycles)) / self.frequency

    def deviation(self, by: float) -> np.ndarray:
        """Return the deviation [s] of a time measured at a frequency [Hz]: `bandwidth`, or the carrier."""
        return 1 / (2 * np.pi * by * np.sqrt(2 * self.noise_ratio))


def measured_arrivals(signals: np.ndarray, time: np.ndarray, pulse: Pulse, sampling_rate: float, *,
                      predicted: np.ndarray, reach: np.ndarray, doppler: np.ndarray) -> MeasuredArrivals:
    """Find the echoes of targets."""
    # signals (P, E, samples); time [s]; sampling_rate [Hz]; predicted (P, K, E) [s]; reach (P, K) [s]; doppler (P, K)
    # [-]
    shape = predicted.shape
    found, peak, ratio = np.full(shape, np.nan), np.full(shape, np.nan + 0j), np.full(shape, np.nan)
    for ping in range(shape[0]):
        for target in range(shape[1]):
            others = np.abs(np.delete(predicted[ping], target, 0) - predicted[ping, target])
            if others.size and np.any(others < np.delete(reach[ping], target)[:, None] + reach[ping, target]):
                continue
            compressed = matched_filter(signals[ping], pulse, sampling_rate, doppler=float(doppler[ping, target]))
            half = int(np.ceil(reach[ping, target] * sampling_rate)) + FEWEST
            for element in range(shape[2]):
                middle = int(round((predicted[ping, target, element] - time[0]) * sampling_rate))
                if middle - half < 0 or middle + half > len(time):
                    continue
                window = compressed[element, middle - half:middle + half]
                place, value, surroundings = _peak(window, sampling_rate / pulse.bandwidth)
                if abs(value) ** 2 > WEAKEST * surroundings:
                    found[ping, target, element] = time[0] + (middle - half + place) / sampling_rate
                    peak[ping, target, element] = value
                    ratio[ping, target, element] = abs(value) ** 2 / surroundings
    return MeasuredArrivals(time=found, peak=peak, noise_ratio=ratio, frequency=pulse.frequency,
                            bandwidth=rms_bandwidth(pulse, sampling_rate))


def _peak(window: np.ndarray, width: float) -> tuple[float, complex, float]:
    """Return the place [samples] and the value of the highest peak of a window, and the mean power beside it."""
    count = len(window)
    spectrum = fft.fft(window)
    wide = np.zeros(FINER * count, complex)
    wide[:count // 2], wide[-(count - count // 2):] = spectrum[:count // 2], spectrum[count // 2:]
    fine = FINER * fft.ifft(wide)
    # the ends of a window wrap round
    edge = FINER * FEWEST // 2
    power = np.abs(fine) ** 2
    best = edge + int(np.argmax(power[edge:-edge]))
    before, here, after = np.sqrt(power[best - 1:best + 2])
    shift = 0.5 * (before - after) / min(before - 2 * here + after, -1e-30)
    low, high = (fine[best], fine[best + 1]) if shift >= 0 else (fine[best - 1], fine[best])
    share = shift if shift >= 0 else 1 + shift
    value = low + (high - low) * share
    beside = np.abs(np.arange(count) - best / FINER) > 2 * width
    surroundings = float(np.mean(np.abs(window[beside]) ** 2)) if beside.any() else 0.0
    return (best + shift) / FINER, complex(value), max(surroundings, 1e-12 * abs(value) ** 2)
