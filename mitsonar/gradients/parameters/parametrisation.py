"""Replace parameters of a model by others, by the chain rule forward and backward.

    F(g(x)),    J G dx,    Gᵀ Jᵀ w

g -> `changes`. Changes can follow one another, such as heights of a mesh and then those heights on fewer nodes:

    parametrised(model, Heights("bed.vertex_positions"), OnNodes(key="bed.heights", places=xy, spacing=4.0))
"""
from __future__ import annotations

import numpy as np

from mitsonar.device.spelling import meant

from ..model import ForwardModel, Linearised, Values, left_out, shape_of
from .changes import BoundChange, Change


def parametrised(model: ForwardModel, *changes: Change) -> ForwardModel:
    """Return a model with other parameters; each change may name a parameter that an earlier change made.

    Raises
    ------
    ValueError
        If a name is unknown, a change does not fit its parameter, or makes a name that is there already.
    """
    for change in changes:
        model = Parametrised(model, change)
    return model


class Parametrised:
    """Replace one parameter of a model by other numbers."""

    def __init__(self, model: ForwardModel, change: Change):
        key = change.key
        if key not in model.start:
            raise ValueError(f"{key!r} is none of the model's parameters{meant(key, model.start)}: "
                             f"{', '.join(model.start)}")
        self._model, self._key = model, key
        self._change = change.bound(np.asarray(model.start[key], float), model.units.get(key, ""))
        if self._change.name in model.start:
            raise ValueError(f"the model has a parameter {self._change.name!r} already; use that")
        # in the place of the old one
        self.start = {self._change.name if name == key else name: self._change.start if name == key else value
                      for name, value in model.start.items()}
        self.units = {self._change.name if name == key else name: self._change.unit if name == key else unit
                      for name, unit in model.units.items()}
        shape = shape_of(model)
        if shape is not None:
            self.shape = shape

    def value(self, values: Values) -> np.ndarray:
        """Return the record for values; see `ForwardModel.value`."""
        return self._model.value(self._inner(self._checked(values)))

    def linearised(self, values: Values) -> ParametrisedLine:
        """Return the record about values; see `ForwardModel.linearised`."""
        checked = self._checked(values)
        at = checked.get(self._change.name, self._change.start)
        return ParametrisedLine(self._model.linearised(self._inner(checked)), self._key, self._change, at)

    def _checked(self, values: Values) -> dict[str, np.ndarray]:
        found = {}
        for name, value in values.items():
            if name not in self.start:
                raise ValueError(f"{name!r} is none of the model's parameters{meant(name, self.start)}: "
                                 f"{', '.join(self.start)}")
            found[name] = np.asarray(value, float)
        own = found.get(self._change.name)
        if own is not None:
            _check_shape(self._change, own)
        return found

    def _inner(self, values: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the parameters of the inner model."""
        return {self._key if name == self._change.name else name:
                self._change.inner(value) if name == self._change.name else value for name, value in values.items()}


class ParametrisedLine:
    """Hold a `Parametrised` model about some values, as a `Linearised`."""

    def __init__(self, line: Linearised, key: str, change: BoundChange, at: np.ndarray):
        self._line, self._key, self._change, self._at = line, key, change, at
        self.value = line.value
        self.told = left_out(line)

    def forward(self, tangents: Values) -> np.ndarray:
        """Return J v; see `Linearised.forward`."""
        if self._key in tangents:
            raise ValueError(f"{self._key!r} is by {self._change.name!r} here; give directions of that")
        inner = {name: value for name, value in tangents.items() if name != self._change.name}
        if self._change.name in tangents:
            own = np.asarray(tangents[self._change.name], float)
            _check_shape(self._change, own)
            inner[self._key] = self._change.push(self._at, own)
        return self._line.forward(inner)

    def backward(self, cotangent: np.ndarray) -> dict[str, np.ndarray]:
        """Return Jᵀ w; see `Linearised.backward`."""
        return {self._change.name if name == self._key else name:
                self._change.pull(self._at, value) if name == self._key else value
                for name, value in self._line.backward(cotangent).items()}


def _check_shape(change: BoundChange, value: np.ndarray) -> None:
    if value.shape != change.start.shape:
        raise ValueError(f"{change.name} has the shape {value.shape}; give {change.start.shape}")
    if not np.isfinite(value).all():
        raise ValueError(f"{change.name} holds numbers that are not finite")
