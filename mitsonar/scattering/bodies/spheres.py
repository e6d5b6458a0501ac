"""Exact target strength of rigid and soft spheres: 20 log |f| of `sphere_series` in backscatter.

For ka >> 1 it tends to 20 log (a/2), a -> ``radius`` [m].
"""
from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from .sphere_series import SphereBody, sphere_form


def sphere_target_strength_db(radius: float, frequency: ArrayLike, sound_speed: float = 1500.0, *,
                              surface: Literal["rigid", "soft"] = "rigid") -> np.ndarray:
    """Return the target strength of a sphere whose surface is rigid or soft.

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
        If the surface is unknown, or ka is out of the range of `sphere_series`.
    """
    if surface not in ("rigid", "soft"):
        raise ValueError(f"spheres are rigid or soft, got the surface \"{surface}\"")
    form = sphere_form(radius, frequency, sound_speed, body=SphereBody(inside=surface))
    return 20 * np.log10(np.abs(form))
