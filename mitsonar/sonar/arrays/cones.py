"""Directions of beams from the steering angles of two line arrays: each angle is a cone about its array.

    l = α a_t + β a_r + γ (a_t x a_r)      a_t·l = u      a_r·l = v      with k = a_t·a_r:

    α = (u - k v) / (1 - k²)      β = (v - k u) / (1 - k²)      γ² = (1 - α u - β v) / (1 - k²)

a_t, a_r -> unit vectors along the transmit and the receive array; u, v -> sines of the steering angles, or the slowness
along the arrays times the sound speed. Of the two directions l, which are mirrored in the plane of the arrays, the one
on the lower side of that plane is meant.
"""
from __future__ import annotations

import numpy as np


def cone_directions(transmit: np.ndarray, receive: np.ndarray, transmit_sine: np.ndarray, receive_sine: np.ndarray,
                    least: float | None = None) -> np.ndarray:
    """Return the unit vectors (N, 3) in which two cones meet, in a frame whose third axis points down.

    Cones that do not meet give NaN, or with ``least`` the nearest direction with at least that γ.
    """
    # transmit, receive (3,) or (N, 3): unit vectors; transmit_sine, receive_sine (N,)
    cosine = (transmit * receive).sum(-1)
    square = 1 - cosine**2
    with np.errstate(invalid="ignore", divide="ignore"):
        first = (transmit_sine - cosine * receive_sine) / square
        second = (receive_sine - cosine * transmit_sine) / square
        third = (1 - first * transmit_sine - second * receive_sine) / square
        third = np.sqrt(third if least is None else np.maximum(third, least**2))
    normal = np.cross(transmit, receive)
    third = np.where(normal[..., 2] < 0, -third, third)
    found = first[..., None] * transmit + second[..., None] * receive + third[..., None] * normal
    return found / np.linalg.norm(found, axis=-1)[..., None]
