"""Sums of several words a bin: the same as a packet and word by word, wherever rays fall."""
import drjit as dr
import numpy as np
import pytest
from drjit.auto import UInt32, UInt64

from mitsonar.device.arrays import upload
from mitsonar.echoes.sums.energy_sums import add_words


@pytest.mark.parametrize("words", [2, 4, 8])
@pytest.mark.parametrize("size", [1 << 16, 1 << 21])         # with a copy for every thread, and without
def test_words_of_a_row_are_summed_side_by_side(variant, rng, words, size):
    index = rng.integers(0, 50, 30_000).astype(np.uint32)
    values = rng.integers(0, 1 << 48, (words, len(index))).astype(np.uint64)
    counted, target = index % 7 != 3, dr.zeros(UInt64, size)
    add_words(target, [upload(UInt64, word) for word in values], upload(UInt32, index),
              upload(UInt32, counted.astype(np.uint32)) != 0)
    expected = np.zeros((50, words), np.uint64)
    np.add.at(expected, index[counted], values.T[counted])
    found = target.numpy()
    np.testing.assert_array_equal(found[:50 * words].reshape(50, words), expected)
    assert not found[50 * words:].any()
