"""Beds whose facets join the tree of a scene when rays ask for them.

Mitsuba builds the tree of a scene when it makes the scene, about 0.4 µs a facet. The picture of a fan sends some
hundred straight rays to the bed and no others, which need the facets near these rays alone. A bed that is made within
`held_back` therefore shows Mitsuba one facet without area until its scene stands; a `LateScene` then builds what is
asked for. A hit does not depend on the facets beside it.
"""
from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cached_property
from typing import Any, cast

import drjit as dr
import mitsuba as mi
import numpy as np

from ..protocols import LateFacets, late_facets
from ..two_scenes import TwoScenes, scene_of

BLOCK = 4                          # cells of a grid whose facets join together
STEP = 0.5                         # cells between the places of a line that are looked at
ABOVE = 1e-3                       # [m] over the highest node, where a line may still meet the bed
MOST_PLACES, MOST_SHARE = 500_000, 0.25    # of lines, and of a bed's blocks; beyond, all facets join

_holding = ContextVar("_holding", default=False)


@contextmanager
def held_back() -> Iterator[None]:
    """Let beds that are made in here hold their facets back."""
    token = _holding.set(dr.backend_v(mi.Float) == dr.JitBackend.LLVM)    # OptiX knows one scene in a kernel
    try:
        yield
    finally:
        _holding.reset(token)


def holding() -> bool:
    """Return True within `held_back`."""
    return _holding.get()


def join(scene: mi.Scene) -> None:
    """Give the beds of a scene the facets that they held back; those in the scene's tree stay without."""
    for shape, late in _beds(scene.shapes()):
        _put(shape, late.facets)


def late_scene(scene: mi.Scene) -> mi.Scene:
    """Return a scene, or one that builds its trees when they are asked for, if its beds came late."""
    beds = _beds(scene.shapes())
    return cast(mi.Scene, LateScene(scene, beds)) if beds else scene


class LateScene:
    """Scene with the queries of Mitsuba's, for a scene whose tree lacks `beds`."""

    def __init__(self, loaded: mi.Scene, beds: list[tuple[mi.Mesh, LateFacets]]):
        self.loaded, self._blocks = loaded, [_Blocks(mesh, late) for mesh, late in beds]
        self._partial: tuple[list[np.ndarray], mi.Scene] | None = None     # marked blocks, and a scene with them

    def shapes(self) -> list[mi.Shape]:
        """Return the shapes, beds included."""
        return self.loaded.shapes()

    @cached_property
    def whole(self) -> mi.Scene:
        """Return the scene with all facets."""
        return scene_of(self.shapes())

    def near(self, start: np.ndarray, end: np.ndarray) -> mi.Scene:
        """Return a scene that gives straight lines, from points (N, 3) to points (N, 3) [m], the hits of the whole."""
        return self._with([blocks.met_by(start, end) for blocks in self._blocks])

    def over(self, low: np.ndarray, high: np.ndarray) -> mi.Scene:
        """Return a scene that gives vertical rays within boxes (N, 2) to (N, 2) [m] the hits of the whole."""
        return self._with([blocks.within(low, high) for blocks in self._blocks])

    def _with(self, marks: list[np.ndarray | None]) -> mi.Scene:
        """Return a scene with marked blocks of each bed, or the whole if they are many."""
        known = [own for own in marks if own is not None and own.mean() < MOST_SHARE]
        if "whole" in self.__dict__ or len(known) < len(self._blocks):
            return self.whole
        if self._partial is None or any((own & ~held).any() for own, held in zip(known, self._partial[0])):
            scene: Any = self.loaded
            for blocks, own in zip(self._blocks, known):
                scene = TwoScenes(self.loaded, cast(mi.Scene, blocks.scene(own)), scene)
            self._partial = known, cast(mi.Scene, scene)
        return self._partial[1]

    def without(self, shapes: Sequence[mi.Shape]) -> mi.Scene | None:
        """Return the scene of all shapes but late beds if these are the given ones, else None."""
        others = {*self.shapes()} - {blocks.mesh for blocks in self._blocks}
        return self.loaded if others == {*shapes} else None

    def ray_intersect_preliminary(self, ray: mi.Ray3f, coherent: Any = False,
                                  active: Any = True) -> mi.PreliminaryIntersection3f:
        """Return the hits, as `mi.Scene` does."""
        return self.whole.ray_intersect_preliminary(ray, coherent=coherent, active=active)

    def ray_intersect(self, ray: mi.Ray3f, active: Any = True) -> mi.SurfaceInteraction3f:
        """Return the interactions, as `mi.Scene` does."""
        return self.whole.ray_intersect(ray, active)

    def ray_test(self, ray: mi.Ray3f, coherent: Any = False, active: Any = True) -> mi.Bool:
        """Return True for rays that meet anything, as `mi.Scene` does."""
        return self.whole.ray_test(ray, coherent=coherent, active=active)


