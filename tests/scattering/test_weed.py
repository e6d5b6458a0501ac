"""Weed: its share of the bed, its edges, and that it is the same at a place whoever asks.

Closed forms: <f> = cover for any edge, n of mean 0 and variance 1 with the mean square slope of the module's head,
<1 + f (w - 1)> = 1 + cover (w - 1). A square of 1 km holds 6e4 patches of 4 m: cover to 0.003, 4 standard errors.
"""
import numpy as np
import pytest
from scipy.stats import norm

from mitsonar.scattering.surfaces.weed import EDGE_QUANTILE, Weed

COUNT, SIDE = 1_000_000, 1000.0


@pytest.fixture
def places(variant, rng):
    import mitsuba as mi

    return [mi.Float(rng.uniform(-SIDE, SIDE, COUNT).astype(np.float32)) for _ in range(2)]


def field(**more):
    import mitsuba as mi

    from mitsonar.device.arrays import arrays_of

    weed = Weed(**{"cover": 0.2, "strength": 4.0, "size": 4.0, **more})
    return weed, weed.on(arrays_of(mi.Float))


@pytest.mark.parametrize("more", [{}, {"edge": 1.0}, {"cover": 0.7, "edge": 4.0}, {"cover": 0.02}, {"size": 1.0},
                                  {"size": 2.0, "stretch": 8.0, "heading": 0.6, "edge": 0.5}])
def test_weed_covers_its_share_whatever_the_edge(places, more):
    weed, on_bed = field(**more)
    share = on_bed.share(*places).numpy()
    assert share.mean() == pytest.approx(weed.cover, abs=0.004 * np.sqrt(weed.stretch))
    assert 0 <= share.min() and share.max() <= 1 and share.max() > 0.99
    assert on_bed.at(*places).numpy().mean() == pytest.approx(1 + share.mean() * (weed.strength - 1), rel=1e-4)
    inside = np.mean((share > 0.01) & (share < 0.99))
    assert inside < 2e-3 if not weed.edge else inside > 0.02


@pytest.mark.parametrize("stretch", [1.0, 6.0])
def test_the_field_is_normal_and_as_steep_as_its_edge_needs(places, stretch):
    weed, on_bed = field(edge=0.5, stretch=stretch, heading=0.4)
    x, y = places
    n = on_bed._field(x, y).numpy().astype(float)
    assert n.mean() == pytest.approx(0, abs=0.01 * np.sqrt(stretch))
    assert n.std() == pytest.approx(1, abs=0.01 * np.sqrt(stretch))
    step = 0.02
    slopes = [(on_bed._field(x + a, y + b).numpy() - n) / step for a, b in ((step, 0), (0, step))]
    slope = np.sqrt(np.mean(slopes[0] ** 2 + slopes[1] ** 2))
    assert weed.sharpness == pytest.approx(0.5 * slope / EDGE_QUANTILE, rel=0.01)
    along = abs(np.mean((np.sin(0.4) * slopes[0] + np.cos(0.4) * slopes[1]) ** 2))
    assert np.sqrt(along) == pytest.approx(slope / np.sqrt(1 + stretch ** 2), rel=0.02)


@pytest.mark.parametrize("edge", [0.2, 1.0, 3.0])
def test_edges_cover_what_the_normal_distribution_says(places, edge):
    """0.1 < f < 0.9 where n lies within 1.28 e of its threshold."""
    weed, on_bed = field(edge=edge)
    share = on_bed.share(*places).numpy()
    e = weed.sharpness
    t = -np.sqrt(1 + e ** 2) * norm.ppf(weed.cover)
    wanted = np.diff(norm.cdf(t + np.array([-0.5, 0.5]) * EDGE_QUANTILE * e))[0]
    assert np.mean((share > 0.1) & (share < 0.9)) == pytest.approx(wanted, abs=0.005)


def test_places_decide_alone(places):
    import mitsuba as mi

    x, y = places
    whole = field(edge=0.5)[1].at(x, y).numpy()
    part = field(edge=0.5)[1].at(mi.Float(x.numpy()[500:900]), mi.Float(y.numpy()[500:900])).numpy()
    np.testing.assert_array_equal(part, whole[500:900])


@pytest.mark.parametrize("more", [{"cover": 0.0}, {"cover": 1.0}, {"size": 0.0}, {"edge": -1.0}, {"stretch": 0.5},
                                  {"strength": -1.0}, {"cover": np.nan}])
def test_numbers_out_of_range_are_refused(more):
    with pytest.raises(ValueError, match="weed"):
        Weed(**{"cover": 0.2, "strength": 4.0, "size": 4.0, **more})
