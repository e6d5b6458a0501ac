"""Facets of a scene's smooth surfaces, and their cells: corners, normals, and the facet that a hit lies in.

A facet is cut into n² congruent triangles, numbered as in `scatterers.cells`; n depends on the place it is seen from.
Smooth surfaces are those whose material has the attribute ``smooth``. Shapes without facets are tessellated
(`tessellation`). Corners of cells lie on the curved surface that a facet stands for, at the height over the facet

    h = κ_ab λ_a λ_b + κ_bc λ_b λ_c + κ_ca λ_c λ_a,    κ_ij = (n_j - n_i)·(x_j - x_i) / 2

λ barycentric coordinates, n normals at the facet's corners x. For an edge of length l on a sphere, h is l²/8R mid-way.
"""
from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, reinterpreted, upload
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.protocols import is_smooth
from mitsonar.scene.tessellation import FINEST_SAGITTA, Grids, grid_of

from ..scatterers.cells import four_wide, place

ROUNDED = 2e-7                     # rounding of corners to float32, relative to their distance from the origin
SHARP = np.radians(30.0)           # angle between neighbours above which their common edge is one of the object itself
FLAT_ENOUGH = 1e-5                 # wavelengths that cells may lie below a curved surface: more acts as a grating
RESOLVED = 0.55                    # cell side in wavelengths below which no grating angle exists
TURN = 0.06                        # [rad] largest turn of the surface over a cell that is lit or not as a whole


@dataclass(frozen=True, kw_only=True)
class SmoothCells:
    """A block of cells, on the device."""

    point: dr.ArrayBase  # (R,) [m]: centroids
    corners: list[mi.Vector3f]  # (R,) [m]: on the curved surface, from the centroid
    flat: list[mi.Vector3f]  # (R,) [m]: in the facet, from the centroid
    places: list[tuple[mi.Float, mi.Float]]  # (Float, Float): barycentric coordinates of the corners in the facet
    normal: mi.Vector3f  # (R,): of the facet, unit
    facet: mi.UInt32  # (R,)
    area: mi.Float  # (R,) [m²]


