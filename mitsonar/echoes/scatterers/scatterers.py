"""Scatterers of a scene: cells of its facets (`cells`), and their amplitudes in repeated passes.

Shapes without facets are tessellated (`scene.tessellation`). Point targets and smooth surfaces have no cells; they have
modules of their own (`point_targets`, `smooth.targets`).

The ground may be disturbed between passes. In pass n, a scatterer of coherence c (an attribute of its material) has the
amplitude

    a_n = √c g + √(1 - c) h_n

g and h_n are independent complex Gaussians of unit mean square; g belongs to the scatterer, h_n to the scatterer in
that pass. So <a_m a_n*> = c for any two passes, and <|a_n|²> = 1 (the temporal coherence of Zebker and Villasenor,
1992, IEEE Trans. Geosci. Remote Sens. 30, 950). With c = 0, pass 0 has g.
"""
from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, reinterpreted, upload
from mitsonar.device.chance import Salt, gaussian, hashed_pair, shape_key, uniform_inside
from mitsonar.device.types import Array4u
from mitsonar.scene.geometry import Geometry, interpolated
from mitsonar.scene.materials import coherence, loses_coherence
from mitsonar.scene.protocols import is_mirror, is_sea_surface, is_smooth, target_shape
from mitsonar.scene.tessellation import Grids, grid_of
from mitsonar.scene.tracing.connection import Connection
from mitsonar.scene.tracing.hits import Hits

from .cells import cell_of, divisions, four_wide, place


class Amplitudes:
    """Amplitudes of scatterers in one pass."""

    def __init__(self, geometry: Geometry, pass_number: int):
        self._lib, self._first = arrays_of(mi.Float), pass_number == 0
        self._changes = loses_coherence(geometry, pass_number)
        self._pass = dr.opaque(mi.UInt32, pass_number)

    def of(self, first: mi.UInt32, second: mi.UInt32, point: dr.ArrayBase, normal: mi.Vector3f, shape: mi.ShapePtr,
           primitive: mi.UInt32, uv: mi.Point2f) -> tuple[mi.Float, mi.Float]:
        """Return a_n as real and imaginary part (R,), from two hashes (R,) of each scatterer."""
        own = gaussian(self._lib, first, second)
        if not self._changes:
            return own
        kept = coherence(point, normal, shape, primitive, uv)
        if self._first:
            kept = dr.select(kept > 0, kept, 1)
        # a new hash: `first` itself is already used in g
        of_pass = gaussian(self._lib, *hashed_pair(self._lib, first, mi.UInt32(Salt.OF_ONE_PASS), self._pass))
        a, b = dr.sqrt(kept), dr.sqrt(1 - kept)
        return a * own[0] + b * of_pass[0], a * own[1] + b * of_pass[1]


MOST_CUTS = 32768                  # s and n² are 32-bit


@dataclass(frozen=True, kw_only=True)
class Cells:
    """A block of scatterers, on the device."""

    point: dr.ArrayBase  # (R,) [m]
    normal: mi.Vector3f  # (R,): of the facet, unit; vertices run counter-clockwise seen from its side
    area: mi.Float  # (R,) [m²]
    amplitude: tuple[mi.Float, mi.Float]  # (Float, Float): real and imaginary part of a_n
    shape: mi.ShapePtr  # (R,)
    primitive: mi.UInt32  # (R,)
    uv: mi.Point2f  # (R,): texture coordinates, as in `Hits`
    smooth: mi.Vector3f | None = None  # (R,): interpolated normal, see `tracing.hits.towards_sound`

    def hits(self, way: Connection) -> Hits:
        """Return the cells as hits of sound that arrives along `way`."""
        return Hits.on_surface(valid=way.free, point=self.point, normal=self.normal, shape=self.shape, uv=self.uv,
                               primitive=self.primitive, arrival_direction=way.arrival_direction,
                               sound_speed=way.sound_speed, smooth=self.smooth)


