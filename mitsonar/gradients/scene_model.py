"""A scene's record as a function of what is in the scene: the `ForwardModel` of a sonar's mean intensities.

    I(x) = P L [Σ_r E_r(x)] + I_other + N        [µPa²], (ping, row, bin)

E_r -> the first-hit echoes of rays that stay the same (`energy_field`), P L -> pulse and sides (`pictures`), I_other ->
echoes of several bounces, of the water and of what has a phase, N -> noise; the last two are those at the start, and
stand still. Seabeds are met by normals between their nodes, in values and in gradients: of facets, neither would be
smooth.

Parameters are what `mi.traverse(scene)` names. The model writes them into the scene: nobody else should meanwhile.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np

from ..scene.geometry import Geometry
from .attached_scene import AttachedScene
from .energy_field import Block, EnergyField, Kept
from .model import Values
from .pictures import Picture
from .scene_values import SceneValues

__all__ = ["SceneLinearised", "SceneModel"]

MOST_KEPT = 8_000_000              # rays of which hits are kept between products: 150 bytes each


class SceneModel:
    """The mean intensities of a sonar's record, as a function of parameters.

    Parameters
    ----------
    scene : mitsuba.Scene
    keys : sequence of str
        Names of `mi.traverse(scene)` of parameters that can vary.
    picture : Picture
        Of the sonar: what is to be made.
    seed : int
        Of ray directions.

    Attributes
    ----------
    start, units
        See `ForwardModel`.
    shape : (int, int, int)
        Pings, rows and bins of the record.

    Raises
    ------
    ValueError
        If a name is unknown or its parameter has no gradient, or sonar and scene do not fit together.
    """

    def __init__(self, scene: mi.Scene, keys: Sequence[str], picture: Picture, *, seed: int = 0):
        self._scene, self._picture = scene, picture
        self._values = SceneValues(scene, keys)
        self.start, self.units = self._values.start, self._values.units
        survey = picture.survey
        self._survey = replace(survey, geometry=Geometry(scene, smooth_beds=True))
        self._field = EnergyField(self._survey, picture.rows, seed)
        self.shape = survey.track.pings, picture.rows.per_ping, picture.rows.bins.count
        self._attached = AttachedScene(picture, self._survey)
        self._still = picture.still(self._survey, seed)

    def value(self, values: Values) -> np.ndarray:
        """Give the record of values, (N,) [µPa²]; see `ForwardModel.value`."""
        self._values.write(values)
        field, found = self._field, []
        scenery = self._attached.scenery(field, attached=False)
        for block in field.blocks:
            found.append(_array(field.sums(scenery, block, field.kept(scenery, block))))
        return self._shown(np.concatenate(found))

    def linearised(self, values: Values) -> SceneLinearised:
        """Give the record about values, with its Jacobian; see `ForwardModel.linearised`."""
        self._values.write(values)
        return SceneLinearised(self)

    def _shown(self, energy: np.ndarray) -> np.ndarray:
        """What the picture shows of energies (N,) [1/m²]."""
        return self._linear(energy) + self._still

    def _linear(self, energy: np.ndarray) -> np.ndarray:
        return self._picture.shown(energy.reshape(self.shape) * self._field.unit).ravel()

    def _transposed(self, cotangent: np.ndarray) -> np.ndarray:
        return (self._picture.transposed(cotangent.reshape(self.shape)) * self._field.unit).ravel()


class SceneLinearised:
    """A `SceneModel` about values: see `model.Linearised`.

    Parameters
    ----------
    model : SceneModel
        Whose scene has these values now.
    """

    def __init__(self, model: SceneModel):
        self._model = model
        field = model._field
        self._values = model._values.attached()
        self._scenery = model._attached.scenery(field, attached=True)
        rays = sum(dr.width(rays.direction) for block in field.blocks for rays in block.rays)
        self._kept = [self._traced(block) for block in field.blocks] if rays <= MOST_KEPT else None
        with dr.suspend_grad():
            found = [_array(field.sums(self._scenery, block, kept)) for block, kept in self._each()]
        self.value = model._shown(np.concatenate(found))

    def _traced(self, block: Block) -> list[Kept]:
        kept = self._model._field.kept(self._scenery, block)
        dr.eval(kept)
        return kept

    def _each(self):
        """Blocks with their hits, traced anew where they are not kept."""
        blocks = self._model._field.blocks
        for number, block in enumerate(blocks):
            yield block, self._traced(block) if self._kept is None else self._kept[number]

    def forward(self, tangents: Values) -> np.ndarray:
        """Give J v; see `Linearised.forward`."""
        values, field, found = self._values, self._model._field, []
        directions = values.directions(tangents)
        for block, kept in self._each():
            values.set_tangents(directions)
            scenery = self._model._attached.scenery(field, attached=True, like=self._scenery)
            sums = field.sums(scenery, block, kept)
            dr.forward_to(sums)
            found.append(_array(dr.grad(sums)))
        values.clear()
        return self._model._linear(np.concatenate(found))

    def backward(self, cotangent: np.ndarray) -> dict[str, np.ndarray]:
        """Give Jᵀ w; see `Linearised.backward`."""
        model, values, field = self._model, self._values, self._model._field
        weights = np.asarray(cotangent, float)
        if weights.shape != self.value.shape:
            raise ValueError(f"weights have the shape {weights.shape}, and the record {self.value.shape}; give one for "
                             "every value of it")
        weights, first = model._transposed(weights), 0
        values.clear()
        for block, kept in self._each():
            scenery = model._attached.scenery(field, attached=True, like=self._scenery)
            sums = field.sums(scenery, block, kept)
            count = dr.width(sums)
            if dr.grad_enabled(sums):
                dr.set_grad(sums, mi.Float64(np.ascontiguousarray(weights[first:first + count])))
                dr.enqueue(dr.ADMode.Backward, sums)
                dr.traverse(dr.ADMode.Backward)
            first += count
        return values.gradients()


def _array(sums: mi.Float64) -> np.ndarray:
    return dr.detach(sums).numpy().astype(float)
