"""Ambient noise of the sea: spectral levels in dB re 1 uPa^2/Hz.

    turbulence  17 - 30 log f
    shipping    40 + 20 (s - 1/2) + 26 log f - 60 log(f + 0.03)
    wind        50 + 7.5 sqrt(w) + 20 log f - 40 log(f + 0.4)          (logs to base 10, f in kHz)
    thermal     4 pi k T rho f^2 / c                                   (as a power)

f -> ``frequency`` [Hz], s -> ``shipping`` 0..1, w -> ``wind_speed`` [m/s], k the Boltzmann constant. The first
three are the fit by Coates to Wenz's curves; his thermal line, -15 + 20 log f, lies 0.36 dB below the last.
In a band of width B, a beam of directivity index DI receives level + 10 log B - DI.
"""
from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mitsonar.units import db_from_power, khz_from_hertz, power_from_db

from .ranges import checked

BOLTZMANN = 1.380649e-23  # [J/K]
MICROPASCAL = 1e-6  # [Pa]


def ambient_noise_db(frequency: ArrayLike, wind_speed: ArrayLike = 5.0, shipping: ArrayLike = 0.5) -> np.ndarray:
    """Return the ambient noise level of the deep sea.

    Parameters
    ----------
    frequency : array [Hz]
        Above zero.
    wind_speed : array [m/s]
    shipping : array [-]
        0 (remote) to 1 (heavy). All arguments broadcast.

    Returns
    -------
    array [dB re 1 uPa^2/Hz]

    Raises
    ------
    ValueError
        If an argument is not finite or outside ``water.ranges.RANGES``.

    Notes
    -----
    Coates (1990), *Underwater Acoustic Systems*, after Wenz (1962), J. Acoust. Soc. Am. 34, 1936. Above about
    100 kHz thermal noise dominates.
    """
    levels = noise_components_db(frequency, wind_speed, shipping)
    return db_from_power(np.sum([power_from_db(level) for level in levels.values()], axis=0))


def noise_components_db(frequency: ArrayLike, wind_speed: ArrayLike = 5.0,
                        shipping: ArrayLike = 0.5) -> dict[str, np.ndarray]:
    """Return the levels of the components of `ambient_noise_db`.

    Parameters
    ----------
    frequency, wind_speed, shipping
        See `ambient_noise_db`.

    Returns
    -------
    dict[str, array [dB re 1 uPa^2/Hz]]
        "turbulence", "shipping", "wind" and "thermal", in the shape to which the arguments broadcast. The last is
        Coates's line; `thermal_noise_db` gives the exact level.

    Raises
    ------
    ValueError
        If an argument is not finite or out of its range.
    """
    frequency, wind_speed, shipping = np.broadcast_arrays(
        *checked("ambient noise", frequency=frequency, wind_speed=wind_speed, shipping=shipping))
    f = khz_from_hertz(_above_zero(frequency))
    log_f = np.log10(f)
    return {
        "turbulence": 17 - 30 * log_f,
        "shipping": 40 + 20 * (shipping - 0.5) + 26 * log_f - 60 * np.log10(f + 0.03),
        "wind": 50 + 7.5 * np.sqrt(wind_speed) + 20 * log_f - 40 * np.log10(f + 0.4),
        "thermal": -15 + 20 * log_f,
    }


def thermal_noise_db(frequency: ArrayLike, temperature: ArrayLike = 10.0, sound_speed: ArrayLike = 1500.0,
                     density: ArrayLike = 1025.0) -> np.ndarray:
    """Return the level of the thermal noise of water, the lower limit for every hydrophone.

    Parameters
    ----------
    frequency : array [Hz]
        Above zero.
    temperature : array [deg C]
    sound_speed : array [m/s]
    density : array [kg/m^3]
        All arguments broadcast.

    Returns
    -------
    array [dB re 1 uPa^2/Hz]

    Raises
    ------
    ValueError
        If frequency or temperature is not finite or outside ``water.ranges.RANGES``.

    Notes
    -----
    Mellen (1952), J. Acoust. Soc. Am. 24, 478. For an omnidirectional hydrophone of efficiency 1; with
    efficiency e and directivity index DI, the level relative to signals on the axis is lower by DI + 10 log e.
    """
    frequency, temperature = checked("thermal noise", frequency=frequency, temperature=temperature)
    kelvin = temperature + 273.15
    pressure_squared = 4 * np.pi * BOLTZMANN * kelvin * np.asarray(density) * _above_zero(frequency) ** 2
    return db_from_power(pressure_squared / np.asarray(sound_speed) / MICROPASCAL**2)


def _above_zero(frequency: np.ndarray) -> np.ndarray:
    if (frequency <= 0).any():
        raise ValueError("noise level: frequency is 0 Hz; it must be above zero.")
    return frequency
