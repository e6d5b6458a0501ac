"""Compute gradients of the coherent levels from `mi.render`, by elements of arrays and point targets.

    L = 10 log |p|²,    dL = 10 / ln 10  d|p|² / |p|²

Elements and point targets have phases: their gradients are those of the picture with its speckle (`coherent_picture`).
All other parameters move mean levels (`level_products`). Both at once are refused; offsets of the sonar go with either.
"""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.imaging import fan
from mitsonar.scene.protocols import target_shape
from mitsonar.survey.kinds import kind_of
from mitsonar.survey.sensor import Sensor

from .coherent_picture import CoherentJacobian, CoherentPicture

OF_ELEMENTS = "tx_position", "tx_weight", "tx_delay"
OF_BEAMS = "rx_position", "rx_weight", "rx_delay"
OF_TARGETS = "position", "target_strength_db"
OF_TRACKS = "position_offset", "attitude_offset"
PER_INTENSITY = 10 / np.log(10)    # dB


def is_coherent(scene: mi.Scene, sensor: Sensor) -> bool:
    """Return True if gradients of a sonar's picture are those of the coherent picture."""
    targets = {shape.id() for shape in scene.shapes() if target_shape(shape) is not None}
    elements = {f"{sensor.id()}.{name}" for name in OF_ELEMENTS} | {f"{one}.{name}" for one in targets
                                                                   for name in OF_TARGETS}
    attached = _attached(scene)
    beams = [key for key in attached if key.rpartition(".")[2] in OF_BEAMS]
    if beams:
        raise ValueError(f"{beams[0]} has no gradient in a picture whose beams are formed with it; take a "
                         "mitsonar.coherent_model, whose beams do not know of changes")
    chosen = [key for key in attached if key in elements]
    others = [key for key in attached if key not in elements
              and key not in {f"{sensor.id()}.{name}" for name in OF_TRACKS}]
    if chosen and others:
        raise ValueError(f"{chosen[0]} moves the coherent picture and {others[0]} mean levels; let one of them carry "
                         "gradients at a time")
    return bool(chosen)


class CoherentLevels:
    """Hold levels (rows, columns) [dB re 1 µPa] of a scene's coherent picture, and their derivatives."""

    def __init__(self, scene: mi.Scene, sensor: Sensor, seed: int):
        self._parameters = mi.traverse(scene)
        self._keys = _attached(scene)
        number = [one.id() for one in scene.sensors()].index(sensor.id())
        with dr.suspend_grad():
            model = CoherentPicture(scene, self._keys, sensor=number, seed=seed)
            self._about: CoherentJacobian = model.linearised({})
        self._start, intensity = model.start, self._about.value
        there = intensity > 0
        self._slope = np.divide(PER_INTENSITY, intensity, out=np.zeros_like(intensity), where=there)
        order = kind_of(sensor).rows(np.arange(intensity.size).reshape(model.shape))
        self._shape, self._order = order.shape, order.ravel()
        level = fan.levels(self._about.beams).ravel()
        self.levels = level[self._order].reshape(self._shape).astype(np.float32)

    def forward(self) -> np.ndarray:
        """Return dL, (rows, columns) [dB], for the tangents that are set at the leaves."""
        with dr.resume_grad():
            tangents = {key: np.array(dr.grad(self._parameters[key]), float).reshape(self._start[key].shape)
                        for key in self._keys}
        return (self._about.forward(tangents) * self._slope)[self._order].reshape(self._shape)

    def backward(self, weights: np.ndarray) -> None:
        """Add the gradient of Σ w L, for weights (rows, columns), to the leaves."""
        spread = np.zeros(self._slope.size)
        spread[self._order] = np.ravel(weights)
        for key, gradient in self._about.backward(np.where(self._slope > 0, spread, 0) * self._slope).items():
            leaf = self._parameters[key]
            with dr.resume_grad():
                dr.accum_grad(leaf, type(leaf)(gradient.ravel()))


def _attached(scene: mi.Scene) -> list[str]:
    """Return the names of parameters with gradients, also while gradients are suspended."""
    parameters = mi.traverse(scene)
    with dr.resume_grad():
        return [key for key, value in parameters.items() if dr.is_diff_v(value) and dr.grad_enabled(value)]
