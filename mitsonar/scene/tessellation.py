"""Facets for Mitsuba's shapes without any: rectangle, disk, cylinder and sphere, as grids over their two parameters.

    rectangle    s = (x + 1)/2,  t = (y + 1)/2             disk        s = r,       t = φ/2π
    cylinder     s = φ/2π,       t = z                     sphere      s = φ/2π,    t = θ/π

Here x, y, z are in the shape's own frame, where radii and lengths are 1. A quad (i, j) of the grid is two facets,
(a, b, c) and (a, c, d), with a at (i, j), b at (i + 1, j), c at (i + 1, j + 1), d at (i, j + 1). Corners lie on the
true surface, facets up to a sagitta below it: l²/8R for a facet of length l on a radius R.
"""
from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, upload

if TYPE_CHECKING:
    from mitsonar.device.types import Vector64

FINEST_SAGITTA = 2e-4              # [m] that a point may lie below its own surface and not be in its shadow (`LIFT`)
FEWEST = 12                        # facets round a circle of any size
MOST = 1 << 24                     # facets of a shape
KINDS = {"Rectangle": 1, "Disk": 2, "Cylinder": 3, "Sphere": 4}


@dataclass(frozen=True, kw_only=True)
class SurfaceGrid:
    """Facets of one shape."""

    vertices: np.ndarray  # (V, 3) [m]
    normals: np.ndarray  # (V, 3): unit, of the true surface
    texcoords: np.ndarray  # (V, 2)
    faces: np.ndarray  # (F, 3)
    kind: int  # of KINDS
    size: tuple[int, int]  # quads along s and t
    to_object: np.ndarray  # (3, 4): from the scene to the shape's own frame


def grid_of(shape: mi.Shape, sagitta: float = FINEST_SAGITTA) -> SurfaceGrid:
    """Cut a shape into facets that lie at most a sagitta [m] below it."""
    kind = KINDS.get(shape.class_name())
    if kind is None:
        raise ValueError(f"the shape \"{shape.id()}\" is of the kind {shape.class_name().lower()}, which has no facets "
                         "to carry fixed scatterers; use a mesh (ply, obj) in its place")
    parameters = mi.traverse(shape)
    matrix = parameters["to_world"].matrix
    # entry by entry: the whole would compile a kernel, another one for every matrix
    to_world = np.array([[matrix[row, column][0] for column in range(4)] for row in range(4)], float)
    axes = np.linalg.norm(to_world[:3, :3], axis=0)
    radius = axes[:2].max()
    # over the diagonal of a sphere's quad the sagittas of both sides add up
    edge = np.sqrt((4 if kind == KINDS["Sphere"] else 8) * radius * min(sagitta, radius))
    # one quad along a cylinder would do, but long thin facets would be cut into longer, thinner ones
    around, along = max(FEWEST, int(np.ceil(2 * np.pi * radius / edge))), int(np.ceil(axes[2] / edge))
    size = {1: (1, 1), 2: (int(np.ceil(radius / edge)), around), 3: (around, along), 4: (around, -(-around // 2))}[kind]
    if 2 * size[0] * size[1] > MOST:
        raise ValueError(f"the shape \"{shape.id()}\" is so large that it needs more than {MOST} facets to lie within "
                         f"{1e3 * sagitta:g} mm of it; use a mesh (ply, obj) in its place")
    s, t = np.meshgrid(np.linspace(0, 1, size[0] + 1), np.linspace(0, 1, size[1] + 1), indexing="ij")
    point, normal = _surface(kind, s, t)
    number = np.arange(s.size).reshape(s.shape)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    faces = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], 2).reshape(-1, 3)
    to_object = np.linalg.inv(to_world)
    normal = normal.reshape(-1, 3) @ to_object[:3, :3]                  # inverse transpose
    return SurfaceGrid(vertices=point.reshape(-1, 3) @ to_world[:3, :3].T + to_world[:3, 3],
                       normals=normal / np.linalg.norm(normal, axis=1, keepdims=True), faces=faces.astype(np.uint32),
                       texcoords=np.stack([s, t], -1).reshape(-1, 2), kind=kind, size=size, to_object=to_object[:3])


def _surface(kind, s, t):
    """Return points and normals in the shape's own frame."""
    zero, one = np.zeros_like(s), np.ones_like(s)
    turn = 2 * np.pi * (t if kind == KINDS["Disk"] else s)
    x, y = np.cos(turn), np.sin(turn)
    if kind == KINDS["Rectangle"]:
        point, normal = (2 * s - 1, 2 * t - 1, zero), (zero, zero, one)
    elif kind == KINDS["Disk"]:
        point, normal = (s * x, s * y, zero), (zero, zero, one)
    elif kind == KINDS["Cylinder"]:
        point, normal = (x, y, t), (x, y, zero)
    else:
        sine = np.sin(np.pi * t)
        point = normal = (sine * x, sine * y, np.cos(np.pi * t))
    return np.stack(point, -1), np.stack(normal, -1)


class Grids:
    """Look-up of the facet that a point of a shape lies in, on the device."""

    def __init__(self, rows: list[tuple[int, SurfaceGrid, int]], size: int):
        self.lib = arrays_of(mi.Float)
        size = max([size, *(index + 1 for index, *_ in rows)])
        table, to_object = np.zeros((size, 4), np.uint32), np.zeros((size, 3, 4))
        for index, grid, first in rows:
            table[index] = first, grid.kind, *grid.size
            to_object[index] = grid.to_object
        self._table, self._to_object = upload(mi.UInt32, table), upload(mi.Float64, to_object)
        dr.eval(self._table, self._to_object)

    def first_of(self, registry: mi.UInt32, point: Vector64, active: mi.Bool) -> tuple[mi.UInt32, mi.Bool]:
        """Return the first facet of the quad that points (R,) lie in, and if their shape has a grid."""
        lib = self.lib
        row = dr.gather(lib.Array4u, self._table, registry, active)
        rows = [dr.gather(lib.Array4f64, self._to_object, 3 * registry + i, active) for i in range(3)]
        x, y, z = (mi.Float(r[0] * point.x + r[1] * point.y + r[2] * point.z + r[3]) for r in rows)
        across = dr.sqrt(x * x + y * y)
        turn = dr.atan2(y, x) * float(0.5 / np.pi)
        turn = dr.select(turn < 0, turn + 1, turn)
        kind = row[1]
        s = dr.select(kind == 1, 0.5 * (x + 1), dr.select(kind == 2, across, turn))
        t = dr.select(kind == 1, 0.5 * (y + 1), dr.select(kind == 2, turn, dr.select(
            kind == 3, z, dr.atan2(across, z) * float(1 / np.pi))))
        i, j = (dr.minimum(mi.UInt32(dr.maximum(place, 0) * mi.Float(n)), n - dr.minimum(n, 1))
                for place, n in ((s, row[2]), (t, row[3])))
        return row[0] + 2 * (i * row[3] + j), active & (kind != 0)
