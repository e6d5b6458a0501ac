"""Sums of four numbers an echo in cells of a table (row, column), on the device, the same in every bit on the CPU.

    S[r, c] = Σ (a, b, c, d) of the echoes of the cell                                         one packet an echo
"""
from __future__ import annotations

from collections.abc import Sequence

import drjit as dr
import numpy as np

from ...device.arrays import arrays_of
from ...device.types import Bool, Float, UInt32
from .stripes import STRIPE, add_by_stripes, ordered

__all__ = ["cell_sums"]


def cell_sums(cell: UInt32, inside: Bool, values: Sequence[Float], *, rows: int, columns: int) -> Float:
    """Sum values in cells.

    Parameters
    ----------
    cell : UInt32 (H,)
        row * columns + column.
    inside : Bool (H,)
        Whether an echo counts; the cells of others do not matter.
    values : four Float (H,)
    rows, columns : int

    Returns
    -------
    Float (4 rows columns,)
        The four sums of each cell, one after the other.
    """
    lib = arrays_of(cell)
    sums = dr.zeros(lib.Float, 4 * rows * columns)
    if dr.backend_v(lib.Float) != dr.JitBackend.LLVM:
        dr.scatter_add(sums, lib.Array4f(*values), cell, inside)
        dr.eval(sums)
        return sums
    stripes = -(-rows // STRIPE)
    stripe = dr.select(inside, cell // dr.opaque(lib.UInt32, STRIPE * columns), dr.opaque(lib.UInt32, stripes))
    dr.eval(cell, list(values))
    order, starts = ordered(stripe, stripes)

    def add(place: UInt32) -> None:
        echo = dr.gather(lib.UInt32, order, place)
        dr.scatter_add(sums, lib.ArrayXf([dr.gather(lib.Float, value, echo) for value in values]),
                       dr.gather(lib.UInt32, cell, echo), mode=dr.ReduceMode.NoConflicts)

    add_by_stripes(lib, starts, np.arange(stripes), add)
    dr.eval(sums)
    return sums
