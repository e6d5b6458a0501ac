"""Bodies that can lie on a seabed, and the poses in which they come to rest.

A body that falls on a hard floor ends on a face of its convex hull. It meets the floor first with the face that a line
from its centre of gravity down passes through, as often as the solid angle of that face says where all attitudes are
alike, and rolls on over an edge as long as the centre of gravity is not above the face: the quasi-static estimate of
Goldberg, Mirtich, Zhuang, Craig, Carlisle and Canny, "Part pose statistics: estimators and experiments", IEEE Trans.
Robotics and Automation 15 (1999) 849-857. The centre of gravity is that of the hull filled evenly.
"""
from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from scipy.spatial import ConvexHull

_EDGE = 1e-9                       # of the body's size: a foot this far over an edge still counts as on the face


@dataclass(frozen=True, kw_only=True, eq=False)
class Body:
    """A closed mesh that stands upright as it is.

    Parameters
    ----------
    name : str
        Species.
    vertices : array (V, 3) [m]
        z up, the front to the north (+y), the origin anywhere. Those that no face uses are left out.
    faces : array (F, 3) of int
        Looking outwards.

    Raises
    ------
    ValueError
        If there is no face, a face without a vertex, a coordinate that is not finite, or no volume.
    """

    name: str
    vertices: np.ndarray
    faces: np.ndarray

    def __post_init__(self):
        from scipy.spatial import QhullError

        vertices, faces = np.asarray(self.vertices, float).reshape(-1, 3), np.asarray(self.faces).reshape(-1, 3)
        if len(faces) == 0:
            raise ValueError(f"the mesh {self.name} has no faces; give a closed body")
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise ValueError(f"the mesh {self.name} names vertex {faces.max()} of {len(vertices)}; export it again")
        used, faces = np.unique(faces, return_inverse=True)            # a stray vertex would widen boxes and circles
        object.__setattr__(self, "vertices", vertices[used])
        object.__setattr__(self, "faces", faces.reshape(-1, 3))
        if not np.isfinite(self.vertices).all():
            raise ValueError(f"the mesh {self.name} has vertices that are not finite numbers; export it again")
        try:
            _ = self.hull
        except QhullError:
            raise ValueError(f"the mesh {self.name} lies in a plane; give a closed body that holds a volume") from None

    @cached_property
    def size(self) -> float:
        """Longest side of the bounding box [m]."""
        return float(np.ptp(self.vertices, axis=0).max())

    @cached_property
    def hull(self) -> ConvexHull:
        """The convex hull, a ``scipy.spatial.ConvexHull``."""
        from scipy.spatial import ConvexHull

        return ConvexHull(self.vertices)

    @cached_property
    def outline(self) -> np.ndarray:
        """Vertices of the hull, (N, 3) [m]: no other one reaches farther in any direction."""
        return self.hull.points[self.hull.vertices]

    @cached_property
    def rest_poses(self) -> tuple[np.ndarray, np.ndarray]:
        """Poses of rest: rotations (P, 3, 3) that turn each down, and how often each comes about (P,)."""
        corners = self.hull.points[self.hull.simplices]                # (S, 3 corners, 3)
        outwards = self.hull.equations[:, :3]
        middle = self.hull.points.mean(axis=0)
        volume = np.abs(np.linalg.det(corners - middle))               # of the tetrahedra below the faces, six times
        gravity = np.average((corners.sum(axis=1) + middle) / 4, axis=0, weights=volume)
        edges = np.cross(np.roll(corners, -1, axis=1) - corners, outwards[:, None]) \
            * np.sign(np.einsum("si,si->s", np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]),
                                outwards))[:, None, None]              # in the face, at right angles to its edges, out
        edges /= np.maximum(np.linalg.norm(edges, axis=2, keepdims=True), 1e-300)
        beyond = np.einsum("sei,sei->se", gravity - corners, edges)    # [m] of the foot over each edge
        worst = beyond.argmax(axis=1)                                  # edge e faces corner e + 2
        rolled = self.hull.neighbors[np.arange(len(worst)), (worst + 2) % 3]
        end = np.where(beyond.max(axis=1) > _EDGE * self.size, rolled, np.arange(len(worst)))
        for _ in range(len(end).bit_length()):
            end = end[end]                                             # twice as many rolls
        often = np.bincount(end, weights=_solid_angle(corners - gravity), minlength=len(end)) / (4 * np.pi)
        rests = np.flatnonzero(often > 1e-9)
        return np.array([turn_onto(-outwards[face], (0, 0, 1)) for face in rests]), often[rests] / often[rests].sum()


def turn_onto(start: ArrayLike, end: ArrayLike) -> np.ndarray:
    """Return the least rotation (3, 3) that turns one unit vector into another."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    cosine = start @ end
    if cosine < -1 + 1e-12:                                            # half a turn, about any axis across
        across = np.eye(3)[np.argmin(np.abs(start))]
        across = across - (across @ start) * start
        across /= np.linalg.norm(across)
        return 2 * np.outer(across, across) - np.eye(3)
    x, y, z = np.cross(start, end)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + cross + cross @ cross / (1 + cosine)


def _solid_angle(corners: np.ndarray) -> np.ndarray:
    """Solid angle [sr] of triangles (S, 3, 3) seen from the origin (Van Oosterom and Strackee 1983)."""
    a, b, c = (corners / np.linalg.norm(corners, axis=2, keepdims=True)).transpose(1, 0, 2)
    dots = [np.einsum("si,si->s", *pair) for pair in ((a, b), (b, c), (c, a))]
    return 2 * np.arctan2(np.abs(np.einsum("si,si->s", a, np.cross(b, c))), 1 + sum(dots))
