"""Lines of a scene along which the energy of directions jumps, and how they move with its meshes.

    edge       of a mesh, from corner a to corner b:    dx = (1 - s) dx_a + s dx_b
    meeting    of two meshes that pass through each other, in the planes of two facets:    n_i·dx = n_i·dx_i

s -> the place along the line, 0 to 1; n_i -> normals of the facets, dx_i -> how the facet's point moves that lies
there. What a line's motion along itself is, makes no difference.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..scene.geometry import Geometry
from .mesh_edges import MeshEdges, edges_of
from .mesh_meetings import meetings

__all__ = ["JumpLines", "LineMaker"]


@dataclass(frozen=True, kw_only=True)
class JumpLines:
    """Lines, the edges first.

    Attributes
    ----------
    ends : (L, 2, 3) float32 [m]
    faces : (L, 2) uint32
        Rows in `Geometry.faces` of the facets on either side, or that meet; `NO_FACE` where there is none.
    corners : (L, 2) uint32
        Rows in `Geometry.vertices` of an edge's ends.
    smooth : (L,) bool
        Whether folds there show no facets.
    edges : int
        How many are edges; the others are meetings, of which `corners` means nothing.
    """

    ends: np.ndarray
    faces: np.ndarray
    corners: np.ndarray
    smooth: np.ndarray
    edges: int


class LineMaker:
    """Find the lines that move with some of a scene's meshes, as they are now.

    Edges are paired once: which facets a mesh has stays as it is.

    Parameters
    ----------
    geometry : Geometry
    meshes : sequence of int
        Numbers in `Geometry.meshes` of those that move.
    """

    def __init__(self, geometry: Geometry, meshes: list[int]):
        self._meshes = meshes
        self._edges: MeshEdges = edges_of(geometry, meshes)

    def lines(self, geometry: Geometry) -> JumpLines:
        """Give the lines of the same scene, whose vertices may have moved."""
        vertices = geometry.vertices.numpy().reshape(-1, 4)[:, :3]
        ends, faces = meetings(geometry, self._meshes)
        corners = self._edges.corners
        return JumpLines(ends=np.concatenate([vertices[corners], ends]), edges=len(corners),
                         faces=np.concatenate([self._edges.faces, faces]),
                         smooth=np.concatenate([self._edges.smooth, np.zeros(len(faces), bool)]),
                         corners=np.concatenate([corners, np.zeros((len(faces), 2), np.uint32)]))
