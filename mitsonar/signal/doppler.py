"""Compute Doppler factors of echoes, and choose the few factors that stand for all echoes of a ping.

    η = (c + v_back) / (c - v_out)                        rate of time of the echo, per unit of the pulse's
    ε ≤ f_max T |η - η_k| / (2 η_k)                       error of phase [cycles] at the ends of the pulse

v -> closing speed [m/s] along the outgoing leg at transmission, and along the return leg at reception; η_k the factor
that stands for η, f_max the pulse's highest frequency, T its duration. Echoes are sorted into classes of equal width.
An echo in class k is shifted so that the middles of both pulses coincide,

    Δτ = (T/2) ε,     ε = 1/η - 1/η_k

so that only the error at the ends remains (two-way factor: e.g. Urick 1983, ch. 9). For a sweep that passes the
frequency f at the rate k in its middle, the remaining factor acts as a delay and a phase,

    τ = (f / k) ε,     θ = f η_k τ - k η_k² τ² / 2 [cycles]

for p_k(t - τ) e^{i2πθ} then has the frequency and phase of the echo in the middle (range and Doppler of a sweep: e.g.
Rihaczek 1969, ch. 7). Two errors remain: the ends are off by τ, a share τ / T of the band without its echo, and the
rate of an lfm echo is η² k, an error of π k T² |η - η_k| / 2 at its ends. As a platform passes at a speed v and a range
r, 1/η grows by κ = 2 v² / (r c) a second, and by up to 2 a / c with its own acceleration a: a pulse arrives f κ T² / 8
cycles off at its ends, and is cut into pieces, each with its own factor, where that is more than the bound.

Compressed by the filter of its class, an echo is off by its change of shape alone: where f T |η - η_k| = 0.05, a cw by
-28 dB of its peak, a sweep of BT = 10 by -44 dB (-40 dB with a Hann window). The delay and phase of the best
correlation are equal for a cw, and for sweeps from BT = 6 on at most 1.4 dB better.
"""
from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mitsonar.device.types import Numbers
from mitsonar.sonar.pulses.pulse import Pulse

PHASE_ERROR = 0.02                 # [cycles] at the ends of an echo
ENDS_OFF = 0.004                   # largest delay of a sweep's ends, as a share of its duration: -48 dB of its peak
LEAST_SWEEP = 3.0                  # duration times bandwidth, from which a window leaves enough of the sweep to glide
RATE_ERROR = 0.1                   # largest error of the rate there, as a share of `PHASE_ERROR`: -50 dB


def two_way_doppler(closing_speed: Numbers, sound_speed: Numbers, closing_speed_back: Numbers | None = None) -> Numbers:
    """Return the two-way Doppler factor of echoes.

    Parameters
    ----------
    closing_speed : array [m/s]
        Speed of the sonar along the outgoing leg, or of the target towards a sonar at rest; positive shortens the leg.
    sound_speed : array [m/s]
        Sound speed at the sonar, or at the target if the target moves.
    closing_speed_back : array [m/s]
        Closing speed along the return leg; None for the same.

    Returns
    -------
    array [-]
        The array type of the arguments: NumPy or Dr.Jit.
    """
    back = closing_speed if closing_speed_back is None else closing_speed_back
    return (sound_speed + back) / (sound_speed - closing_speed)


def two_way_shift(closing_speed: Numbers, sound_speed: Numbers, closing_speed_back: Numbers) -> Numbers:
    """Return `two_way_doppler` minus 1, with all digits of a small shift."""
    return (closing_speed_back + closing_speed) / (sound_speed - closing_speed)


def longer_period(shift: Numbers, class_shift: Numbers) -> Numbers:
    """Return ε from η - 1 and η_k - 1: no difference of numbers near 1."""
    return (class_shift - shift) / ((1 + shift) * (1 + class_shift))


class Glide(NamedTuple):
    """Hold the frequency and rate of a sweep in its middle."""

    frequency: float               # f [Hz], of the carrier and the sweep together
    rate: float                    # k [Hz/s]

    def shift(self, longer: Numbers, factor: Numbers) -> tuple[Numbers, Numbers]:
        """Return τ [s] and θ [cycles] from ε and the factor η_k of the class."""
        late = (self.frequency / self.rate) * longer
        cycles = factor * late
        return late, cycles * (self.frequency - 0.5 * self.rate * cycles)


