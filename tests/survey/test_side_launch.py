"""How a sidescan's rays are drawn: each of them evenly over its beam, those aside of the beam by the tile."""
from types import SimpleNamespace

import drjit as dr
import numpy as np
import pytest
from drjit.auto import UInt32

from mitsonar.device.arrays import arrays_of
from mitsonar.device.chance import Salt
from mitsonar.scene.tracing.launch import CELLS, WIDE_SHARE
from mitsonar.survey.energy.side_launch import drawn_across, ray_grid, strata_of

LEVEL = np.linspace(-1.0, 1.0, CELLS + 1)


def drawn(rays, rows=2, seed=3):
    """Strata (φ, u) of the rays of two rows, and the numbers that u is drawn with, over (row, φ, u)."""
    strata = strata_of(arrays_of(UInt32), rows, ray_grid(rays))
    place = SimpleNamespace(key=lambda row: (row + 1) * 0x85EBCA6B)
    tables = np.broadcast_to(LEVEL, (rows, CELLS + 1))
    row, phi, _, _, along = drawn_across(strata.lib, place, strata, tables, seed, Salt.SECOND_PASS)
    _, _, i, j = strata.split(dr.arange(UInt32, strata.rays))
    share, angle = np.empty((rows, *strata.shape)), np.empty((rows, *strata.shape))
    index = row.numpy(), i.numpy(), j.numpy()
    share[index], angle[index] = along.numpy(), phi.numpy()
    return strata, share, angle


@pytest.mark.parametrize("rays", [2000, 20_000, 60_000])
def test_numbers_along_are_even_and_lie_in_their_strata(variant, rays):
    """Evenly spread over [0, 1), the outermost strata too: else a level would be biased. With N numbers, those aside
    shared by tiles, the largest distance of the distributions is some 1 / √(tiles)."""
    strata, share, _ = drawn(rays, rows=8)
    steps = strata.shape[1]
    assert share.min() >= 0 and share.max() < 1
    assert np.abs(share * steps - np.arange(steps) - 0.5).max() < 0.5 + 1e-5
    for j in range(steps):
        within = np.sort((share[:, :, j] * steps - j).ravel())
        distance = np.abs(within - (np.arange(len(within)) + 0.5) / len(within)).max()
        aside = 0.5 * WIDE_SHARE * steps if j in (0, steps - 1) else 0.0
        assert distance < 0.02 + 1.5 * aside / np.sqrt(len(within) / (1 << int(strata.high_bits.numpy()[0])))


def test_rays_of_a_tile_leave_aside_of_the_beam_in_one_direction(variant):
    strata, share, _ = drawn(60_000)
    tiles = share.reshape(2, -1, (1 << int(strata.high_bits.numpy()[0])), strata.shape[1])
    for j, outside in ((0, tiles[..., 0]), (strata.shape[1] - 1, 1 - tiles[..., -1])):
        aside = outside < 0.5 * WIDE_SHARE
        together = [np.ptp(rays[where]) for rays, where in zip(outside.reshape(-1, 16), aside.reshape(-1, 16))]
        assert max(together) < 1e-6
        # 0.4 of a stratum: 6 or 7 of 16 rays in every tile, so that those within the beam are as even
        assert set(aside.sum(-1).ravel()) <= {6, 7}
        assert j in (0, 15)


def test_neighbours_across_lie_apart_along_the_platform(variant):
    """A time bin may hold two strata of φ: within a stratum of u their rays lie at least a third of it apart."""
    strata, share, _ = drawn(60_000)
    within = (share * strata.shape[1] - np.arange(strata.shape[1]))[:, :, 1:-1].reshape(2, -1, 16, 14)
    apart = np.abs(np.diff(within, axis=2))
    assert apart.min() > 1 / 3
