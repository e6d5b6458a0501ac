"""What stands behind every bin of a picture: whose echo it is, and what is not heard because something is in the way.

    share_l = k_j E_jl + C_j P_jl / Σ_l P_jl,   over their sum                           of each instance l
    hidden = Σ_l k_j H_jl / (Σ_l k_j H_jl + k_j B_j)                                     of the seabed's echo

E_jl echo intensity of instance l in bin j and k_j the pulse's gate, as in `imaging.sidescan`; C coherent intensity, which
is shared out as the powers P of the instances' own sums, for what they interfere belongs to none; B what the seabed
sends directly, H what it would send from where instance l stands in front of it.
"""
import numpy as np

from .sidescan import mean_intensity

__all__ = ["shadows", "shares"]

HALF = 0.5


def shares(intensity, gate, coherent_power=None, coherent_intensity=None):
    """Share of every instance in the bins' energy.

    Parameters
    ----------
    intensity : (..., L, bins) [µPa²]
        E.
    gate : array
        As `sidescan.pulse_shares` gives it.
    coherent_power : (..., L, bins) or None
        P, in any unit.
    coherent_intensity : (..., bins) [µPa²] or None
        C.

    Returns
    -------
    (..., L, bins) float32
        Adds to 1 over L, or is 0 where nothing is heard.
    """
    total = mean_intensity(np.asarray(intensity, float), gate)
    if coherent_power is not None:
        power = mean_intensity(np.asarray(coherent_power, float), gate)
        whole = power.sum(-2, keepdims=True)
        total = total + np.where(whole > 0, power / np.where(whole > 0, whole, 1), 0) * coherent_intensity[..., None, :]
    whole = total.sum(-2, keepdims=True)
    return np.where(whole > 0, total / np.where(whole > 0, whole, 1), 0).astype(np.float32)


def shadows(hidden_intensity, seabed_intensity, intensity, gate):
    """Share of the seabed's echo that objects hide, and whose shadow a bin lies in.

    Parameters
    ----------
    hidden_intensity : (..., L, bins) [µPa²]
        H.
    seabed_intensity : (..., bins) [µPa²]
        B.
    intensity : (..., bins) [µPa²]
        Of all echoes, but for those with a phase.
    gate : array
        As `sidescan.pulse_shares` gives it.

    Returns
    -------
    hidden : (..., bins) float32
    object_shadow : (..., bins) uint32
        Number of the instance, from 1, that hides most, where its shadow is; else 0.
    """
    by_object = mean_intensity(np.asarray(hidden_intensity, float), gate)
    lost = by_object.sum(-2)
    total = lost + mean_intensity(np.asarray(seabed_intensity, float), gate)
    hidden = np.where(total > 0, lost / np.where(total > 0, total, 1), 0).astype(np.float32)
    dark = (hidden > HALF) & (mean_intensity(np.asarray(intensity, float), gate) < HALF * total)
    return hidden, np.where(dark, by_object.argmax(-2) + 1, 0).astype(np.uint32)
