"""Scatterers of a scene: one field for all sonars, fixed to its facets, and their amplitudes in repeated passes.

A facet has scatterers k = 0, 1, 2 ... at places of a nested sequence (`nested_points`), each with a circular complex
Gaussian amplitude g, <|g|²> = 1. A sonar takes as many as it needs. Each stands for an equal area dA: its echo has the
pressure g √(σ dA), times the effect of propagation, so the mean level does not depend on their number. Amplitudes of
echoes are Rayleigh where a resolution cell holds many scatterers. With N on average, the second moment of intensity is
at most 2 (1 + 1/N), because their number varies. Place and amplitude are hashed from (shape, facet, k) alone: every
kind of sonar, element, ping and run uses the same seabed.

An array's elements take n² of a facet, n = ⌈longest side / cell size⌉; the beam domain and a sidescan's speckle take
what their resolution needs (`thinned_scatterers`).

Shapes without facets are tessellated (`scene.tessellation`). Point targets and smooth surfaces have no scatterers; they
have modules of their own (`point_targets`, `smooth.targets`).

The ground may be disturbed between passes. In pass n, a scatterer of coherence c (an attribute of its material) has the
amplitude

    a_n = √c g + √(1 - c) h_n

g and h_n are independent complex Gaussians of unit mean square; g belongs to the scatterer, h_n to the scatterer in
that pass. So <a_m a_n*> = c for any two passes, and <|a_n|²> = 1 (the temporal coherence of Zebker and Villasenor,
1992, IEEE Trans. Geosci. Remote Sens. 30, 950). With c = 0, pass 0 has g.

Where a material has glints, amplitudes are a_n √G, <G> = 1, and G depends on the area that a scatterer stands for
(`scattering.surfaces.glints`). The energies of rays are means over glints.
"""
from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, reduce

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, give_back_memory, held, reinterpreted, upload
from mitsonar.device.chance import Salt, gaussian, hashed, hashed_pair, scrambled, shape_key, uniform
from mitsonar.device.types import Array4u
from mitsonar.scattering.surfaces.glints import FEWEST, with_glints
from mitsonar.scene.geometry import Geometry, interpolated
from mitsonar.scene.materials import coherence, loses_coherence
from mitsonar.scene.protocols import is_mirror, is_sea_surface, is_smooth, sound_material, target_shape
from mitsonar.scene.tessellation import Grids, grid_of
from mitsonar.scene.tracing.connection import Connection
from mitsonar.scene.tracing.hits import Hits

from .cells import divisions, four_wide
from .nested_points import exists, owner_of, place_of, triangle_of


class Amplitudes:
    """Amplitudes of scatterers in one pass."""

    def __init__(self, geometry: Geometry, pass_number: int):
        self._lib, self._first = arrays_of(mi.Float), pass_number == 0
        self.change = loses_coherence(geometry, pass_number)
        self._pass = dr.opaque(mi.UInt32, pass_number)

    def of(self, first: mi.UInt32, second: mi.UInt32, point: dr.ArrayBase, normal: mi.Vector3f, shape: mi.ShapePtr,
           primitive: mi.UInt32, uv: mi.Point2f) -> tuple[mi.Float, mi.Float]:
        """Return a_n as real and imaginary part (R,), from two hashes (R,) of each scatterer."""
        own = gaussian(self._lib, first, second)
        if not self.change:
            return own
        kept = coherence(point, normal, shape, primitive, uv)
        if self._first:
            kept = dr.select(kept > 0, kept, 1)
        # a new hash: `first` itself is already used in g
        of_pass = gaussian(self._lib, *hashed_pair(self._lib, first, mi.UInt32(Salt.OF_ONE_PASS), self._pass))
        a, b = dr.sqrt(kept), dr.sqrt(1 - kept)
        return a * own[0] + b * of_pass[0], a * own[1] + b * of_pass[1]


MOST_CUTS = 32768                  # k and n² are 32-bit


