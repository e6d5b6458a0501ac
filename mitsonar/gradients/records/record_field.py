"""Compute the mean intensities of a sonar's picture, with gradients.

    I = P L [Σ_r E_r] + I_other + N        [µPa²], (ping, row, bin)

E_r -> first-hit echoes of rays that stay the same (`energy_field`), P L -> pulse and sides (`pictures`), I_other ->
echoes of several bounces, of the water and with phases, N -> noise; the last two are constant. Seabeds have normals
that are interpolated between nodes, in values and in gradients: with facets neither would be smooth.

Gradients are those of Dr.Jit by arrays in the scene; the owner of the leaves asks `FieldLinearised` for products.
"""
from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cached_property

import drjit as dr
import mitsuba as mi
import numpy as np

from ..attached.scene import AttachedScene
from ..edges.edge_terms import EdgeTerms
from ..edges.jump_lines import LineMaker
from ..edges.unseen import may_meet, seen_in, shares
from .energy_field import Block, EnergyField, Kept, Samplers, Scenery
from .pictures import Picture

MOST_KEPT = 8_000_000              # rays of which hits are kept between products: 150 bytes each


class RecordField:
    """Compute a sonar's record and its derivatives."""
    # still (N,) [µPa²]; still_echoes [µPa²]

    def __init__(self, picture: Picture, seed: int, *, edges: bool = True):
        survey = picture.survey
        survey = replace(survey, world=survey.world.smoothed())
        self._picture = picture
        self.outlines, self._makers = edges, {}
        self.unsampled: list[tuple[str, str]] = []
        self.energy = EnergyField(survey, picture.rows, seed)
        self.shape = _shape(picture)
        self.scene = AttachedScene(picture, survey)
        with dr.suspend_grad():
            self.still = picture.still(survey, seed)
            self.still_echoes = max(float(np.sum(self.still - picture.noise)), 0.0)

    def value(self, picture: Picture | None = None) -> np.ndarray:
        """Return the record (N,) [µPa²] of the present scene."""
        picture = self._picture if picture is None else picture
        shape = _shape(picture)
        if shape != self.shape:
            raise ValueError(f"a render of the changed scene has the shape {shape} (ping, row, bin), and the record "
                             f"{self.shape}; gradients need both alike")
        energy = self.energy.of_rows(picture.rows)
        scenery = self.scene.scenery(energy)
        with dr.suspend_grad():
            sums = [_array(energy.sums(scenery, block, energy.kept(scenery, block))) for block in energy.blocks]
        return self._linear(picture, sums) + self.still

    def about(self) -> FieldLinearised:
        """Return the record about the present scene, with products by its Jacobian."""
        return FieldLinearised(self)

    def samplers(self, scenery: Scenery) -> Samplers | None:
        """Return samplers of points on lines that move with attached parameters, or None if none moves."""
        if not self.outlines:
            return None
        geometry, attached = scenery.tracer.geometry, self.scene.attached(scenery)
        meshes = tuple(range(len(geometry.meshes)) if attached.moves else geometry.moving())
        shapes = attached.facets.shapes
        outlined = [] if shapes is None else shapes.numbers if attached.moves else shapes.moving
        self.unsampled = [] if not geometry.others else may_meet(geometry, outlined, meshes)
        if meshes not in self._makers:
            self._makers = {meshes: LineMaker(geometry, list(meshes))}
        lines = self._makers[meshes].lines(geometry)
        if not len(lines.ends) and not outlined:
            return None
        return self.energy.sampler(scenery, lines if len(lines.ends) else None, outlined)

    def shown(self, energy: list[np.ndarray]) -> np.ndarray:
        """Return the picture of blocks of energies [1/m²]."""
        return self.linear(energy) + self.still

    def linear(self, energy: list[np.ndarray]) -> np.ndarray:
        """Return the picture of blocks of energies without its constant part."""
        return self._linear(self._picture, energy)

    def _linear(self, picture: Picture, energy: list[np.ndarray]) -> np.ndarray:
        """Return another picture of blocks of energies, without its constant part."""
        return picture.shown(np.concatenate(energy).reshape(self.shape) * self.energy.unit).ravel()

    def transposed(self, cotangent: np.ndarray) -> np.ndarray:
        """Return the transpose of `linear`."""
        return (self._picture.transposed(cotangent.reshape(self.shape)) * self.energy.unit).ravel()


