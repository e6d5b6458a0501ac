"""Find lines of a scene along which the energy of directions jumps, and their motion with its meshes.

    edge       of a mesh, from corner a to corner b:    dx = (1 - s) dx_a + s dx_b
    meeting    of two meshes that pass through each other, in the planes of two facets:    n_i·dx = n_i·dx_i

s -> the place along the line, 0 to 1; n_i -> normals of the facets, dx_i -> motion of the facet's point there. Motion
of a line along itself has no effect. A box that lies in the mud, for example, meets the bed along its outline.

Two triangles in planes n_1·x = d_1 and n_2·x = d_2 have the common line x_0 + u t, t = n_1 x n_2. Each covers an
interval of u, between the places where its sides cross the other's plane; they meet where the intervals overlap
(Möller 1997, A fast triangle-triangle intersection test, Journal of Graphics Tools 2).
"""
from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mitsonar.scene.geometry import Geometry

from .mesh_edges import MeshEdges, edges_of

MOST_PAIRS = 1 << 20               # of facets, looked at together


def meetings(geometry: Geometry, meshes: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Return ends (L, 2, 3) [m] and faces (L, 2) of the lines where some of a scene's meshes meet others."""
    vertices, corners = geometry.vertices.numpy().reshape(-1, 4)[:, :3], geometry.faces.numpy().reshape(-1, 4)[:, :3]
    ends, faces = [np.zeros((0, 2, 3), np.float32)], [np.zeros((0, 2), np.uint32)]
    boxes = {}
    for number, (_, _, first, count) in enumerate(geometry.meshes):
        triangles = vertices[corners[first:first + count]]
        boxes[number] = triangles.min(1), triangles.max(1)
    for one in range(len(geometry.meshes)):
        for other in range(one):
            if one in meshes or other in meshes:
                first, second = geometry.meshes[one][2], geometry.meshes[other][2]
                for i, j in _overlaps(boxes[one], boxes[other]):
                    i, j = i + first, j + second
                    met, where = triangles_meet(vertices[corners[i]].astype(float), vertices[corners[j]].astype(float))
                    ends.append(where[met].astype(np.float32))
                    faces.append(np.stack([i[met], j[met]], 1).astype(np.uint32))
    return np.concatenate(ends), np.concatenate(faces)


def _overlaps(one: tuple[np.ndarray, np.ndarray],
              other: tuple[np.ndarray, np.ndarray]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield pairs of facets whose boxes overlap, in blocks."""
    low, high = np.maximum(one[0].min(0), other[0].min(0)), np.minimum(one[1].max(0), other[1].max(0))
    if np.any(low > high):
        return
    near = [np.flatnonzero(np.all((box[0] <= high) & (box[1] >= low), 1)) for box in (one, other)]
    step = max(1, MOST_PAIRS // max(len(near[1]), 1))
    for start in range(0, len(near[0]), step):
        some = near[0][start:start + step]
        apart = np.zeros((len(some), len(near[1])), bool)
        for axis in range(3):
            apart |= one[0][some, None, axis] > other[1][None, near[1], axis]
            apart |= one[1][some, None, axis] < other[0][None, near[1], axis]
        i, j = np.nonzero(~apart)
        if len(i):
            yield some[i], near[1][j]


def triangles_meet(one: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which pairs of triangles (N, 3, 3) [m] meet, (N,), and the ends (N, 2, 3) [m] of their common lines."""
    normals = [np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]) for t in (one, other)]
    along = np.cross(normals[0], normals[1])
    square = np.einsum("nk,nk->n", along, along)
    sizes = np.prod([np.einsum("nk,nk->n", n, n) for n in normals], axis=0)
    tilted = square > 1e-12 * sizes
    along = along / np.sqrt(np.where(tilted, square, 1))[:, None]
    low, high = np.full(len(one), -np.inf), np.full(len(one), np.inf)
    crossed, base = tilted.copy(), np.zeros((len(one), 3))
    for k, (triangle, normal, point) in enumerate(((one, normals[1], other[:, 0]), (other, normals[0], one[:, 0]))):
        height = np.einsum("nk,njk->nj", normal, triangle - point[:, None])
        begin, end, there = _crossing(triangle, height)
        crossed &= there
        if k == 0:
            base = begin
        places = np.sort([np.einsum("nk,nk->n", along, p - base) for p in (begin, end)], 0)
        low, high = np.maximum(low, places[0]), np.minimum(high, places[1])
    met = crossed & (high > low)
    ends = base[:, None] + np.stack([np.where(met, low, 0), np.where(met, high, 0)], 1)[..., None] * along[:, None]
    return met, ends


def _crossing(triangle: np.ndarray, height: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the points where two sides of triangles cross height 0, and True if they do."""
    above = height >= 0
    count = above.sum(1)
    there = (count > 0) & (count < 3)
    alone = np.where(count == 1, np.argmax(above, 1), np.argmin(above, 1))
    row = np.arange(len(triangle))
    ends = []
    for step in (1, 2):
        next_one = (alone + step) % 3
        drop = height[row, alone] - height[row, next_one]
        share = np.where(there, height[row, alone] / np.where(there, drop, 1), 0)
        ends.append(triangle[row, alone] + share[:, None] * (triangle[row, next_one] - triangle[row, alone]))
    return ends[0], ends[1], there


@dataclass(frozen=True, kw_only=True)
class JumpLines:
    """Hold lines, the edges first."""

    ends: np.ndarray  # (L, 2, 3) [m]
    faces: np.ndarray  # (L, 2): rows in `Geometry.faces` of the facets on either side, or that meet
    corners: np.ndarray  # (L, 2): rows in `Geometry.vertices` of an edge's ends
    smooth: np.ndarray  # (L,): True where folds show no facets
    edges: int  # number of edges


class LineMaker:
    """Find the present lines that move with some of a scene's meshes; edges are paired once."""

    def __init__(self, geometry: Geometry, meshes: list[int]):
        self._meshes = meshes
        self._edges: MeshEdges = edges_of(geometry, meshes)

    def lines(self, geometry: Geometry) -> JumpLines:
        """Return the lines of the same scene, whose vertices may have moved."""
        vertices = geometry.vertices.numpy().reshape(-1, 4)[:, :3]
        ends, faces = meetings(geometry, self._meshes)
        corners = self._edges.corners
        return JumpLines(ends=np.concatenate([vertices[corners], ends]), edges=len(corners),
                         faces=np.concatenate([self._edges.faces, faces]),
                         smooth=np.concatenate([self._edges.smooth, np.zeros(len(faces), bool)]),
                         corners=np.concatenate([corners, np.zeros((len(faces), 2), np.uint32)]))
