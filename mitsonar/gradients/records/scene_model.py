"""Model a sonar's mean intensities as a function of the scene: a `ForwardModel` over `record_field`.

Parameters are named as in `mi.traverse(scene)`. The model writes them into the scene, so nothing else may do so.
"""
from __future__ import annotations

from collections.abc import Callable, Sequence

import mitsuba as mi
import numpy as np

from mitsonar.device.turns import one_at_a_time

from ..model import Values
from ..parameters.scene_values import SceneValues
from .pictures import Picture
from .record_field import RecordField


class SceneModel:
    """Mean intensities of a sonar's record as a function of parameters.

    Parameters
    ----------
    scene : mitsuba.Scene
    keys : sequence of str
        Names, in `mi.traverse(scene)`, of the parameters that vary.
    picture : Picture
        Picture of the sonar.
    seed : int
        Seed of ray directions.
    edges : bool
        Include moving outlines, and the lit area that moves with them, in derivatives.
    plan : function, optional
        Returns the picture that a render of the present scene would plan. Records of other values then have its bins
        and beams, so that a check includes changes that a gradient leaves out. Default: bins and beams stay.

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

    def __init__(self, scene: mi.Scene, keys: Sequence[str], picture: Picture, *, seed: int = 0,
                 edges: bool = True, plan: Callable[[], Picture] | None = None):
        self._values = SceneValues(scene, keys)
        self.start, self.units = self._values.start, self._values.units
        self._field, self._plan = RecordField(picture, seed, edges=edges), plan
        self.shape = self._field.shape

    def __repr__(self) -> str:
        pings, rows, bins = self.shape
        return (f"SceneModel of {pings} pings, {rows} rows, {bins} bins by "
                + ", ".join(f"{key} {start.shape}" for key, start in self.start.items()))

    @one_at_a_time
    def value(self, values: Values) -> np.ndarray:
        """Return the record (N,) [µPa²] for values; see `ForwardModel.value`."""
        self._values.write(values)
        return self._field.value(None if self._plan is None else self._plan())

    @one_at_a_time
    def linearised(self, values: Values) -> SceneLinearised:
        """Return the record about values, with its Jacobian; see `ForwardModel.linearised`."""
        self._values.write(values)
        return SceneLinearised(self._values, self._field)


class SceneLinearised:
    """Hold a `SceneModel` about the values that its scene has now, as a `Linearised`."""
    # told [str, float]

    def __init__(self, values: SceneValues, field: RecordField):
        self._values = values.attached()
        self._about = field.about()
        self.value = self._about.value

    @property
    def told(self) -> dict[str, float]:
        """Shares of echoes and bins that the record and its derivatives leave out."""
        return self._about.told

    @one_at_a_time
    def forward(self, tangents: Values) -> np.ndarray:
        """Return J v; see `Linearised.forward`."""
        directions = self._values.directions(tangents)
        self._values.hold()
        moved = self._about.pushed(lambda: self._values.set_tangents(directions))
        self._values.clear()
        return moved

    @one_at_a_time
    def backward(self, cotangent: np.ndarray) -> dict[str, np.ndarray]:
        """Return Jᵀ w; see `Linearised.backward`."""
        weights = np.asarray(cotangent, float)
        if weights.shape != self.value.shape:
            raise ValueError(f"weights have the shape {weights.shape}, and the record {self.value.shape}; give one for "
                             "every value of it")
        if not np.all(np.isfinite(weights)):
            raise ValueError("weights hold numbers that are not finite; give 0 where a value does not count")
        self._values.hold()
        self._values.clear()
        self._about.pull(weights)
        return self._values.gradients()
