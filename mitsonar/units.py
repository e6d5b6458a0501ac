"""Convert between SI and decibels, degrees, kilohertz and knots.

Inside the library all numbers are linear SI and radians. A name with the suffix ``_db``, ``_deg``, ``_khz`` or
``_knots`` holds the other unit, in XML, on the command line and in files. Decibels are power decibels:

    level_db = 10 log10(power) = 20 log10(amplitude)

All functions take scalars or arrays.
"""
from typing import TypeVar, cast

import numpy as np

Values = TypeVar("Values", float, np.ndarray)    # a number gives a number, an array an array

KNOT = 1852 / 3600  # [m/s], exact by definition of the nautical mile
NOTHING_DB = -200.0  # level of a bin without echo or noise, the lowest level
HARDLY_DB = NOTHING_DB + 1  # levels up to this one count as empty


def db_from_power(power: Values) -> Values:
    """Return the decibels of a power, intensity or area ratio; zero gives -inf."""
    with np.errstate(divide="ignore"):
        return cast(Values, 10 * np.log10(power))


def power_from_db(level_db: Values) -> Values:
    """Return the power, intensity or area ratio of a level in decibels."""
    return cast(Values, 10 ** (np.asarray(level_db, float) / 10)[()])


def db_from_amplitude(amplitude: Values) -> Values:
    """Return the decibels of an amplitude (pressure) ratio; zero gives -inf."""
    with np.errstate(divide="ignore"):
        return cast(Values, 20 * np.log10(np.abs(amplitude)))


def amplitude_from_db(level_db: Values) -> Values:
    """Return the amplitude (pressure) ratio of a level in decibels."""
    return cast(Values, 10 ** (np.asarray(level_db, float) / 20)[()])


def radians_from_deg(angle_deg: Values) -> Values:
    """Return the angle [rad] of an angle in degrees."""
    return cast(Values, np.deg2rad(angle_deg))


def deg_from_radians(angle: Values) -> Values:
    """Return the degrees of an angle [rad]."""
    return cast(Values, np.rad2deg(angle))


def hertz_from_khz(frequency_khz: Values) -> Values:
    """Return the frequency [Hz] of a frequency in kilohertz."""
    return cast(Values, np.multiply(frequency_khz, 1e3)[()])


def khz_from_hertz(frequency: Values) -> Values:
    """Return the kilohertz of a frequency [Hz]."""
    return cast(Values, np.multiply(frequency, 1e-3)[()])


def metres_per_second_from_knots(speed_knots: Values) -> Values:
    """Return the speed [m/s] of a speed in knots."""
    return cast(Values, np.multiply(speed_knots, KNOT)[()])


def knots_from_metres_per_second(speed: Values) -> Values:
    """Return the knots of a speed [m/s]."""
    return cast(Values, np.divide(speed, KNOT)[()])
