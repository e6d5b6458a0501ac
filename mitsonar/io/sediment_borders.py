"""How a map of classes goes over from one to the next: for each cell of a survey its class, another one, and that one's
share.

Shares are those of `scattering.borders`, of the classes about a cell under a triangle of base w in both directions: two
running means, each over half of w. Of more than two classes the most frequent other one counts.
"""
import numpy as np

__all__ = ["blended"]


def blended(numbers: np.ndarray, known: np.ndarray, count: int,
            width: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Give the other class of every cell, and its share.

    Parameters
    ----------
    numbers : integer array (Y, X)
        Classes, from 0 to ``count`` - 1.
    known : bool array (Y, X)
        Where there is one.
    count : int
    width : (float, float) [cells]
        w along rows and columns, as numbers of cells in y and x.

    Returns
    -------
    other : uint32 array (Y, X)
    share : float32 array (Y, X)
        From 0 to 1; 0 where no other class is about, and where none is known.
    """
    from scipy.ndimage import uniform_filter1d

    half = [min(max(1, round(0.5 * cells)), length) for cells, length in zip(width, numbers.shape)]

    def smoothed(values):
        values = values.astype(np.float32)
        for axis, size in enumerate(half):
            # two means over an even number of cells lean to one side each
            values = uniform_filter1d(values, size, axis, mode="nearest")
            values = uniform_filter1d(values, size, axis, mode="nearest", origin=-1 if size % 2 == 0 else 0)
        return values

    most, own = np.zeros(numbers.shape, np.float32), np.zeros(numbers.shape, np.float32)
    other = numbers.astype(np.uint32)
    for number in range(count):
        here = known & (numbers == number)
        about = smoothed(here)
        own[here] = about[here]
        better = ~here & (about > np.maximum(most, 1e-6))
        most[better], other[better] = about[better], number
    share = np.where(known, most / np.maximum(own + most, 1e-6), 0)
    return other, share.astype(np.float32)
