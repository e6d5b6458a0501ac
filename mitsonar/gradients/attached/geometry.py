"""Attach corners of facets, and interpolated normals, to the arrays of their meshes.

The numbers are those of `scene.geometry.Geometry`, to the last bit; only gradients come from here. Normals at nodes are
those of `scene.vertex_normals`,

    n_v = Σ_f α_fv n_f / |Σ_f α_fv n_f|

Tables that carry gradients are float64. Threads add to a gradient in any order: in float32 sums would differ by 3e-6
from run to run, and a fit, whose least squares magnify such differences, by some per cent.
"""
from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from mitsonar.device.arrays import arrays_of
from mitsonar.scene.geometry import Geometry, between_corners

from .shapes import AttachedShapes


class AttachedGeometry:
    """Hold a scene's facets with gradients."""

    def __init__(self, geometry: Geometry):
        geometry.refuse_bodies("gradients need")
        self.vertices: Any = geometry.vertices
        self.normals: Any = geometry.normals
        self.texcoords: Any = geometry.texcoords
        meshes = [(first, shape, mi.traverse(shape)["vertex_positions"])
                  for first, (_, shape, *_) in zip(geometry.first_vertices, geometry.meshes)]
        moving = [(first, shape, positions) for first, shape, positions in meshes if dr.grad_enabled(positions)]
        shapes = AttachedShapes(geometry)
        self.shapes, self.textured = shapes if shapes.numbers else None, bool(geometry.textured)
        self.attached = bool(moving or shapes.moving)
        if not moving:
            return
        vertices = dr.zeros(mi.Float64, dr.width(geometry.vertices))
        normals = None if geometry.normals is None else dr.zeros(mi.Float64, dr.width(geometry.normals))
        for first, shape, positions in moving:
            positions = mi.Float64(positions)
            _put(vertices, positions, first)
            if normals is not None and geometry.is_smooth(shape):
                _put(normals, _normals(positions, mi.traverse(shape)["faces"]), first)
        self.vertices = dr.replace_grad(mi.Float64(geometry.vertices), vertices)
        if normals is not None:
            self.normals = dr.replace_grad(mi.Float64(geometry.normals), normals)

    def vertex(self, index: mi.UInt32, active: mi.Bool | bool = True) -> mi.Vector3f:
        """Return the positions of vertices."""
        return _row(self.vertices, index, active)

    def normal(self, face: Any, u: mi.Float, v: mi.Float, active: mi.Bool) -> mi.Vector3f:
        """Return the normals of facets (four-wide rows) at barycentric (u, v); see `scene.geometry.interpolated`."""
        return between_corners([_row(self.normals, face[i], active) for i in range(3)], u, v)


def _row(table: mi.Float | mi.Float64, index: mi.UInt32, active: mi.Bool | bool) -> mi.Vector3f:
    lib = arrays_of(mi.Float)
    row = dr.gather(lib.Array4f64 if isinstance(table, mi.Float64) else lib.Array4f, table, index, active)
    return mi.Vector3f(row[0], row[1], row[2])


def _put(table: mi.Float64, values: mi.Float64, first: int) -> None:
    """Write consecutive vectors of three to rows of four, from a first row on."""
    number = dr.arange(mi.UInt32, dr.width(values))
    dr.scatter(table, values, 4 * (number // 3 + first) + number % 3)


def _normals(positions: mi.Float64, faces: mi.UInt32) -> mi.Float64:
    """Return the normals at nodes, flat (x, y, z)."""
    lib = arrays_of(mi.Float)
    count = dr.width(faces) // 3
    corner = dr.gather(lib.Array3u, faces, dr.arange(mi.UInt32, count))
    points = [dr.gather(mi.Vector3d, positions, corner[i]) for i in range(3)]
    total = dr.zeros(mi.Vector3d, dr.width(positions) // 3)
    for i in range(3):
        ahead, back = points[(i + 1) % 3] - points[i], points[(i + 2) % 3] - points[i]
        across = dr.cross(ahead, back)
        twice_area = dr.norm(across)
        there = twice_area > 0
        area = dr.select(there, twice_area, 1)
        share = dr.select(there, dr.atan2(area, dr.dot(ahead, back)) / area, 0)
        dr.scatter_add(total, across * share, corner[i])
    there = dr.squared_norm(total) > 0
    normals: Any = dr.ravel(dr.select(there, dr.normalize(dr.select(there, total, mi.Vector3d(0, 0, 1))), 0))
    return normals
