"""Facets and labels of a Mitsuba scene, gathered once for the tracer.

The normal at a vertex is the mean of the normals of its faces, weighted by their angles at the vertex:

    n_v = Σ_f α_fv n_f / |Σ_f α_fv n_f|                             (Thürmer and Wüthrich 1998, J. Graphics Tools 3, 43)

Mitsuba computes the same, but adds on all cores in any order, so that the last bits differ from run to run.
"""
from __future__ import annotations

import weakref
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, cast

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import give_back_memory, upload
from mitsonar.device.types import ArrayTypes
from mitsonar.scattering.bodies.scattering_functions import ScatteringFunction

from .labels import ShapeLabels
from .moving import Movements, MovingPart, Stand, moving_shape
from .protocols import (
    LocatedShape,
    has_smooth_normals,
    is_mirror,
    is_sea_surface,
    sound_material,
    target_shape,
)
from .queries.height_field import HeightField, large_grid
from .queries.several_scenes import MovingScene, SeveralScenes, scene_of
from .sea import Sea, SeaStand, WavySurface, wavy_surface

MANY = 1 << 19                     # facets, of whose tables memory is given back


def vertex_normals(vertices: np.ndarray,    # (V, 3) [m]
                   faces: np.ndarray) -> np.ndarray:
    """Compute the normals at vertices, float32 (V, 3), from faces (F, 3)."""
    corners = np.ascontiguousarray(vertices.astype(float).T[:, faces.T])                  # axis, corner, face
    share = np.empty((3, len(faces), 3))                                                  # axis, face, corner
    for corner in range(3):
        ahead, back = corners[:, (corner + 1) % 3] - corners[:, corner], corners[:, corner - 1] - corners[:, corner]
        across = [ahead[i] * back[j] - ahead[j] * back[i] for i, j in ((1, 2), (2, 0), (0, 1))]
        twice_area = np.sqrt(across[0] ** 2 + across[1] ** 2 + across[2] ** 2)
        angle = np.arctan2(twice_area, ahead[0] * back[0] + ahead[1] * back[1] + ahead[2] * back[2])
        weight = angle / np.where(twice_area > 0, twice_area, np.inf)
        for axis in range(3):
            share[axis, :, corner] = across[axis] * weight
    total = np.stack([np.bincount(faces.ravel(), part.ravel(), len(vertices)) for part in share], -1)
    length = np.linalg.norm(total, axis=-1, keepdims=True)
    return (total / np.where(length > 0, length, 1)).astype(np.float32)


class Target(NamedTuple):
    """A point target."""

    position: np.ndarray | Sequence[float]  # (3,) [m]
    strength_db: float                         # [dB re 1 m²]; NaN if a function of its own scatters
    label: int
    scattering: ScatteringFunction | None = None
    rotation: np.ndarray | None = None         # (3, 3): from the target's axes to the scene's, if it has a function

    def strength_at(self, frequency: float, sound_speed: float) -> float:
        """Return the backscattering target strength at a frequency [Hz], mean over aspects [dB re 1 m²]."""
        if self.scattering is None:
            return float(self.strength_db)
        form = self.scattering.form(np.array([frequency]), *self.scattering.examples(), sound_speed)
        return float(10 * np.log10(np.mean(np.abs(form) ** 2)))


class MovingBody(NamedTuple):
    """A moving object, or a part of one that has a gait: its shape in the scene, and the copy that moves."""

    part: MovingPart
    label: int
    number: int                    # of its motion: the label, or one beyond all labels for further parts
    copy: mi.Mesh | None           # None: a point target, which rays pass
    first_vertex: int
    normals: np.ndarray | None     # (V, 3): at rest, if it scatters by normals of its vertices


class MovingSea(NamedTuple):
    """A sea surface with waves, likewise."""

    part: WavySurface
    label: int
    copy: mi.Mesh
    first_vertex: int
    normals: None = None

    @property
    def number(self) -> int:
        """Return the number of its motion."""
        return self.label


