"""The far-field sum of an array's elements, on the device.

    F(d) = Σ_e w_e e^(i2π(x_e·d - t_e))

x_e -> places in wavelengths, t_e -> drive delays in cycles, w_e weights, d unit vectors in the places' frame.
"""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from ..device.arrays import arrays_of, opaque_vector, upload
from ..device.lookups import held

__all__ = ["ArraySum", "LineSum", "along_a_line"]

FINER = 64                         # places of a line's table, over those that resolve it: read within 3e-4
STRAIGHT = 1e-3                    # wavelengths that elements may stand off a line


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


class LineSum:
    """The same of elements on a line, from a table: F is one function of the sine along it.

    Parameters
    ----------
    axis : (3,) [-]
        Unit vector.
    place : (E, 3) [wavelengths]
        On the line through 0.
    weight : (E,) [-]
    late : (E,) [cycles]
    """

    def __init__(self, axis: np.ndarray, place: np.ndarray, weight: np.ndarray, late: np.ndarray):
        along = place @ axis
        # a direction less what steers it has sines up to 2
        count = int(np.ceil(4 * FINER * max(np.abs(along).max(), 1))) + 1
        sine = np.linspace(-2, 2, count)
        values = np.concatenate([np.exp(2j * np.pi * (some[:, None] * along - late)) @ weight
                                 for some in np.array_split(sine, -(-count // 4096))])
        self._axis, self._nodes = axis, count
        self._table = upload(mi.Float, values.astype(np.complex64).view(np.float32))
        dr.eval(self._table)

    def of(self, direction: mi.Vector3f, rotation: np.ndarray | None = None) -> tuple[mi.Float, mi.Float]:
        """Give real and imaginary part of F; see `ArraySum.of`."""
        axis = self._axis if rotation is None else rotation @ self._axis
        sine = dr.dot(direction, opaque_vector(mi.Vector3f, axis))
        place = held((sine + 2) * dr.opaque(mi.Float, (self._nodes - 1) / 4), 0.0,
                     dr.opaque(mi.Float, self._nodes - 1.001))
        node = mi.UInt32(place)
        share = place - mi.Float(node)
        low, high = (dr.gather(arrays_of(mi.Float).Array2f, self._table, node + step) for step in (0, 1))
        value = low + (high - low) * share
        return value.x, value.y


def along_a_line(place: np.ndarray) -> np.ndarray | None:
    """Give the unit vector of the line through 0 that places (E, 3) [wavelengths] lie on, None where there is none."""
    _, _, axes = np.linalg.svd(place, full_matrices=False)
    axis = axes[0]
    off = place - np.outer(place @ axis, axis)
    return axis if np.abs(off).max() <= STRAIGHT else None


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
