"""Axes of ROS: the one place where frames are converted.

    map          x east, y north, z up: the scene's own frame                   (REP 103: ENU)
    base_link    x forward, y port, z up                                        (REP 103: FLU)
    sonar        z along the middle of the beams, x and y across, as `marine_acoustic_msgs` has it

The body of mitsonar has x forward, y starboard, z down: F = diag(1, -1, -1) turns the one into the other, both ways.
The sonar's x is up and its y starboard for beams ahead; for beams below, x is forward and y starboard. REP 103: Foote
and Purvis, Standard units of measure and coordinate conventions, 2010.
"""
from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from mitsonar.device.rotations import attitude_of, rotation_matrix

FLIP = np.array([1.0, -1.0, -1.0])                     # the diagonal of F
# columns x, y, z of the sonar's frame in the body's
AHEAD = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
BELOW = np.eye(3)


def flu(vectors: np.ndarray) -> np.ndarray:
    """Return vectors (..., 3) forward, port, up from those forward, starboard, down; and back."""
    return np.asarray(vectors, float) * FLIP


def quaternions(attitude: np.ndarray) -> np.ndarray:
    """Return the rotations (P, 4) from base_link to map, as x, y, z, w, of roll, pitch and heading (P, 3) [rad]."""
    return Rotation.from_matrix(rotation_matrix(*np.transpose(attitude)) * FLIP).as_quat()


def attitudes(quaternion: np.ndarray) -> np.ndarray:
    """Return roll, pitch and heading (P, 3) [rad] of rotations (P, 4) from base_link to map: undoes `quaternions`."""
    return attitude_of(Rotation.from_quat(quaternion).as_matrix() * FLIP)


def mounting_quaternion(frame: np.ndarray) -> np.ndarray:
    """Return the rotation (4,) from the sonar's frame to base_link, of columns (3, 3) in the body's frame."""
    return Rotation.from_matrix(FLIP[:, None] * frame).as_quat()


def in_sonar(directions: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """Return directions (..., 3) of the body in the sonar's frame."""
    return np.asarray(directions, float) @ frame


def velocities(time: np.ndarray, position: np.ndarray, quaternion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return linear [m/s] and angular [rad/s] velocities (P, 3) in base_link, by differences of neighbouring poses."""
    turn = Rotation.from_quat(quaternion)
    linear = turn.inv().apply(np.gradient(position, time, axis=0))
    first, last = np.maximum(np.arange(time.size) - 1, 0), np.minimum(np.arange(time.size) + 1, time.size - 1)
    angular = (turn[first].inv() * turn[last]).as_rotvec() / (time[last] - time[first])[:, None]
    return linear, angular