class Geometry:
    """Facets of a scene, gathered once so that hit points can be rebuilt without a call for each shape.

    Has `labels` {number: name}, `depth_range` [m], `horizontal_bounds` [m] and `local_origin` (2,) [m] or None.
    `still` is the scene of what never moves, `scene` all of it. `bodies` are the moving objects, `movers` these and a
    sea surface with waves; they stand where `stand` has put them last.
    """

    def __init__(self, scene: mi.Scene, *, smooth_beds: bool = False):
        shapes = scene.shapes()
        if not shapes:
            raise ValueError("the scene has no shape to hit; add a seabed, e.g. <shape type=\"seabed\"/>")
        _check_extents(shapes)
        _check_merged(shapes)
        self.loaded, self.scene, self.still = scene, scene, scene
        self._moving_scenes: list[tuple[MovingScene, set[str]]] = []   # with the ids of their shapes
        self.named = ShapeLabels(shapes)
        self.labels = self.named.names
        pointers: Any = scene.shapes_dr()
        numbers: Any = dr.reinterpret_array(mi.UInt32, pointers)
        registry, copies = numbers.numpy(), {}
        self.moving_scene: MovingScene | None = None                   # of the objects alone
        self.sea = next((Sea(surface, self.named.of(shape), mirrors=is_mirror(shape)) for shape in shapes
                         if (surface := wavy_surface(shape)) is not None), None)
        if self.sea is not None or any(moving_shape(shape) is not None for shape in shapes):
            registry, copies = self._moved_apart(scene, registry)
        else:
            self.scene = self.still = self._standing(scene, {}, registry)
        self.bodies: list[MovingBody] = []
        seas: list[MovingSea] = []
        self.stands: list[Stand | SeaStand] = []
        self.deepest_moving = -np.inf                                  # [m]: depth of the lowest moving point
        self.body_samples: tuple[np.ndarray, ...] | None = None        # made by `shadows.exposure`
        # what the places of moving objects follow from: the movements, and a ping of theirs
        self.moment: tuple[Movements, tuple[object, ...]] | None = None
        self._followers: list[weakref.WeakMethod] = []
        # Mitsuba's own materials may read textures; mitsonar's have an attribute for it
        self.textured = any((own := sound_material(shape.bsdf())) is None or own.textured for shape in shapes)
        # columns: label, first face, is a mesh, has texture coordinates
        rows = np.zeros((int(registry.max()) + 1, 4), np.uint32)
        vertices, faces, texcoords, normals, first_vertex, first_face = [], [], [], [], 0, 0
        self.meshes, self.others, self.first_vertices, self.smooth_beds = [], [], [], smooth_beds
        any_smooth = any(self.is_smooth(shape) for shape in shapes)
        for index, shape in zip(registry, shapes):
            rows[index, 0] = self.named.of(shape)
            parameters = mi.traverse(shape)
            if "vertex_positions" not in parameters:                        # Mitsuba's rectangle calls itself a mesh
                self.others.append((int(index), shape))
                continue
            vertex = dr.detach(parameters["vertex_positions"]).numpy().reshape(-1, 3)
            face = parameters["faces"].numpy().reshape(-1, 3)
            if face.max(initial=0) >= len(vertex):     # in a scene that Mitsuba itself loaded, or built in Python
                raise ValueError(f'a face of the mesh "{shape.id()}" names vertex {face.max()}, and the vertices count '
                                 f"from 0 to {len(vertex) - 1}; repair the mesh")
            rows[index, 1:] = first_face, 1, self.textured and shape.has_vertex_texcoords()
            if self.textured:
                texcoords.append(parameters["vertex_texcoords"].numpy().reshape(-1, 2) if rows[index, 3]
                                 else np.zeros((len(vertex), 2), np.float32))
            vertices.append(vertex)
            if any_smooth:
                normals.append(vertex_normals(vertex, face) if self.is_smooth(shape)
                               else np.zeros((len(vertex), 3), np.float32))
            corners = np.empty((len(face), 4), np.uint32)
            corners[:, 3] = self.named.of_faces(shape, len(face))
            np.add(face, np.uint32(first_vertex), out=corners[:, :3])
            faces.append(corners)
            self.meshes.append((int(index), shape, first_face, len(face)))
            self.first_vertices.append(first_vertex)
            if (moving := moving_shape(shape)) is not None:
                label = self.named.of(shape)
                own = vertex_normals(moving.poses[0], face) if self.is_smooth(shape) else None
                for part in moving.parts:
                    self.bodies.append(MovingBody(
                        part, label, len(self.named) + 1 + len(self.bodies) if part.first else label,
                        copies.get(shape.id()), first_vertex + part.first,
                        None if own is None else own[part.first:part.first + len(part.rest)]))
            elif (surface := wavy_surface(shape)) is not None and shape.id() in copies:
                seas.append(MovingSea(surface, self.named.of(shape), copies[shape.id()], first_vertex))
            first_vertex, first_face = first_vertex + len(vertex), first_face + len(face)
        self.movers: list[MovingBody | MovingSea] = [*self.bodies, *seas]
        self.only_meshes = len(faces) == len(shapes)
        self.rows, self.kinds = upload(mi.UInt32, rows), upload(mi.UInt32, self.named.label_kinds()[rows[:, 0]])
        # four wide, so that a vertex is one aligned packet, and a face with its label another one
        self.vertices = upload(mi.Float, _padded(vertices))
        self.faces = upload(mi.UInt32, np.concatenate(faces) if faces else np.zeros((1, 4), np.uint32))
        self.texcoords = upload(mi.Float, np.concatenate(texcoords)) if self.textured and texcoords else None
        self.normals = upload(mi.Float, _padded(normals)) if any_smooth else None
        dr.eval(self.rows, self.kinds, self.vertices, self.faces)
        self.large = first_face > MANY     # its tables are worth giving memory back for
        if self.large:
            del vertices, texcoords, faces, normals, vertex, face, corners
            give_back_memory()         # what these tables and the scene were made of is twice as much as they are
        box = scene.bbox()
        self.depth_range = -float(box.max.z), -float(box.min.z)
        surface = [shape for shape in shapes if is_sea_surface(shape)]
        if len(surface) > 1:
            raise ValueError(f"the scene has {len(surface)} sea surfaces; leave one")
        self.surface_label = self.named.surface
        self.surface_mirrors = any(is_mirror(shape) for shape in surface)
        if len(shapes) > len(surface):
            box = mi.ScalarBoundingBox3f()
            for shape in shapes:
                if shape not in surface:
                    box.expand(shape.bbox())
        self.horizontal_bounds = (float(box.min.x), float(box.min.y)), (float(box.max.x), float(box.max.y))
        located = [shape for shape in shapes if isinstance(shape, LocatedShape) and shape.local_origin is not None]
        self.local_origin = np.asarray(located[0].local_origin, float) if located else None
        self.crs = located[0].crs if located else None

    def mesh(self, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Return vertices (V, 3) [m] and corners of faces (count, 3) of the mesh with these rows in `faces`."""
        faces = self.faces.numpy().reshape(-1, 4)[first:first + count, :3]
        lowest, highest = int(faces.min()), int(faces.max())
        return self.vertices.numpy().reshape(-1, 4)[lowest:highest + 1, :3], faces - np.uint32(lowest)

    def _moved_apart(self, scene: mi.Scene, registry: np.ndarray) -> tuple[np.ndarray, dict]:
        """Put copies of what moves into scenes of their own; return registry indices and copies by id."""
        if dr.backend_v(mi.Float) != dr.JitBackend.LLVM:
            # OptiX leaves out what a kernel traces in a second scene
            raise ValueError("what moves needs an LLVM variant of Mitsuba, such as llvm_ad_mono, and this is "
                             f"{mi.variant()}; set that variant, or take moving shapes and waves out of the scene")
        shapes = scene.shapes()
        movers = [shape for shape in shapes if moving_shape(shape) is not None]
        names = [shape.id() for shape in movers]
        if len(set(names)) < len(names):
            raise ValueError(f'two moving shapes are named "{max(names, key=names.count)}"; give each an id of its own')
        groups = [{shape.id(): _copy_of(shape) for shape in group} for group in (
            [shape for shape in movers if target_shape(shape) is None],
            [shape for shape in shapes if wavy_surface(shape) is not None and not is_mirror(shape)])]
        scenes = [MovingScene(list(group.values())) if group else None for group in groups]
        self.moving_scene, copies = scenes[0], {**groups[0], **groups[1]}
        self.still = self._standing(scene, copies, registry)
        self.scene, index, self._moving_scenes = self.still, {}, []
        for group, moving in zip(groups, scenes):
            if moving is not None:
                self.scene = cast(mi.Scene, SeveralScenes(scene, self.scene, moving))
                index.update(zip(group, moving.registry))
                self._moving_scenes.append((moving, {*group}))
        return np.array([index.get(shape.id(), own) for shape, own in zip(shapes, registry)], np.uint32), copies

    def _standing(self, scene: mi.Scene, copies: dict, registry: np.ndarray) -> mi.Scene:
        """Return the scene of what has no copy, in which large beds that are grids need no tree."""
        fields, others = [], []
        for shape, index in zip(scene.shapes(), registry):
            if shape.id() in copies:
                continue
            if (grid := large_grid(shape)) is None:
                others.append(shape)
            else:
                fields.append(HeightField(grid, int(index)))
        if fields:
            return cast(mi.Scene, SeveralScenes(scene, *fields, *([scene_of(others)] if others else [])))
        return scene_of(others) if copies else scene

    @property
    def moves(self) -> bool:
        """Return True if anything in the scene moves."""
        return bool(self.bodies) or self.sea is not None

    @property
    def body_stands(self) -> list[Stand]:
        """Return where the moving objects stand, in the order of `bodies`."""
        return [stand for stand in self.stands if isinstance(stand, Stand)]

    def refuse_bodies(self, why: str) -> None:
        """Raise `ValueError` if objects move; `why` names who needs a scene that stands still."""
        if self.bodies:
            raise ValueError(f'{why} a scene that stands still, and the shape "{self.bodies[0].part.id()}" moves; '
                             "take the nested shape out of its <shape type=\"moving\">")
        if self.sea is not None:
            raise ValueError(f"{why} a scene that stands still, and the sea surface has waves; leave them out")

    def stand(self, stands: list[Stand | SeaStand]) -> None:
        """Put what moves, in the order of `movers`, where it stands; who follows is told."""
        self.stands, self.moment = stands, None
        places, rows, turned, meshes = [], [], [], {}
        for body, stand in zip(self.movers, stands):
            vertices = (stand.vertices.reshape(-1, 3) if isinstance(stand, SeaStand)
                        else stand.placed(body.part.rest)).astype(np.float32)
            places.append(vertices)
            if body.copy is not None:
                meshes.setdefault(body.part.id(), []).append(vertices)
            rows.append(body.first_vertex + np.arange(len(vertices), dtype=np.uint32))
            if self.normals is not None:
                normals = (np.zeros_like(vertices) if body.normals is None
                           else stand.turned(body.normals, body.part.rest))
                turned.append(normals.astype(np.float32))
        for moving, names in self._moving_scenes:
            moving.move([parts[0] if len(parts) == 1 else np.concatenate(parts)
                         for name, parts in meshes.items() if name in names])
        if places:
            self.moved_rows, self.moved_places = np.concatenate(rows), np.concatenate(places)
            self.vertices = self.with_moved(self.vertices, self.moved_places)
            if self.normals is not None:
                self.moved_normals = np.concatenate(turned)
                self.normals = self.with_moved(self.normals, self.moved_normals)
        for follower in self._followers:
            if (moved := follower()) is not None:
                moved()

    def carried(self, number: np.ndarray, points: np.ndarray,
                directions: np.ndarray | None = None) -> np.ndarray:
        """Return points (N, 3) of the own frames of `movers` with these numbers (N,), moved; or directions there.

        Numbers of objects rise.
        """
        moved, ends = np.empty(points.shape), np.searchsorted(number, np.arange(len(self.stands) + 1))
        for body, (stand, first, end) in enumerate(zip(self.stands, ends, ends[1:])):
            own = slice(first, end) if self.sea is None else np.flatnonzero(number == body)
            moved[own] = stand.placed(points[own]) if directions is None else stand.turned(directions[own], points[own])
        return moved

    def at_rest(self, vertices: np.ndarray) -> np.ndarray:
        """Return vertices (V, 4) with those of what moves in its own frame."""
        vertices = vertices.copy() if self.movers else vertices
        for body in self.movers:
            vertices[body.first_vertex:body.first_vertex + len(body.part.rest), :3] = body.part.rest
        return vertices

    def body_numbers(self, vertex: np.ndarray) -> np.ndarray:
        """Return the numbers in `movers` of vertices (N,) that move."""
        first = np.array([body.first_vertex for body in self.movers])
        order = np.argsort(first)
        return order[np.searchsorted(first[order], vertex, side="right") - 1]

    def with_moved(self, table: mi.Float, places: np.ndarray) -> mi.Float:
        """Return a table, four wide, in which the rows of moving vertices hold other places (M, 3)."""
        return scattered_rows(table, self.moved_rows, places, 4)

    def body_boxes(self) -> Iterator[tuple[MovingBody, Stand, np.ndarray, np.ndarray]]:
        """Yield the moving objects, their stands, and the corners (3,) [m] of their boxes; of parts, the first one."""
        first = 0
        for body, stand in zip(self.bodies, self.body_stands):
            if not body.part.first:
                own = self.moved_places[first:first + body.part.shape.poses.shape[1]]
                first += len(own)
                yield body, stand, own.min(0).astype(float), own.max(0).astype(float)

    def follow(self, moved: Callable[[], None]) -> None:
        """Call a method after every `stand`, and at once if the objects stand; nothing happens in a still scene."""
        if self.movers:
            self._followers.append(weakref.WeakMethod(moved))
            if self.stands:
                moved()

    def widen(self, depths: tuple[float, float]) -> None:
        """Widen the range of depths [m] to hold other depths, those of moving objects."""
        self.depth_range = min(self.depth_range[0], depths[0]), max(self.depth_range[1], depths[1])
        self.deepest_moving = depths[1]

    def moving(self) -> list[int]:
        """Return the indices in `meshes` of those whose vertices carry gradients."""
        return [number for number, (_, shape, *_) in enumerate(self.meshes)
                if dr.grad_enabled(mi.traverse(shape)["vertex_positions"])]

    def is_smooth(self, shape: mi.Shape) -> bool:
        """Return True if a mesh scatters by normals interpolated between its vertices."""
        return has_smooth_normals(shape) or self.smooth_beds and self.named.of(shape) in self.named.seabed

    def targets(self) -> list[Target]:
        """Return the point targets, moving ones where they stand."""
        stands = {body.label: stand for body, stand in zip(self.bodies, self.body_stands)}
        targets = []
        for _, shape, *_ in self.meshes:
            if (target := target_shape(shape)) is not None:
                place, rotation = np.asarray(target.position, float), target.rotation
                if (stand := stands.get(self.named.of(shape))) is not None:
                    place = stand.placed(place)
                    rotation = None if rotation is None else stand.rotation @ rotation
                targets.append(Target(place, float(target.target_strength_db), self.named.of(shape),
                                      target.scattering, rotation))
        return targets


def interpolated(lib: ArrayTypes, normals: mi.Float, face: Any, u: mi.Float, v: mi.Float,
                 active: mi.Bool | bool = True) -> mi.Vector3f:
    """Return Σ λ_i n_i, Vector3f (R,), from four-wide normals at the corners of faces, at barycentric (u, v)."""
    return between_corners([mi.Vector3f(n[0], n[1], n[2]) for n in
                            (dr.gather(lib.Array4f, normals, face[i], active) for i in range(3))], u, v)


def between_corners(normals: list[mi.Vector3f], u: mi.Float, v: mi.Float) -> mi.Vector3f:
    """Return Σ λ_i n_i, Vector3f (R,), from normals at three corners, at barycentric (u, v)."""
    a, b, c = normals
    return a * (1 - u - v) + b * u + c * v


def scattered_rows(table: mi.Float, rows: np.ndarray, values: np.ndarray, width: int) -> mi.Float:
    """Return a table of rows of a `width` in which these rows (M,) begin with other values (M, K)."""
    index = width * rows.astype(np.uint32)[:, None] + np.arange(values.shape[1], dtype=np.uint32)
    # not evaluated here: each launch of a small kernel keeps all threads awake for a while
    dr.scatter(table, upload(mi.Float, values.astype(np.float32)), upload(mi.UInt32, index))
    return table


def _copy_of(shape):
    """Return a copy of a moving shape's mesh that can be moved while the shape stays as it was loaded."""
    properties, parameters = mi.Properties(), mi.traverse(shape)
    properties["bsdf"] = shape.bsdf()
    copy = mi.Mesh(shape.id(), shape.vertex_count(), shape.face_count(), props=properties,
                   has_vertex_texcoords=shape.has_vertex_texcoords())
    filled = mi.traverse(copy)
    for name in ("vertex_positions", "faces", *(["vertex_texcoords"] if shape.has_vertex_texcoords() else [])):
        filled[name] = type(filled[name])(parameters[name])
    filled.update()
    copy.set_id(shape.id())
    return copy


def _check_merged(shapes):
    """Refuse meshes that Mitsuba has merged into one without a name: their labels are lost."""
    if any(type(shape) is mi.Mesh and shape.class_name() == "Mesh" and not shape.id() for shape in shapes):
        raise ValueError("Mitsuba has merged meshes of one material in this scene, and their names with them; load it "
                         "by mitsonar.load_file, or by mi.load_file or mi.load_dict with optimize=False")


def _check_extents(shapes):
    for shape in shapes:
        box = shape.bbox()
        extents = np.array(box.max, float) - np.array(box.min, float)
        # point targets have no extent: rays pass them
        if not (np.isfinite(extents).all() and (np.sum(extents > 0) >= 2 or target_shape(shape) is not None)):
            name = f'"{shape.id()}"' if shape.id() else f"of the kind {shape.class_name().lower()}"
            raise ValueError(f"the shape {name} has no extent; give it a radius, a length or a scale above 0")


def _padded(parts):
    table = np.zeros((max(sum(map(len, parts)), 1), 4), np.float32)
    if parts:
        np.concatenate(parts, out=table[:, :3])
    return table
