"""Triangles over a regular grid of heights, the common half of the shapes `seabed` and `bathymetry`."""
from typing import NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from ..attributes import Boolean, Nested, Transform

TO_WORLD = Transform("to_world", otherwise="the identity", text="transform of the finished shape")
MATERIAL = Nested("bsdf", default=None, otherwise="Mitsuba's `diffuse`", text="material of the shape")
SMOOTH_NORMALS = Boolean("smooth_normals", default=False,
                         text="scatter by normals interpolated between nodes, so that the facets of a coarse mesh do "
                              "not show; places, areas and shadows stay those of the facets")


class GridMesh(NamedTuple):
    """Hold a triangle mesh: vertices (V, 3) float32 [m], faces (F, 3) uint32, texcoords (V, 2) float32 in 0 to 1.

    ``cells`` (F,) uint32 is the grid cell of each face, counted along the rows; None of a mesh that is no grid.
    """

    vertices: np.ndarray
    faces: np.ndarray
    texcoords: np.ndarray
    cells: np.ndarray | None = None


def triangulate(x: np.ndarray, y: np.ndarray, heights: np.ndarray, to_world: np.ndarray) -> GridMesh:
    """Make two triangles of every grid cell, and one or none of a cell that touches a hole."""
    # x, y (X,) [m]; heights (Y, X) [m]; to_world (4, 4)
    rows, columns = heights.shape
    index = np.arange(rows * columns, dtype=np.uint32).reshape(rows, columns)
    here, east, north, across = index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]
    faces = np.empty((rows - 1, columns - 1, 6), np.uint32)
    for corner, node in enumerate((here, east, north, east, across, north)):
        faces[..., corner] = node
    faces = faces.reshape(-1, 3)
    cells = np.repeat(np.arange((rows - 1) * (columns - 1), dtype=np.uint32), 2)
    valid = np.isfinite(heights).ravel()
    if not valid.all():
        whole = valid[faces].all(axis=1)
        faces, cells = faces[whole], cells[whole]
        used = np.zeros(valid.size, bool)
        used[faces] = True
        faces = (np.cumsum(used, dtype=np.uint32) - np.uint32(1))[faces]
    else:
        used = slice(None)
    # u and v before the transform: they belong to the grid.
    texcoords = _nodes((x - x[0]) / (x[-1] - x[0]), (y - y[0]) / (y[-1] - y[0]))[used]
    if np.array_equal(to_world[:3, :3], np.eye(3)):
        vertices = _nodes(*(axis + shift for axis, shift in zip((x, y, heights), to_world[:3, 3])))[used]
    else:
        place = _nodes(x, y, heights, kind=np.float64)[used]
        vertices = (place @ to_world[:3, :3].T + to_world[:3, 3]).astype(np.float32)
    if np.linalg.det(to_world[:3, :3]) < 0:
        faces = faces[:, ::-1]  # a mirrored mesh keeps its outside outside
    return GridMesh(vertices, faces, texcoords, cells)


def _nodes(x: np.ndarray, y: np.ndarray, *others: np.ndarray, kind: type = np.float32) -> np.ndarray:
    """Return values at the nodes of a grid (Y X, 2 or more): one that depends on x, one on y, others (Y, X)."""
    nodes = np.empty((y.size, x.size, 2 + len(others)), kind)
    nodes[..., 0], nodes[..., 1] = x, y[:, None]
    for column, values in enumerate(others, 2):
        nodes[..., column] = values
    return nodes.reshape(-1, nodes.shape[-1])


def fill(mesh: mi.Mesh, grid: GridMesh) -> None:
    """Write the buffers of a ``mi.Mesh`` that was made for the counts of ``grid`` with texture coordinates."""
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = mi.Float(np.ascontiguousarray(grid.vertices).ravel())
    parameters["vertex_texcoords"] = mi.Float(np.ascontiguousarray(grid.texcoords).ravel())
    parameters["faces"] = mi.UInt32(np.ascontiguousarray(grid.faces).ravel())
    parameters.update()
    dr.eval()
