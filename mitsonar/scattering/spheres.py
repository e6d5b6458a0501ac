"""Target strength of spheres, exactly: the series over spherical waves.

    k f = Σ_n (2n + 1) (-1)^n A_n,    A_n = -j_n'(ka) / h_n'(ka)  rigid,    -j_n(ka) / h_n(ka)  soft

a -> ``radius`` [m], k = 2πf / c; j and h spherical Bessel and Hankel functions (V. C. Anderson, 1950, J. Acoust. Soc.
Am. 22, 426). For ka >> 1 it tends to 20 log (a/2).
"""
from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import spherical_jn, spherical_yn

__all__ = ["sphere_target_strength_db"]


def sphere_target_strength_db(radius: float, frequency: ArrayLike, sound_speed: float = 1500.0, *,
                              surface: Literal["rigid", "soft"] = "rigid") -> np.ndarray:
    """Give the target strength of a sphere whose surface is rigid or soft.

    Parameters
    ----------
    radius : float [m]
    frequency : array (...) [Hz]
    sound_speed : float [m/s]
    surface : str
        "rigid" or "soft".

    Returns
    -------
    array (...) [dB re 1 m²]

    Raises
    ------
    ValueError
        If the surface is neither.
    """
    if surface not in ("rigid", "soft"):
        raise ValueError(f"spheres are rigid or soft, got the surface \"{surface}\"")
    wavenumber = 2 * np.pi * np.asarray(frequency, float) / sound_speed
    ka = np.atleast_1d(wavenumber * radius)
    terms = int(np.max(ka) + 5 * np.cbrt(np.max(ka)) + 10)         # the rest is below 1e-12
    n = np.arange(terms + 1)[:, None]
    derivative = surface == "rigid"
    j, y = spherical_jn(n, ka, derivative), spherical_yn(n, ka, derivative)
    with np.errstate(over="ignore", invalid="ignore"):
        ratio = np.where(np.isfinite(y), -j / (j + 1j * np.where(np.isfinite(y), y, 1)), 0)
    length = np.sum((2 * n + 1) * (-1.0) ** n * ratio, axis=0) / np.atleast_1d(wavenumber)
    return (20 * np.log10(np.abs(length))).reshape(np.shape(wavenumber))[()]