class SmoothFacets:
    """The facets of a scene's smooth surfaces."""
    # corner (F, 3, 3) [m]; centre, normal (F, 3) [m], [-]; radius, side, area (F,) [m], [m], [m²];
    # bent, fewest, fewest_lit, outward, label (F,)

    def __init__(self, geometry: Geometry, wavelength: float):
        self.lib = arrays_of(mi.Float)
        parts, rows, grids, first = [], [], [], 0
        shapes = [*geometry.meshes, *((index, shape, None, 0) for index, shape in geometry.others)]
        for index, shape, row, count in shapes:
            if not is_smooth(shape):
                continue
            if row is None:
                grid = grid_of(shape, min(FINEST_SAGITTA, wavelength / 32))
                corner, normal = grid.vertices[grid.faces], grid.normals[grid.faces]
                grids.append((index, grid, first))
            else:
                corner, normal = _mesh_corners(geometry, row, count), _vertex_normals(shape)
            parts.append((corner, _at_corners(corner, normal), index, shape))
            rows.append((index, first, row is None))
            first += len(corner)
        self.shapes = [shape for *_, shape in parts]
        if not parts:
            return
        self.corner = np.concatenate([corner for corner, *_ in parts])
        self.centre = self.corner.mean(1)
        self.radius = np.linalg.norm(self.corner - self.centre[:, None], axis=-1).max(1)
        self.side = np.linalg.norm(self.corner - np.roll(self.corner, 1, axis=1), axis=-1).max(1)
        self.area, self.normal = _area_and_normal(self.corner)
        normals = np.concatenate([normals for _, normals, *_ in parts])
        bend = _bend(self.corner, normals)
        deep = np.abs(bend).max(1) / 4
        self.bent = deep > FLAT_ENOUGH * wavelength
        self.fewest = np.maximum(1, np.ceil(np.minimum(np.sqrt(deep / (FLAT_ENOUGH * wavelength)),
                                                       self.side / (RESOLVED * wavelength)))).astype(int)
        outward = [_outward(corner) for corner, *_ in parts]
        self.outward = np.repeat(outward, [len(corner) for corner, *_ in parts])
        turn = np.linalg.norm(normals - np.roll(normals, 1, axis=1), axis=-1).max(1)
        self.fewest_lit = np.maximum(1, np.ceil(turn / TURN)).astype(int)
        self.convex = len(parts) == 1 and _is_convex(self.corner, self.normal, outward[0])
        facts = np.concatenate([np.stack(np.broadcast_arrays(
            index, np.arange(len(corner)), geometry.named.of_faces(shape, len(corner)), 0), 1)
            for corner, _, index, shape in parts])
        self.label = facts[:, 2].astype(np.uint32)
        table = np.zeros((max(index for index, *_ in rows) + 1, 4), np.uint32)
        for index, row, is_grid in rows:
            table[index] = row, 1, is_grid, 0
        self._registry = len(table)
        self._grids = Grids(grids, len(table))
        self._corners = upload(mi.Float64, four_wide(self.corner))
        self._normals = upload(mi.Float, four_wide(normals).astype(np.float32))
        self._bend = upload(mi.Float, four_wide(bend).astype(np.float32))
        self._facts, self._rows = upload(mi.UInt32, facts.astype(np.uint32)), upload(mi.UInt32, table)
        dr.eval(self._corners, self._normals, self._bend, self._facts, self._rows)

    def __len__(self) -> int:
        return len(self.corner) if self.shapes else 0

    def corners_of(self, facet: mi.UInt32, active: mi.Bool | bool = True) -> list[dr.ArrayBase]:
        """Return the corners of facets, three Array3f64 (R,) [m]."""
        rows = (dr.gather(self.lib.Array4f64, self._corners, 3 * facet + i, active) for i in range(3))
        return [self.lib.Array3f64(row[0], row[1], row[2]) for row in rows]

    def cells(self, facet: mi.UInt32, s: mi.UInt32, n: mi.UInt32) -> SmoothCells:
        """Return cells s of facets cut n-fold, UInt32 (R,) each."""
        lib = self.lib
        a, b, c = self.corners_of(facet)
        across = dr.cross(mi.Vector3f(b - a), mi.Vector3f(c - a))
        twice, cuts = dr.norm(across), mi.Float(n)
        normal = across / dr.maximum(twice, 1e-30)
        # the corners of the unit triangle, which `place` turns by half a turn in cells that are upside down
        places = [place(lib, s, n, lib.Float64(x), lib.Float64(y)) for x, y in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))]
        flat = [(b - a) * u + (c - a) * v for u, v in places]
        middle = (flat[0] + flat[1] + flat[2]) * (1 / 3)
        flat = [mi.Vector3f(corner - middle) for corner in flat]
        places = [(mi.Float(u), mi.Float(v)) for u, v in places]
        corners = [corner + self.height(facet, u, v) * normal for corner, (u, v) in zip(flat, places)]
        return SmoothCells(point=a + middle, corners=corners, flat=flat, places=places, normal=normal, facet=facet,
                           area=0.5 * twice / (cuts * cuts))

    def bend_of(self, facet: mi.UInt32, active: mi.Bool | bool = True) -> list[mi.Float]:
        """Return κ of the three edges of facets, Float (R,) [m]."""
        row = dr.gather(self.lib.Array4f, self._bend, facet, active)
        return [row[0], row[1], row[2]]

    def normals_of(self, facet: mi.UInt32, active: mi.Bool | bool = True) -> list[mi.Vector3f]:
        """Return the normals of the surface at the three corners of facets, Vector3f (R,)."""
        rows = (dr.gather(self.lib.Array4f, self._normals, 3 * facet + i, active) for i in range(3))
        return [mi.Vector3f(row[0], row[1], row[2]) for row in rows]

    def flat_normal(self, facet: mi.UInt32) -> mi.Vector3f:
        """Return the normals of the facets themselves, Vector3f (R,)."""
        a, b, c = self.corners_of(facet)
        return dr.normalize(dr.cross(mi.Vector3f(b - a), mi.Vector3f(c - a)))

    def height(self, facet: mi.UInt32, u: mi.Float, v: mi.Float) -> mi.Float:
        """Return the height [m] of the curved surface over the facet, on the side of its normal."""
        bend = self.bend_of(facet)
        return bend[0] * (1 - u - v) * u + bend[1] * u * v + bend[2] * v * (1 - u - v)

    def barycentric(self, facet: mi.UInt32, point: dr.ArrayBase,
                    offsets: Sequence[mi.Vector3f]) -> list[tuple[mi.Float, mi.Float]]:
        """Return barycentric coordinates (u, v) in facets of `point` + each of `offsets` [m]."""
        a, b, c = self.corners_of(facet)
        e, f, w = mi.Vector3f(b - a), mi.Vector3f(c - a), mi.Vector3f(point - a)
        ee, ef, ff = dr.dot(e, e), dr.dot(e, f), dr.dot(f, f)
        scale = dr.rcp(dr.maximum(ee * ff - ef * ef, 1e-30))
        products = [(dr.dot(w + offset, e), dr.dot(w + offset, f)) for offset in offsets]
        return [((ff * we - ef * wf) * scale, (ee * wf - ef * we) * scale) for we, wf in products]

    def facts(self, facet: mi.UInt32) -> tuple[mi.ShapePtr, mi.UInt32, mi.UInt32]:
        """Return shape, primitive and label of facets."""
        row = dr.gather(self.lib.Array4u, self._facts, facet)
        return reinterpreted(mi.ShapePtr, row[0]), row[1], row[2]

    def normals_at(self, facet: mi.UInt32, point: dr.ArrayBase, offsets: Sequence[mi.Vector3f]) -> list[mi.Vector3f]:
        """Return the surface's normals at `point` + each of `offsets` [m], linear between those of the facets' corners.

        They point to the side from which the facet's corners run counter-clockwise.
        """
        a, b, c = self.normals_of(facet)
        return [dr.normalize(a + (b - a) * u + (c - a) * v) for u, v in self.barycentric(facet, point, offsets)]

    def of(self, shape: mi.ShapePtr, primitive: mi.UInt32, point: dr.ArrayBase,
           active: mi.Bool) -> tuple[mi.UInt32, mi.Bool]:
        """Return the facets of hits, and whether the hit surface is smooth."""
        registry = reinterpreted(mi.UInt32, shape)
        active = active & (registry < self._registry)
        row = dr.gather(self.lib.Array4u, self._rows, registry, active)
        smooth = active & (row[1] != 0)
        quad, gridded = self._grids.first_of(registry, point, smooth & (row[2] != 0))
        facet = dr.select(gridded, quad, row[0] + primitive)
        a, b, c = self.corners_of(facet, smooth)
        # beyond the side a c of a quad lies its second facet; at a sphere's pole only that exists
        e, f, w = mi.Vector3f(b - a), mi.Vector3f(c - a), mi.Vector3f(point - a)
        beyond = dr.dot(f, f) * dr.dot(w, e) < dr.dot(e, f) * dr.dot(w, f)
        return dr.select(gridded & (beyond | (dr.squared_norm(e) < 1e-16)), facet + 1, facet), smooth


