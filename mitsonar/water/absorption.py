"""Absorption of sound in seawater: relaxation of boric acid and magnesium sulphate, and viscosity of the water.

    alpha = A1 P1 f1 f^2 / (f^2 + f1^2) + A2 P2 f2 f^2 / (f^2 + f2^2) + A3 P3 f^2      (alpha in dB/km, f in kHz)

f -> ``frequency`` [Hz], T -> ``temperature`` [deg C], S -> ``salinity`` [g/kg], D -> ``depth`` [m], pH -> ``ph``.
Ainslie and McColm shortened the three terms; Thorp's law depends on f only, for one kind of water. The loss along a
path is the integral over its depths; over a few tens of metres, the value at the mean depth suffices.
"""
from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from mitsonar.device.types import Real
from mitsonar.units import khz_from_hertz

from .ranges import checked, chosen


def francois_garrison_db(frequency: ArrayLike, temperature: ArrayLike = 10.0, salinity: ArrayLike = 35.0,
                         depth: ArrayLike = 0.0, ph: ArrayLike = 8.0) -> np.ndarray:
    """Return the absorption of seawater by Francois and Garrison.

    Parameters
    ----------
    frequency : array [Hz]
    temperature : array [deg C]
    salinity : array [g/kg]
    depth : array [m]
        Positive down.
    ph : array [-]
        All arguments broadcast.

    Returns
    -------
    array [dB/m]

    Raises
    ------
    ValueError
        If an argument is not finite or outside ``water.ranges.RANGES``.

    Notes
    -----
    Francois and Garrison (1982), J. Acoust. Soc. Am. 72, 896 and 1879. Within 5 % for 10..500 kHz, -2..22 deg C,
    30..35 g/kg and 0..3.5 km; in use for 0.2..1000 kHz. At 20 deg C the water term jumps by 0.05 %.
    """
    f, t, s, d, ph = _checked(frequency, temperature, salinity, depth, ph)
    c = 1412 + 3.21 * t + 1.19 * s + 0.0167 * d
    kelvin = 273 + t
    # Boric acid
    a1 = 8.86 / c * 10 ** (0.78 * ph - 5)
    f1 = 2.8 * np.sqrt(s / 35) * 10 ** (4 - 1245 / kelvin)
    # Magnesium sulphate
    a2 = 21.44 * s / c * (1 + 0.025 * t)
    p2 = 1 - 1.37e-4 * d + 6.2e-9 * d**2
    f2 = 8.17 * 10 ** (8 - 1990 / kelvin) / (1 + 0.0018 * (s - 35))
    # Water itself: one cubic for cold, one for warm
    a3 = np.where(t <= 20, 4.937e-4 + t * (-2.59e-5 + t * (9.11e-7 - t * 1.50e-8)),
                  3.964e-4 + t * (-1.146e-5 + t * (1.45e-7 - t * 6.5e-10)))
    p3 = 1 - 3.83e-5 * d + 4.9e-10 * d**2
    return 1e-3 * (a1 * _relaxation(f, f1) + a2 * p2 * _relaxation(f, f2) + a3 * p3 * f**2)


def ainslie_mccolm_db(frequency: ArrayLike, temperature: ArrayLike = 10.0, salinity: ArrayLike = 35.0,
                      depth: ArrayLike = 0.0, ph: ArrayLike = 8.0) -> np.ndarray:
    """Return the absorption of seawater by Ainslie and McColm; for arguments and errors see `francois_garrison_db`.

    Returns
    -------
    array [dB/m]

    Notes
    -----
    Ainslie and McColm (1998), J. Acoust. Soc. Am. 103, 1671: a shorter form of Francois and Garrison, within 10 %
    of it for 0.1..1000 kHz.
    """
    f, t, s, d, ph = _checked(frequency, temperature, salinity, depth, ph)
    km = d / 1000
    f1 = 0.78 * np.sqrt(s / 35) * np.exp(t / 26)
    f2 = 42 * np.exp(t / 17)
    boric = 0.106 * np.exp((ph - 8) / 0.56) * _relaxation(f, f1)
    magnesium = 0.52 * (1 + t / 43) * (s / 35) * np.exp(-km / 6) * _relaxation(f, f2)
    water = 0.00049 * np.exp(-(t / 27 + km / 17)) * f**2
    return 1e-3 * (boric + magnesium + water)


def thorp_db(frequency: ArrayLike, temperature: ArrayLike = 10.0, salinity: ArrayLike = 35.0, depth: ArrayLike = 0.0,
             ph: ArrayLike = 8.0) -> np.ndarray:
    """Return the absorption of seawater by Thorp; for arguments and errors see `francois_garrison_db`.

    Returns
    -------
    array [dB/m]
        Depends on ``frequency`` only, but has the shape to which all arguments broadcast.

    Notes
    -----
    Thorp (1967), J. Acoust. Soc. Am. 42, 270, in the form of Jensen, Kuperman, Porter and Schmidt, *Computational
    Ocean Acoustics*: water of about 4 deg C at about 1 km, below 50 kHz. In other water it errs by tens of
    per cent, in fresh water at 100 kHz by a factor of 11; it serves to repeat earlier computations.
    """
    f, *rest = _checked(frequency, temperature, salinity, depth, ph)
    f = np.broadcast_arrays(f, *rest)[0]
    return 1e-3 * (0.0033 + 0.11 * _relaxation(f, 1.0) + 44 * f**2 / (4100 + f**2) + 3e-4 * f**2)


FORMULAS: dict[str, Callable[..., np.ndarray]] = {
    "francois-garrison": francois_garrison_db, "ainslie-mccolm": ainslie_mccolm_db, "thorp": thorp_db}


def absorption_db(frequency: ArrayLike, temperature: ArrayLike = 10.0, salinity: ArrayLike = 35.0,
                  depth: ArrayLike = 0.0, ph: ArrayLike = 8.0, formula: str = "francois-garrison") -> np.ndarray:
    """Return the absorption of seawater by a named formula.

    Parameters
    ----------
    frequency : array [Hz]
    temperature : array [deg C]
    salinity : array [g/kg]
    depth : array [m]
        Positive down.
    ph : array [-]
        All arrays broadcast.
    formula : str
        Key of `FORMULAS`: "francois-garrison", "ainslie-mccolm" or "thorp".

    Returns
    -------
    array [dB/m]

    Raises
    ------
    ValueError
        If the formula is unknown, or a value is not finite or outside ``water.ranges.RANGES``.

    Notes
    -----
    For sources and ranges see `francois_garrison_db`, `ainslie_mccolm_db` and `thorp_db`.

    Examples
    --------
    >>> [round(1000 * float(absorption_db(100e3, formula=name)), 3) for name in FORMULAS]
    [33.63, 34.341, 34.319]
    """
    return chosen("absorption", formula, FORMULAS)(frequency, temperature, salinity, depth, ph)


def _relaxation(f: np.ndarray, f_relax: Real) -> np.ndarray:
    # f_relax = 0 (no salt) and f = 0 give no loss, also together
    return f_relax * f**2 / np.maximum(f**2 + f_relax**2, np.finfo(float).tiny)


def _checked(frequency: ArrayLike, temperature: ArrayLike, salinity: ArrayLike, depth: ArrayLike,
             ph: ArrayLike) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    f, t, s, d, ph = checked("absorption", frequency=frequency, temperature=temperature, salinity=salinity, depth=depth,
                             ph=ph)
    return khz_from_hertz(f), t, s, d, ph