class Scatterers:
    """Facets of a scene and their cells."""
    # centre (F, 3) [m]; radius (F,) [m]; longest_side (F,) [m]; cuts (F,); at_surface (F,); label (F,)

    def __init__(self, geometry: Geometry, cell_size: float, pass_number: int = 0):           # cell_size [m]
        self.lib = arrays_of(mi.Float)
        self.amplitudes = Amplitudes(geometry, pass_number)
        self.geometry = geometry
        vertices = geometry.vertices.numpy().reshape(-1, 4)
        faces = geometry.faces.numpy().reshape(-1, 4).copy()
        named = faces[:, 3].copy()
        grids = [(index, shape, grid_of(shape)) for index, shape in geometry.others]
        meshed, meshed_faces, rows = len(vertices), len(faces), []
        for index, shape, grid in grids:
            rows.append((index, shape, len(faces), len(grid.faces)))
            faces = np.concatenate([faces, four_wide(grid.faces + np.uint32(len(vertices))).astype(np.uint32)])
            vertices = np.concatenate([vertices, four_wide(grid.vertices).astype(np.float32)])
        corner = vertices[faces[:, :3], :3].astype(float)                                        # (F, 3, 3)
        side = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=-1).max(1)
        self.longest_side, self.cuts = side, divisions(side, cell_size)
        if self.cuts.max(initial=1) > MOST_CUTS:
            raise ValueError(f"Cells of {cell_size:g} m cut a facet of {side.max():.0f} m into more than {MOST_CUTS} "
                             "rows. Use larger cells, or a mesh of smaller facets.")
        faces[:, 3] = self.cuts
        self._host_vertices, self._host_faces = vertices, faces
        self.centre = corner.mean(1)
        self.radius = np.linalg.norm(corner - self.centre[:, None], axis=-1).max(1)
        # for each facet: registry index of its shape, its number there, the hash key of its cells, and 1 if its
        # corners have texture coordinates
        facts = np.zeros((len(faces), 4), np.uint32)
        self.scattering, self.at_surface = np.zeros(len(faces), bool), np.zeros(len(faces), bool)
        shapes = [*geometry.meshes, *rows]
        self.label = np.zeros(len(faces), np.uint32)
        self.rows = np.zeros((max(index for index, *_ in shapes) + 1, 2), np.uint32)
        for index, shape, first, count in shapes:
            own = slice(first, first + count)
            facts[own] = np.stack([np.full(count, index), np.arange(count), np.full(count, shape_key(shape.id())),
                                   np.zeros(count)], 1)
            self.scattering[own] = not (target_shape(shape) is not None or is_smooth(shape) or is_mirror(shape))
            self.at_surface[own] = is_sea_surface(shape)
            self.rows[index] = first, first >= meshed_faces
            self.label[own] = named[own] if first < meshed_faces else geometry.named.of(shape)
            facts[own, 3] = geometry.textured and (self.rows[index, 1] or shape.has_vertex_texcoords())
        self._grids = Grids([(index, grid, first) for (index, _, grid), (_, _, first, _) in zip(grids, rows)],
                            len(self.rows))
        self._vertices, self._faces = upload(mi.Float, vertices), upload(mi.UInt32, faces)
        self._facts, self._rows = upload(mi.UInt32, facts), upload(mi.UInt32, self.rows)
        self._texcoords = None
        if geometry.textured:
            texcoords = np.zeros((len(vertices), 2), np.float32)
            if grids:
                texcoords[meshed:] = np.concatenate([grid.texcoords for *_, grid in grids])
            if geometry.texcoords is not None:
                own = geometry.texcoords.numpy().reshape(-1, 2)
                texcoords[:len(own)] = own
            self._texcoords = upload(mi.Float, texcoords)
        self._normals = None
        if geometry.normals is not None:
            own = geometry.normals.numpy()
            self._normals = upload(mi.Float, np.concatenate([own, np.zeros(4 * len(vertices) - len(own), np.float32)]))
        dr.eval(self._vertices, self._faces, self._facts, self._rows)

    def in_reach(self, origin: np.ndarray, nearest: float, farthest: float) -> np.ndarray:
        """Return the facets (K,) that come nearer to `origin` (3,) than `farthest` and reach beyond `nearest` [m]."""
        distance = np.linalg.norm(self.centre - origin, axis=1)
        return np.flatnonzero(self.scattering & (distance - self.radius < farthest)
                              & (distance + self.radius > nearest)).astype(np.uint32)

    def listed(self, runs: tuple[np.ndarray, np.ndarray, np.ndarray],
               most: int) -> Iterator[tuple[mi.UInt32, mi.UInt32]]:
        """Yield the cells of `Pieces.runs` as (facet, s), in UInt32 arrays of at most `most` each."""
        facets, firsts, counts = runs
        ends = np.cumsum(counts)
        for start in range(0, int(ends[-1]) if len(ends) else 0, most):
            stop = min(start + most, int(ends[-1]))
            first, last = np.searchsorted(ends, [start, stop - 1], side="right")
            part = slice(first, last + 1)
            begin = np.maximum(start - (ends[part] - counts[part]), 0)
            taken = np.minimum(ends[part], stop) - np.maximum(ends[part] - counts[part], start)
            facet = np.repeat(facets[part], taken)
            s = np.arange(stop - start) + np.repeat(firsts[part] + begin - (np.cumsum(taken) - taken), taken)
            yield upload(mi.UInt32, facet), upload(mi.UInt32, s.astype(np.uint32))

    def of(self, hits: Hits) -> tuple[mi.UInt32, mi.UInt32]:
        """Return facet and number s of the cell that each hit lies in, UInt32 (R,)."""
        registry = reinterpreted(mi.UInt32, hits.shape)
        row = dr.gather(self.lib.Array2u, self._rows, registry, hits.valid)
        facet, is_quad = row[0] + hits.primitive, row[1] != 0
        if self.geometry.others:
            quad, _ = self._grids.first_of(registry, hits.point, hits.valid & is_quad)
            facet = dr.select(is_quad, quad, facet)
        a, b, c = self.device_corners(facet, hits.valid)[:3]
        u, v = _barycentric(hits.point, a, b, c)
        # a quad is (a, b, c) and (a, c, d); beyond the side a c, u is negative. At a sphere's pole, a equals b.
        facet = dr.select(is_quad & ((u < 0) | (dr.squared_norm(b - a) < 1e-16)), facet + 1, facet)
        a, b, c, n = self.device_corners(facet, hits.valid)
        u, v = _barycentric(hits.point, a, b, c)
        u, v = dr.clip(u, 0, 1), dr.clip(v, 0, 1)
        return facet, cell_of(self.lib, u, v, n)

    def device_corners(self, facet: mi.UInt32, active: mi.Bool | bool = True) -> tuple:
        """Return the corners of facets, three Array3f64 (R,) [m], and the number of rows of cells, UInt32 (R,)."""
        lib = self.lib
        row = dr.gather(lib.Array4u, self._faces, facet, active)
        corners = (dr.gather(lib.Array4f, self._vertices, row[i], active) for i in range(3))
        return (*(lib.Array3f64(v[0], v[1], v[2]) for v in corners), row[3])

    def at(self, facet: mi.UInt32, s: mi.UInt32) -> Cells:
        """Return the scatterers of cells s (R,) of facets (R,)."""
        lib = self.lib
        a, b, c, n = self.device_corners(facet)
        facts = self.facts(facet)
        first, second = hashed_pair(lib, facts[2], facts[1], s, mi.UInt32(Salt.PLACE))
        third, fourth = hashed_pair(lib, facts[2], facts[1], s, mi.UInt32(Salt.AMPLITUDE))
        u, v = place(lib, s, n, uniform_inside(lib, first), uniform_inside(lib, second))
        point = a + (b - a) * u + (c - a) * v
        across = dr.cross(mi.Vector3f(b - a), mi.Vector3f(c - a))
        twice = dr.norm(across)
        cuts, normal = mi.Float(n), across / dr.maximum(twice, 1e-30)
        shape = reinterpreted(mi.ShapePtr, facts[0])
        uv = self.texture_coordinates(facet, facts[3] != 0, mi.Float(u), mi.Float(v))
        return Cells(point=point, normal=normal, area=0.5 * twice / (cuts * cuts), primitive=facts[1], shape=shape,
                     uv=uv, amplitude=self.amplitudes.of(third, fourth, point, normal, shape, facts[1], uv),
                     smooth=self.smooth_normals(facet, mi.Float(u), mi.Float(v)))

    def corners(self, facet: np.ndarray) -> np.ndarray:
        """Return the corners of facets (K,) on the host, (K, 3, 3) [m]."""
        return self._host_vertices[self._host_faces[facet, :3], :3]

    def facts(self, facet: mi.UInt32) -> Array4u:
        """Return registry index of the shape, number there, hash key, and 1 if it has texture coordinates."""
        return dr.gather(self.lib.Array4u, self._facts, facet)

    def smooth_normals(self, facet: mi.UInt32, u: mi.Float, v: mi.Float) -> mi.Vector3f | None:
        """Return interpolated normals at barycentric coordinates, or None if no shape has any."""
        if self._normals is None:
            return None
        return interpolated(self.lib, self._normals, dr.gather(self.lib.Array4u, self._faces, facet), u, v)

    def texture_coordinates(self, facet: mi.UInt32, mapped: mi.Bool, u: mi.Float, v: mi.Float) -> mi.Point2f:
        """Return the texture coordinates at barycentric coordinates."""
        if self._texcoords is None:
            return mi.Point2f(u, v)
        row = dr.gather(self.lib.Array4u, self._faces, facet)
        a, b, c = (mi.Point2f(dr.gather(self.lib.Array2f, self._texcoords, row[i], mapped)) for i in range(3))
        return dr.select(mapped, a * (1 - u - v) + b * u + c * v, mi.Point2f(u, v))


def _barycentric(point, a, b, c):
    """Return (u, v), Float64, of points in the planes of triangles (a, b, c)."""
    e, f, w = b - a, c - a, point - a
    ee, ef, ff, we, wf = dr.dot(e, e), dr.dot(e, f), dr.dot(f, f), dr.dot(w, e), dr.dot(w, f)
    scale = dr.rcp(dr.maximum(ee * ff - ef * ef, 1e-30))
    return (ff * we - ef * wf) * scale, (ee * wf - ef * we) * scale
