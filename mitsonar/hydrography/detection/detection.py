"""Detect the bed in the beams of a ping: one time a beam, by amplitude or by phase.

A rough track through the fan limits the search (`bottom_track`). Each beam is detected by both methods
(`amplitude_detection`, `phase_detection`), and the detection of the smaller standard deviation is the sounding
(`quality`). No depth is assumed, and no beam is reserved for a method: near normal incidence the phase turns within
one pulse, far from it the echo is long, and the deviations follow. Where the phase places the middle of an amplitude's
echo at x off the beam's axis, by more than speckle does, the deviation of its time grows by t tan ψ x, ψ the incidence.
"""
from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..record import BY_AMPLITUDE, BY_PHASE, NOT_DETECTED
from .amplitude_detection import (
    AmplitudeDetections,
    about,
    along_delay,
    by_amplitude,
    footprint_duration,
    incidences,
    refined_centre,
    slopes,
)
from .bottom_track import CELL, BottomEchoes, BottomTrack, in_rows, noise_level, reduced, track
from .phase_detection import by_phase, no_phase
from .quality import GAUSSIAN_WIDTH, angle_deviation, quality_factor
from .windows import Windows, windows_about

LEAST_QUALITY = 1.5         # 3 % of the depth
QUIETEST = 1e-15            # noise over the strongest echo, at the level of rounding
LEAST_PEAK = 20.0           # over the mean noise, of an echo detected by amplitude: 13 dB
LEAST_PEAK_BY_PHASE = 10.0
MOST_STRAYS = 3.0           # standard deviations by which speckle may move the middle of an amplitude's echo
MOST_ASIDE = 0.5            # largest offset of an amplitude's middle from the axis, in rms widths of the beam


@dataclass(frozen=True, kw_only=True)
class Head:
    """Parameters of the sounder for bottom detection.

    Attributes
    ----------
    pulse_length : float [s]
        ∫|χ|² dt of the compressed pulse χ with peak 1 (`signal.matched_filter.compression`).
    beam_width : float (B,) [rad]
        -3 dB width of each whole receiving beam, in angle.
    baseline : float [wavelengths]
        Distance from the port half's phase centre to the starboard's, negative if an echo from starboard of a beam's
        axis retards the starboard phase. 0 is an unsplit beam, which is detected by amplitude only.
    transmit_width : float [rad]
        -3 dB width of the transmission along the track.
    noise : float or None [µPa²]
        Mean noise power in a whole beam. None estimates it.
    gate : (float, float) or None [s]
        First and last time at which the bed is sought.
    """

    pulse_length: float
    beam_width: np.ndarray
    baseline: float
    transmit_width: float = 0.0
    noise: float | None = None
    gate: tuple[float, float] | None = None


@dataclass(frozen=True, kw_only=True)
class Detections:
    """Soundings of B beams.

    Attributes
    ----------
    time : float (B,) [s]
        Time of the bed on the beam's axis, NaN where not valid.
    method : uint8 (B,)
        NOT_DETECTED, BY_AMPLITUDE or BY_PHASE of `record`.
    deviation : float (B,) [s]
        Standard deviation of the time.
    angle_offset : float (B,)
        Sine to add to the beam's, for the middle of an amplitude's echo. It is 0 for phase.
    angle_deviation : float (B,) [rad]
        Standard deviation of that middle, which is the time's error seen as an angle. It is 0 for phase.
    quality : float (B,)
        log10(time / deviation).
    intensity : float (B,) [µPa²]
        Mean intensity of the whole beam from begin to end, without the noise.
    incidence : float (B,) [rad]
        Incidence on the bed across the track, from the neighbouring beams; positive to starboard of the normal.
    begin, end : int (B,)
        Samples begin <= n < end that the beam's -3 dB footprint and the pulse cover.
    valid : bool (B,)
        True where there is a sounding.
    """

    time: np.ndarray
    method: np.ndarray
    deviation: np.ndarray
    angle_offset: np.ndarray
    angle_deviation: np.ndarray
    quality: np.ndarray
    intensity: np.ndarray
    incidence: np.ndarray
    begin: np.ndarray
    end: np.ndarray
    valid: np.ndarray


