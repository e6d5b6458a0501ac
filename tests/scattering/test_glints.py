"""Glints of scatterers: <g> = 1, var g = s² / (β a), the number Poisson, in areas as in single scatterers.

Sample of n squares: standard errors stand in each test. Left out by single precision and by twelve terms of Poisson's
distribution: less than 1e-3 of the mean. Where scatterers lie at random, a box of them has var S = s² / (β A); the
fitted `a` of nested scatterers is 4 % off at most.
"""
import numpy as np
import pytest

from mitsonar.echoes.scatterers.nested_points import place_of
from mitsonar.scattering.surfaces.glints import SQUARE, Glints, with_glints


@pytest.fixture
def factor(variant):
    import mitsuba as mi

    from mitsonar.device.arrays import arrays_of

    def of(x, y, area, per_area, share):
        columns = (mi.Float(np.asarray(value, np.float32).ravel()) for value in (x, y, area, per_area, share))
        return with_glints(arrays_of(mi.Float), *columns).numpy().astype(float)

    return of


@pytest.mark.parametrize("per_area", [1.0, 30.0, 10_000.0])
@pytest.mark.parametrize("area", [1e-6, 1e-2, 0.5])
@pytest.mark.parametrize("share", [0.3, 1.0])
def test_the_mean_stays_and_the_number_is_poissons(factor, per_area, area, share):
    i, j = np.divmod(np.arange(1_000_000), 1000)
    g = factor((i + 0.5) * SQUARE, (j - 499.5) * SQUARE, area, per_area, share)
    mean = per_area * (area ** 1.5 + SQUARE ** 3) ** (2 / 3)
    error = share / np.sqrt(mean * len(g))
    assert g.mean() == pytest.approx(1.0, abs=4 * error + 1e-3 * share)
    # var of a sample's variance: σ⁴ (2 + 1/mean) / n
    assert g.var() / (share ** 2 / mean) == pytest.approx(1.0, abs=4 * np.sqrt((2 + 1 / mean) / len(g)) + 2e-3)
    none = np.mean(g < 1 - share + 1e-6)
    if mean < 3:
        assert none == pytest.approx(np.exp(-mean), abs=4 * np.sqrt(mean / len(g)) + 1e-6)


def test_scatterers_of_one_square_share_its_glints_and_squares_do_not(factor):
    i, j = np.divmod(np.arange(250_000), 500)
    first, other = (factor((i + part) * SQUARE, (j + part) * SQUARE, 1e-6, 200.0, 1.0) for part in (0.1, 0.9))
    np.testing.assert_array_equal(first, other)
    g = first.reshape(500, 500) - first.mean()
    for step in ((1, 0), (0, 1), (1, 1), (1, -1)):
        assert abs((g * np.roll(g, step, (0, 1))).mean()) < 5 * g.var() / 500


@pytest.mark.parametrize("squares", [0.1, 0.5, 1.0, 3.0, 30.0])
def test_any_number_of_scatterers_has_the_variance_of_the_area(factor, squares, rng):
    """Facets of 0.5 m², 10 glints in each: var S within 4 % of the fit, and 4 standard errors of the sample."""
    area, per_area, facets = squares * SQUARE ** 2, 20.0, 3000
    count = int(0.5 / area)
    seed = np.repeat(rng.integers(0, 2 ** 32, facets, dtype=np.uint32), count)
    found = []
    for part in np.array_split(np.arange(facets), 1 + facets * count // 4_000_000):
        k = np.tile(np.arange(count, dtype=np.uint32), len(part))
        u, v = place_of(k, seed[part[0] * count:(part[-1] + 1) * count])
        east = np.repeat(part % 50, count) * 1.37 + u
        north = np.repeat(part // 50, count) * 1.53 + v
        found.append(factor(east, north, area, per_area, 1.0).reshape(len(part), count).mean(1))
    S = np.concatenate(found)
    wanted = 1 / (per_area * 0.5)
    assert S.mean() == pytest.approx(1.0, abs=4 * np.sqrt(wanted / facets))
    assert S.var() / wanted == pytest.approx(1.0, abs=0.04 + 4 * np.sqrt((2 + wanted) / facets))


@pytest.mark.parametrize("per_area, share", [(0.0, 0.3), (1e6, 0.3), (np.nan, 0.3), (1.0, -0.1), (1.0, 1.1)])
def test_numbers_out_of_range_are_refused(per_area, share):
    with pytest.raises(ValueError, match="glint"):
        Glints(per_area=per_area, share=share)
