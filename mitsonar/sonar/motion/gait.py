"""Gait of a swimming body: rigid parts that repeat a few poses with a period.

A part moves from its place in the first pose, v, to

    A(t) v + b(t),      b(t) = p(t) - A(t) p_0

by a rotation A, whose vector is joined by a periodic spline through those of the poses, about a joint p_0: the point
that moves least over the poses. Rotations are fitted to the parts' points (Kabsch 1976, Acta Cryst. A32, 922). Parts
are the pieces of a mesh that no face joins; pieces that move alike are one part.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mitsonar.device.rotations import NORTH_EAST_DOWN, attitude_of, rotation_matrix

from .trajectory import Trajectory

RIGID, ALIKE = 2e-3, 5e-4          # [m]: largest change of a part's form; of places of pieces that move alike
AT_REST = 1e-9                     # [m]


class Gait:
    """Periodic motion of a rigid part in the frame of its body."""

    def __init__(self, rotation: np.ndarray, moved: np.ndarray, about: np.ndarray, period: float):
        # rotation (K, 3, 3), moved (K, 3) [m]: A and b of the poses; about (3,) [m]: a point of the part
        from scipy.interpolate import CubicSpline
        from scipy.spatial.transform import Rotation

        turned = (rotation - np.eye(3)).reshape(-1, 3)
        off = (moved + (rotation - np.eye(3)) @ about).reshape(-1)
        self._joint = about + np.linalg.lstsq(turned, -off, rcond=1e-4)[0]
        values = np.concatenate([Rotation.from_matrix(rotation).as_rotvec(), rotation @ self._joint + moved], 1)
        phase = np.linspace(0, 1, len(values) + 1)
        self._curve, self._period = CubicSpline(phase, np.vstack([values, values[:1]]), bc_type="periodic"), period

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return A (..., 3, 3) and b (..., 3) [m] at times (...) [s]."""
        from scipy.spatial.transform import Rotation

        values = self._curve(np.asarray(times, float) / self._period % 1.0)
        rotation = Rotation.from_rotvec(values[..., :3].reshape(-1, 3)).as_matrix().reshape(*values.shape[:-1], 3, 3)
        return rotation, values[..., 3:] - rotation @ self._joint


@dataclass(frozen=True, kw_only=True, eq=False)
class Swung(Trajectory):
    """Trajectory of a part of a body that follows one."""

    gait: Gait

    @classmethod
    def of(cls, body: Trajectory, gait: Gait) -> Swung:
        """Return the trajectory of a part of a body."""
        return cls(lead=body.lead, motion=body.motion, offset=body.offset, tide=body.tide, gait=gait)

    def pose(self, times: np.ndarray, since: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Return position (..., 3) [m] and attitude (..., 3) [rad] of the part's frame; as `Trajectory.pose`."""
        position, attitude = super().pose(times, since)
        body = rotation_matrix(*np.moveaxis(attitude, -1, 0)) @ NORTH_EAST_DOWN
        rotation, moved = self.gait.at(times)
        turned = body @ rotation @ NORTH_EAST_DOWN.T
        return position + (body @ moved[..., None])[..., 0], attitude_of(turned)


@dataclass(frozen=True, kw_only=True, eq=False)
class RigidPart:
    """Part of a mesh that keeps its form in all poses."""

    vertices: np.ndarray  # (M,): numbers, rising
    gait: Gait | None  # None: it stays


def rigid_parts(poses: np.ndarray, faces: np.ndarray, period: float) -> Sequence[RigidPart]:
    """Return the parts of a mesh with faces (F, 3) in poses (K, V, 3) [m]; raise `ValueError` if a piece bends."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count = poses.shape[1]
    joined = coo_array((np.ones(2 * len(faces)), (faces[:, [0, 1]].ravel(), faces[:, [1, 2]].ravel())),
                       shape=(count, count))
    piece = connected_components(joined, directed=False)[1]
    found: list[tuple[np.ndarray, np.ndarray, list[np.ndarray]]] = []           # A, b and vertices of parts
    for number in np.argsort(-np.bincount(piece), kind="stable"):               # large ones first
        own = np.flatnonzero(piece == number)
        places = poses[:, own]
        for rotation, moved, parts in found:
            if np.abs(_placed(rotation, moved, places[0]) - places).max() < ALIKE:
                parts.append(own)
                break
        else:
            rotation, moved = _fitted(places)
            if (bent := float(np.abs(_placed(rotation, moved, places[0]) - places).max())) > RIGID:
                raise ValueError(f"a piece of the mesh with {len(own)} vertices changes its form by {1000 * bent:.3g} "
                                 "mm between poses; give limbs as pieces of their own, which keep their form.")
            found.append((rotation, moved, [own]))
    parts = []
    for rotation, moved, pieces in found:
        own = np.sort(np.concatenate(pieces))
        still = np.abs(poses[:, own] - poses[:1, own]).max() <= AT_REST
        parts.append(RigidPart(vertices=own, gait=None if still else Gait(
            rotation, moved, poses[0, own].mean(0), period)))
    return parts


def _placed(rotation: np.ndarray, moved: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return points (M, 3) in all poses (K, M, 3)."""
    return points @ np.swapaxes(rotation, 1, 2) + moved[:, None]


def _fitted(places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return A (K, 3, 3) and b (K, 3) that bring points of the first pose to places (K, M, 3)."""
    middle = places.mean(1, keepdims=True)
    spread = np.swapaxes(places - middle, 1, 2) @ (places[0] - middle[0])       # Σ w v^T
    left, _, right = np.linalg.svd(spread)
    left[..., 2] *= np.linalg.det(left @ right)[:, None]
    rotation = left @ right
    return rotation, middle[:, 0] - rotation @ middle[0, 0]