@dataclass(frozen=True, kw_only=True)
class Cells:
    """A block of scatterers, on the device."""

    point: dr.ArrayBase  # (R,) [m]
    normal: mi.Vector3f  # (R,): of the facet, unit; vertices run counter-clockwise seen from its side
    area: mi.Float  # (R,) [m²]: that each stands for
    amplitude: tuple[mi.Float, mi.Float]  # (Float, Float): real and imaginary part of a_n
    shape: mi.ShapePtr  # (R,)
    primitive: mi.UInt32  # (R,): facet of the shape
    label: mi.UInt32  # (R,)
    uv: mi.Point2f  # (R,): texture coordinates, as in `Hits`
    smooth: mi.Vector3f | None = None  # (R,): interpolated normal, see `tracing.hits.towards_sound`
    part: mi.UInt32 | None = None  # (R,): number of the motion, see `MovingBody`; None: the label

    @property
    def motion(self) -> mi.UInt32:
        """Number of the scatterers' motion (R,)."""
        return self.label if self.part is None else self.part

    def hits(self, way: Connection) -> Hits:
        """Return the scatterers as hits of sound that arrives along `way`."""
        return Hits.on_surface(valid=way.free, point=self.point, normal=self.normal, shape=self.shape, uv=self.uv,
                               primitive=self.primitive, arrival_direction=way.arrival_direction,
                               sound_speed=way.sound_speed, smooth=self.smooth)

    def chosen(self, index: mi.UInt32) -> Cells:
        """Return the scatterers at an index."""
        dr.eval(*(value for value in vars(self).values() if value is not None))
        real, imaginary = (dr.gather(mi.Float, part, index) for part in self.amplitude)
        values = {name: dr.gather(type(value), value, index) for name, value in vars(self).items()
                  if name != "amplitude" and value is not None}
        return Cells(amplitude=(real, imaginary), **values)


