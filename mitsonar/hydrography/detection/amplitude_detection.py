"""Detect the bed by amplitude: the centre of gravity of an echo's intensity.

    t = Σ (I_n - N) t_n / Σ (I_n - N)

I -> intensity of the whole beam, N -> mean noise, n -> samples of a window that is centred on t until t rests
(de Moustier 1993; Lurton 2010, An Introduction to Underwater Acoustics, ch. 8). Window and compressed pulse are
symmetric, so the pulse length causes no bias. The bias of the footprint is removed: the echo of a plane bed is late by

    (1 + 2 tan²ψ) σ_b²/2 + σ_a² cos(ψ - θ)/(2 cos θ cos ψ)

of its time, and its middle lies off the axis by σ_b² d(ln E)/dθ, which is returned as an offset of the beam's sine.
σ_b, σ_a -> rms widths of the beam across and of the transmission along the track, ψ -> incidence, θ -> beam angle,
E -> energy of the neighbours' echoes.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from .quality import GAUSSIAN_WIDTH, echoes_side_by_side, gravity_deviation, pulse_deviation
from .windows import Windows, among_neighbours, over_spans, windows_about

NEIGHBOURS = (4, 8)               # least number of beams to either side for slopes
SPANS = (0.03, 0.1)               # least angle to either side [rad]
STEEPEST = 1.48                   # [rad]
PASSES = 4
REACH = 1.0                       # half the window, in -3 dB widths of the footprint
PULSES = 1.5                      # added to it, in pulse lengths


@dataclass(frozen=True, kw_only=True)
class AmplitudeDetections:
    """Amplitude detections of B beams, still with the delay of the footprint."""

    time: np.ndarray  # (B,) [s]
    deviation: np.ndarray  # (B,) [s]
    energy: np.ndarray  # (B,) [µPa² s], without noise
    peak: np.ndarray  # (B,), greatest intensity over the noise


def footprint_duration(time: np.ndarray, slope: np.ndarray, beam: np.ndarray) -> np.ndarray:
    """Return the rms duration [s] of a plane footprint's echo."""
    # time (B,) [s]; slope (B,); beam (B,) [rad]
    return time * beam * np.sqrt(slope ** 2 + beam ** 2 / 2)


def along_delay(angle: np.ndarray, incidence: np.ndarray, transmit_width: float) -> np.ndarray:
    """Return the relative delay of an echo due to the width of the transmission along the track."""
    return (transmit_width / GAUSSIAN_WIDTH) ** 2 * np.cos(incidence - angle) / (2 * np.cos(angle) * np.cos(incidence))


def slopes(values: np.ndarray, angle: np.ndarray, good: np.ndarray) -> np.ndarray:
    """Return the slope of values over the beams' angles: the median of differences across each beam."""
    # values, angle (B,); good (B,) -> (B,)
    beams = np.arange(len(values))
    spacing = float(np.median(np.diff(angle))) if len(angle) > 1 else 1.0
    found = [np.full(len(values), np.nan)]
    beyond = float(len(values))        # no pair of beams is as far apart
    nearest, farthest = (min(max(count, span / max(spacing, 1e-12)), beyond)
                         for count, span in zip(NEIGHBOURS, SPANS, strict=True))
    for away in np.unique(np.linspace(nearest, farthest, 7).astype(int)):
        low, high = np.maximum(beams - away, 0), np.minimum(beams + away, len(beams) - 1)
        both = (high - low == 2 * away) & good[low] & good[high]
        apart = np.where(both, angle[high] - angle[low], 1.0)
        found.append(np.where(both, (values[high] - values[low]) / apart, np.nan))
    stacked = np.stack(found)
    known = ~np.isnan(stacked).all(axis=0)
    return np.where(known, np.nanmedian(np.where(known, stacked, 0.0), axis=0), np.nan)


