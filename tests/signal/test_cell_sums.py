"""Sums in cells against NumPy's, and the same bits for any number of threads."""
import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mitsonar.device.arrays import upload
from mitsonar.signal.beam_grid.stripes import cell_sums

ROWS, COLUMNS = 37, 53


def drawn(count):
    random = np.random.default_rng(count)
    return random.integers(0, ROWS * COLUMNS, count).astype(np.uint32), random.random(count) < 0.8, random.random(
        (4, count)).astype(np.float32)


def summed(cell, inside, values):
    """Sums of the echoes in their cells, and the sums of their numbers."""
    numbers = dr.zeros(mi.UInt32, ROWS * COLUMNS)
    sums = cell_sums(upload(mi.UInt32, cell), upload(mi.UInt32, cell // COLUMNS), upload(mi.Bool, inside),
                     [upload(mi.Float, one) for one in values], rows=ROWS, columns=COLUMNS,
                     word=dr.arange(mi.UInt32, len(cell)),
                     count=lambda cell, word, active: dr.scatter_add(numbers, word, cell, active, dr.ReduceMode.Direct))
    return sums.numpy().reshape(-1, 4), numbers.numpy()


@pytest.mark.parametrize("count", [1, 100, 60_000])
def test_cells_hold_the_sums_of_their_echoes(variant, count):
    cell, inside, values = drawn(count)
    expected = np.stack([np.bincount(cell[inside], one[inside], ROWS * COLUMNS) for one in values], 1)
    sums, numbers = summed(cell, inside, values)
    assert sums == pytest.approx(expected, rel=1e-5, abs=1e-6)
    assert (numbers == np.bincount(cell[inside], np.flatnonzero(inside), ROWS * COLUMNS)).all()


def test_threads_change_no_bit(exact):
    cell, inside, values = drawn(60_000)
    before, found = dr.thread_count(), []
    try:
        for threads in (1, 2, 3):
            dr.set_thread_count(threads)
            found.append(summed(cell, inside, values)[0])
    finally:
        dr.set_thread_count(before)
    assert (found[0] == found[1]).all() and (found[0] == found[2]).all()
