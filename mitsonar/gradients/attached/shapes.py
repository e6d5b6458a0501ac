"""Attach spheres, cylinders, disks and rectangles to their ``to_world``, which moves, turns and scales them.

    x = A x_o + t                       to_world; x_o on the unit shape of Mitsuba
    dx = dA x_o + dt                    of the material point that was hit
    n = cof(A) n_o / |cof(A) n_o|,      cof(A) = (b x c, c x a, a x b),  A = (a, b, c)

n_o -> the normal of the unit shape: x_o of a sphere, (x_o, y_o, 0) of a cylinder from z_o = 0 to 1, (0, 0, 1) of a disk
or a rectangle. A point that slides over the surface has another x_o, and so another normal and other texture
coordinates. A sphere has only a centre and a radius, which is that of its volume, r³ = |det A|.
"""
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import upload
from mitsonar.scene.geometry import Geometry

from .ray_shift import tangent

SPHERE, CYLINDER, DISK, RECTANGLE = 1, 2, 3, 4
KINDS = {"Sphere": SPHERE, "Cylinder": CYLINDER, "Disk": DISK, "Rectangle": RECTANGLE}
LEAST_VOLUME = 1e-12               # [m³] of a unit cube by to_world: less has no inverse


def kind_of(shape: mi.Shape) -> int:
    """Return the kind of a shape that its ``to_world`` moves, or 0."""
    return KINDS.get(shape.class_name(), 0)


def as_taken(kind: int, matrix: np.ndarray, name: str) -> np.ndarray:
    """Return the matrix (4, 4) that a shape uses: for a sphere, one that scales all axes alike."""
    volume = np.linalg.det(matrix[:3, :3])
    if not np.allclose(matrix[3], (0, 0, 0, 1), atol=1e-6):
        raise ValueError(f"{name} has the last row {matrix[3].tolist()}; give 0, 0, 0, 1")
    if not abs(volume) > LEAST_VOLUME:
        raise ValueError(f"{name} has no inverse: its shape would have no extent; give scales other than 0")
    if kind != SPHERE:
        return matrix
    left, _, right = np.linalg.svd(matrix[:3, :3])
    taken = matrix.copy()
    taken[:3, :3] = np.cbrt(abs(volume)) * left @ right
    return taken


@dataclass(frozen=True, kw_only=True)
class OnShapes:
    """Hold kinds and transforms of the shapes that points lie on."""

    kind: mi.UInt32  # (R,): 0 of points on nothing that is known here
    columns: tuple[mi.Vector3f, mi.Vector3f, mi.Vector3f, mi.Vector3f]  # (R,): a, b, c, t

    @property
    def known(self) -> mi.Bool:
        """True for points on shapes of these kinds."""
        return self.kind != 0

    def motion(self, point: mi.Vector3f) -> mi.Vector3f:
        """Return dx of the material there: 0, with gradients."""
        a, b, c, t = self.columns
        with dr.suspend_grad():
            still = dr.detach(a), dr.detach(b), dr.detach(c), dr.detach(t)
            on_unit = _on_unit(*still, dr.detach(point))
        dx = tangent(a * on_unit.x + b * on_unit.y + c * on_unit.z + t)
        return dr.select(self.known, dx, 0)

    def normal(self, point: mi.Vector3f) -> mi.Vector3f:
        """Return unit normals at attached points, on either side."""
        a, b, c, t = self.columns
        on_unit = _on_unit(a, b, c, t, point)
        flat, round_ = self.kind >= DISK, self.kind == SPHERE
        n = mi.Vector3f(dr.select(flat, 0, on_unit.x), dr.select(flat, 0, on_unit.y),
                        dr.select(flat, 1, dr.select(round_, on_unit.z, 0)))
        across = dr.cross(b, c) * n.x + dr.cross(c, a) * n.y + dr.cross(a, b) * n.z
        there = self.known & (dr.squared_norm(dr.detach(across)) > 0)
        return dr.normalize(dr.select(there, across, mi.Vector3f(0, 0, 1)))

    def texture(self, point: mi.Vector3f) -> mi.Point2f:
        """Return texture coordinates at attached points, up to whole turns."""
        on_unit = _on_unit(*self.columns, point)
        x, y, z = on_unit.x, on_unit.y, on_unit.z
        off = dr.maximum(dr.square(dr.detach(x)) + dr.square(dr.detach(y)), 1e-8)
        # of an angle the derivative alone, which has no jump
        turn = tangent((dr.detach(x) * y - dr.detach(y) * x) / (dr.two_pi * off))
        along = tangent((dr.detach(x) * x + dr.detach(y) * y) * dr.rsqrt(off))
        steep = dr.sqrt(off)
        upright = tangent(steep * -z + dr.detach(z) * along) / dr.pi                         # of acos z, |x_o| = 1
        return mi.Point2f(
            dr.select(self.kind == DISK, along, dr.select(self.kind == RECTANGLE, tangent(0.5 * x), turn)),
            dr.select(self.kind == DISK, turn, dr.select(self.kind == RECTANGLE, tangent(0.5 * y), dr.select(
                self.kind == SPHERE, upright, tangent(z)))))


