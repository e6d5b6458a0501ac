"""How rays are numbered: every ray has strata of its own, and sixteen neighbours lie close together."""
import drjit as dr
import numpy as np
import pytest
from drjit.auto import UInt32

from mitsonar.device.arrays import arrays_of
from mitsonar.scene.tracing.launch import Strata

BOTH = pytest.mark.parametrize("tall", [False, True])


@BOTH
def test_every_ray_has_strata_of_its_own(variant, tall):
    strata = Strata(arrays_of(UInt32), 3, 48, 8, tall=tall)
    row, within, i, j = (part.numpy() for part in strata.split(dr.arange(UInt32, strata.rays)))
    assert len(np.unique(np.stack([row, i, j]), axis=1).T) == 3 * 48 * 8 == strata.rays
    assert row.max() == 2 and i.max() == 47 and j.max() == 7 and within.max() == 48 * 8 - 1
    np.testing.assert_array_equal(strata.index(*(UInt32(part) for part in (row, i, j))).numpy(),
                                  np.arange(strata.rays))


@BOTH
def test_a_packet_of_sixteen_rays_is_a_tile(variant, tall):
    strata = Strata(arrays_of(UInt32), 1, 48, 8, tall=tall)
    _, _, i, j = (part.numpy().reshape(-1, 16) for part in strata.split(dr.arange(UInt32, strata.rays)))
    high, wide = (16, 1) if tall else (4, 4)
    assert (np.ptp(i, 1) == high - 1).all() and (np.ptp(j, 1) == wide - 1).all()


@pytest.mark.parametrize("shape", [(4, 4), (60_000, 12), (16, 4), (1048, 20)])
def test_rows_and_tiles_of_large_numbers_are_exact(variant, shape):
    """The quotient is rounded from double precision: at the ends of rows it is the nearest to another one."""
    per_row = shape[0] * shape[1]
    strata, rows = Strata(arrays_of(UInt32), 1, *shape), 2 ** 32 // per_row - 1
    row = np.linspace(0, rows, 1000).astype(np.uint64)
    number = np.concatenate([row * per_row, row * per_row + per_row - 1, row * per_row + 15])
    found = strata.split(UInt32(number.astype(np.uint32)))
    np.testing.assert_array_equal(found[0].numpy(), number // per_row)
    within = number % per_row
    np.testing.assert_array_equal(found[1].numpy(), within)
    np.testing.assert_array_equal(found[2].numpy() // 4, within // 16 // (shape[1] // 4))
