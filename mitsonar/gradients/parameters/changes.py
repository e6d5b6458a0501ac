"""Replace a parameter by other numbers: heights of a mesh, the pose of an object, decibels, nodes, an offset.

    y = g(x),    dy = G dx,    Gᵀ w                      `BoundChange.inner`, `.push`, `.pull`

y -> the parameter of the model; x -> the numbers that replace it. Vertices, or the transform of a shape, that move and
turn as one:

    v' = c + t + R (v - c)              of vertices v (V, 3)
    A' = R A,  o' = c + t + R (o - c)   of a transform (4, 4) with the columns A and the origin o
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mitsonar.device.rotations import vector_rotation

from .node_weights import node_weights


class RigidChange:
    """Move and turn vertices, or a transform, as one body."""
    # start (V, 3) [m]; centre (3,) [m]

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
        """Return the vectors (N, 3) of an array: vertices, or three columns and the origin."""
        return array[:3].T if self._matrix else array

    def array(self, rows: np.ndarray, *, tangent: bool = False) -> np.ndarray:
        """Return the array of vectors (N, 3); the last row of a transform's tangent is zero."""
        return np.vstack([rows.T, (0, 0, 0, 0.0 if tangent else 1.0)]) if self._matrix else rows

    def arms(self, rotation: np.ndarray) -> np.ndarray:
        """Return R (v - c) and R A, (N, 3)."""
        return self._arms @ rotation.T

    def moved(self, rotation: np.ndarray, shift: np.ndarray) -> np.ndarray:
        """Return the array after rotation and shift."""
        return self.array(self.arms(rotation) + self.carried * (self.centre + shift))


DECIBELS = 10 / np.log(10)


@dataclass(frozen=True, kw_only=True, eq=False)
class BoundChange:
    """Hold a change of one parameter."""

    name: str  # of x
    unit: str
    start: np.ndarray  # x at the start of the model
    inner: Callable[[np.ndarray], np.ndarray]  # y of x
    push: Callable[[np.ndarray, np.ndarray], np.ndarray]  # G dx of x and dx
    pull: Callable[[np.ndarray, np.ndarray], np.ndarray]  # Gᵀ w of x and w


class Change(Protocol):
    """Replacement of the parameter with a name by other numbers.

    Attributes
    ----------
    key : str
        Name of the parameter.
    """

    @property
    def key(self) -> str: ...

    def bound(self, start: np.ndarray, unit: str) -> BoundChange:
        """Return the change for a parameter with these start values and unit.

        Raises
        ------
        ValueError
            If the parameter is not of the kind that the change needs.
        """
        ...


@dataclass(frozen=True)
class Heights:
    """Heights z (V,) [m] of the vertices of a mesh with x and y fixed: ``bed.vertex_positions`` as ``bed.heights``."""

    key: str

    def bound(self, start: np.ndarray, unit: str) -> BoundChange:
        """Return the change for vertices (V, 3); see `Change.bound`."""
        _check_vertices(self.key, start)

        def inner(x: np.ndarray) -> np.ndarray:
            return np.column_stack([start[:, :2], x])

        def push(x: np.ndarray, dx: np.ndarray) -> np.ndarray:
            return np.column_stack([np.zeros((len(dx), 2)), dx])

        def pull(x: np.ndarray, weights: np.ndarray) -> np.ndarray:
            return weights[:, 2]

        return BoundChange(name=_sibling(self.key, "heights"), unit=unit, start=start[:, 2].copy(), inner=inner,
                           push=push, pull=pull)


@dataclass(frozen=True)
class Pose:
    """Six numbers of a rigid object: displacement east, north, up [m], and a rotation vector [rad], about its centre.

    ``crate.vertex_positions`` or ``ball.to_world`` as ``crate.pose`` and ``ball.pose``, zeros at the start. The centre
    is that of the box around the vertices, or the origin of a transform. The rotation vector points along the axis, in
    scene coordinates, and its length is the angle.
    """

    key: str

    def bound(self, start: np.ndarray, unit: str) -> BoundChange:
        """Return the change for vertices (V, 3) or a transform (4, 4); see `Change.bound`."""
        body = RigidChange(self.key, start)

        def inner(x: np.ndarray) -> np.ndarray:
            return body.moved(vector_rotation(x[3:])[0], x[:3])

        def push(x: np.ndarray, dx: np.ndarray) -> np.ndarray:
            rotation, jacobian = vector_rotation(x[3:])
            turned = np.cross(jacobian @ dx[3:], body.arms(rotation))
            return body.array(body.carried * dx[:3] + turned, tangent=True)

        def pull(x: np.ndarray, weights: np.ndarray) -> np.ndarray:
            forces, (rotation, jacobian) = body.rows(weights), vector_rotation(x[3:])
            moment = np.cross(body.arms(rotation), forces).sum(0)
            return np.concatenate([(body.carried * forces).sum(0), jacobian.T @ moment])

        return BoundChange(name=_sibling(self.key, "pose"), unit="m, rad", start=np.zeros(6), inner=inner, push=push,
                           pull=pull)


