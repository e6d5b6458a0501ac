"""Detection by phase: where the difference between the two halves of a split beam crosses zero.

    arg(s p*) = 2π d (sin θ' - sin θ)

s, p -> the starboard and the port half's beam, both steered to sin θ; d -> ``baseline``; θ' -> where the echo comes
from. The bed about the beam's axis is taken as a plane of incidence ψ, so that an echo at t comes from

    sin θ'(t) = sin(acos(t₀ cos ψ / t) + θ - ψ)

With x(t) = sin θ'(t) - sin θ the phase is a line β₀ + β₁ x, β₁ = 2π d where ψ is right: as a line over x it has the
curvature that a parabola over t would have to find (Lurton 2010, An Introduction to Underwater Acoustics, ch. 8).
It is fitted to the samples within the beam by the greatest Σ |s p*| cos(arg(s p*) - β₀ - β₁ x), least squares weighted
by magnitude that need no unwrapping. The window is centred on the crossing anew until that rests. The slope also says
what ψ really is.

The deviation is that of the fit, from the samples' own scatter, which holds noise, the bed's roughness and what the
pulse's length takes of the coherence. Scatter is summed over blocks of some echoes before it is squared (as Newey and
West 1987, Econometrica 55, 703, sum it over lags): what the echoes within a pulse pull to one side the next ones pull
back, so that samples taken singly say two to four times too much. It is averaged over neighbouring beams.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .windows import Windows, among_neighbours, windows_about

__all__ = ["PhaseDetections", "by_phase", "no_phase"]

PASSES = 4
REACH = 0.8                  # half the window, in the -3 dB width of the beam: that of a half is twice as wide
BLOCK = 2.0                  # echoes that the scatter is summed over, so that what cancels between neighbours does
FREE = 2.3                   # echoes that the line takes of those there are, with such blocks
LEAST_ECHOES = 2.0           # within the window
SLOPES = (0.4, 2.5)          # β₁ over 2π d that a bed can have
SIDE_BY_SIDE = 1.5           # pulse lengths from one independent echo to the next: ∫ρ² over ∫|χ|² (Gauss √2, CW 1.62)


@dataclass(frozen=True, kw_only=True)
class PhaseDetections:
    """One a beam.

    Attributes
    ----------
    time, deviation : float (B,) [s]
        deviation is inf where the phase does not say.
    slope : float (B,)
        tan of the incidence.
    coherence : float (B,)
    echoes : float (B,)
        Independent ones in the window.
    """

    time: np.ndarray
    deviation: np.ndarray
    slope: np.ndarray
    coherence: np.ndarray
    echoes: np.ndarray


def by_phase(halves: tuple[np.ndarray, np.ndarray], time: np.ndarray, centre: np.ndarray, slope: np.ndarray,
             sines: np.ndarray, widths: np.ndarray, baseline: float, pulse_length: float) -> PhaseDetections:
    """Detect by the zero crossing.

    Parameters
    ----------
    halves : complex (B, T), complex (B, T)
        Port and starboard.
    time : float (T,) [s]
    centre : float (B,) [s]
        Where the echo is, to within half the footprint.
    slope : float (B,)
        tan of the incidence, from neighbouring beams.
    sines : float (B,)
    widths : float (B,) [rad]
        Of the whole beams, -3 dB.
    baseline : float [wavelengths]
    pulse_length : float [s]

    Returns
    -------
    PhaseDetections
    """
    reach = REACH * widths * np.sqrt(1 - sines ** 2)
    incidence = np.arctan(np.where(np.abs(slope) < 0.02, 0.02, slope))
    half = centre * np.abs(np.tan(incidence)) * widths * 1.5 * REACH
    windows = windows_about(time, centre, half + pulse_length)
    port, starboard = (windows.taken(record).astype(complex) for record in halves)
    samples = _Samples(product=starboard * np.conj(port), power=(np.abs(port) ** 2 + np.abs(starboard) ** 2) / 2,
                       instants=time[windows.sample], windows=windows)
    turn = np.full(len(centre), 2 * np.pi * baseline)
    found, ok = centre, np.ones(len(centre), bool)
    for number in range(PASSES):
        fit = _fitted(samples, found, incidence, sines, reach, turn, slope_too=number > 1)
        ok = np.isfinite(fit.crossing) & (np.abs(fit.crossing) < 2 * reach)
        found = np.where(ok, np.clip(_time_of(fit.crossing, found, incidence, sines), centre - half, centre + half),
                         found)
        if 1 < number < PASSES - 1:
            share = np.clip(np.where(ok, fit.turn / turn, 1.0), 0.5, 2.0)
            incidence = np.arctan(np.tan(incidence) / share)
    spacing = SIDE_BY_SIDE * pulse_length / (time[1] - time[0])
    fit = _fitted(samples, found, incidence, sines, reach, turn, True, int(round(BLOCK * spacing)))
    ratio = slope / np.tan(incidence)
    echoes = fit.count / max(spacing, 1.0)
    rate = np.abs(fit.turn) * np.cos(np.arcsin(sines)) / (found * np.abs(np.tan(incidence)))
    freedom = echoes / np.maximum(echoes - FREE, 0.5)
    own = fit.variance * freedom / np.where(rate > 0, rate, np.nan) ** 2
    deviation = np.sqrt(among_neighbours(own, np.isfinite(own) & (echoes >= LEAST_ECHOES)))
    ok &= (echoes >= LEAST_ECHOES) & (ratio > SLOPES[0]) & (ratio < SLOPES[1]) & (fit.turn / turn > 0.5)
    ok &= np.isfinite(deviation) & (np.abs(found - centre) < half)
    return PhaseDetections(time=_time_of(np.where(ok, fit.crossing, 0.0), found, incidence, sines),
                           deviation=np.where(ok, deviation, np.inf), slope=np.tan(incidence),
                           coherence=fit.coherence, echoes=echoes)


def no_phase(time: np.ndarray) -> PhaseDetections:
    """Give the detections (B,) of a head whose beams are not split: none."""
    nothing = np.zeros_like(time)
    return PhaseDetections(time=time, deviation=np.full_like(time, np.inf), slope=nothing, coherence=nothing,
                           echoes=nothing)


@dataclass(frozen=True, kw_only=True)
class _Samples:
    product: np.ndarray
    power: np.ndarray
    instants: np.ndarray
    windows: Windows


@dataclass(frozen=True, kw_only=True)
class _Fit:
    """Crossing of the phase [sine], its slope, its variance there [rad²] of samples each for itself, and counts."""

    crossing: np.ndarray
    turn: np.ndarray
    variance: np.ndarray
    coherence: np.ndarray
    count: np.ndarray


def _fitted(samples: _Samples, found: np.ndarray, incidence: np.ndarray, sines: np.ndarray, reach: np.ndarray,
            turn: np.ndarray, slope_too: bool, block: int = 1) -> _Fit:
    """Fit the phase's line about a time of every beam, by one step from the best offset of a line of slope ``turn``."""
    windows, beam = samples.windows, samples.windows.beam
    x = _offsets(samples.instants, found, incidence, sines, beam)
    inside = np.abs(x) <= reach[beam]
    product = np.where(inside, samples.product, 0.0) * np.exp(-1j * turn[beam] * np.where(inside, x, 0.0))
    start = np.angle(windows.summed(product))
    product = product * np.exp(-1j * start)[beam]
    x = np.where(inside, x, 0.0)
    weight = np.maximum(np.real(product), 0.3 * np.abs(product))
    m0, m1, m2 = (windows.summed(weight * x ** power) for power in range(3))
    e0, e1 = (windows.summed(np.imag(product) * x ** power) for power in range(2))
    with np.errstate(invalid="ignore", divide="ignore"):
        determinant = m0 * m2 - m1 ** 2
        change = (m0 * e1 - m1 * e0) / determinant if slope_too else np.zeros(len(turn))
        offset = start + (e0 - change * m1) / m0
        fitted = turn + change
        crossing = -offset / fitted
        rest = product * np.exp(-1j * ((offset - start)[beam] + change[beam] * x))
        g0, g1 = (m2 - m1 * crossing) / determinant, (m0 * crossing - m1) / determinant
        pull = np.where(inside, np.imag(rest) * (g0[beam] + g1[beam] * x), 0.0)
        length = np.full(len(turn), 2 * (block // 2) + 1)
        variance = windows.summed(windows.smoothed(np.nan_to_num(pull), length) ** 2) / length
        coherence = np.abs(windows.summed(product)) / windows.summed(np.where(inside, samples.power, 0.0))
    return _Fit(crossing=crossing, turn=fitted, variance=variance, coherence=np.nan_to_num(coherence),
                count=windows.summed(inside.astype(float)))


def _offsets(instants: np.ndarray, found: np.ndarray, incidence: np.ndarray, sines: np.ndarray,
             beam: np.ndarray) -> np.ndarray:
    """Give x(t) (W,)."""
    leaning = np.arcsin(sines) - incidence
    nearest = (found * np.cos(incidence))[beam] / np.maximum(instants, 1e-12)
    away = np.sign(incidence)[beam] * np.arccos(np.minimum(nearest, 1.0))
    return np.sin(away + leaning[beam]) - sines[beam]


def _time_of(crossing: np.ndarray, found: np.ndarray, incidence: np.ndarray, sines: np.ndarray) -> np.ndarray:
    """Give the time (B,) at which the plane through ``found`` is seen ``crossing`` off the axis."""
    leaning = np.arcsin(sines) - incidence
    away = np.arcsin(np.clip(sines + crossing, -1, 1)) - leaning
    return found * np.cos(incidence) / np.maximum(np.cos(away), 1e-3)
