"""Stones of many shapes: rounded ones with bumps of every size, and angular ones broken along planes.

    rounded   radius(w) = (|wx/a|^m + |wy/b|^m + |wz/c|^m)^(-1/m) (1 + sum over n of s_n sin(k_n . w + phase_n))
    angular   convex hull of random points, its edges chamfered, its faces roughened

w -> direction; a >= b >= c -> half axes. Stones are a metre long, so that a factor of size is a length in metres.
m -> 2 (ellipsoid) to 3 (blocky); k_n -> 2 to 16 rad, s_n -> at most 0.24 / |k_n|, so that bumps of all sizes are about
equally steep. The ratios b/a and c/b are uniform from 0.5 to 0.95, on both sides of the border 2/3 between the four
classes of Zingg (1935): spheres, discs, rods and blades all occur.

References
----------
Zingg (1935), Beitrag zur Schotteranalyse, Schweiz. Mineral. Petrogr. Mitt. 15, 39.
"""
from __future__ import annotations

from functools import lru_cache

import numpy as np

from .bodies import Body

KINDS = "rounded_stone", "angular_stone"
PER_KIND = 24
_NODES = 322                       # of a rounded stone: 640 faces
_CORNERS = 17, 23                  # of an angular stone before its edges are chamfered, from and to
_CHAMFER = 0.1, 0.22               # of the way from a corner to the middle of a face, from and to
_ROUGH = 0.07                      # of the length of the shortest edge there: rms of the roughness of broken faces


@lru_cache
def stones(kind: str) -> tuple[Body, ...]:
    """Return the stones of a kind: closed bodies about a metre long, lying on their longest sides."""
    make = {"rounded_stone": _rounded, "angular_stone": _angular}[kind]
    return tuple(_lying(kind, make(np.random.default_rng([KINDS.index(kind), number]))) for number in range(PER_KIND))


def _rounded(generator: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    way = _even_directions(_NODES)
    power = generator.uniform(2, 3)
    radius = (np.abs(way / _half_axes(generator)) ** power).sum(axis=1) ** (-1 / power)
    for wave in (2, 3, 4, 6, 8, 11, 16):
        bump = np.sin(way @ _direction(generator) * wave + generator.uniform(0, 2 * np.pi))
        radius *= 1 + 0.12 * 2 / wave * generator.uniform(0.3, 1) * bump
    faces, _ = _hull(way)                                              # star-shaped: as the sphere's
    return way * radius[:, None], faces


def _angular(generator: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    # points of random radius on even directions: large flat faces, few of them alike
    way = _even_directions(int(generator.integers(*_CORNERS, endpoint=True)))
    way = way + 0.25 * generator.standard_normal(way.shape)
    corners = way / np.linalg.norm(way, axis=1, keepdims=True) * generator.uniform(0.85, 1.0, (len(way), 1))
    corners *= _half_axes(generator)
    faces, _ = _hull(corners)
    middle = corners[faces].mean(axis=1, keepdims=True)
    chamfer = generator.uniform(*_CHAMFER, (len(faces), 1, 1))
    cut = (corners[faces] + chamfer * (middle - corners[faces])).reshape(-1, 3)
    faces, used = _hull(cut)
    vertices, faces = _halved(cut[used], faces)
    rough = _ROUGH * _shortest_edges(vertices, faces) * generator.standard_normal(len(vertices))
    return vertices * (1 + rough / np.linalg.norm(vertices, axis=1))[:, None], faces


def _lying(kind: str, mesh: tuple[np.ndarray, np.ndarray]) -> Body:
    """Return a stone of the length 1 m, its middle over the origin and its lowest point on z = 0."""
    vertices, faces = mesh
    vertices = vertices / np.ptp(vertices, axis=0).max()
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    return Body(name=kind, vertices=vertices - (*(low + high)[:2] / 2, low[2]), faces=faces)


def _half_axes(generator: np.random.Generator) -> np.ndarray:
    """Return half axes (x, y, z) [m]: the longest to the north, the shortest upwards."""
    intermediate, short = np.cumprod(generator.uniform(0.5, 0.95, 2))
    return 0.5 * np.array([intermediate, 1.0, short])


def _direction(generator: np.random.Generator) -> np.ndarray:
    way = generator.standard_normal(3)
    return way / np.linalg.norm(way)


def _even_directions(count: int) -> np.ndarray:
    """Return unit vectors (N, 3) that cover the sphere evenly, on a spiral with the golden angle."""
    number = np.arange(count) + 0.5
    z, turn = 1 - 2 * number / count, np.pi * (3 - np.sqrt(5)) * number
    return np.column_stack((np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z))


def _hull(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the faces (F, 3) of a convex hull, oriented outwards, and the points (V,) that they count."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    used, faces = np.unique(hull.simplices, return_inverse=True)
    faces = faces.reshape(-1, 3)
    a, b, c = points[used][faces].transpose(1, 0, 2)
    inwards = np.einsum("fi,fi->f", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    faces[inwards] = faces[inwards, ::-1]
    return faces, used


def _shortest_edges(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the length (V,) [m] of the shortest edge at every vertex."""
    shortest = np.full(len(vertices), np.inf)
    for start, end in ((0, 1), (1, 2), (2, 0)):
        length = np.linalg.norm(vertices[faces[:, start]] - vertices[faces[:, end]], axis=1)
        np.minimum.at(shortest, faces[:, start], length)
        np.minimum.at(shortest, faces[:, end], length)
    return shortest


def _halved(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a mesh with four triangles for each, by the middles of its edges."""
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]], axis=2)       # (F, 3 edges, 2)
    pairs, number = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True)
    ab, bc, ca = len(vertices) + number.reshape(-1, 3).T
    a, b, c = faces.T
    split = np.concatenate([np.column_stack(part) for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return np.concatenate((vertices, vertices[pairs].mean(axis=1))), split
