"""Detect the bed by phase: the zero crossing of the phase difference between the halves of a split beam.

    arg(s p*) = 2π d (sin θ' - sin θ)

s, p -> beams of the starboard and the port half, both steered to sin θ; d -> ``baseline``; θ' -> direction of the echo.
The bed about the beam's axis is taken as a plane of incidence ψ, so that an echo at t comes from

    sin θ'(t) = sin(acos(t₀ cos ψ / t) + θ - ψ)

With x(t) = sin θ'(t) - sin θ the phase is a line β₀ + β₁ x, β₁ = 2π d if ψ is right. A line over x has the curvature
that a parabola over t would have to find (Lurton 2010, An Introduction to Underwater Acoustics, ch. 8). It is fitted
to the samples within the beam by the greatest Σ |s p*| cos(arg(s p*) - β₀ - β₁ x): least squares weighted by magnitude,
without unwrapping. The window is centred on the crossing until that rests. The fitted slope corrects ψ.

A bed with ripples or stones within the beam bends the line. The crossing is therefore measured in windows of the full,
half and a quarter of the reach, and the widest that agrees with the narrower ones is used (Lepski 1991, Theory Probab.
Appl. 35, 454), judged over neighbouring beams together.

The deviation is that of the fit, from the samples' own scatter: noise, roughness of the bed and decorrelation by the
pulse length. Scatter is summed over blocks of some echoes before it is squared (Newey and West 1987, Econometrica 55,
703), because errors of adjacent echoes cancel: single samples overestimate it two to four times. It is averaged over
neighbouring beams.
"""
from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mitsonar.signal.beamforming.alignment import device_arrays

from .phase_lines import PhaseLines, PhaseSamples
from .windows import among_neighbours

PASSES = 3
REACHES = (0.8, 0.4, 0.2)    # half the windows, in -3 dB widths of the beam; a half's beam is twice as wide
AGREED = 1.2                 # rms difference of the crossings of wider and narrower windows, in deviations
BLOCK = 2.0                  # echoes over which the scatter is summed
FREE = 2.3                   # degrees of freedom of the line, in echoes, with such blocks
LEAST_ECHOES = (2.3, 3.5, 5.0)      # within each window
SLOPES = (0.4, 2.5)          # allowed β₁ over 2π d
SIDE_BY_SIDE = 1.5           # pulse lengths between independent echoes: ∫ρ² over ∫|χ|² (Gauss √2, CW 1.62)


@dataclass(frozen=True, kw_only=True)
class PhaseDetections:
    """Phase detections of B beams."""

    time: np.ndarray  # (B,) [s]
    deviation: np.ndarray  # (B,) [s], inf where there is no detection
    slope: np.ndarray  # (B,), tan of the incidence
    echoes: np.ndarray  # (B,), independent ones in the window


def by_phase(halves: tuple[np.ndarray, np.ndarray], time: np.ndarray, centre: np.ndarray, slope: np.ndarray,
             sines: np.ndarray, widths: np.ndarray, baseline: float, pulse_length: float) -> PhaseDetections:
    """Detect the bed by the zero crossing of the phase."""
    # halves (B, T); time (T,) [s]; centre (B,) [s]; slope (B,); sines (B,); widths (B,) [rad]; baseline [wavelengths];
    # pulse_length [s]
    beams = _PhaseBeams(halves=halves, time=time, sines=sines, spread=widths * np.sqrt(1 - sines ** 2),
                   turn=np.full(len(centre), 2 * np.pi * baseline), spacing=SIDE_BY_SIDE * pulse_length)
    incidence = np.arctan(np.where(np.abs(slope) < 0.02, 0.02, slope))
    half = centre * np.abs(np.tan(incidence)) * widths * 1.5 * REACHES[0]
    found, incidence, settled = _settled(beams, centre, incidence, half)
    ratio = slope / np.tan(incidence)
    settled &= (ratio > SLOPES[0]) & (ratio < SLOPES[1]) & (np.abs(found - centre) < half)
    made, samples = [], beams.samples(found, beams.half(found, incidence, REACHES[0]))
    for reach, least in zip(REACHES, LEAST_ECHOES, strict=True):
        one = _measured(beams, samples, found, incidence, reach, least, settled)
        made.append(_no_surer(one, made[-1]) if made else one)
        found = np.where(np.isfinite(made[-1].deviation), made[-1].time, found)
    best = _widest_that_agrees(made)
    return PhaseDetections(slope=np.tan(incidence), **{name: np.choose(best, [getattr(one, name) for one in made])
                                                       for name in ("time", "deviation", "echoes")})