class ResidualDoppler(NamedTuple):
    """Hold what makes a delay and a phase of the Doppler that an echo has beside its class."""

    half: float                    # T/2 [s]
    carrier: float                 # [Hz]
    glide: Glide | None

    def shift(self, shift: Numbers, class_shift: Numbers) -> tuple[Numbers, Numbers]:
        """Return Δτ + τ [s], and the phase [cycles] besides that of the carrier at rest, from η - 1 and η_k - 1."""
        longer = longer_period(shift, class_shift)
        late, turn = self.half * longer, 0.0
        if self.glide is not None:
            more, turn = self.glide.shift(longer, 1 + class_shift)
            late = late + more
        return late, turn - self.carrier * late


def residual_doppler(pulse: Pulse) -> ResidualDoppler:
    """Return the residual of a pulse; a sweep of few cycles stays in place as a cw does."""
    swept = abs(pulse.bandwidth) * pulse.duration >= LEAST_SWEEP
    return ResidualDoppler(half=0.5 * pulse.duration, carrier=pulse.frequency, glide=glide_of(pulse) if swept else None)


def glide_of(pulse: Pulse) -> Glide | None:
    """Return the glide of a whole pulse, or None if the pulse does not sweep."""
    if pulse.sweep is None:
        return None
    first, last = (pulse.frequency + end for end in pulse.sweep)
    rate = (last - first) / pulse.duration
    if pulse.kind == "hfm":
        # its period, not its frequency, changes at a constant rate
        middle = 2 * first * last / (first + last)
        return Glide(frequency=middle, rate=rate * middle ** 2 / (first * last))
    return Glide(frequency=0.5 * (first + last), rate=rate)


def factor_tolerance(pulse: Pulse, phase_error: float = PHASE_ERROR, glide: Glide | None = None) -> float:
    """Return the tolerance of a factor near 1 that keeps the phase error [cycles] at the ends of a pulse.

    With a glide, which corrects the first order, the bound holds for the remaining errors.
    """
    tolerance = 2 * phase_error / ((pulse.frequency + pulse.band[1]) * pulse.duration)
    if glide is None or not glide.rate:      # a sweep may be too narrow for the digits of its frequencies
        return tolerance
    swept = abs(glide.rate) * pulse.duration
    return max(tolerance, min(ENDS_OFF * swept / glide.frequency,
                              4 * RATE_ERROR * phase_error / (swept * pulse.duration)))


def pieces_of(pulse: Pulse, speed: float, sound_speed: float, nearest: float, acceleration: float = 0.0,
              phase_error: float = PHASE_ERROR) -> int:
    """Count the pieces, each of one factor, that a pulse is cut into.

    Echoes come from `nearest` [m] on, at a speed [m/s] and an acceleration [m/s²].
    """
    bend = 2 * (speed ** 2 / nearest + acceleration) / sound_speed
    highest = pulse.frequency + pulse.band[1]
    return max(1, int(np.ceil(pulse.duration * np.sqrt(highest * bend / (8 * phase_error)))))


def doppler_classes(pulse: Pulse, lowest: float, highest: float, phase_error: float = PHASE_ERROR,
                    glide: Glide | None = None) -> np.ndarray:
    """Choose the factors that stand for all echoes between two factors.

    Parameters
    ----------
    pulse : Pulse
    lowest, highest : float [-]
        Two-way factors.
    phase_error : float [cycles]
        Largest error anywhere in an echo.
    glide : Glide or None
        Glide of the pulse, if echoes are also shifted by it; the bound is then that of `factor_tolerance`.

    Returns
    -------
    (K,) [-]
        Middles of K classes of equal width, rising; K is as small as the bound allows.

    Raises
    ------
    ValueError
        If the factors are not 0 < lowest <= highest, or the error is not above 0.
    """
    if not (0 < lowest <= highest < np.inf and phase_error > 0):
        raise ValueError(f"Doppler classes: factors {lowest} to {highest} within {phase_error} cycles; give "
                         "0 < lowest <= highest and an error above 0.")
    widest = 2 * lowest * factor_tolerance(pulse, phase_error, glide)
    count = max(1, int(np.ceil((highest - lowest) / widest)))
    return lowest + (np.arange(count) + 0.5) * (highest - lowest) / count


def doppler_class(doppler: ArrayLike, classes: ArrayLike, pulse: Pulse) -> tuple[np.ndarray, np.ndarray]:
    """Assign echoes to classes.

    Parameters
    ----------
    doppler : array [-]
    classes : (K,) [-]
        Factors from `doppler_classes`.
    pulse : Pulse

    Returns
    -------
    index : int array
        Number of the nearest class.
    delay : array [s]
        Delay to add to the echo, in phase and place, before it is accumulated into its class.
    """
    doppler, classes = np.asarray(doppler, float), np.asarray(classes, float)
    index = np.searchsorted(0.5 * (classes[1:] + classes[:-1]), doppler)
    return index, 0.5 * pulse.duration * longer_period(doppler - 1, classes[index] - 1)
