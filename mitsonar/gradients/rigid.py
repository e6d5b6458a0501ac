"""Vertices, or the transform of a shape, that move and turn as one.

    v' = c + t + R (v - c)              of vertices v (V, 3)
    A' = R A,  o' = c + t + R (o - c)   of a transform (4, 4) with the columns A and the origin o
"""
from __future__ import annotations

import numpy as np

__all__ = ["Rigid"]


class Rigid:
    """What moves as one.

    Parameters
    ----------
    key : str
    start : (V, 3) or (4, 4) [m]

    Attributes
    ----------
    centre : (3,) [m]
        c: the middle of the box around vertices; the origin of a transform, which is the middle of a sphere, disk or
        rectangle and the foot of a cylinder.

    Raises
    ------
    ValueError
        If it is neither.
    """

    def __init__(self, key: str, start: np.ndarray):
        self._matrix = start.shape == (4, 4)
        if not self._matrix and (start.ndim != 2 or start.shape[1] != 3):
            raise ValueError(f"{key} has the shape {start.shape}, and is not the vertices (V, 3) of a mesh, nor the "
                             "to_world (4, 4) of a shape; give the key of a mesh's vertices, or of a to_world")
        rows = self.rows(start)
        self.carried = np.array([[0.0], [0], [0], [1]]) if self._matrix else np.ones((len(rows), 1))
        self.centre = rows[3] if self._matrix else (rows.min(0) + rows.max(0)) / 2
        self._arms = rows - self.carried * self.centre

    def rows(self, array: np.ndarray) -> np.ndarray:
        """The vectors (N, 3) of an array: vertices, or three columns and the origin."""
        return array[:3].T if self._matrix else array

    def array(self, rows: np.ndarray, *, tangent: bool = False) -> np.ndarray:
        """The array of vectors (N, 3); of a tangent the last row of a transform stands still."""
        return np.vstack([rows.T, (0, 0, 0, 0.0 if tangent else 1.0)]) if self._matrix else rows

    def arms(self, rotation: np.ndarray) -> np.ndarray:
        """R (v - c) and R A, (N, 3)."""
        return self._arms @ rotation.T

    def moved(self, rotation: np.ndarray, shift: np.ndarray) -> np.ndarray:
        """The array, moved and turned."""
        return self.array(self.arms(rotation) + self.carried * (self.centre + shift))
