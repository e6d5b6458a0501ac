"""Numbers of a sonar's elements under the names of `mi.traverse`; later renders use what is written there.

    tx_position, rx_position   [m]   three numbers an element, body frame, from the arrays' centre
    tx_delay, rx_delay         [s]   one number an element: delay of its transmission, or of its signal
    tx_weight, rx_weight       [-]   one number an element; 0 for a failed one

For arrays and forward-looking sonars, gradients of the transmit elements go through the coherent picture
(`mitsonar.gradients.elements.coherent_levels`), and `mitsonar.coherent_model` has the gradients of receivers whose
delays do not steer. `mitsonar.differentiable_signals` has the gradients of the elements' signals by all of them but
``rx_weight``, which shades beams only.
"""
from __future__ import annotations

from dataclasses import replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import upload
from mitsonar.sonar.arrays.array import Array

ARRAYS = {"tx": "transmit", "rx": "receive"}
GEOMETRY, ALL = ("position", "delay"), ("position", "delay", "weight")


class ElementKeys:
    """Numbers of a sonar's elements on the device."""

    def __init__(self, kind: str, transmit: Array, receive: Array, numbers: tuple[str, ...] = ALL) -> None:
        self._kind, self._numbers = kind, numbers
        self._arrays = {"tx": transmit, "rx": receive}
        self._values: dict[str, Any] = {
            f"{side}_{number}": upload(mi.Float64, np.asarray(getattr(array, number), float))
            for side, array in self._arrays.items() for number in numbers}

    def traverse(self, callback: mi.TraversalCallback) -> None:
        """Show the numbers to `mi.traverse`."""
        for name, value in self._values.items():
            followed = name != "rx_weight"           # it shades beams: signals of elements do not depend on it
            callback.put(name, value, mi.ParamFlags.Differentiable if followed else mi.ParamFlags.NonDifferentiable)

    def changed(self) -> tuple[Array, Array]:
        """Return the transmit and receive array of the present numbers; the same objects if none changed."""
        self._arrays = {side: self._array(side, array) for side, array in self._arrays.items()}
        return self._arrays["tx"], self._arrays["rx"]

    def _array(self, side: str, array: Array) -> Array:
        changes = {}
        for number in self._numbers:
            name, old = f"{side}_{number}", getattr(array, number)
            value = dr.detach(self._values[name]).numpy()
            if value.size != old.size:
                raise ValueError(f"{self._kind}: {name} has {value.size} numbers; give {old.size}, "
                                 f"{old.size // array.elements} for each of {array.elements} elements.")
            if not np.array_equal(value.reshape(old.shape), old):
                changes[number] = value.reshape(old.shape)
        if not changes:
            return array
        try:
            return replace(array, **changes, **({"layout": ()} if "position" in changes else {}))
        except ValueError as error:
            raise ValueError(f"{self._kind}: {ARRAYS[side]} {error}") from None
