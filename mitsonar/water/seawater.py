"""Sound speed of seawater, by TEOS-10 or another formula in use.

    p = p(depth, latitude)    SA = SA(salinity, p, longitude, latitude)    c = c(SA, T, p)        TEOS-10
    c = Cw(T, P) + A(T, P) S + B(T, P) S^(3/2) + D(P) S^2,   P = p / 10                           Chen and Millero
    c = polynomial in T, S and z                                                                  other formulas

T -> ``temperature`` [deg C, ITS-90], in situ; S -> ``salinity``; z -> ``depth`` [m]; p [dbar], P [bar]. TEOS-10 uses
the full Gibbs function, not its 75-term fit (rms 0.07 m/s).
"""
from __future__ import annotations

import gsw
import numpy as np
from numpy.polynomial.polynomial import polyval, polyval2d
from numpy.typing import ArrayLike

from .ranges import RANGES, SOUND_SPEED_RANGES, checked, chosen

# Chen and Millero's coefficients, refitted to ITS-90 by Wong and Zhu (1995): rows are powers of P [bar], columns of T
_CW = [[1402.388, 5.03830, -5.81090e-2, 3.3432e-4, -1.47797e-6, 3.1419e-9],
       [0.153563, 6.8999e-4, -8.1829e-6, 1.3632e-7, -6.1260e-10, 0],
       [3.1260e-5, -1.7111e-6, 2.5986e-8, -2.5353e-10, 1.0415e-12, 0],
       [-9.7729e-9, 3.8513e-10, -2.3654e-12, 0, 0, 0]]
_A = [[1.389, -1.262e-2, 7.166e-5, 2.008e-6, -3.21e-8],
      [9.4742e-5, -1.2583e-5, -6.4928e-8, 1.0515e-8, -2.0142e-10],
      [-3.9064e-7, 9.1061e-9, -1.6009e-10, 7.994e-12, 0],
      [1.100e-10, 6.651e-12, -3.391e-13, 0, 0]]
_B = [[-1.922e-2, -4.42e-5], [7.3637e-5, 1.7950e-7]]
_D = [1.727e-3, -7.9836e-6]


def _teos_10(temperature, salinity, depth, latitude, longitude):
    pressure = gsw.p_from_z(-depth, latitude)
    absolute_salinity = gsw.SA_from_SP(salinity, pressure, longitude, latitude)
    return gsw.sound_speed_t_exact(absolute_salinity, temperature, pressure)


def _chen_millero(temperature, salinity, depth, latitude, longitude):
    p, t, s, _ = np.broadcast_arrays(gsw.p_from_z(-depth, latitude) / 10, temperature, salinity, longitude)
    return polyval2d(p, t, _CW) + polyval2d(p, t, _A) * s + polyval2d(p, t, _B) * s**1.5 + polyval(p, _D) * s**2


def _mackenzie(temperature, salinity, depth, latitude, longitude):
    t, s, z, *_ = np.broadcast_arrays(temperature, salinity - 35, depth, latitude, longitude)
    return (1448.96 + t * (4.591 + t * (-5.304e-2 + t * 2.374e-4)) + 1.340 * s
            + 1.630e-2 * z + 1.675e-7 * z**2 - 1.025e-2 * t * s - 7.139e-13 * t * z**3)


def _medwin(temperature, salinity, depth, latitude, longitude):
    t, s, z, *_ = np.broadcast_arrays(temperature, salinity - 35, depth, latitude, longitude)
    return 1449.2 + t * (4.6 + t * (-0.055 + t * 0.00029)) + (1.34 - 0.010 * t) * s + 0.016 * z


def _leroy_robinson_goldsmith(temperature, salinity, depth, latitude, longitude):
    t, s, z, north, _ = np.broadcast_arrays(temperature, salinity, depth, np.abs(latitude), longitude)
    return (1402.5 + t * (5 + t * (-5.44e-2 + t * 2.1e-4)) + s * (1.33 + t * (-1.23e-2 + t * 8.7e-5))
            + z * (1.56e-2 + z * (2.55e-7 - z * 7.3e-12)) + 1.2e-6 * z * (north - 45)
            - 9.5e-13 * t * z**3 + 3e-7 * t**2 * z + 1.43e-5 * s * z)


FORMULAS = {"teos-10": _teos_10, "chen-millero": _chen_millero, "mackenzie": _mackenzie, "medwin": _medwin,
            "leroy-robinson-goldsmith": _leroy_robinson_goldsmith}


def sound_speed(temperature: ArrayLike, salinity: ArrayLike, depth: ArrayLike, latitude: ArrayLike = 45.0,
                longitude: ArrayLike = -20.0, formula: str = "teos-10") -> np.ndarray:
    """Return the sound speed of seawater from the quantities that a CTD measures.

    Parameters
    ----------
    temperature : array [deg C]
        In situ, ITS-90.
    salinity : array [-]
        Practical salinity.
    depth : array [m]
        Positive down.
    latitude, longitude : array [deg]
        Position: gravity changes the pressure at a depth, and the mix of salts differs between seas (together by less
        than 0.1 m/s). All arrays broadcast.
    formula : str
        Key of `FORMULAS`: "teos-10", "chen-millero", "mackenzie", "medwin" or "leroy-robinson-goldsmith".

    Returns
    -------
    array [m/s]
        Mackenzie's and Medwin's formulas ignore the position, Chen and Millero's and Leroy's the longitude.

    Raises
    ------
    ValueError
        If the formula is unknown, or a value is not finite, outside ``water.ranges.RANGES`` or outside the
        range of the formula (``water.ranges.SOUND_SPEED_RANGES``).

    Notes
    -----
    IOC, SCOR and IAPSO (2010), TEOS-10. Chen and Millero (1977), J. Acoust. Soc. Am. 62, 1129, with the coefficients
    of Wong and Zhu (1995), J. Acoust. Soc. Am. 97, 1732: 0..40 deg C, 0..40, to 1000 bar. Mackenzie (1981), J. Acoust.
    Soc. Am. 70, 807: -2..30 deg C, 30..40, to 8000 m, 0.07 m/s rms; not for brackish water. Medwin (1975), J. Acoust.
    Soc. Am. 58, 1318: 0..35 deg C, to 1000 m. Leroy, Robinson and Goldsmith (2008), J. Acoust. Soc. Am.
    124, 2774: -1..30 deg C, 0..42, within 0.2 m/s in all seas; it uses the latitude without sign, like gravity.
    From 2 to 30 deg C, 30 to 40 and down to 200 m, all agree within 0.5 m/s.

    Examples
    --------
    >>> [round(float(sound_speed(10, 35, 50, formula=name)), 2) for name in FORMULAS]
    [1490.61, 1490.66, 1490.62, 1490.79, 1490.63]
    """
    law = chosen("sound speed", formula, FORMULAS)
    return law(*checked(f"sound speed, {formula}", {**RANGES, **SOUND_SPEED_RANGES[formula]}, temperature=temperature,
                        salinity=salinity, depth=depth, latitude=latitude, longitude=longitude))
