"""Compute gradients of the levels from `mi.render`: products with the Jacobian of the picture in decibels.

    L = 10 log I,    dL = 10 / ln 10  dI / I

I -> mean intensities of `record_field`, with noise. Speckle is a factor that belongs to the ground, so a picture with
speckle moves as its mean does. Bins without any echo do not move.
"""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.survey.integrator import SoundIntegrator
from mitsonar.survey.kinds import kind_of
from mitsonar.survey.sensor import Sensor

from ..parameters.scene_values import check_followed
from .pictures import picture_of
from .record_field import FieldLinearised, RecordField

PER_INTENSITY = 10 / np.log(10)    # dB


class LevelProducts:
    """Multiply by the Jacobian of the levels of a scene's picture."""

    def __init__(self, scene: mi.Scene, sensor: Sensor, integrator: SoundIntegrator, seed: int):
        with dr.resume_grad():
            check_followed(scene)
        field = RecordField(picture_of(scene, sensor, integrator), sensor.own_seed(seed))
        self._about: FieldLinearised = field.about()
        intensity = self._about.value
        self._slope = np.divide(PER_INTENSITY, intensity, out=np.zeros_like(intensity), where=intensity > 0)
        order = kind_of(sensor).rows(np.arange(intensity.size).reshape(field.shape))
        self._shape, self._order = order.shape, order.ravel()

    def forward(self) -> np.ndarray:
        """Return dL, (rows, columns) [dB], for the tangents that are set at the leaves."""
        moved = self._about.pushed(lambda: None) * self._slope
        return moved[self._order].reshape(self._shape)

    def backward(self, weights: np.ndarray) -> None:
        """Add the gradient of Σ w L, for weights (rows, columns), to the leaves."""
        spread = np.zeros(self._slope.size)
        spread[self._order] = np.ravel(weights)
        self._about.pull(spread * self._slope)


def wants_gradients(scene: mi.Scene) -> bool:
    """Return True if any parameter of a scene carries a gradient, also while gradients are suspended."""
    parameters = mi.traverse(scene)
    with dr.resume_grad():
        return any(dr.grad_enabled(value) for _, value in parameters.items() if dr.is_diff_v(value))