@dataclass(frozen=True, kw_only=True)
class _PhaseBeams:
    """Both halves, times, sines, widths [sine], 2π d, and the time between independent echoes [s]."""

    halves: tuple[np.ndarray, np.ndarray]
    time: np.ndarray
    sines: np.ndarray
    spread: np.ndarray
    turn: np.ndarray
    spacing: float

    def half(self, found: np.ndarray, incidence: np.ndarray, reach: float) -> np.ndarray:
        """Return half a window (B,) [s] that holds the bed within `reach` of the beam."""
        return 1.2 * found * np.abs(np.tan(incidence)) * self.spread / np.sqrt(1 - self.sines ** 2) * reach

    def samples(self, centre: np.ndarray, half: np.ndarray) -> PhaseSamples:
        """Return the samples about a time of every beam."""
        return PhaseSamples(device_arrays(), self.halves, self.time, centre, half + self.spacing)

    def lines(self, found: np.ndarray, half: np.ndarray, incidence: np.ndarray, reach: np.ndarray) -> PhaseLines:
        """Return the lines expected of a plane bed about a time of every beam."""
        return PhaseLines(found=found, half=half + self.spacing, incidence=incidence, sines=self.sines, reach=reach,
                          turn=self.turn)


def _settled(beams: _PhaseBeams, centre: np.ndarray, incidence: np.ndarray,
             half: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centre the widest window on the crossing; return its time, the incidence, and True where it rests."""
    samples = beams.samples(centre, half)
    reach = REACHES[0] * beams.spread
    found, ok, share = centre, np.ones(len(centre), bool), np.ones(len(centre))
    for number in range(PASSES):
        lines = beams.lines(found, half, incidence, reach)
        if number < PASSES - 1:
            crossing = -samples.offsets(lines) / beams.turn
        else:
            fit = samples.fitted(lines, 1)
            crossing = fit.crossing
            share = np.where(np.isfinite(crossing), fit.turn / beams.turn, 1.0)
        ok = np.isfinite(crossing) & (np.abs(crossing) < 2 * reach)
        moved = _time_of(crossing, found, incidence, beams.sines)
        found = np.where(ok, np.clip(moved, centre - half, centre + half), found)
    incidence = np.arctan(np.tan(incidence) / np.clip(np.where(ok, share, 1.0), 0.5, 2.0))
    return found, incidence, ok


def _measured(beams: _PhaseBeams, samples: PhaseSamples, found: np.ndarray, incidence: np.ndarray, reach: float,
              least: float, settled: np.ndarray) -> PhaseDetections:
    """Measure the crossing and its deviation in one window."""
    tangent = np.abs(np.tan(incidence))
    spacing = max(beams.spacing / (beams.time[1] - beams.time[0]), 1.0)
    lines = beams.lines(found, beams.half(found, incidence, reach), incidence, reach * beams.spread)
    fit = samples.fitted(lines, int(round(BLOCK * spacing)))
    echoes = fit.count / spacing
    rate = np.abs(fit.turn) * np.sqrt(1 - beams.sines ** 2) / (found * tangent)
    freedom = echoes / np.maximum(echoes - FREE, 0.5)
    own = fit.variance * freedom / np.where(rate > 0, rate, np.nan) ** 2
    deviation = np.sqrt(among_neighbours(own, np.isfinite(own) & (echoes >= least)))
    ok = settled & (echoes >= least) & (fit.turn / beams.turn > SLOPES[0]) & np.isfinite(deviation)
    ok &= np.abs(fit.crossing) < 1.5 * reach * beams.spread
    return PhaseDetections(time=_time_of(np.where(ok, fit.crossing, 0.0), found, incidence, beams.sines),
                           deviation=np.where(ok, deviation, np.inf), slope=tangent, echoes=echoes)


def _no_surer(narrow: PhaseDetections, wide: PhaseDetections) -> PhaseDetections:
    """Raise a narrower window's deviation to what its fewer echoes allow, as their scatter may be small by chance."""
    known = np.where(np.isfinite(wide.deviation), wide.deviation, 0.0) * np.sqrt(
        wide.echoes / np.maximum(narrow.echoes, 0.1))
    return replace(narrow, deviation=np.maximum(narrow.deviation, known))


def _widest_that_agrees(made: list[PhaseDetections]) -> np.ndarray:
    """Return the number (B,) of the widest window whose crossing agrees with those of all narrower ones."""
    best = np.full(len(made[0].time), len(made) - 1)
    for number in range(len(made) - 2, -1, -1):
        agreed = np.isfinite(made[number].deviation)
        for narrower in made[number + 1:]:
            both = np.isfinite(made[number].deviation) & np.isfinite(narrower.deviation)
            apart = (made[number].time - narrower.time) / np.where(both, narrower.deviation, 1.0)
            agreed &= ~(among_neighbours(apart ** 2, both) > AGREED ** 2)
        best = np.where(agreed | ~np.isfinite(made[number + 1].deviation) & (best == number + 1), number, best)
    return best


def no_phase(time: np.ndarray) -> PhaseDetections:
    """Return undetected beams (B,), for a head whose beams are not split."""
    nothing = np.zeros_like(time)
    return PhaseDetections(time=time, deviation=np.full_like(time, np.inf), slope=nothing, echoes=nothing)


def _time_of(crossing: np.ndarray, found: np.ndarray, incidence: np.ndarray, sines: np.ndarray) -> np.ndarray:
    """Return the time (B,) at which the plane through ``found`` is ``crossing`` off the axis."""
    leaning = np.arcsin(sines) - incidence
    away = np.arcsin(np.clip(sines + crossing, -1, 1)) - leaning
    return found * np.cos(incidence) / np.maximum(np.cos(away), 1e-3)
