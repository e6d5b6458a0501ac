"""Backscattering by finite cylinders: modes of an infinite cylinder, integrated over the length.

    f = (i L / π) (sin Δ / Δ) Σ_n ε_n B_n* cos nφ,     Δ = k L sin θ,    backwards φ = π                       [m]

L -> ``length``, a -> ``radius`` [m], k = 2πf / c, θ -> ``tilt`` off broadside, ε_0 = 1, else ε_n = 2; with
K = k cos θ, B_n is -J_n'(Ka) / H_n'(Ka) of a rigid and -J_n(Ka) / H_n(Ka) of a soft cylinder (T. K. Stanton, 1988,
J. Acoust. Soc. Am. 83, 55). The ends are left out, so L >> a and tilts up to about 30 degrees are valid.
"""
from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import h1vp, hankel1, jv, jvp

LARGEST_KA = 10_000.0


def cylinder_form(radius: float, length: float, frequency: ArrayLike, sound_speed: float = 1500.0, *,
                  tilt: ArrayLike = 0.0, surface: Literal["rigid", "soft"] = "rigid") -> np.ndarray:
    """Return the backscattering form function f of a cylinder, with the phase of its centre.

    Parameters
    ----------
    radius, length : float [m]
    frequency : array [Hz]
    sound_speed : float [m/s]
    tilt : array [rad]
        Angle from broadside, below π/2; broadcast with `frequency`.
    surface : {"rigid", "soft"}

    Returns
    -------
    complex array [m]
        Form function for time e^(+iωt), as in `sphere_series.sphere_form`; 20 log |f| is the target strength.

    Raises
    ------
    ValueError
        If the surface is unknown, or ka is not above 0 and up to LARGEST_KA.
    """
    if surface not in ("rigid", "soft"):
        raise ValueError(f"cylinders are rigid or soft, got the surface \"{surface}\".")
    frequency, tilt = np.broadcast_arrays(np.asarray(frequency, float), np.asarray(tilt, float))
    wavenumber = 2 * np.pi * frequency / sound_speed
    across = np.atleast_1d(wavenumber * radius * np.cos(tilt))
    if not (across.size and np.all((across > 0) & (across <= LARGEST_KA))):
        raise ValueError(f"cylinders are computed for ka cos θ above 0 and up to {LARGEST_KA:g}; give a radius and "
                         "frequencies above 0 and tilts within 90 degrees of broadside.")
    highest = float(np.max(across))
    n = np.arange(int(highest + 5 * np.cbrt(highest) + 10) + 1).reshape(-1, *np.ones(across.ndim, int))
    with np.errstate(invalid="ignore", over="ignore"):
        mode = -jvp(n, across) / h1vp(n, across) if surface == "rigid" else -jv(n, across) / hankel1(n, across)
    mode = np.where(np.isfinite(mode), mode, 0)
    total = np.sum(np.where(n == 0, 1, 2) * (-1.0) ** n * np.conj(mode), axis=0).reshape(wavenumber.shape)
    lobe = np.sinc(wavenumber * length * np.sin(tilt) / np.pi)
    return (1j * length / np.pi * lobe * total)[()]
