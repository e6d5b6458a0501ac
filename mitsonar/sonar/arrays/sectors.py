"""Sectors of a swath: transmissions of one ping that differ in direction, frequency and pulse, and their beams."""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..pulses.pulses import Pulse
from .array import Array
from .shading import window_weights

SPACINGS = ("angle", "distance")
STEPS = ("angle", "sine")          # what grows by equal steps from beam to beam of a fan
STEEPEST = np.deg2rad(85.0)        # of beams at even distances
TRIED = 256                        # elements of the line on which a window's beam is measured


@dataclass(frozen=True, kw_only=True, eq=False)
class Sector:
    """One transmission of a ping, and the beams that receive its echoes."""

    pulse: Pulse
    source_level_db: float  # [dB re 1 µPa @ 1 m]: on its axis
    delay: float  # [s]: after the ping's first transmission
    tilt: float  # [rad]: of the transmission, forward of the vertical plane across the track
    beams: np.ndarray  # (B,) [rad]: angles from the vertical, positive to starboard, rising
    first: float  # [rad]: lower edge of the sector
    last: float  # [rad]: upper edge

    @property
    def middle(self) -> float:
        """Angle [rad] that the transmitting faces look at."""
        return 0.5 * (self.first + self.last)


def beam_angles(beams: int, swath: float, spacing: str, middle: float = 0.0) -> np.ndarray:
    """Return the angles (B,) [rad] of beams over a swath [rad] about its middle, even in angle or on a level bed."""
    if spacing not in SPACINGS:
        raise ValueError(f'beam spacing is "{spacing}"; give one of {", ".join(SPACINGS)}.')
    first, last = middle - 0.5 * swath, middle + 0.5 * swath
    if spacing == "angle":
        return np.linspace(first, last, beams)
    if max(-first, last) > STEEPEST:
        raise ValueError(f"a swath from {np.rad2deg(first):g} to {np.rad2deg(last):g} degrees has no even distances "
                         f"on a level bed; end it within {np.rad2deg(STEEPEST):g} degrees, or take even angles.")
    return np.arctan(np.linspace(np.tan(first), np.tan(last), beams))


def elements_for_beam_width(beam_width: float, spacing: float, window: str | None) -> int:
    """Choose how many elements a line has for a full one-way width at -3 dB [rad]; spacing in wavelengths.

    A line N d long of a window w has |W(s)|² = 1/2 where s = x / (N d), x that of the window.
    """
    weight = np.ones(TRIED) if window is None else window_weights(window, TRIED)
    half = 0.5 * half_power_width((np.arange(TRIED) - (TRIED - 1) / 2) / TRIED, weight)
    return max(2, int(round(half / (spacing * np.sin(0.5 * beam_width)))))


def half_power_width(place: np.ndarray, weight: np.ndarray) -> float:
    """Return the width in sines between which a line's |W|² is over a half, times the unit of its places (E,)."""
    middle = place @ weight / weight.sum()

    def above_half(sine: float) -> float:
        return float((weight @ np.cos(2 * np.pi * (place - middle) * sine) / weight.sum()) ** 2 - 0.5)

    length = float(np.ptp(place)) or 1.0
    from scipy.optimize import brentq

    return 2 * float(brentq(above_half, 0.05 / length, 3.0 / length))


def pattern_integral(array: Array, wavelength: float) -> float:
    """Return ∫ |W(s)|² ds of an evenly spaced line over the sines from one grating lobe to the next.

    By Parseval's theorem (λ / d) Σ w² / (Σ w)², d the pitch.
    """
    weight = array.weight
    return float(wavelength / array.pitch() * np.sum(weight ** 2) / np.sum(weight) ** 2)
