"""Where a pass of rays shows that more are needed: in the directions that lead into time bins which few rays reach."""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from ..echoes.energy_sums import sum_size
from ..tracing.launch import CELLS
from .energy_bins import EnergyBins

__all__ = ["ray_need"]


def ray_need(row: mi.UInt32, cell: mi.UInt32, bin: mi.UInt32, inside: mi.Bool, *, rows: int,
             bins: EnergyBins) -> np.ndarray:
    """Give how far each cell of the table that rays were drawn through leads into bins that few rays reach.

    Parameters
    ----------
    row, cell, bin : UInt32 (R,)
        Of the rays: row of the block, cell of the table (rows, CELLS), time bin.
    inside : Bool (R,)
        Whether they arrive within the record.
    rows : int
        Of the block.
    bins : EnergyBins

    Returns
    -------
    (rows, CELLS)
        Sum over the rays of 1 / (rays in the bin).
    """
    index = row * bins.opaque_count + bin
    count = dr.zeros(mi.UInt32, sum_size(rows * bins.count))
    dr.scatter_add(count, mi.UInt32(1), index, inside)
    dr.eval(count, index, inside, cell)
    share = mi.UInt64(2.0 ** 32 / mi.Float64(dr.maximum(dr.gather(mi.UInt32, count, index, inside), 1)))
    need = dr.zeros(mi.UInt64, sum_size(rows * CELLS))
    dr.scatter_add(need, share, cell, inside)
    return need.numpy()[:rows * CELLS].reshape(rows, CELLS) / 2.0 ** 32
