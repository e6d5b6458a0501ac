"""Rotations by vectors, and how they change with them.

    R(θ) = exp [θ],     d(R p) = (J dθ) × (R p),     J = I + (1 - cos φ)/φ² [θ] + (φ - sin φ)/φ³ [θ]²

φ -> the length of θ, J -> its left Jacobian (Chirikjian, 2012, Stochastic Models, Information Theory, and Lie Groups 2,
eq. 10.86).
"""
from __future__ import annotations

import numpy as np

__all__ = ["left_jacobian", "rotation"]

SMALL = 1e-4                       # rad, below which series are better than quotients


def rotation(vector: np.ndarray) -> np.ndarray:
    """Give the matrix (3, 3) of a rotation vector (3,) [rad]."""
    angle, cross = float(np.linalg.norm(vector)), _cross(vector)
    first, second = (np.sinc(angle / np.pi), 0.5 * np.sinc(angle / (2 * np.pi)) ** 2)
    return np.eye(3) + first * cross + second * cross @ cross


def left_jacobian(vector: np.ndarray) -> np.ndarray:
    """Give J (3, 3) of a rotation vector (3,) [rad]."""
    angle, cross = float(np.linalg.norm(vector)), _cross(vector)
    first = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    second = 1 / 6 - angle ** 2 / 120 if angle < SMALL else (angle - np.sin(angle)) / angle ** 3
    return np.eye(3) + first * cross + second * cross @ cross


def _cross(vector: np.ndarray) -> np.ndarray:
    """[θ], the matrix that takes p to θ × p."""
    x, y, z = vector
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
