"""Bodies on a seabed, and their stable poses.

A body that falls on a hard floor ends on a face of its convex hull. It first lands on the face below its centre of
gravity, with a probability given by the solid angle of that face for random attitudes, and then rolls over edges until
the centre of gravity is above the face: the quasi-static estimate of Goldberg, Mirtich, Zhuang, Craig, Carlisle and
Canny, "Part pose statistics: estimators and experiments", IEEE Trans. Robotics and Automation 15 (1999) 849-857. The
centre of gravity is that of the hull with uniform density.
"""
from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from scipy.spatial import ConvexHull

_EDGE = 1e-9                       # of the body's size: tolerance of the centre of gravity beyond an edge


@dataclass(frozen=True, kw_only=True, eq=False)
class Body:
    """Closed mesh in its upright pose.

    Parameters
    ----------
    name : str
        Species.
    vertices : array (V, 3) [m]
        z up, front to the north (+y), any origin. Unused vertices are removed.
    faces : array (F, 3) of int
        Vertices of each face, oriented outwards.

    Raises
    ------
    ValueError
        If the mesh has no face, a face with an unknown vertex, a coordinate that is not finite, or no volume.
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
        used, faces = np.unique(faces, return_inverse=True)            # unused vertices would enlarge boxes and circles
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
        """Return the longest side of the bounding box [m]."""
        return float(np.ptp(self.vertices, axis=0).max())

    @cached_property
    def hull(self) -> ConvexHull:
        """Return the convex hull."""
        from scipy.spatial import ConvexHull

        return ConvexHull(self.vertices)

    @cached_property
    def outline(self) -> np.ndarray:
        """Return the vertices of the hull (N, 3) [m], which determine the extent in every direction."""
        return self.hull.points[self.hull.vertices]

    @cached_property
    def rest_poses(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the stable poses as rotations (P, 3, 3), and their probabilities (P,)."""
        corners = self.hull.points[self.hull.simplices]                # (S, 3 corners, 3)
        outwards = self.hull.equations[:, :3]
        middle = self.hull.points.mean(axis=0)
        volume = np.abs(np.linalg.det(corners - middle))               # six times that of tetrahedra below the faces
        gravity = np.average((corners.sum(axis=1) + middle) / 4, axis=0, weights=volume)
        edges = np.cross(np.roll(corners, -1, axis=1) - corners, outwards[:, None]) \
            * np.sign(np.einsum("si,si->s", np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]),
                                outwards))[:, None, None]              # in the face, normal to its edges, outwards
        edges /= np.maximum(np.linalg.norm(edges, axis=2, keepdims=True), 1e-300)
        beyond = np.einsum("sei,sei->se", gravity - corners, edges)    # [m] of the foot point beyond each edge
        worst = beyond.argmax(axis=1)                                  # edge e is opposite corner e + 2
        rolled = self.hull.neighbors[np.arange(len(worst)), (worst + 2) % 3]
        end = np.where(beyond.max(axis=1) > _EDGE * self.size, rolled, np.arange(len(worst)))
        for _ in range(len(end).bit_length()):
            end = end[end]                                             # doubles the number of rolls
        probability = np.bincount(end, weights=_solid_angle(corners - gravity), minlength=len(end)) / (4 * np.pi)
        rests = np.flatnonzero(probability > 1e-9)
        return (np.array([turn_onto(-outwards[face], (0, 0, 1)) for face in rests]),
                probability[rests] / probability[rests].sum())


def turn_onto(start: ArrayLike, end: ArrayLike) -> np.ndarray:
    """Return the smallest rotation (3, 3) of a unit vector onto another."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    cosine = start @ end
    if cosine < -1 + 1e-12:                                            # half a turn about any normal axis
        across = np.eye(3)[np.argmin(np.abs(start))]
        across = across - (across @ start) * start
        across /= np.linalg.norm(across)
        return 2 * np.outer(across, across) - np.eye(3)
    x, y, z = np.cross(start, end)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + cross + cross @ cross / (1 + cosine)


def _solid_angle(corners: np.ndarray) -> np.ndarray:
    """Return the solid angle [sr] of triangles (S, 3, 3) from the origin (Van Oosterom and Strackee 1983)."""
    a, b, c = (corners / np.linalg.norm(corners, axis=2, keepdims=True)).transpose(1, 0, 2)
    dots = [np.einsum("si,si->s", *pair) for pair in ((a, b), (b, c), (c, a))]
    return 2 * np.arctan2(np.abs(np.einsum("si,si->s", a, np.cross(b, c))), 1 + sum(dots))
