"""Heights of the bed, looked for from above: exact to the rounding of float32."""
import numpy as np
import pytest


@pytest.fixture
def geometry(variant):
    import mitsuba as mi

    from mitsonar.scene.geometry import Geometry

    to_world = mi.ScalarTransform4f
    scene = mi.load_dict({
        "type": "scene", "bed": {"type": "seabed", "depth": 10.0, "length": 20.0, "width": 20.0, "spacing": 1.0},
        "crate": {"type": "cube", "to_world": to_world().translate([3, 0, -9]) @ to_world().scale(0.5)}})
    return Geometry(scene)


def test_the_bed_is_found_under_what_lies_over_it_and_not_beyond_its_ends(geometry):
    from mitsonar.scene.shadows.bed_cover import bed_height

    found = bed_height(geometry, np.array([3.0, -4.0, 30.0]), np.zeros(3))
    assert found[:2] == pytest.approx(-10, abs=1e-5) and np.isnan(found[2])


def test_no_place_asks_for_no_height(geometry):
    from mitsonar.scene.shadows.bed_cover import bed_height

    assert bed_height(geometry, np.zeros(0), np.zeros(0)).shape == (0,)
