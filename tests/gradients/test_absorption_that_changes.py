"""Absorption node by node: closed form at constant speed, differences in a thermocline, and what cannot be."""
import mitsuba as mi
import numpy as np
import pytest
from scene_text import lit_bed

import mitsonar
from mitsonar.verbs.gradients import scene_model

KEY = "sonar.medium.absorption_offset"


@pytest.fixture
def model(tmp_path):
    def made(profile, seed=0):
        path = tmp_path / "scene.xml"
        path.write_text(lit_bed(profile=profile, rays=20_000, pings=1, start=(0, 0, -18), speed_knots=0.01,
                                water='<float name="absorption_db_per_km" value="40"/>'))
        return scene_model(mitsonar.load_file(path), [KEY], seed=seed)

    return made


def test_levels_fall_by_twice_the_way_through_each_layer(model):
    """d level / dα_i = -2 R <hat_i>, hat_i linear between nodes, <> over the depths from sonar to bed: 18 to 30 m.

    Sums over nodes are -2 R to the quarter of a bin that rays and pulse leave open (3e-4); shares are exact to the
    table's float32, 1e-4."""
    nodes = np.array([0.0, 10, 20, 26, 50])
    made = model("0:1500, 10:1500, 20:1500, 26:1500, 50:1500")
    about = made.linearised({})
    lit = np.array([100, 150, 190])
    bins = 34 / 200
    slopes = np.stack([about.forward({KEY: one}).reshape(made.shape)[0, 1, lit] for one in np.eye(5)])
    slopes = slopes / about.value.reshape(made.shape)[0, 1, lit] * 10 / np.log(10)
    depth = np.linspace(18, 30, 2001)
    shares = np.array([np.trapezoid(np.interp(depth, nodes, one), depth) / 12 for one in np.eye(5)])
    assert slopes.sum(0) == pytest.approx(-2 * (lit + 0.5) * bins, rel=1e-3)
    assert slopes / slopes.sum(0) == pytest.approx(np.repeat(shares[:, None], 3, 1), abs=1e-4)


def test_in_a_thermocline_products_are_those_of_differences(model):
    """At a water that absorbs more in the middle already; both directions of the product, float32 sums: 1e-3."""
    made = model("0:1492, 18:1490, 24:1478, 30:1474, 50:1474")
    there = {KEY: np.array([0.0, 0.01, 0.02, 0.0, 0.0])}
    about = made.linearised(there)
    way = np.array([0.3, 1.0, -0.5, 0.8, 0.2])
    ahead, back = (made.value({KEY: there[KEY] + sign * 0.005 * way}) for sign in (1, -1))
    product = about.forward({KEY: way})
    assert np.linalg.norm(product - (ahead - back) / 0.01) < 2e-3 * np.linalg.norm(product)
    weights = np.random.default_rng(0).uniform(0.5, 1.5, product.size)
    assert about.backward(weights)[KEY] @ way == pytest.approx(weights @ product, rel=1e-4)


def test_water_that_would_absorb_less_than_nothing_is_refused(model):
    made = model("0:1500, 50:1500")
    assert made.units[KEY] == "dB/m" and not made.start[KEY].any()
    with pytest.raises(ValueError, match="not negative; somewhere it is -0.01 dB/m"):
        made.value({KEY: np.full(2, -0.05)})


def test_what_is_added_counts_in_records_of_all_kinds():
    water = mi.load_dict({"type": "seawater", "profile": "0:1500, 40:1500", "absorption_db_per_km": 20.0})
    parameters = mi.traverse(water)
    parameters["absorption_offset"] = mi.Float64([0.0, 0.04])
    parameters["absorption_scale"] = mi.Float64([2.0])
    parameters.update()
    column = water.absorption_column(100e3)
    assert column.at(np.array([0.0, 20, 40, 100])) == pytest.approx([0.04, 0.08, 0.12, 0.12])
    parameters["absorption_offset"] = mi.Float64([0.0])
    with pytest.raises((ValueError, RuntimeError), match="one for each"):
        parameters.update()
