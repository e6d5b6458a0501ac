"""Losses of a water whose absorption carries a gradient.

    A = s A_0,    dA = A ds / s

A -> two-way loss [dB], s -> ``absorption_scale``. What a change of sound speed does to absorption along a given way is
left out: 1e-3 of the loss where a speed changes by 1 m/s over a whole way.
"""
from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..tracing.water import DeviceWater, Way
from .tangents import tangent

__all__ = ["AttachedWater"]


class AttachedWater:
    """See the module's text.

    Parameters
    ----------
    water : DeviceWater
        With the scale as it is.
    scale : Float64 (1,) [-]
    """

    def __init__(self, water: DeviceWater, scale: mi.Float64):
        self._water, self._grows = water, None
        if dr.grad_enabled(scale):
            self._grows = 1 + mi.Float(tangent(scale)) / dr.maximum(mi.Float(dr.detach(scale)), 1e-30)

    def loss_db(self, start: dr.ArrayBase, end: dr.ArrayBase, way: Way) -> mi.Float:
        """Two-way absorption [dB], Float (R,); see `DeviceWater.loss_db`."""
        loss = self._water.loss_db(start, end, way)
        return loss if self._grows is None else loss * self._grows
