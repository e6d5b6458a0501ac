"""Find edges of meshes: lines at which the hit of a ray jumps, outlines or folds between two facets.

Corners at the same place count as one, also where a mesh holds a corner once for each facet's normal.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsonar.scene.geometry import Geometry

NO_FACE = 0xFFFFFFFF               # in place of a facet


@dataclass(frozen=True, kw_only=True)
class MeshEdges:
    """Hold edges of a scene's meshes."""

    corners: np.ndarray  # (L, 2): rows in `Geometry.vertices`
    faces: np.ndarray  # (L, 2): rows in `Geometry.faces` of the facets on either side
    smooth: np.ndarray  # (L,): True for meshes with interpolated normals


def mesh_edges(vertices: np.ndarray, faces: np.ndarray, smooth: bool = False) -> MeshEdges:
    """Return the edges of one mesh with vertices (V, 3) [m] and faces (F, 3)."""
    found = _paired(faces, smooth)
    rim = np.unique(found.corners[found.faces[:, 1] == NO_FACE])
    if not len(rim):
        return found
    one = np.arange(len(vertices))
    _, first, which = np.unique(vertices[rim], axis=0, return_index=True, return_inverse=True)
    one[rim] = rim[first[which.ravel()]]
    return _paired(one[faces], smooth)


def _paired(faces: np.ndarray, smooth: bool) -> MeshEdges:
    """Return edges by the numbers of their corners."""
    ends = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64), 1)
    face = np.repeat(np.arange(len(faces)), 3)
    there = ends[:, 0] != ends[:, 1]
    ends, face = ends[there], face[there]
    order = np.lexsort((face, ends[:, 1], ends[:, 0]))
    ends, face = ends[order], face[order]
    new = np.r_[True, np.any(np.diff(ends, axis=0) != 0, 1)] if len(ends) else np.zeros(0, bool)
    first = np.flatnonzero(new)
    second = np.full(len(first), NO_FACE, np.uint32)
    after = np.minimum(first + 1, len(ends) - 1)
    shared = (after > first) & ~new[after]
    second[shared] = face[after[shared]]
    return MeshEdges(corners=ends[first].astype(np.uint32), smooth=np.full(len(first), smooth),
                     faces=np.stack([face[first].astype(np.uint32), second], 1))


def edges_of(geometry: Geometry, meshes: list[int]) -> MeshEdges:
    """Return the edges of some of a scene's meshes, by their numbers in `Geometry.meshes`."""
    vertices, faces = geometry.vertices.numpy().reshape(-1, 4)[:, :3], geometry.faces.numpy().reshape(-1, 4)[:, :3]
    corners, sides, smooth = [np.zeros((0, 2), np.uint32)], [np.zeros((0, 2), np.uint32)], [np.zeros(0, bool)]
    for number in meshes:
        _, shape, first, count = geometry.meshes[number]
        base = geometry.first_vertices[number]
        own = faces[first:first + count] - np.uint32(base)
        found = mesh_edges(vertices[base:base + int(own.max(initial=0)) + 1], own, geometry.is_smooth(shape))
        smooth.append(found.smooth)
        corners.append(found.corners + np.uint32(base))
        sides.append(np.where(found.faces == NO_FACE, np.uint32(NO_FACE), found.faces + np.uint32(first)))
    return MeshEdges(corners=np.concatenate(corners), faces=np.concatenate(sides),
                     smooth=np.concatenate(smooth))
