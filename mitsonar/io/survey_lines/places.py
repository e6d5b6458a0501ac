"""Convert attitudes and lever arms between sensor, vessel and level, and distances on the track to places.

Offsets of soundings from their ping are not multiplied by the scale of the line's zone (0.9996 to 1.0010): distances of
a record are metres, as those of a scene. Headings are clockwise from grid north, so that x and y follow from them.
"""
from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mitsonar.device.rotations import mounted, mounting_angles, mounting_matrix


def levelled(offset: np.ndarray, roll: ArrayLike, pitch: ArrayLike) -> np.ndarray:
    """Return lever arms (..., 3) of the body as forward, starboard and down of the levelled vessel."""
    return mounted(offset, np.asarray(roll), np.asarray(pitch))


def from_sensor(roll: np.ndarray, pitch: np.ndarray, heading: np.ndarray,
                mounting: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the vessel's roll, pitch and heading from those of a sensor and its mounting (roll, pitch, heading)."""
    if heading.size == 0 or not np.any(mounting):
        return roll, pitch, heading
    vessel = mounting_matrix(roll, pitch, heading) @ mounting_matrix(*mounting).T
    roll, pitch, heading = mounting_angles(vessel).T
    return roll, pitch, heading


def straight(mounting: np.ndarray) -> tuple[np.ndarray, bool]:
    """Return the mounting (roll, pitch, heading) of an array with its cable turned aft, and True if it left forward.

    An array turned by half a circle about its normal is the same array with forward and starboard exchanged for aft and
    port: Rz(h) Ry(p) Rx(r) Rz(180) = Rz(h + 180) Ry(-p) Rx(-r).
    """
    roll, pitch, heading = mounting
    heading = np.remainder(heading + np.pi, 2 * np.pi) - np.pi
    if abs(heading) <= np.pi / 2:
        return np.array([roll, pitch, heading]), False
    return np.array([-roll, -pitch, heading - np.copysign(np.pi, heading)]), True


def across_and_along(x: ArrayLike, y: ArrayLike, heading: ArrayLike, across: np.ndarray,
                     along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return x and y of points at distances across and along track from a position."""
    sine, cosine = np.sin(heading), np.cos(heading)
    return x + along * sine + across * cosine, y + along * cosine - across * sine
