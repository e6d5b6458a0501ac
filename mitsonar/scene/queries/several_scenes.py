"""Parts of a scene that are asked together, such as what stands still and what moves: the nearest of their hits.

A change of one vertex makes Mitsuba build the tree of its whole scene anew, which takes a second for a bed of two
million triangles. Moving bodies therefore stand in a scene of their own, whose tree is small. The second query costs a
twentieth of the first.
"""
from __future__ import annotations

import functools
import operator
from collections.abc import Sequence
from typing import Any, Protocol, cast

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import reinterpreted, upload


def scene_of(shapes: Sequence[mi.Shape]) -> mi.Scene:
    """Return a scene of these shapes alone, which keep their ids, to trace rays against them."""
    names = [shape.id() for shape in shapes]
    scene = mi.load_dict({"type": "scene", **{f"part{number}": shape for number, shape in enumerate(shapes)}},
                         optimize=False)
    # Mitsuba has renamed the shapes after their keys
    for shape, name in zip(shapes, names):
        shape.set_id(name)
    return cast(mi.Scene, scene)


class MovingScene:
    """Meshes that move, in a group with a single instance: the tree of a group takes a third of the time to build."""

    def __init__(self, meshes: Sequence[mi.Mesh]):
        names = [mesh.id() for mesh in meshes]
        parts = {f"part{number}": mesh for number, mesh in enumerate(meshes)}
        self.scene = cast(mi.Scene, mi.load_dict({
            "type": "scene", "bodies": {"type": "shapegroup", **parts},
            "all": {"type": "instance", "group": {"type": "ref", "id": "bodies"}}}, optimize=False))
        parameters = mi.traverse(self.scene)
        keys = [key for key in parameters.keys() if key.endswith("vertex_positions")]
        for mesh, name in zip(meshes, names):
            mesh.set_id(name)                  # Mitsuba has renamed them after their keys
        self._keys = sorted(keys, key=lambda key: int(key.split(".")[-2].removeprefix("part")))
        self._parameters = parameters
        pointers = [reinterpreted(mi.UInt32, mi.ShapePtr(mesh)) for mesh in meshes]
        self.registry = np.concatenate([pointer.numpy() for pointer in pointers])
        self._registry = upload(mi.UInt32, self.registry)
        dr.eval(self._registry)

    def move(self, vertices: Sequence[np.ndarray]) -> None:
        """Put the vertices (V, 3) [m] of all meshes elsewhere."""
        for key, places in zip(self._keys, vertices):
            self._parameters[key] = upload(mi.Float, places)
        self._parameters.update()

    def ray_test(self, ray: mi.Ray3f, coherent: Any = False, active: Any = True) -> mi.Bool:
        """Return True for rays that meet anything, as `mi.Scene` does."""
        return self.scene.ray_test(ray, coherent=coherent, active=active)

    def ray_intersect_preliminary(self, ray: mi.Ray3f, coherent: Any = False,
                                  active: Any = True) -> mi.PreliminaryIntersection3f:
        """Return the hits, on meshes as if they were in no group."""
        found = self.scene.ray_intersect_preliminary(ray, coherent=coherent, active=active)
        row = dr.gather(mi.UInt32, self._registry, found.shape_index, found.is_valid())
        found.shape, found.instance = reinterpreted(mi.ShapePtr, row), dr.zeros(mi.ShapePtr)
        return found


class Queried(Protocol):
    """What rays are asked of: a scene of Mitsuba's, or a part of a scene."""

    def ray_intersect_preliminary(self, ray: mi.Ray3f, coherent: Any, active: Any,
                                  /) -> mi.PreliminaryIntersection3f:
        """Return the first hits, as `mi.Scene` does."""
        ...

    def ray_test(self, ray: mi.Ray3f, coherent: Any, active: Any, /) -> mi.Bool:
        """Return True for rays that meet anything, as `mi.Scene` does."""
        ...


class SeveralScenes:
    """One or more parts of a scene with the queries of one; `whole` lists the shapes as they were loaded."""

    def __init__(self, whole: mi.Scene, *parts: Queried):
        self.whole, self.parts = whole, parts

    def shapes(self) -> list[mi.Shape]:
        """Return the shapes as they were loaded."""
        return self.whole.shapes()

    def ray_intersect_preliminary(self, ray: mi.Ray3f, coherent: Any = False,
                                  active: Any = True) -> mi.PreliminaryIntersection3f:
        """Return the nearest hits of all parts, as `mi.Scene` does."""
        first, *others = self.parts
        nearest, nearer = first.ray_intersect_preliminary(ray, coherent, active), mi.Ray3f(ray)
        for part in others:
            nearer.maxt = dr.minimum(nearer.maxt, nearest.t)
            found = part.ray_intersect_preliminary(nearer, coherent, active)
            nearest = dr.select(found.is_valid(), found, nearest)
        return nearest

    def ray_intersect(self, ray: mi.Ray3f, active: Any = True) -> mi.SurfaceInteraction3f:
        """Return the nearest interactions of all parts, as `mi.Scene` does."""
        found = self.ray_intersect_preliminary(ray, active=active)
        return found.compute_surface_interaction(ray, mi.RayFlags.All, active)

    def ray_test(self, ray: mi.Ray3f, coherent: Any = False, active: Any = True) -> mi.Bool:
        """Return True for rays that meet anything in any part, as `mi.Scene` does."""
        return functools.reduce(operator.or_, (part.ray_test(ray, coherent, active) for part in self.parts))


def asked_together(whole: mi.Scene, still: Sequence[mi.Shape], moving: MovingScene | None) -> mi.Scene:
    """Return a scene of shapes that stand still, with a moving scene beside it if there is one."""
    if moving is None:
        return scene_of(still)
    return cast(mi.Scene, SeveralScenes(whole, scene_of(still), moving) if still else moving)