class Scatterers:
    """Facets of a scene and their scatterers."""
    # centre (F, 3) [m]; radius (F,) [m]; longest_side (F,) [m]; cuts (F,); at_surface (F,); label (F,)

    def __init__(self, geometry: Geometry, cell_size: float, pass_number: int = 0, seed: int = 0):  # cell_size [m]
        self.lib = arrays_of(mi.Float)
        self.amplitudes = Amplitudes(geometry, pass_number)
        self.geometry = geometry
        vertices = geometry.at_rest(geometry.vertices.numpy().reshape(-1, 4))
        faces = geometry.faces.numpy().reshape(-1, 4)
        grids = [(index, shape, grid_of(shape)) for index, shape in geometry.others]
        meshed, meshed_faces, rows = len(vertices), len(faces), []
        for index, shape, grid in grids:
            rows.append((index, shape, len(faces), len(grid.faces)))
            corners = four_wide(grid.faces + np.uint32(len(vertices))).astype(np.uint32)
            corners[:, 3] = geometry.named.of(shape)
            faces = np.concatenate([faces, corners])
            vertices = np.concatenate([vertices, four_wide(grid.vertices).astype(np.float32)])
        # the geometry's own tables, unless there are more facets or some vertices move; corners and label of each facet
        self._vertices = upload(mi.Float, vertices) if grids or geometry.movers else geometry.vertices
        self._faces = upload(mi.UInt32, faces) if grids else geometry.faces
        self.label = faces[:, 3]
        self._cuts: mi.UInt32 | None = None                           # n of each facet; None: 1
        side, self.centre, self.radius = self._measured(len(faces))
        self.longest_side, self.cuts = side, divisions(side, cell_size)
        if self.cuts.max(initial=1) > MOST_CUTS:
            raise ValueError(f"Cells of {cell_size:g} m cut a facet of {side.max():.0f} m into more than {MOST_CUTS} "
                             "rows. Use larger cells, or a mesh of smaller facets.")
        if np.isfinite(cell_size):
            self._cuts = upload(mi.UInt32, self.cuts)
        registry = np.zeros(len(faces), np.uint32)
        self.scattering, self.at_surface = np.zeros(len(faces), bool), np.zeros(len(faces), bool)
        shapes = [*geometry.meshes, *rows]
        # for each shape: first facet, 1 if it is no mesh, 1 if its corners have texture coordinates, key
        self.rows = np.zeros((max(index for index, *_ in shapes) + 1, 4), np.uint32)
        glints = np.zeros((len(self.rows), 2), np.float32)
        for index, shape, first, count in shapes:
            own = slice(first, first + count)
            registry[own] = index
            self.scattering[own] = not (target_shape(shape) is not None or is_smooth(shape) or is_mirror(shape))
            self.at_surface[own] = is_sea_surface(shape)
            is_grid = first >= meshed_faces
            mapped = geometry.textured and (is_grid or shape.has_vertex_texcoords())
            self.rows[index] = first, is_grid, mapped, shape_key(shape.id())
            if (material := sound_material(shape.bsdf())) is not None and material.glints is not None:
                glints[index] = material.glints.per_area, material.glints.share
        self.glinting, self._glints = bool(glints.any()), upload(mi.Float, glints)
        self._registry, self._rows = upload(mi.UInt32, registry), upload(mi.UInt32, self.rows)
        row = dr.gather(self.lib.Array4u, self._rows, self._registry)
        self._keys = hashed(self.lib, row[3], dr.arange(mi.UInt32, len(faces)) - row[0],
                            dr.opaque(mi.UInt32, int(seed) & 0xFFFFFFFF))
        self._grids = Grids([(index, grid, first) for (index, _, grid), (_, _, first, _) in zip(grids, rows)],
                            len(self.rows))
        self._threshold = uniform(self.lib, hashed(self.lib, self._keys, mi.UInt32(Salt.COUNT)))
        dr.eval(self._keys, self._threshold)
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
        dr.eval(self._vertices, self._faces, self._registry, self._rows, self._cuts)
        self.radius[self.at_surface] *= geometry.sea.stretch if geometry.sea is not None else 1
        self.moving = np.isin(self.label, [body.label for body in geometry.movers])
        self._moving = facet = np.flatnonzero(self.moving).astype(np.uint32)
        self._parts = None
        if any(one.number != one.label for one in geometry.movers):
            parts = self.label.copy()
            body = geometry.body_numbers(self._on_host[1][facet, 0])
            parts[facet] = np.array([one.number for one in geometry.movers], np.uint32)[body]
            self._parts = upload(mi.UInt32, parts)
        geometry.follow(self._moved)

    def _moved(self) -> None:
        """Move the facets of moving objects; their longest sides and radii stay."""
        geometry = self.geometry
        self.__dict__.pop("_on_host", None)    # a second owner would make a copy of the tables
        self._vertices = geometry.with_moved(self._vertices, geometry.moved_places)
        if self._normals is not None:
            self._normals = geometry.with_moved(self._normals, geometry.moved_normals)
        a, b, c, _ = self.device_corners(upload(mi.UInt32, self._moving))
        self.centre[self._moving] = np.stack([axis.numpy() for axis in mi.Point3f((a + b + c) / 3)], 1)

    def _measured(self, facets: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return longest sides (F,), centres (F, 3) and radii (F,) of all facets [m]."""
        a, b, c, _ = self.device_corners(dr.arange(mi.UInt32, facets))
        centre = (a + b + c) / 3
        side, radius = (dr.maximum(dr.maximum(*(dr.norm(way) for way in ways[:2])), dr.norm(ways[2]))
                        for ways in ((b - a, c - b, a - c), (a - centre, b - centre, c - centre)))
        # millions of facets: single precision is enough to find those within reach
        centre, side, radius = mi.Point3f(centre), mi.Float(side), mi.Float(radius)
        dr.eval(centre, side, radius)
        places = np.stack([axis.numpy() for axis in centre], 1)
        del centre
        if self.geometry.large:
            give_back_memory()
        return side.numpy(), places, radius.numpy()

    def in_reach(self, origin: np.ndarray, nearest: float, farthest: float) -> np.ndarray:
        """Return the facets (K,) that come nearer to `origin` (3,) than `farthest` and reach beyond `nearest` [m]."""
        distance = np.linalg.norm(self.centre - origin, axis=1)
        return np.flatnonzero(self.scattering & (distance - self.radius < farthest)
                              & (distance + self.radius > nearest)).astype(np.uint32)

    def near(self, places: np.ndarray, farthest: float) -> np.ndarray:
        """Return True (F,) for facets that scatter, and come nearer than `farthest` [m] to the box of places or move.
        """
        # places (N, 3) [m]
        distance = to_box(self.centre, places) - self.radius
        if self.geometry.sea is not None:
            distance[self.at_surface] -= self.geometry.sea.waves.crest
        return self.scattering & ((distance < farthest) | self.moving & ~self.at_surface)

    def forget_measures(self) -> None:
        """Free centres, radii and longest sides, which take 40 bytes a facet, where nobody asks for them again."""
        if not self.geometry.movers:
            self.centre = self.radius = self.longest_side = np.empty(0, np.float32)

    @cached_property
    def _on_host(self) -> tuple[np.ndarray, np.ndarray]:
        """Return vertices (V, 4) and facets (F, 4); on LLVM, the same memory as on the device."""
        return self._vertices.numpy().reshape(-1, 4), self._faces.numpy().reshape(-1, 4)

    @cached_property
    def _seed(self) -> mi.UInt32:
        """Return the seeds of all facets (F,), see `seed_of`."""
        seed = self.seed_of(self._keys)
        dr.eval(seed)
        return seed

    @cached_property
    def threshold(self) -> np.ndarray:
        """Return h of every facet, float32 (F,), see `nested_points`."""
        return self._threshold.numpy()

    def triangles(self, facet: mi.UInt32, k: mi.UInt32,
                  level: mi.UInt32) -> tuple[mi.Point3f, mi.Point3f, mi.Point3f]:
        """Return the corners (R,) [m] of the triangles of levels (R,) in which scatterers k (R,) of facets lie."""
        a, b, c = (mi.Point3f(corner) for corner in self.device_corners(facet)[:3])
        u, v, side = triangle_of(scrambled(k, dr.gather(mi.UInt32, self._seed, facet)), level)
        first, e, f = a + u * (b - a) + v * (c - a), side * (b - a), side * (c - a)
        return first, first + e, first + f

    def balls(self, facet: np.ndarray, k: np.ndarray, level: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return middles (K, 3) and radii (K,) [m] of balls that hold the triangles of `triangles`."""
        if not len(facet):
            return np.zeros((0, 3), np.float32), np.zeros(0, np.float32)
        a, b, c = self.triangles(*(upload(mi.UInt32, part.astype(np.uint32)) for part in (facet, k, level)))
        centre = (a + b + c) / 3
        radius = reduce(dr.maximum, (dr.norm(corner - centre) for corner in (a, b, c)))
        dr.eval(centre, radius)
        return np.stack([axis.numpy() for axis in centre], 1), radius.numpy()

    def listed(self, runs: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
               most: int) -> Iterator[tuple[mi.UInt32, mi.UInt32]]:
        """Yield the scatterers of `Pieces.runs` as (facet, k), in UInt32 arrays of at most `most` each."""
        facets, firsts, steps, counts = runs
        ends = np.cumsum(counts)
        for start in range(0, int(ends[-1]) if len(ends) else 0, most):
            stop = min(start + most, int(ends[-1]))
            first, last = np.searchsorted(ends, [start, stop - 1], side="right")
            part = slice(first, last + 1)
            begin = np.maximum(start - (ends[part] - counts[part]), 0)
            taken = np.minimum(ends[part], stop) - np.maximum(ends[part] - counts[part], start)
            # modulo 2^32, which k is below: what is added may be negative
            begin = firsts[part] + steps[part] * (begin - (np.cumsum(taken) - taken))
            k = np.arange(stop - start, dtype=np.uint32)
            k *= np.repeat(steps[part].astype(np.uint32), taken)
            k += np.repeat(begin.astype(np.uint32), taken)
            yield upload(mi.UInt32, np.repeat(facets[part].astype(np.uint32), taken)), upload(mi.UInt32, k)

    def of(self, hits: Hits) -> tuple[mi.UInt32, mi.UInt32]:
        """Return the facet of each hit, and the scatterer that owns its place there, UInt32 (R,)."""
        registry = reinterpreted(mi.UInt32, hits.shape)
        row = dr.gather(self.lib.Array4u, self._rows, registry, hits.valid)
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
        u, v = held(mi.Float(u), 0, 1), held(mi.Float(v), 0, 1)
        seed = dr.gather(mi.UInt32, self._seed, facet, hits.valid)
        return facet, owner_of(u, v, seed, dr.select(hits.valid, n * n, 1))

    def device_corners(self, facet: mi.UInt32, active: mi.Bool | bool = True) -> tuple:
        """Return the corners of facets, three Array3f64 (R,) [m], and n, UInt32 (R,)."""
        lib = self.lib
        row = dr.gather(lib.Array4u, self._faces, facet, active)
        corners = (dr.gather(lib.Array4f, self._vertices, row[i], active) for i in range(3))
        return (*(lib.Array3f64(v[0], v[1], v[2]) for v in corners), self._rows_of_cells(facet, active))

    def _rows_of_cells(self, facet: mi.UInt32, active: mi.Bool | bool = True) -> mi.UInt32:
        """Return n, into how many rows facets (R,) are cut."""
        return mi.UInt32(1) if self._cuts is None else dr.gather(mi.UInt32, self._cuts, facet, active)

    def seed_of(self, key: mi.UInt32) -> mi.UInt32:
        """Return the seeds of the sequences of places, from the keys of facets."""
        return hashed(self.lib, key, mi.UInt32(Salt.PLACE))

    def amplitude_key(self, key: mi.UInt32) -> mi.UInt32:
        """Return what the amplitudes of a facet's scatterers are hashed from, from the keys of facets."""
        return hashed(self.lib, key, mi.UInt32(Salt.AMPLITUDE))

    def amplitude(self, facet: mi.UInt32, amplitude_key: mi.UInt32, k: mi.UInt32, u: mi.Float, v: mi.Float,
                  turned: mi.Float) -> tuple[mi.Float, mi.Float]:
        """Return amplitudes a_n of scatterers at (u, v), turned by an angle [rad]."""
        if self.amplitudes.change:
            real, imaginary = self.at(facet, k).amplitude
            sine, cosine = dr.sincos(turned)
            return real * cosine - imaginary * sine, real * sine + imaginary * cosine
        return gaussian(self.lib, *hashed_pair(self.lib, amplitude_key, k), turned)

    def glinted(self, cells: Cells, area: mi.Float) -> Cells:
        """Return scatterers as they are where each stands for an area (R,) [m²]."""
        if not self.glinting:
            return replace(cells, area=area)
        root = self.root_of_glints(self.glints_of(reinterpreted(mi.UInt32, cells.shape)), cells.point, area)
        return replace(cells, area=area, amplitude=(cells.amplitude[0] * root, cells.amplitude[1] * root))

    def glints_of(self, shape: mi.UInt32) -> tuple[mi.Float, mi.Float]:
        """Return density [1/m²] and share of the glints of shapes by their registry index, (R,)."""
        per_area, share = dr.gather(self.lib.Array2f, self._glints, shape)
        return dr.maximum(per_area, FEWEST), share

    def root_of_glints(self, glints: tuple[mi.Float, mi.Float], point: dr.ArrayBase, area: mi.Float) -> mi.Float:
        """Return √G of scatterers (R,) at points that stand for areas [m²]."""
        return dr.sqrt(with_glints(self.lib, mi.Float(point.x), mi.Float(point.y), dr.detach(area), *glints))

    def exist(self, facet: mi.UInt32, k: mi.UInt32, share: mi.Float) -> mi.Bool:
        """Return True for scatterers that exist where a sonar takes a share of the n² of each facet."""
        n = mi.Float(self._rows_of_cells(facet))
        return exists(k, self.threshold_of(facet), share * n * n)

    def threshold_of(self, facet: mi.UInt32) -> mi.Float:
        """Return h of facets (R,), see `nested_points`."""
        return dr.gather(mi.Float, self._threshold, facet)

    def at(self, facet: mi.UInt32, k: mi.UInt32) -> Cells:
        """Return scatterers k (R,) of facets (R,), of which each facet has n²."""
        lib = self.lib
        a, b, c, n = self.device_corners(facet)
        facts = self.facts(facet)
        u, v = place_of(k, self.seed_of(facts[2]))
        point = a + (b - a) * lib.Float64(u) + (c - a) * lib.Float64(v)
        across = dr.cross(mi.Vector3f(b - a), mi.Vector3f(c - a))
        twice, cuts = dr.norm(across), mi.Float(n)
        normal, shape = across / dr.maximum(twice, 1e-30), reinterpreted(mi.ShapePtr, facts[0])
        uv = self.texture_coordinates(facet, facts[3] != 0, u, v)
        bits = hashed_pair(lib, self.amplitude_key(facts[2]), k)
        return Cells(point=point, normal=normal, area=0.5 * twice / (cuts * cuts), primitive=facts[1], shape=shape,
                     uv=uv, amplitude=self.amplitudes.of(*bits, point, normal, shape, facts[1], uv),
                     label=dr.gather(lib.Array4u, self._faces, facet)[3], smooth=self.smooth_normals(facet, u, v),
                     part=None if self._parts is None else dr.gather(mi.UInt32, self._parts, facet))

    def corners(self, facet: np.ndarray) -> np.ndarray:
        """Return the corners of facets (K,) on the host, (K, 3, 3) [m]."""
        vertices, faces = self._on_host
        return vertices[faces[facet, :3], :3]

    def facts(self, facet: mi.UInt32) -> Array4u:
        """Return registry index of the shape, number there, hash key, and 1 if it has texture coordinates."""
        shape = dr.gather(mi.UInt32, self._registry, facet)
        row = dr.gather(self.lib.Array4u, self._rows, shape)
        return self.lib.Array4u(shape, facet - row[0], dr.gather(mi.UInt32, self._keys, facet), row[2])

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


def to_box(point: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return the distances (K,) of points (K, 3) from the smallest box that holds places (N, 3) [m]."""
    low, high = places.min(0).astype(np.float32), places.max(0).astype(np.float32)
    return np.sqrt(sum(np.square(np.clip(column, a, b) - column) for column, a, b in zip(point.T, low, high)))


def _barycentric(point, a, b, c):
    """Return (u, v), Float64, of points in the planes of triangles (a, b, c)."""
    e, f, w = b - a, c - a, point - a
    ee, ef, ff, we, wf = dr.dot(e, e), dr.dot(e, f), dr.dot(f, f), dr.dot(w, e), dr.dot(w, f)
    scale = dr.rcp(dr.maximum(ee * ff - ef * ef, 1e-30))
    return (ff * we - ef * wf) * scale, (ee * wf - ef * we) * scale