class AttachedShapes:
    """Hold a scene's spheres, cylinders, disks and rectangles with gradients; `names` by registry index."""

    def __init__(self, geometry: Geometry):
        known = [(number, shape) for number, shape in geometry.others if kind_of(shape)]
        rows = max((number for number, _ in known), default=-1) + 1
        kinds, tables = np.zeros(max(rows, 1), np.uint32), np.zeros((max(rows, 1), 12), np.float32)
        attached = []
        for number, shape in known:
            parameters = mi.traverse(shape)
            matrix = parameters["to_world"].matrix
            kinds[number] = kind_of(shape)
            tables[number] = as_taken(kind_of(shape), _numpy(matrix), f"{shape.id()}.to_world")[:3].T.ravel()
            if dr.grad_enabled(matrix):
                attached.append((number, matrix))
        self.names = {number: shape.id() or shape.class_name().lower() for number, shape in known}
        self.numbers, self.moving = [number for number, _ in known], [number for number, _ in attached]
        self._rows, self._kinds = len(kinds), upload(mi.UInt32, kinds)
        self._table = upload(mi.Float, tables.ravel())
        if attached:
            moved = dr.zeros(mi.Float, 12 * self._rows)
            for number, matrix in attached:
                for entry, value in enumerate(_entries(matrix, int(kinds[number]))):
                    dr.scatter(moved, value, mi.UInt32(12 * number + entry))
            self._table = dr.replace_grad(self._table, moved)
        self.kinds = {number: int(kinds[number]) for number in self.numbers}
        self.matrices = {number: tables[number].reshape(4, 3).T.astype(float) for number in self.numbers}

    def on(self, number: mi.UInt32, active: mi.Bool) -> OnShapes:
        """Return kinds and transforms by registry indices (R,)."""
        active = active & (number < self._rows)
        kind = dr.gather(mi.UInt32, self._kinds, number, active)
        entries = [dr.gather(mi.Float, self._table, 12 * number + k, active) for k in range(12)]
        a, b, c, t = (mi.Vector3f(*entries[3 * k:3 * k + 3]) for k in range(4))
        return OnShapes(kind=kind, columns=(a, b, c, t))


def _on_unit(a: mi.Vector3f, b: mi.Vector3f, c: mi.Vector3f, t: mi.Vector3f, point: mi.Vector3f) -> mi.Vector3f:
    """Return x_o of points."""
    normals = dr.cross(b, c), dr.cross(c, a), dr.cross(a, b)
    volume = dr.dot(a, normals[0])
    there = dr.detach(volume) != 0
    per_volume = dr.select(there, dr.rcp(dr.select(there, volume, 1)), 0)
    away = point - t
    return mi.Vector3f(*(dr.dot(normal, away) * per_volume for normal in normals))


def _entries(matrix: Any, kind: int) -> list[mi.Float]:
    """Return a matrix with gradients, column by column, as the shape uses it."""
    columns = [mi.Vector3f(*(matrix[row, column] for row in range(3))) for column in range(4)]
    if kind == SPHERE:
        volume = dr.dot(columns[0], dr.cross(columns[1], columns[2]))
        # r / r_0 to first order
        grows = 1 + tangent(volume) / (3 * dr.detach(volume))
        columns[:3] = [dr.detach(column) * grows for column in columns[:3]]
    return [column[row] for column in columns for row in range(3)]


def _numpy(matrix: Any) -> np.ndarray:
    return np.array(dr.detach(matrix), float).reshape(4, 4)
