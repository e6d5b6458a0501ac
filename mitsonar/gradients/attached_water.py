"""Losses of a water whose absorption carries a gradient.

    A = s (A_0 + A[δ]),    dA = A ds / s + s A[dδ]

A -> two-way loss [dB], s -> ``absorption_scale``, δ -> ``absorption_offset`` [dB/m] at the profile's nodes. Loss is
linear in absorption: A[δ] is that of a water that absorbs δ (`water.column`), at constant speed

    dA / dδ_i = 2 L <hat_i>              L the way one way, <> the mean over depth between its ends

What a change of sound speed does to absorption along a given way is left out: 1e-3 of the loss where a speed changes by
1 m/s over a whole way.
"""
from __future__ import annotations

import copy
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from ..device.arrays import upload
from ..tracing.water import DeviceWater, Way
from ..water.absorption_table import Absorption
from ..water.profile import SoundSpeedProfile
from .tangents import tangent

__all__ = ["AttachedWater"]


class AttachedWater:
    """See the module's text.

    Parameters
    ----------
    water : DeviceWater
        With scale and offset as they are.
    scale : Float64 (1,) [-]
    offset : Float64 (K,) [dB/m]
    """

    def __init__(self, water: DeviceWater, scale: mi.Float64, offset: mi.Float64):
        self._water, self._grows, self._more = water, None, None
        table = water.direct.absorption
        if dr.grad_enabled(scale):
            self._grows = 1 + mi.Float(tangent(scale)) / dr.maximum(mi.Float(dr.detach(scale)), 1e-30)
        if dr.grad_enabled(offset) and table is not None:
            self._more = _more(table, water.profile, offset * dr.detach(scale))

    def loss_db(self, start: dr.ArrayBase, end: dr.ArrayBase, way: Way) -> mi.Float:
        """Two-way absorption [dB], Float (R,); see `DeviceWater.loss_db`."""
        loss = self._water.loss_db(start, end, way)
        if self._grows is not None:
            loss = loss * self._grows
        if self._more is not None:
            z0, z1 = (mi.Float(-dr.detach(point).z) for point in (start, end))
            arc, parameter = dr.detach(way.arc_length), mi.Float(dr.detach(way.ray_parameter))
            loss = loss + tangent(self._more.two_way_db(z0, z1, arc, parameter))
        return loss


def _more(table: Absorption, profile: SoundSpeedProfile, offset: mi.Float64) -> Absorption:
    """The same table, attached to what is added to absorption at the profile's nodes."""
    nodes = profile.depth
    inside = nodes[(nodes > table.depth[0]) & (nodes < table.depth[-1])]
    fine = np.unique(np.concatenate([table.depth, inside]))
    lower = np.clip(np.searchsorted(nodes, fine, side="right") - 1, 0, max(len(nodes) - 2, 0))
    upper = np.minimum(lower + 1, len(nodes) - 1)
    apart = np.where(upper > lower, nodes[upper] - nodes[lower], 1.0)
    share = upload(mi.Float64, np.clip((fine - nodes[lower]) / apart, 0, 1))
    low, high = (dr.gather(mi.Float64, offset, upload(mi.UInt32, node.astype(np.uint32))) for node in (lower, upper))
    alpha = dr.lerp(low, high, share)
    reference = float(table.c2.numpy()[0])
    e = upload(mi.Float64, profile.at(fine) ** 2 / reference - 1)
    ahead = dr.minimum(dr.arange(mi.UInt32, len(fine)) + 1, len(fine) - 1)
    step = upload(mi.Float64, np.append(np.diff(fine), 0.0))
    rows = upload(mi.UInt32, np.searchsorted(fine, table.depth).astype(np.uint32))
    attached = dr.zeros(mi.Float, 4 * len(table.depth))
    for column, values in ((0, alpha), (1, alpha * e)):
        area = 0.5 * step * (values + dr.gather(mi.Float64, values, ahead))
        integral = dr.prefix_reduce(dr.ReduceOp.Add, area, exclusive=True)
        _put(attached, column, mi.Float(dr.gather(mi.Float64, integral, rows)))
    _put(attached, 3, mi.Float(dr.gather(mi.Float64, alpha, rows)))
    found: Any = copy.copy(table)
    found.table = dr.replace_grad(dr.detach(table.table), attached)
    return found


def _put(table: mi.Float, column: int, values: mi.Float) -> None:
    dr.scatter(table, values, 4 * dr.arange(mi.UInt32, dr.width(values)) + column)