def detect(halves: tuple[np.ndarray, np.ndarray], *, time: np.ndarray, sines: np.ndarray, head: Head,
           without: np.ndarray | None = None, sums: BottomEchoes | None = None) -> Detections:
    """Detect the bed in the beams of one ping, or of one sector of it.

    Parameters
    ----------
    halves : complex (B, T), complex (B, T) [µPa]
        Compressed beams of the port and of the starboard half, both steered to ``sines``; their mean is the beam.
        Samples that are not finite count as silence.
    time : float (T,) [s]
        Evenly spaced times after the transmission.
    sines : float (B,)
        Sines of the beams' axes, increasing.
    head : Head
        Parameters of the sounder.
    without : bool (B,) or None
        Beams without a bed. They are not searched, and the beams around take no slope from them.
    sums : BottomEchoes or None
        Sums over blocks, if `reduced` has made them of these beams.

    Returns
    -------
    Detections

    Raises
    ------
    ValueError
        If shapes differ, times are not evenly spaced, sines do not increase, or the gate holds no sample.
    """
    time, sines, widths, gate = _checked(halves, time, sines, head)
    halves, sums = _finite(halves, time, head.pulse_length, sums)
    noise = max(noise_level(sums) if head.noise is None else float(head.noise), QUIETEST * float(sums.power.max()))
    rough = track(sums, sines, widths, noise, gate)
    if without is not None:
        rough = replace(rough, seen=rough.seen & ~without)
    fan = _DetectionFan(halves=halves, time=time, angle=np.arcsin(sines), rms=widths / GAUSSIAN_WIDTH, noise=noise,
                        head=head)
    brightest, amplitude, incidence = _amplitudes(fan, rough)
    phase = (by_phase(halves, time, amplitude.time, np.tan(incidence), sines, widths, head.baseline, head.pulse_length)
             if head.baseline else no_phase(amplitude.time))

    sure = np.hypot(amplitude.deviation, _aside(fan, amplitude.time, incidence))
    phased = phase.deviation < sure
    late = (1 + 2 * np.tan(incidence) ** 2) * fan.rms ** 2 / 2
    found = np.where(phased, phase.time, amplitude.time * (1 - late))
    found = found * (1 - along_delay(fan.angle, incidence, head.transmit_width))
    deviation = np.where(phased, phase.deviation, sure)
    quality = quality_factor(found, deviation)
    footprint = footprint_duration(found, np.tan(incidence), fan.rms)
    half = np.hypot(GAUSSIAN_WIDTH * footprint, head.pulse_length) / 2
    valid = rough.seen & (quality > LEAST_QUALITY) & (found + half < time[-1])
    valid &= amplitude.peak > np.where(phased, LEAST_PEAK_BY_PHASE, LEAST_PEAK)
    valid &= (np.minimum(found, brightest) >= gate[0]) & (np.maximum(found, brightest) <= gate[1])

    brighter = np.nan_to_num(slopes(np.log(amplitude.energy), fan.angle, valid))
    offset = fan.rms * np.clip(fan.rms * brighter, -MOST_ASIDE, MOST_ASIDE) * np.cos(fan.angle)
    held = windows_about(time, found, half)
    mean = held.summed(_intensity(halves, held)) / (held.end - held.begin) - noise
    spread = angle_deviation(fan.rms, footprint, head.pulse_length)
    return Detections(
        time=np.where(valid, found, np.nan),
        method=np.where(valid, np.where(phased, BY_PHASE, BY_AMPLITUDE), NOT_DETECTED).astype(np.uint8),
        deviation=np.where(valid, deviation, np.nan),
        angle_offset=np.where(valid & ~phased, offset, 0.0),
        angle_deviation=np.where(valid & ~phased, spread, 0.0),
        quality=np.where(valid, quality, np.nan), intensity=np.where(valid, np.maximum(mean, 0.0), np.nan),
        incidence=incidence, begin=held.begin, end=held.end, valid=valid)


@dataclass(frozen=True, kw_only=True)
class _DetectionFan:
    """Beams of a ping, their angles and rms widths (B,) [rad], and the noise [µPa²]."""

    halves: tuple[np.ndarray, np.ndarray]
    time: np.ndarray
    angle: np.ndarray
    rms: np.ndarray
    noise: float
    head: Head


