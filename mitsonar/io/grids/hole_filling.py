"""Holes of a survey filled by the smoothest bed that overshoots nowhere.

    laplacian(height) = 0 in the hole, heights of the survey on its rim

Such a surface has its highest and lowest point on the rim. The equation is that of five nodes, with the steps of the
grid, and conjugate gradients solve it, from the solution on a grid of half as many rows and columns on.
"""
from typing import cast

import numpy as np

_MOST_NODES = 5_000_000       # unknowns: about 1.5 GB
_FEW = 1000                   # unknowns that need no first guess
_TOLERANCE = 3e-4             # of the residual, relative; the rest is clipped to the rim's heights


def fill_holes(heights: np.ndarray, steps: tuple[float, float], widest: float | None = None) -> np.ndarray:
    """Fill the holes that the survey surrounds; what reaches the grid's edge lies outside the survey and stays open.

    Parameters
    ----------
    heights : float32 array (Y, X) [m]
        NaN is a hole. It is left as it is.
    steps : tuple of 2 floats [m]
        Distance of columns and of rows.
    widest : float [m], optional
        Wider holes stay open: width is the diameter of the largest circle that finds room between soundings.

    Returns
    -------
    float32 array (Y, X) [m]

    Raises
    ------
    ValueError
        If the holes to be filled have more nodes than fit into memory.
    """
    from scipy import ndimage

    holes, count = cast("tuple[np.ndarray, int]", ndimage.label(np.isnan(heights)))
    edge = np.concatenate((holes[0], holes[-1], holes[:, 0], holes[:, -1]))
    asked = np.ones(count + 1, bool)
    asked[0] = asked[edge] = False
    if widest is not None and asked.any():
        deep = ndimage.maximum(ndimage.distance_transform_edt(holes > 0, sampling=steps[::-1]), holes,
                               np.arange(count + 1))
        asked &= 2 * deep <= widest
    unknown = asked[holes]
    number = np.count_nonzero(unknown)
    if number == 0:
        return heights
    if number > _MOST_NODES:
        raise ValueError(f"the holes to be filled have {number} nodes, more than {_MOST_NODES:.0e}; fill smaller ones "
                         "by holes_max, or use a coarser resolution.")
    filled = heights.copy()
    filled[unknown] = _harmonic(heights, unknown, steps)
    # Of each hole, not higher nor lower than its rim.
    rim = ndimage.grey_dilation(np.where(unknown, holes, 0), footprint=ndimage.generate_binary_structure(2, 1))
    rim = np.where(unknown | np.isnan(heights), 0, rim)
    index = np.arange(count + 1)
    lowest, highest = (extreme(filled, rim, index)[holes[unknown]] for extreme in (ndimage.minimum, ndimage.maximum))
    filled[unknown] = np.clip(filled[unknown], lowest, highest)
    return filled


def _harmonic(heights, unknown, steps):
    """Give the heights of the unknown nodes, in the order of the array."""
    from scipy.sparse import coo_array, diags_array
    from scipy.sparse.linalg import cg

    nodes = np.argwhere(unknown)
    level = float(np.nanmean(heights))                  # small numbers: sums keep their digits
    known = np.where(unknown | np.isnan(heights), 0.0, heights - level)
    index = np.full(heights.shape, -1, np.int32)
    index[unknown] = np.arange(len(nodes))
    pull, entries = np.zeros(len(nodes)), []
    across, along = 1 / steps[0] ** 2, 1 / steps[1] ** 2
    for weight, down, right in (along, 1, 0), (along, -1, 0), (across, 0, 1), (across, 0, -1):
        beside = nodes[:, 0] + down, nodes[:, 1] + right                # a hole never touches the edge
        neighbour = index[beside]
        inside = np.flatnonzero(neighbour >= 0)
        pull += weight * np.where(neighbour < 0, known[beside], 0)
        entries.append((np.full(inside.size, weight), inside, neighbour[inside]))
    weight, row, column = (np.concatenate(part) for part in zip(*entries))
    beside = coo_array((weight, (row, column)), shape=(len(nodes), len(nodes))).tocsr()
    matrix = (diags_array(np.full(len(nodes), 2 * across + 2 * along)) - beside).tocsr()
    start = _coarse(heights, unknown, steps, nodes) - level if len(nodes) > _FEW else None
    solution, _ = cg(matrix, pull, x0=start, rtol=_TOLERANCE, maxiter=5000)
    return solution + level


def _coarse(heights, unknown, steps, nodes):
    """Give a first guess at nodes: the same on a grid of half as many rows and columns, from which a few rounds do."""
    from scipy.ndimage import map_coordinates

    rows, columns = (length + length % 2 for length in heights.shape)
    padded = [(0, rows - heights.shape[0]), (0, columns - heights.shape[1])]
    blocks = np.pad(np.where(unknown, np.nan, heights), padded, mode="edge").reshape(rows // 2, 2, columns // 2, 2)
    measured = np.isfinite(blocks)
    number = measured.sum((1, 3))
    halved = np.where(measured, blocks, 0).sum((1, 3)) / np.where(number, number, np.nan)
    hole = np.pad(unknown, padded).reshape(blocks.shape).any((1, 3)) & (number == 0)
    hole[[0, -1]] = hole[:, [0, -1]] = False
    halved[hole] = _harmonic(halved, hole, tuple(2 * step for step in steps))
    halved[np.isnan(halved)] = np.nanmean(halved)       # outside
    return map_coordinates(halved, (nodes.T - 0.5) / 2, order=1, mode="nearest")
