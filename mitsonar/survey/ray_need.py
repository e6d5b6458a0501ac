"""Where a pass of rays shows that more are needed: in the directions that lead into time bins which few rays reach."""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from ..device.arrays import upload
from ..echoes.energy_sums import sum_size
from ..tracing.launch import CELLS
from .energy_bins import EnergyBins

__all__ = ["aside_need", "ray_need"]

WINDOW_RAYS = 8                    # rays aside that a window of bins holds


def aside_need(row: mi.UInt32, cell: mi.UInt32, bin: mi.UInt32, inside: mi.Bool, aside: mi.Bool, *, rows: int,
               bins: EnergyBins, drawn: float, wanted: float) -> np.ndarray:
    """Return how far each cell leads into bins that few rays reach, of rays within the core and of those aside of it.

    A bin that only side lobes reach is reached by few rays of a first pass, if by any. What side lobes bring changes
    slowly along the record, so that rays aside count for the bins around theirs:

        v = K n_a w/d,   c = n_c (1 - w) / (1 - d),   need_c = Σ c/n_c 1/(c + v),   need_a = Σ v/(K n_a) K [1/(c + v)]

    n -> rays of the first pass in a bin, d -> ``drawn``, w -> ``wanted``, K -> mean over a window of bins.

    Parameters
    ----------
    row, cell, bin, inside, rows, bins
        As of `ray_need`.
    aside : Bool (R,)
        Whether rays lie aside of the core.
    drawn, wanted : float
        Share of rays aside, as they were drawn and as they are to be where a bin lacks nothing.

    Returns
    -------
    (2, rows, CELLS)
        Of the rays within the core, and of those aside.
    """
    kind = dr.select(aside, dr.opaque(mi.UInt32, rows), mi.UInt32(0)) + row
    index = kind * bins.opaque_count + bin
    count = dr.zeros(mi.UInt32, sum_size(2 * rows * bins.count))
    dr.scatter_add(count, mi.UInt32(1), index, inside)
    dr.eval(count, index, inside, aside, cell)
    core, beside = count.numpy()[:2 * rows * bins.count].reshape(2, rows, bins.count).astype(float)
    per_row = max(beside.sum() / rows, 1)
    reach = min(int(np.ceil(0.5 * WINDOW_RAYS * bins.count / per_row)), bins.count // 8)
    near, far = _averaged(beside, reach), _averaged(beside, 4 * reach)
    core, beside = core * ((1 - wanted) / (1 - drawn)), np.where(near > 0, near, far) * (wanted / drawn)
    total = core + beside
    lack = np.where(total > 0, 1 / np.maximum(total, 1e-30), 0)
    worth = np.stack([lack * ((1 - wanted) / (1 - drawn)), _averaged(lack, reach) * (wanted / drawn)])
    padded = np.zeros(sum_size(worth.size))
    padded[:worth.size] = worth.ravel()
    share = mi.UInt64(2.0 ** 32 * dr.gather(mi.Float64, upload(mi.Float64, padded), index, inside))
    need = dr.zeros(mi.UInt64, sum_size(2 * rows * CELLS))
    dr.scatter_add(need, share, dr.select(aside, dr.opaque(mi.UInt32, rows * CELLS), mi.UInt32(0)) + cell, inside)
    return need.numpy()[:2 * rows * CELLS].reshape(2, rows, CELLS) / 2.0 ** 32


def _averaged(values: np.ndarray, reach: int) -> np.ndarray:
    """Means of values (rows, bins) over the bins up to `reach` away."""
    bins = values.shape[1]
    summed = np.concatenate([np.zeros((len(values), 1)), np.cumsum(values, 1)], 1)
    low, high = (np.clip(np.arange(bins) + end, 0, bins) for end in (-reach, reach + 1))
    return (summed[:, high] - summed[:, low]) / (high - low)


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
