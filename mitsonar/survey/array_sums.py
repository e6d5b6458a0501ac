"""The far-field sum of an array's elements, on the device.

    F(d) = Σ_e w_e e^(i2π(x_e·d - t_e))

x_e -> places in wavelengths, t_e -> drive delays in cycles, w_e weights, d unit vectors in the places' frame.
"""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from ..device.arrays import upload

__all__ = ["ArraySum"]


class ArraySum:
    """Sum the elements of an array that have a weight.

    Parameters
    ----------
    place : (E, 3) [wavelengths]
    weight : (E,) [-]
    late : (E,) [cycles]
    """

    def __init__(self, place: np.ndarray, weight: np.ndarray, late: np.ndarray):
        working = np.flatnonzero(weight)
        self._table = np.concatenate([place[working], late[working, None]], 1)
        self._weight = upload(mi.Float, weight[working].astype(np.float32))
        self._count = dr.opaque(mi.UInt32, len(working))
        dr.eval(self._weight)

    def of(self, direction: mi.Vector3f, rotation: np.ndarray | None = None) -> tuple[mi.Float, mi.Float]:
        """Give real and imaginary part of F.

        Parameters
        ----------
        direction : Vector3f (R,)
        rotation : (3, 3) or None
            From the places' frame to the directions'; None: it is one.
        """
        table = self._table
        if rotation is not None:
            table = np.concatenate([table[:, :3] @ rotation.T, table[:, 3:]], 1)
        on_device = upload(mi.Float, table.astype(np.float32))
        dr.eval(on_device)
        return _summed(on_device, self._weight, self._count, direction)


@dr.syntax
def _summed(table, weight, count, direction):
    """F of `count` rows (x, t) of a table."""
    real, imaginary = mi.Float(0), mi.Float(0)
    i = mi.UInt32(0)
    while i < count:
        x, y = dr.gather(mi.Float, table, 4 * i), dr.gather(mi.Float, table, 4 * i + 1)
        z, t = dr.gather(mi.Float, table, 4 * i + 2), dr.gather(mi.Float, table, 4 * i + 3)
        w = dr.gather(mi.Float, weight, i)
        turns = x * direction.x + y * direction.y + z * direction.z - t
        sine, cosine = dr.sincos((turns - dr.round(turns)) * float(2 * np.pi))
        real, imaginary = real + w * cosine, imaginary + w * sine
        i += 1
    return real, imaginary
