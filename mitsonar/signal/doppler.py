"""Doppler of an echo, and the few factors that stand for all echoes of a ping.

    η = (c + v_back) / (c - v_out)                        rate of time of the echo, per unit of the pulse's
    ε ≤ f_max T |η - η_k| / (2 η_k)                       error of phase [cycles] at the ends of the pulse

v -> closing speed along the outgoing leg at transmission, and along the return leg at reception [m/s]; η_k the factor
that stands for η, f_max the pulse's highest frequency, T its duration. Echoes are put into classes of equal width; one
that takes part in class k is shifted so that the middles of both pulses coincide,

    Δτ = (T/2) (1/η - 1/η_k)

which leaves the error at the ends alone (two-way factor: e.g. Urick 1983, ch. 9; the rest is kinematics). As a platform
passes at a speed v and a range r, 1/η grows by κ = 2 v² / (r c) a second, and by up to 2 a / c with its own
acceleration a: a pulse arrives f κ T² / 8 cycles off at its ends, and is cut into pieces, each with a factor of its
own, where that is more.
"""
from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..device.types import Numbers
from ..sonar.pulse import Pulse

__all__ = ["doppler_class", "doppler_classes", "factor_tolerance", "pieces_of", "two_way_doppler"]

PHASE_ERROR = 0.02                 # [cycles] at the ends of an echo


def two_way_doppler(closing_speed: Numbers, sound_speed: Numbers, closing_speed_back: Numbers | None = None) -> Numbers:
    """Give the two-way Doppler factor of echoes.

    Parameters
    ----------
    closing_speed : array [m/s]
        Of the sonar along the outgoing leg, or of the target towards a sonar at rest; positive shortens the leg.
    sound_speed : array [m/s]
        At the sonar (at the target, if that is what moves).
    closing_speed_back : array [m/s]
        Along the return leg; None for the same.

    Returns
    -------
    array [-]
        Plain arithmetic: NumPy and Dr.Jit arrays alike.
    """
    back = closing_speed if closing_speed_back is None else closing_speed_back
    return (sound_speed + back) / (sound_speed - closing_speed)


def factor_tolerance(pulse: Pulse, phase_error: float = PHASE_ERROR) -> float:
    """Give how wrong a factor near 1 may be for an error of phase [cycles] at the ends of a pulse."""
    return 2 * phase_error / ((pulse.frequency + pulse.band[1]) * pulse.duration)


def pieces_of(pulse: Pulse, speed: float, sound_speed: float, nearest: float, acceleration: float = 0.0,
              phase_error: float = PHASE_ERROR) -> int:
    """Count the pieces that a pulse is cut into, each of one factor.

    For echoes from `nearest` [m] on, at a speed [m/s] and an acceleration [m/s²].
    """
    bend = 2 * (speed ** 2 / nearest + acceleration) / sound_speed
    highest = pulse.frequency + pulse.band[1]
    return max(1, int(np.ceil(pulse.duration * np.sqrt(highest * bend / (8 * phase_error)))))


def doppler_classes(pulse: Pulse, lowest: float, highest: float, phase_error: float = PHASE_ERROR) -> np.ndarray:
    """Choose the factors that stand for all echoes between two factors.

    Parameters
    ----------
    pulse : Pulse
    lowest, highest : float [-]
        Two-way factors.
    phase_error : float [cycles]
        Largest error anywhere in an echo.

    Returns
    -------
    (K,) [-]
        Equally spaced, rising, the middles of K classes of equal width; as few as the bound allows.

    Raises
    ------
    ValueError
        If the factors are not 0 < lowest <= highest, or the error not above 0.
    """
    if not (0 < lowest <= highest < np.inf and phase_error > 0):
        raise ValueError(f"Doppler classes: factors {lowest} to {highest} within {phase_error} cycles; give "
                         "0 < lowest <= highest and an error above 0.")
    widest = 2 * lowest * factor_tolerance(pulse, phase_error)
    count = max(1, int(np.ceil((highest - lowest) / widest)))
    return lowest + (np.arange(count) + 0.5) * (highest - lowest) / count


def doppler_class(doppler: ArrayLike, classes: ArrayLike, pulse: Pulse) -> tuple[np.ndarray, np.ndarray]:
    """Assign echoes to classes.

    Parameters
    ----------
    doppler : array [-]
    classes : (K,) [-]
        Of `doppler_classes`.
    pulse : Pulse

    Returns
    -------
    index : int array
        The nearest class.
    delay : array [s]
        To add to the echo's delay, in its phase as in its place, before it is accumulated into its class.
    """
    doppler, classes = np.asarray(doppler, float), np.asarray(classes, float)
    index = np.searchsorted(0.5 * (classes[1:] + classes[:-1]), doppler)
    return index, 0.5 * pulse.duration * (1 / doppler - 1 / classes[index])