def _amplitudes(fan: _DetectionFan, rough: BottomTrack) -> tuple[np.ndarray, AmplitudeDetections, np.ndarray]:
    """Detect by amplitude about a track; return also the brightest times (B,) [s], and the incidence (B,)."""
    pulse = fan.head.pulse_length
    incidence = incidences(np.log(rough.time), fan.angle, rough.seen, fan.angle)
    footprint = footprint_duration(rough.time, np.tan(incidence), fan.rms)
    windows = windows_about(fan.time, rough.time, 1.5 * (CELL * rough.time + GAUSSIAN_WIDTH * footprint))
    centre = refined_centre(_intensity(fan.halves, windows), windows, fan.time, GAUSSIAN_WIDTH * footprint + pulse)
    windows = about(fan.time, centre, footprint, pulse)
    intensity = _intensity(fan.halves, windows)
    first = by_amplitude(intensity, windows, fan.time, centre, footprint, pulse, fan.noise)
    clear = rough.seen & (first.peak > LEAST_PEAK)
    incidence = incidences(np.log(np.maximum(first.time, fan.time[1])), fan.angle, clear, incidence)
    footprint = footprint_duration(first.time, np.tan(incidence), fan.rms)
    amplitude = by_amplitude(intensity, windows, fan.time, first.time, footprint, pulse, fan.noise)
    return fan.time[windows.place_of_greatest(intensity)], amplitude, incidence


def _aside(fan: _DetectionFan, centre: np.ndarray, incidence: np.ndarray) -> np.ndarray:
    """Return the errors (B,) [s] of an amplitude's times by echoes from beside the axis, beyond those by speckle."""
    if not fan.head.baseline:
        return np.zeros_like(centre)
    slope, pulse = np.tan(incidence), fan.head.pulse_length
    footprint = footprint_duration(centre, slope, fan.rms)
    held = windows_about(fan.time, centre, np.hypot(GAUSSIAN_WIDTH * footprint, pulse) / 2)
    port, starboard = (held.taken(half).astype(complex) for half in fan.halves)
    middle = np.angle(held.summed(starboard * np.conj(port))) / (2 * np.pi * fan.head.baseline * np.cos(fan.angle))
    usual = MOST_STRAYS * angle_deviation(fan.rms, footprint, pulse)
    return np.where(np.abs(middle) > usual, centre * np.abs(slope * middle), 0.0)


def _finite(halves: tuple[np.ndarray, np.ndarray], time: np.ndarray, pulse_length: float,
            sums: BottomEchoes | None) -> tuple[tuple[np.ndarray, np.ndarray], BottomEchoes]:
    """Return the halves as complex64, zero where not finite, and their sums over blocks."""
    port, starboard = (in_rows(half) for half in halves)
    sums = sums or reduced((port, starboard), time, pulse_length)
    if not np.isfinite(sums.power).all():
        port, starboard = (np.where(np.isfinite(half), half, 0) for half in (port, starboard))
        sums = reduced((port, starboard), time, pulse_length)
    return (port, starboard), sums


def _intensity(halves: tuple[np.ndarray, np.ndarray], windows: Windows) -> np.ndarray:
    """Return the whole beam's intensity (W,) in windows."""
    whole = windows.taken(halves[0]) + windows.taken(halves[1])
    return 0.25 * (np.square(np.real(whole), dtype=float) + np.square(np.imag(whole), dtype=float))


def _checked(halves: tuple[np.ndarray, np.ndarray], time: np.ndarray, sines: np.ndarray,
             head: Head) -> tuple[np.ndarray, np.ndarray, np.ndarray, tuple[float, float]]:
    """Check the arguments; return time, sines, widths (B,) and the gate."""
    time, sines = np.asarray(time, float), np.asarray(sines, float)
    shape = (len(sines), len(time))
    if np.shape(halves[0]) != shape or np.shape(halves[1]) != shape:
        raise ValueError(f"the halves' beams are {np.shape(halves[0])} and {np.shape(halves[1])}, and there are "
                         f"{shape[0]} sines and {shape[1]} times; give arrays (beams, times).")
    if shape[0] < 1 or shape[1] < 16:
        raise ValueError(f"bottom detection needs a beam and 16 samples, got {shape[0]} and {shape[1]}.")
    step = (time[-1] - time[0]) / (shape[1] - 1)
    if not step > 0 or np.abs(np.diff(time) - step).max() > 1e-3 * step:
        raise ValueError("the times of the samples must increase evenly.")
    if (np.diff(sines) <= 0).any() or not (np.abs(sines) < 1).all():
        raise ValueError("the beams' sines must increase, between -1 and 1.")
    if not head.pulse_length > 0:
        raise ValueError(f"the pulse's length is {head.pulse_length} s, it must be positive.")
    low, high = head.gate if head.gate is not None else (0.0, np.inf)
    low, high = max(low, time[0], step), min(high, time[-1])
    if not high > low + 8 * step:
        raise ValueError(f"the gate {head.gate} s holds no samples: they last from {time[0]:g} to {time[-1]:g} s.")
    return time, sines, np.broadcast_to(np.asarray(head.beam_width, float), sines.shape), (low, high)
