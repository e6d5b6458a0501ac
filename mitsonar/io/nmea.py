"""Positions of NMEA 0183 sentences (GGA, GLL, RMC), as instruments record them among their own data."""
import re

import numpy as np

_FIX = re.compile(rb"\$..(?:GGA,[^,]*|GLL|RMC,[^,]*,A),(\d+\.?\d*),([NS]),(\d+\.?\d*),([EW])")


def fix_of(sentence: bytes) -> tuple[float, float] | None:
    """Return latitude and longitude [degrees] of a sentence, None if it has no position."""
    match = _FIX.search(sentence)
    if match is None:
        return None
    latitude, longitude = _degrees(match, 1, b"S"), _degrees(match, 3, b"W")
    return (latitude, longitude) if abs(latitude) <= 90 and abs(longitude) <= 180 else None


def at_times(time: np.ndarray, clock: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return values at times, interpolated on a clock in any order; NaN outside it, and everywhere without values."""
    if clock.size < 2:
        return np.full(time.shape, np.nan)
    order = np.argsort(clock, kind="stable")
    clock, values = clock[order], values[order]
    inside = (time >= clock[0]) & (time <= clock[-1])
    return np.where(inside, np.interp(time, clock, values), np.nan)


def _degrees(match, number, negative):
    """Return the degrees of an angle in degrees and minutes."""
    degrees, minutes = divmod(float(match[number]), 100)
    return (degrees + minutes / 60) * (-1 if match[number + 1] == negative else 1)