def incidences(log_time: np.ndarray, angle: np.ndarray, good: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
    """Return the incidence ψ (B,) [rad] on the bed across the track: tan ψ is the slope of log t over the angle.

    A beam without a slope takes the tilt of the nearest beam with one, or ``otherwise`` (B,) if there is none.
    """
    tilt = angle - np.arctan(slopes(log_time, angle, good))
    known = np.flatnonzero(np.isfinite(tilt))
    if not known.size:
        return otherwise
    beams = np.arange(len(angle))
    after = np.minimum(np.searchsorted(known, beams), len(known) - 1)
    before = np.maximum(after - 1, 0)
    nearest = known[np.where(np.abs(known[after] - beams) < np.abs(beams - known[before]), after, before)]
    return np.clip(angle - ndimage.median_filter(tilt[nearest], 5, mode="nearest"), -STEEPEST, STEEPEST)


def by_amplitude(intensity: np.ndarray, windows: Windows, time: np.ndarray, centre: np.ndarray, footprint: np.ndarray,
                 pulse_length: float, noise: float) -> AmplitudeDetections:
    """Detect the bed by the centre of gravity of the intensity."""
    # intensity (W,) [µPa²]; time (T,) [s]; centre (B,) [s]; footprint (B,) [s]; pulse_length [s]; noise [µPa²]
    step = time[1] - time[0]
    half = REACH * GAUSSIAN_WIDTH * footprint + PULSES * pulse_length
    middle = 0.5 * (time[windows.begin] + time[windows.end - 1])
    late = np.append(time[windows.sample] - middle[windows.beam], 0.0)
    clear = np.append(intensity - noise, 0.0)
    first, strong = clear * late, np.maximum(clear, 0)
    found = centre - middle
    for _ in range(PASSES):
        spans = windows.spans(time, middle + found, half)
        total = over_spans(np.add, clear, spans)
        with np.errstate(invalid="ignore", divide="ignore"):
            moved = over_spans(np.add, first, spans) / total - found
        found = found + np.where(total > 0, np.clip(moved, -half / 2, half / 2), 0.0)
    spans = windows.spans(time, middle + found, half)
    late -= np.append(found[windows.beam], 0.0)
    square = late ** 2
    total = np.maximum(over_spans(np.add, clear, spans), 1e-150)
    spread = over_spans(np.add, clear * square, spans) / total
    own = np.sqrt(np.maximum(spread - pulse_deviation(pulse_length) ** 2, 0))
    samples = max(pulse_length / step, 1.0)
    with np.errstate(over="ignore"):   # a beam without energy has an infinite deviation
        noisy = samples * noise / total ** 2 * (2 * over_spans(np.add, strong * square, spans)
                                                + noise * over_spans(np.add, square, spans))
    usual = among_neighbours(total, total > 1e-150, 4)
    duration = np.sqrt((own ** 2 + footprint ** 2) / 2)
    speckle = gravity_deviation(duration, pulse_length)
    faded = np.where(total > 1e-150, usual / total, 1.0)
    speckle = speckle * faded ** (0.5 / echoes_side_by_side(duration, pulse_length))
    peak = over_spans(np.maximum, np.append(intensity, 0.0), spans)
    return AmplitudeDetections(time=middle + found, deviation=np.hypot(speckle, np.sqrt(noisy)), energy=total * step,
                               peak=peak / max(noise, 1e-300))


def refined_centre(intensity: np.ndarray, windows: Windows, time: np.ndarray, length: np.ndarray) -> np.ndarray:
    """Return the time of the greatest energy in each beam's window."""
    # intensity (W,); time (T,) [s]; length (B,) [s]
    samples = np.maximum(length / (time[1] - time[0]), 1).astype(np.int64)
    return time[windows.place_of_greatest(windows.smoothed(intensity, samples))]


def about(time: np.ndarray, centre: np.ndarray, footprint: np.ndarray, pulse_length: float) -> Windows:
    """Return windows of twice the reach of the centre of gravity."""
    return windows_about(time, centre, 2 * (REACH * GAUSSIAN_WIDTH * footprint + PULSES * pulse_length))
