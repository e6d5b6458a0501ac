"""Bottom detection: from the beams of a ping to one time a beam, by amplitude or by phase.

A track through the fan says roughly where the bed is (`bottom_track`). In each beam both detections are made there
(`amplitude_detection`, `phase_detection`), and that of the smaller standard deviation is the sounding (`quality`).
Nothing is known of the depth before, and no beam is for one method: near the point of normal incidence the phase turns
within one pulse and says little, far from it the echo is long and its centre of gravity says little. Where the phase
says that an amplitude's echo has its middle at x off the beam's axis, by more than speckle moves it, the time is that
of another direction, and its deviation grows by t tan ψ x, ψ the incidence.
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
from .bottom_track import CELL, BottomEchoes, BottomTrack, noise_level, reduced, track
from .phase_detection import by_phase, no_phase
from .quality import GAUSSIAN_WIDTH, angle_deviation, quality_factor
from .windows import Windows, windows_about

LEAST_QUALITY = 1.5         # 3 % of the depth
QUIETEST = 1e-15            # noise over the strongest echo: rounding leaves no less
LEAST_PEAK = 20.0           # over the noise's mean, of an echo found by amplitude: 13 dB
LEAST_PEAK_BY_PHASE = 10.0
MOST_STRAYS = 3.0           # deviations that speckle moves the middle of an amplitude's echo by
MOST_ASIDE = 0.5            # rms widths of the beam that an amplitude's echo can have its middle off the axis


@dataclass(frozen=True, kw_only=True)
class Head:
    """What a detector knows of the sounder.

    Attributes
    ----------
    pulse_length : float [s]
        ∫|χ|² dt of the compressed pulse χ with peak 1 (`signal.matched_filter.compression`).
    beam_width : float (B,) [rad]
        -3 dB width of each whole receiving beam, in angle.
    baseline : float [wavelengths]
        From the port half's phase centre to the starboard's. Echoes from starboard of a beam's axis must turn
        starboard's phase forward; negative where signals have the other sign. 0 is no split: all is by amplitude.
    transmit_width : float [rad]
        -3 dB width of the transmission along the track.
    noise : float or None [µPa²]
        Mean power of noise in a whole beam; None estimates it.
    gate : (float, float) or None [s]
        Times between which the bed is sought.
    """

    pulse_length: float
    beam_width: np.ndarray
    baseline: float
    transmit_width: float = 0.0
    noise: float | None = None
    gate: tuple[float, float] | None = None


@dataclass(frozen=True, kw_only=True)
class Detections:
    """One sounding a beam; the arrays are (B,).

    Attributes
    ----------
    time : float [s]
        Of the bed on the beam's axis; NaN where not valid.
    method : uint8
        NOT_DETECTED, BY_AMPLITUDE or BY_PHASE of `record`.
    deviation : float [s]
        Standard deviation of the time.
    angle_offset : float
        Sine to add to the beam's: where an amplitude's echo has its middle. 0 for phase.
    angle_deviation : float [rad]
        How far that middle strays: the time's error seen as an angle, not one more. 0 for phase.
    quality : float
        log10(time / deviation).
    intensity : float [µPa²]
        Mean of the whole beam's from begin to end, without the noise.
    incidence : float [rad]
        On the bed across the track, by the neighbouring beams; positive to starboard of the normal.
    begin, end : int
        Samples begin <= n < end that the beam's -3 dB footprint and the pulse cover.
    valid : bool
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
           without: np.ndarray | None = None) -> Detections:
    """Detect the bed in the beams of one ping, or of one sector of it.

    Parameters
    ----------
    halves : complex (B, T), complex (B, T) [µPa]
        Compressed beams of the port and of the starboard half, both steered to ``sines``; their mean is the beam.
        Samples that are not finite count as silence.
    time : float (T,) [s]
        After the transmission, evenly spaced.
    sines : float (B,)
        Of the beams' axes, increasing.
    head : Head
    without : bool (B,) or None
        Beams that are known to have no bed: none is sought, and the beams around do not take their slope from them.

    Returns
    -------
    Detections

    Raises
    ------
    ValueError
        If shapes differ, times are not evenly spaced, sines do not increase, or the gate holds no sample.
    """
    time, sines, widths, gate = _checked(halves, time, sines, head)
    halves, sums = _finite(halves, time, head.pulse_length)
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
    """A ping's beams, the beams' angles and rms widths (B,) [rad], and the noise [µPa²]."""

    halves: tuple[np.ndarray, np.ndarray]
    time: np.ndarray
    angle: np.ndarray
    rms: np.ndarray
    noise: float
    head: Head


def _amplitudes(fan: _DetectionFan, rough: BottomTrack) -> tuple[np.ndarray, AmplitudeDetections, np.ndarray]:
    """Detect by amplitude about a track; give where beams are brightest there (B,) [s], and the incidence (B,) too."""
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
    """Return how far an amplitude's times (B,) [s] are off as its echo comes from beside the axis.

    The phase between both halves tells where the echo has its middle. What speckle moves that by is 0 here: it is in
    the time's deviation.
    """
    if not fan.head.baseline:
        return np.zeros_like(centre)
    slope, pulse = np.tan(incidence), fan.head.pulse_length
    footprint = footprint_duration(centre, slope, fan.rms)
    held = windows_about(fan.time, centre, np.hypot(GAUSSIAN_WIDTH * footprint, pulse) / 2)
    port, starboard = (held.taken(half).astype(complex) for half in fan.halves)
    middle = np.angle(held.summed(starboard * np.conj(port))) / (2 * np.pi * fan.head.baseline * np.cos(fan.angle))
    usual = MOST_STRAYS * angle_deviation(fan.rms, footprint, pulse)
    return np.where(np.abs(middle) > usual, centre * np.abs(slope * middle), 0.0)


def _finite(halves: tuple[np.ndarray, np.ndarray], time: np.ndarray,
            pulse_length: float) -> tuple[tuple[np.ndarray, np.ndarray], BottomEchoes]:
    """Return the halves as complex64 without what is not finite, and their sums over blocks."""
    port, starboard = (np.ascontiguousarray(half, np.complex64) for half in halves)
    sums = reduced((port, starboard), time, pulse_length)
    if not np.isfinite(sums.power).all():
        port, starboard = (np.where(np.isfinite(half), half, 0) for half in (port, starboard))
        sums = reduced((port, starboard), time, pulse_length)
    return (port, starboard), sums


def _intensity(halves: tuple[np.ndarray, np.ndarray], windows: Windows) -> np.ndarray:
    """Return the whole beam's intensity (W,) in some windows."""
    whole = (windows.taken(halves[0]).astype(complex) + windows.taken(halves[1])) / 2
    return whole.real ** 2 + whole.imag ** 2


def _checked(halves: tuple[np.ndarray, np.ndarray], time: np.ndarray, sines: np.ndarray,
             head: Head) -> tuple[np.ndarray, np.ndarray, np.ndarray, tuple[float, float]]:
    """Check what was given; give time, sines, widths (B,) and the gate."""
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
