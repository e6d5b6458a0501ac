"""Element signals as an operation of Dr.Jit: its derivatives are the closed forms over the fast sums.

    y = F(x),    forward: dy = J dx,    backward: x* += Jᵀ y*

x -> what carries gradients in a scene; F, J -> `elements.ElementModel` and its Jacobian. So losses of signals, or of
beams and pictures that Dr.Jit makes of them, go back to elements, point targets and the track.
"""
from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import drjit as dr
import mitsuba as mi
import numpy as np

from .elements import ElementJacobian, ElementModel

OF_PINGS = "position_offset", "attitude_offset"       # a scene names them for all pings, a model for its own


def attached_signals(model: ElementModel, parameters: Any, pings: Sequence[int]) -> mi.TensorXf:
    """Return a model's signals, attached to parameters of its scene."""
    # -> [µPa]
    values = [parameters[key] for key in model.start]
    return dr.custom(_Signals, model.linearised({}), model, list(pings), values)


class _Signals(dr.CustomOp):
    """See the module's text."""

    def eval(self, jacobian: ElementJacobian, model: ElementModel, pings: list[int], values: list[Any]) -> mi.TensorXf:
        self._jacobian, self._model, self._pings, self._values = jacobian, model, pings, values
        return self._tensor(jacobian.value)

    def forward(self) -> None:
        tangents, moved = {}, cast(list, self.grad_in("values"))
        for (key, start), tangent in zip(self._model.start.items(), moved):
            numbers = np.array(tangent, float).reshape(-1, *start.shape[1:])
            tangents[key] = (numbers[self._pings] if _of_pings(key) else numbers).reshape(start.shape)
        self.set_grad_out(self._tensor(self._jacobian.forward(tangents)))

    def backward(self) -> None:
        found = self._jacobian.backward(np.array(self.grad_out(), float).ravel())
        gradients = []
        for (key, gradient), value in zip(found.items(), self._values):
            whole = gradient
            if _of_pings(key):
                whole = np.zeros((dr.width(value) // 3, 3))
                whole[self._pings] = gradient
            gradients.append(type(value)(whole.ravel()))
        self.set_grad_in("values", gradients)

    def name(self) -> str:
        return "element signals"

    def _tensor(self, signals: np.ndarray) -> mi.TensorXf:
        return mi.TensorXf(signals.reshape(self._model.shape).astype(np.float32))


def _of_pings(key: str) -> bool:
    return key.rpartition(".")[2] in OF_PINGS