def too_coarse(corner: np.ndarray, wavelength: float,
               bend: np.ndarray | float = 0.0) -> tuple[float, float] | None:
    """Return sagitta [m] and needed edge length [m] if a mesh is too coarse for a curved surface, else None.

    The sagitta between two neighbours is l a / 8, with l their mean height over the shared edge and a the angle between
    them. An edge of more than 30 degrees is taken for one of the object itself. Facets whose normals follow the
    curvature, to the depth `bend` [m], are fine enough.
    """
    # corner (F, 3, 3) [m]; wavelength [m]; bend (F,) [m]
    _, vertex = np.unique(np.round(corner.reshape(-1, 3), 6), axis=0, return_inverse=True)
    vertex = vertex.reshape(-1, 3)
    area, normal = _area_and_normal(corner)
    ends = np.sort(np.stack([vertex, np.roll(vertex, -1, axis=1)], -1).reshape(-1, 2), axis=1)
    length = np.linalg.norm(corner - np.roll(corner, -1, axis=1), axis=-1).ravel()
    order = np.lexsort(ends.T)
    same = np.all(ends[order[1:]] == ends[order[:-1]], axis=1)
    first, second = order[:-1][same], order[1:][same]
    good = (length[first] > 0) & (area[first // 3] > 0) & (area[second // 3] > 0)
    first, second = first[good], second[good]
    across = np.linalg.norm(np.cross(normal[first // 3], normal[second // 3]), axis=1)
    angle = np.arctan2(across, np.sum(normal[first // 3] * normal[second // 3], axis=1))
    height = (area[first // 3] + area[second // 3]) / length[first]
    sagitta = height * angle / 8
    sagitta[(angle > SHARP) | (np.broadcast_to(bend, len(corner))[first // 3] > 0.5 * sagitta)] = 0
    if not sagitta.size or sagitta.max() <= wavelength / 16:
        return None
    worst = sagitta.argmax()
    return float(sagitta[worst]), float(np.sqrt(height[worst] / angle[worst] * wavelength / 2))


def warn_where_too_coarse(geometry: Geometry, wavelength: float) -> None:
    """Warn of each smooth mesh that is too coarse for a wavelength [m]."""
    for _, shape, first, count in geometry.meshes:
        if not is_smooth(shape):
            continue
        corner = _mesh_corners(geometry, first, count)
        bend = _bend(corner, _at_corners(corner, _vertex_normals(shape)))
        coarse = too_coarse(corner, wavelength, np.abs(bend).max(1) / 4)
        if coarse is not None:
            warnings.warn(f"the smooth mesh \"{shape.id()}\" is too coarse for a wavelength of {1e3 * wavelength:.3g} "
                          f"mm: its facets lie {1e3 * coarse[0]:.2g} mm off the curved surface they stand for, more "
                          f"than 1/16 of the wavelength, and will glint one by one. Use edges of at most "
                          f"{coarse[1]:.2g} m.", stacklevel=2)


def _mesh_corners(geometry, first, count):
    vertices, faces = geometry.mesh(first, count)
    return vertices[faces].astype(float)


def _vertex_normals(shape):
    parameters = mi.traverse(shape)
    if "vertex_normals" not in parameters or not shape.has_vertex_normals():
        return None
    normals = parameters["vertex_normals"].numpy().reshape(-1, 3)
    return normals[parameters["faces"].numpy().reshape(-1, 3)]


def _at_corners(corner, normal):
    """Return normals at corners (F, 3, 3): the facet's own if a mesh has none, or where its own lead round an edge."""
    flat = np.broadcast_to(_area_and_normal(corner)[1][:, None], corner.shape)
    if normal is None:
        return flat
    # a mesh's normals may point to the other side of its facets
    along = np.sum(normal * flat, -1, keepdims=True)
    return np.where(np.abs(along) > np.cos(SHARP), normal * np.sign(along), flat)


def _bend(corner, normal):
    """Return κ of the edges a b, b c, c a, (F, 3) [m], on the side of the facet's normal."""
    return 0.5 * np.sum((np.roll(normal, -1, axis=1) - normal) * (np.roll(corner, -1, axis=1) - corner), axis=-1)


def _area_and_normal(corner):
    across = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    twice = np.linalg.norm(across, axis=-1)
    return 0.5 * twice, across / np.maximum(twice, 1e-30)[:, None]


def _outward(corner):
    """Return 1 if facets are the closed surface of a body and their normals point out, -1 if in, 0 if it is open."""
    _, vertex = np.unique(np.round(corner.reshape(-1, 3), 6), axis=0, return_inverse=True)
    vertex = vertex.reshape(-1, 3)
    ends = np.stack([vertex, np.roll(vertex, -1, axis=1)], -1).reshape(-1, 2)
    ends = ends[ends[:, 0] != ends[:, 1]]
    # closed and consistently wound: every edge occurs in both directions
    there, back = (pair[np.lexsort(pair.T)] for pair in (ends, ends[:, ::-1]))
    if not np.array_equal(there, back):
        return 0
    local = corner - corner.mean((0, 1))
    return int(np.sign(np.sum(local[:, 0] * np.cross(local[:, 1], local[:, 2]))))


def _is_convex(corner, normal, outward):
    """Return True if all facets lie in one plane, or are the surface of a convex body."""
    points, number = np.unique(corner.reshape(-1, 3).round(6), axis=0, return_inverse=True)
    slack = 1e-5 * np.ptp(points, axis=0).max() + ROUNDED * np.abs(points).max()
    if np.abs((points - points[0]) @ normal[0]).max() < slack:
        return True
    # a closed, connected surface is convex if it is so at every edge (van Heijenoort 1952)
    number = number.reshape(-1, 3)
    edge = np.sort(np.stack([number, np.roll(number, -1, axis=1)], -1), -1).reshape(-1, 2)
    order = np.lexsort(edge.T)
    first, second = order[0::2], order[1::2]
    if not outward or len(order) % 2 or np.any(edge[first] != edge[second]) or np.any(
            np.all(edge[first][1:] == edge[first][:-1], axis=1)):
        return False
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    joined = coo_array((np.ones(len(first)), (first // 3, second // 3)), shape=(len(corner), len(corner)))
    if connected_components(joined, directed=False)[0] > 1:
        return False
    # the second facet's corner that is not on the edge, over the plane of the first facet
    apex = corner[second // 3, (second % 3 + 2) % 3] - corner[first // 3, 0]
    return bool(np.all(outward * np.sum(apex * normal[first // 3], axis=1) < slack))