@dataclass(frozen=True)
class InDecibels:
    """Parameter above zero as 10 log y [dB]: ``mu`` as ``mu_in_db``."""

    key: str

    def bound(self, start: np.ndarray, unit: str) -> BoundChange:
        """Return the change for a parameter above zero; see `Change.bound`."""
        return _logarithm(self.key, start, f"{self.key}_in_db", f"dB re 1 {unit}" if unit not in ("", "1") else "dB",
                          DECIBELS)


@dataclass(frozen=True)
class Log:
    """Parameter above zero as ln y: ``mu`` as ``mu_log``."""

    key: str

    def bound(self, start: np.ndarray, unit: str) -> BoundChange:
        """Return the change for a parameter above zero; see `Change.bound`."""
        return _logarithm(self.key, start, f"{self.key}_log", "Np", 1.0)


@dataclass(frozen=True)
class Offset:
    """Number that is added to all of a parameter: ``bed.heights`` as ``bed.heights_offset``, 0 at the start."""

    key: str
    by_column: bool = False  # one number for each column

    def bound(self, start: np.ndarray, unit: str) -> BoundChange:
        """Return the change for any parameter, or one with columns; see `Change.bound`."""
        if self.by_column and start.ndim != 2:
            raise ValueError(f"{self.key} has the shape {start.shape}, and no columns; leave by_column out")
        count = start.shape[1] if self.by_column else 1

        def inner(x: np.ndarray) -> np.ndarray:
            return start + (x if self.by_column else x[0])

        def push(x: np.ndarray, dx: np.ndarray) -> np.ndarray:
            return np.zeros_like(start) + (dx if self.by_column else dx[0])

        def pull(x: np.ndarray, weights: np.ndarray) -> np.ndarray:
            return weights.sum(0) if self.by_column else np.array([weights.sum()])

        return BoundChange(name=f"{self.key}_offset", unit=unit, start=np.zeros(count), inner=inner, push=push,
                           pull=pull)


@dataclass(frozen=True, kw_only=True, eq=False)
class OnNodes:
    """Add to a parameter what a grid of fewer nodes holds: ``bed.heights`` as ``bed.heights_nodes``, 0 at first."""

    key: str
    places: np.ndarray  # [m]: where the parameter's numbers lie, in their order
    spacing: float  # [m]: between nodes
    cubic: bool = False  # cubic B-splines, which are smooth to the second derivative, instead of linear weights

    def bound(self, start: np.ndarray, unit: str) -> BoundChange:
        """Return the change for a parameter with one number per place; see `Change.bound`."""
        places = np.asarray(self.places, float)
        if places.ndim != 2 or len(places) != start.size:
            raise ValueError(f"{self.key} has {start.size} numbers, and its places the shape {places.shape}; give one "
                             "place for each")
        weights, shape = node_weights(places, self.spacing, self.cubic)

        def inner(x: np.ndarray) -> np.ndarray:
            return start + (weights @ x.ravel()).reshape(start.shape)

        def push(x: np.ndarray, dx: np.ndarray) -> np.ndarray:
            return (weights @ dx.ravel()).reshape(start.shape)

        def pull(x: np.ndarray, cotangent: np.ndarray) -> np.ndarray:
            return (weights.T @ cotangent.ravel()).reshape(shape)

        return BoundChange(name=f"{self.key}_nodes", unit=unit, start=np.zeros(shape), inner=inner, push=push,
                           pull=pull)


def _logarithm(key: str, start: np.ndarray, name: str, unit: str, scale: float) -> BoundChange:
    """Return the change x = scale ln y."""
    if not (start > 0).all():
        raise ValueError(f"{key} has numbers that are not above zero, and they have no logarithm")

    def inner(x: np.ndarray) -> np.ndarray:
        return np.exp(x / scale)

    def push(x: np.ndarray, dx: np.ndarray) -> np.ndarray:
        return inner(x) / scale * dx

    return BoundChange(name=name, unit=unit, start=scale * np.log(start), inner=inner, push=push, pull=push)


def _sibling(key: str, name: str) -> str:
    """Return the name of another parameter of the same object."""
    owner, dot, _ = key.rpartition(".")
    return f"{owner}{dot}{name}"


def _check_vertices(key: str, start: np.ndarray) -> None:
    if start.ndim != 2 or start.shape[1] != 3:
        raise ValueError(f"{key} has the shape {start.shape}, and is not the vertices (V, 3) of a mesh; give the name "
                         "of its vertex_positions")
