"""Directions in the body frame (x forward, y starboard, z down), by name, as a vector or as two angles.

    û = (cos δ cos α, cos δ sin α, sin δ)

α -> ``azimuth`` from the bow, positive to starboard; δ -> ``depression`` below the horizontal, both [rad].
"""
from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mitsonar.device.spelling import meant

AXES = {"forward": (1.0, 0.0, 0.0), "aft": (-1.0, 0.0, 0.0), "starboard": (0.0, 1.0, 0.0), "port": (0.0, -1.0, 0.0),
        "down": (0.0, 0.0, 1.0), "up": (0.0, 0.0, -1.0)}
PARALLEL = 1e-6                    # sine of the angle below which two directions count as one


def body_direction(azimuth: ArrayLike, depression: ArrayLike) -> np.ndarray:
    """Make the unit vector of an azimuth and a depression angle.

    Parameters
    ----------
    azimuth : array (...) [rad]
        From the bow, positive to starboard.
    depression : array (...) [rad]
        Below the horizontal of the body.

    Returns
    -------
    array (..., 3) [-]
        In the body frame.

    Examples
    --------
    >>> body_direction(np.pi / 2, 0.0).round(12)
    array([0., 1., 0.])
    """
    azimuth, depression = np.broadcast_arrays(azimuth, depression)
    level = np.cos(depression)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(depression)], axis=-1)


def axis_vector(name: str, axis: str | ArrayLike) -> np.ndarray:
    """Make a unit vector of one of `AXES` or of any vector."""
    # axis (3,) -> (3,) [-]
    if isinstance(axis, str):
        if axis not in AXES:
            raise ValueError(f'{name} is "{axis}"{meant(axis, AXES)}; give one of {", ".join(AXES)} or a vector '
                             "(forward, starboard, down).")
        return np.array(AXES[axis])
    try:
        vector = np.array(axis, dtype=np.float64)
    except (TypeError, ValueError):
        vector = np.empty(0)
    if vector.shape != (3,) or not np.isfinite(vector).all() or not vector.any():
        raise ValueError(f"{name} is {axis}; give three finite numbers (forward, starboard, down), not all zero, or "
                         f"one of {', '.join(AXES)}.")
    return vector / np.linalg.norm(vector)


def across(normal: np.ndarray, towards: ArrayLike) -> np.ndarray:
    """Return the unit component of a direction that is perpendicular to other directions."""
    # normal (..., 3) [-]; towards (3,) [-] -> (..., 3) [-]
    part = normal                  # nothing found yet: shares no direction with what is wanted
    found = np.zeros(normal.shape[:-1] + (1,), dtype=bool)
    for candidate in (towards, AXES["forward"], AXES["starboard"]):
        rest = candidate - np.sum(normal * candidate, axis=-1, keepdims=True) * normal
        size = np.linalg.norm(rest, axis=-1, keepdims=True)
        new = ~found & (size > PARALLEL)
        part = np.where(new, rest / np.where(new, size, 1.0), part)
        found |= new
    return part
