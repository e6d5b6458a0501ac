"""Strength that varies by patches: moments and distribution of the factor, and where it changes.

Closed form: Gamma(ν, 1/ν). The table's mean is 1 by construction, its second moment lacks what varies within a cell,
found to be below 1e-3 of it for ν from 0.1 up; a sample of n patches adds its standard error, given in each test.
"""
import drjit as dr
import numpy as np
import pytest
from scipy import stats

from mitsonar.scattering.surfaces.patches import Patches, gamma_cells


@pytest.fixture
def patches(variant):
    import mitsuba as mi

    from mitsonar.device.arrays import arrays_of, upload

    return lambda shape, size=1.0, border=0.0: Patches(shape, size, arrays_of(mi.Float), upload, border)


def drawn(patches, count=1000):
    """g of count² patches about the origin."""
    import mitsuba as mi

    index = dr.arange(mi.UInt32, count * count)
    x, y = (mi.Float(mi.Int32(v) - count // 2) + 0.5 for v in (index // count, index % count))
    return patches.at(x * patches.size, y * patches.size).numpy().astype(float)


@pytest.mark.parametrize("shape", [0.1, 0.3, 0.5, 1.0, 2.0, 5.0, 50.0, 1000.0])
def test_table_has_the_moments_of_the_gamma_distribution(shape):
    cells = gamma_cells(shape, 1 << 13)
    assert np.all(np.diff(cells) > 0) or shape < 0.3           # the first cells of a very patchy bed are all 0
    assert cells.mean() == pytest.approx(1.0, abs=1e-12)
    assert (cells**2).mean() == pytest.approx(1 + 1 / shape, rel=2e-3)


@pytest.mark.parametrize("shape", [0.3, 1.0, 5.0, 50.0])
def test_patches_are_gamma_distributed(patches, shape):
    """A million patches: 4 standard errors of mean and second moment, and Kolmogorov's distance at 1 % (0.0016) plus
    the table's step (0.0001)."""
    g = drawn(patches(shape))
    n = len(g)
    assert g.mean() == pytest.approx(1.0, abs=4 * g.std() / np.sqrt(n))
    assert (g**2).mean() == pytest.approx(1 + 1 / shape, abs=4 * (g**2).std() / np.sqrt(n))
    assert stats.kstest(g, stats.gamma(shape, scale=1 / shape).cdf).statistic < 1.63 / np.sqrt(n) + 2e-4


def test_neighbours_are_independent(patches):
    g = drawn(patches(2.0)).reshape(1000, 1000) - 1
    variance = (g**2).mean()
    for other in (np.roll(g, 1, 0), np.roll(g, 1, 1), np.roll(g, (1, -1), (0, 1))):
        assert abs((g * other).mean()) < 4 * variance / 1000


def test_a_patch_is_a_square_of_its_size(patches):
    import mitsuba as mi

    field = patches(1.0, 2.5)
    x, y = mi.Float([0.1, 2.4, 2.6, 0.1, -0.1, 0.1]), mi.Float([0.1, 2.4, 0.1, 2.6, 0.1, -0.1])
    g = field.at(x, y).numpy()
    assert g[0] == g[1] and len(set(g)) == 5
    np.testing.assert_array_equal(patches(1.0, 2.5).at(x, y).numpy(), g)


@pytest.mark.parametrize("shape, size", [(0.0, 1.0), (2000.0, 1.0), (np.nan, 1.0), (1.0, 0.0), (1.0, np.inf)])
def test_numbers_out_of_range_are_refused(patches, shape, size):
    with pytest.raises(ValueError, match="patch"):
        patches(shape, size)


def test_borders_of_patches_are_no_steps(patches):
    """Along an edge at x = 0 each 5 cm square has g of either side; means go over like (1 - 2 d / w)² / 2."""
    import mitsuba as mi

    # along the middle of patches of 100 m in y, so that no third one is near
    d, y = np.array([-30.0, -10.0, -2.5, 2.5, 10.0, 30.0]), 50 + 0.05 * (np.arange(4000) % 200 - 100)
    x = d[:, None] + 0.05 * (np.arange(4000) // 200)
    places = mi.Float(x.ravel()), mi.Float(np.tile(y, 6))
    steps, soft = (patches(1.0, 100.0, border).at(*places).numpy().reshape(6, -1) for border in (0.0, 40.0))
    left, right = steps[0, 0], steps[5, 0]
    assert left != right and np.array_equal(np.unique(steps), np.sort([left, right]))
    share = ((soft - left) / (right - left)).mean(1)
    middle = x.mean(1)
    beyond = 0.5 * (1 - np.minimum(2 * np.abs(middle) / 40, 1)) ** 2
    np.testing.assert_allclose(share, np.where(middle < 0, beyond, 1 - beyond), atol=0.03)


def test_a_place_within_a_border_is_distributed_as_any_other(patches):
    import mitsuba as mi

    count = 300
    x, y = (axis.ravel() * 3.0 + 0.02 for axis in np.meshgrid(np.arange(count), np.arange(count)))
    g = patches(0.5, 1.0, 1.0).at(mi.Float(x), mi.Float(y)).numpy().astype(float)
    assert g.mean() == pytest.approx(1, abs=0.02) and (g ** 2).mean() == pytest.approx(3, rel=0.05)
    with pytest.raises(ValueError, match="patch_border is 2.0 m; it must lie in 0..1"):
        patches(0.5, 1.0, 2.0)