class _Blocks:
    """Blocks of cells of a late bed."""

    def __init__(self, mesh: mi.Mesh, late: LateFacets):
        rows, columns = late.nodes
        self.mesh = mesh
        self._faces = late.facets.numpy().reshape(rows - 1, columns - 1, 6)
        box = mesh.bbox()
        self._low, high = np.array(box.min, float)[:2], np.array(box.max, float)
        self._step, self._top = (high[:2] - self._low) / (columns - 1, rows - 1), high[2] + ABOVE
        self._shape = -(-(rows - 1) // BLOCK), -(-(columns - 1) // BLOCK)

    def within(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Return marks of the blocks that reach into boxes."""
        marks = np.zeros(self._shape, bool)
        first = np.floor((low - self._low) / self._step).astype(int) - 1
        last = np.floor((high - self._low) / self._step).astype(int) + 1
        for (west, south), (east, north) in zip(np.maximum(first // BLOCK, 0), np.maximum(last // BLOCK + 1, 0)):
            marks[south:north, west:east] = True
        return marks

    def met_by(self, start: np.ndarray, end: np.ndarray) -> np.ndarray | None:
        """Return marks of the blocks that lines may meet; None if the lines are too long."""
        start = np.asarray(start, float)
        way = end - start
        # shares of a line between which it is not above the bed
        with np.errstate(divide="ignore", invalid="ignore"):
            cross = (self._top - start[:, 2]) / way[:, 2]
        first = np.where(start[:, 2] > self._top, np.where(way[:, 2] < 0, cross, np.inf), 0)
        last = np.where(end[:, 2] > self._top, np.where(way[:, 2] > 0, cross, -np.inf), 1)
        low = first <= last
        start, way, first, last = start[low], way[low], first[low], last[low]
        length = (last - first) * np.abs(way[:, :2] / self._step).max(1, initial=0)              # [cells]
        if length.sum() > MOST_PLACES * STEP:
            return None
        places = np.ceil(length / STEP).astype(int) + 1
        line = np.repeat(np.arange(len(places)), places)
        number = np.arange(len(line)) - np.repeat(np.cumsum(places) - places, places)
        share = first[line] + (last - first)[line] * number / np.maximum(places[line] - 1, 1)
        cell = np.floor((start[line, :2] + share[:, None] * way[line, :2] - self._low) / self._step).astype(int)
        marks = np.zeros(self._shape, bool)
        for aside in ((i, j) for i in (-1, 1) for j in (-1, 1)):       # a place may be rounded into the next cell
            column, row = (cell + aside).T // BLOCK
            inside = (column >= 0) & (row >= 0) & (column < marks.shape[1]) & (row < marks.shape[0])
            marks[row[inside], column[inside]] = True
        return marks

    def scene(self, marks: np.ndarray) -> _PartOfBed:
        """Return a scene of the marked blocks alone."""
        rows, columns, _ = self._faces.shape
        cells = marks.repeat(BLOCK, 0)[:rows].repeat(BLOCK, 1)[:, :columns]
        # a mesh needs a facet; a node three times has no area
        nodes, faces = np.unique(self._faces[cells] if cells.any() else np.zeros(3, np.uint32), return_inverse=True)
        own: Any = mi.traverse(self.mesh)
        part = mi.Mesh("part", len(nodes), faces.size // 3)
        parameters: Any = mi.traverse(part)
        parameters["vertex_positions"] = mi.Float(own["vertex_positions"].numpy().reshape(-1, 3)[nodes].ravel())
        parameters["faces"] = mi.UInt32(faces.ravel().astype(np.uint32))
        parameters.update()
        return _PartOfBed(self.mesh, scene_of([part]))


class _PartOfBed:
    """Scene of a part of a bed, whose hits are those of the bed but for the numbers of facets."""

    def __init__(self, mesh: mi.Mesh, scene: mi.Scene):
        self._mesh, self._scene = mi.ShapePtr(mesh), scene

    def ray_intersect_preliminary(self, ray: mi.Ray3f, coherent: Any = False,
                                  active: Any = True) -> mi.PreliminaryIntersection3f:
        """Return the hits, as `mi.Scene` does."""
        found = self._scene.ray_intersect_preliminary(ray, coherent=coherent, active=active)
        found.shape = dr.select(found.is_valid(), self._mesh, found.shape)
        return found

    def ray_test(self, ray: mi.Ray3f, coherent: Any = False, active: Any = True) -> mi.Bool:
        """Return True for rays that meet the part, as `mi.Scene` does."""
        return self._scene.ray_test(ray, coherent=coherent, active=active)


def near(scene: mi.Scene, start: np.ndarray, end: np.ndarray) -> mi.Scene:
    """Return a scene that gives straight lines between points (N, 3) [m] the hits of `scene`, perhaps a smaller one."""
    return scene.near(start, end) if isinstance(scene, LateScene) else scene


def over(scene: mi.Scene, low: np.ndarray, high: np.ndarray) -> mi.Scene:
    """Return a scene that gives vertical rays within boxes (N, 2) [m] the hits of `scene`, perhaps a smaller one."""
    return scene.over(low, high) if isinstance(scene, LateScene) else scene


def _beds(shapes: Sequence[mi.Shape]) -> list[tuple[mi.Mesh, LateFacets]]:
    return [(cast(mi.Mesh, shape), late) for shape in shapes if (late := late_facets(shape)) is not None]


def _put(mesh: mi.Mesh, facets: mi.UInt32) -> None:
    """Give a mesh other facets."""
    parameters = mi.traverse(mesh)
    parameters["faces"] = facets
    parameters.update()