class FieldLinearised:
    """Hold a record about the present scene."""
    # value (N,) [µPa²]

    def __init__(self, field: RecordField):
        self._field, self._energy = field, field.energy
        self._scenery = field.scene.scenery(field.energy)
        self._samplers = field.samplers(self._scenery)
        self._unsampled = field.unsampled
        rays = sum(dr.width(rays.direction) for block in field.energy.blocks for rays in block.rays)
        self._kept = [self._traced(block) for block in field.energy.blocks] if rays <= MOST_KEPT else None
        with dr.suspend_grad():
            self.value = field.shown([_array(self._energy.sums(self._scenery, block, kept))
                                      for block, kept, _ in self._each(edges=False)])

    @cached_property
    def told(self) -> dict[str, float]:
        """Shares of echoes and bins that the record and its derivatives leave out."""
        found = [seen_in(self._energy, self._scenery, block, kept) for block, kept, _ in self._each(edges=False)]
        told, echoes = shares(found, outlines=self._field.outlines), self._field.still_echoes
        told |= {f"where {one} and {other} meet, left out": 1.0 for one, other in self._unsampled}
        if echoes > 0:                                     # of several bounces, of the water, of what has a phase
            moving = float(np.sum(self.value - self._field.still))
            told["echoes that stand still"] = echoes / (echoes + moving)
        return told

    def _traced(self, block: Block, edges: bool = True) -> tuple[list[Kept], list[EdgeTerms]]:
        kept = self._energy.kept(self._scenery, block)
        dr.eval(kept)
        if self._samplers is None or not edges:
            return kept, []
        return kept, self._energy.edges(self._scenery, block, self._samplers)

    def _each(self, edges: bool = True) -> Iterator[tuple[Block, list[Kept], list[EdgeTerms]]]:
        """Yield blocks with their hits, traced anew where they are not kept; edges are optional then."""
        for number, block in enumerate(self._energy.blocks):
            yield block, *(self._traced(block, edges) if self._kept is None else self._kept[number])

    def pushed(self, set_tangents: Callable[[], None]) -> np.ndarray:
        """Return J v, (N,); `set_tangents` sets v at the leaves, and is called for every block."""
        found = []
        for block, kept, edges in self._each():
            set_tangents()
            sums = self._energy.sums(self._field.scene.attached(self._scenery), block, kept, edges)
            if dr.grad_enabled(sums):
                dr.forward_to(sums, flags=dr.ADFlag.ClearVertices)
            found.append(_array(dr.grad(sums)))
        return self._field.linear(found)

    def pull(self, cotangent: np.ndarray) -> None:
        """Add Jᵀ w for weights (N,) to the leaves."""
        weights, first = self._field.transposed(cotangent), 0
        for block, kept, edges in self._each():
            sums = self._energy.sums(self._field.scene.attached(self._scenery), block, kept, edges)
            count = dr.width(sums)
            if dr.grad_enabled(sums):
                dr.set_grad(sums, mi.Float64(np.ascontiguousarray(weights[first:first + count])))
                dr.enqueue(dr.ADMode.Backward, sums)
                dr.traverse(dr.ADMode.Backward, flags=dr.ADFlag.ClearVertices)
            first += count


def _shape(picture: Picture) -> tuple[int, int, int]:
    """Return the numbers of pings, rows and bins of a picture."""
    return picture.survey.track.pings, picture.rows.per_ping, picture.rows.bins.count


def _array(sums: mi.Float64) -> np.ndarray:
    return dr.detach(sums).numpy().astype(float)
