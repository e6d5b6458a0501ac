"""Elements of a sonar's arrays as `mi.traverse` names them: what is written there is what later renders have.

    tx_position, rx_position   [m]   three numbers an element, body frame, about the arrays' centre
    tx_delay, rx_delay         [s]   one an element: by which it sends, or its signal comes, later
    tx_weight, rx_weight       [-]   one an element; 0 is one that has failed

Renders follow them. Of arrays and forward-looking sonars, gradients of what transmits go through the coherent picture,
`mitsonar.gradients.elements.coherent_levels`; `mitsonar.coherent_model` has those of receivers that beams do not know
of. Of the elements' own signals `mitsonar.differentiable_signals` has all but ``rx_weight``, which shades beams alone.
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
        """Show them."""
        for name, value in self._values.items():
            followed = name != "rx_weight"           # it shades beams: signals of elements do not depend on it
            callback.put(name, value, mi.ParamFlags.Differentiable if followed else mi.ParamFlags.NonDifferentiable)

    def changed(self) -> tuple[Array, Array]:
        """Return the transmit and the receive array of the numbers as they are now; the same objects if none changed.
        """
        arrays = {side: self._array(side, array) for side, array in self._arrays.items()}
        self._arrays = arrays
        return arrays["tx"], arrays["rx"]

    def _array(self, side: str, array: Array) -> Array:
        found = {}
        for number in self._numbers:
            name, now = f"{side}_{number}", getattr(array, number)
            value = dr.detach(self._values[name]).numpy()
            if value.size != now.size:
                raise ValueError(f"{self._kind}: {name} has {value.size} numbers; give {now.size}, "
                                 f"{now.size // array.elements} for each of {array.elements} elements.")
            if not np.array_equal(value.reshape(now.shape), now):
                found[number] = value.reshape(now.shape)
        if not found:
            return array
        try:
            return replace(array, **found, **({"layout": ()} if "position" in found else {}))
        except ValueError as error:
            raise ValueError(f"{self._kind}: {ARRAYS[side]} {error}") from None
