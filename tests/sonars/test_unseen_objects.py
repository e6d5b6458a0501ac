"""Objects that no ping sees are told by name; those of which an echo or a shadow is there are not."""
import mitsuba as mi
import numpy as np
import pytest

import mitsonar
from mitsonar.validation.scenes import array_sonar, bed, point_target, sidescan


def box(x, y, z):
    """A cube of 1 m."""
    return {"type": "cube", "to_world": mi.ScalarTransform4f().translate([x, y, z]).scale([0.5, 0.5, 0.5])}


def test_a_sidescan_tells_what_it_never_sees():
    shapes = {"seabed": bed(30.0), "near": box(20, 0, -29), "far": box(150, 0, -29), "astern": box(20, -60, -29),
              "buried": box(-20, 0, -31.5), "buoy": point_target([25, 0, -28])}
    with pytest.warns(UserWarning, match="no ping sees astern, buried, far: out of range"):
        image = mitsonar.render(sidescan(shapes, film={"range": 60.0, "bins": 100}, rays=20_000))
    assert image.attrs["unseen"] == ["astern", "buried", "far"]


def test_many_are_counted():
    shapes = {"seabed": bed(30.0), **{f"drum{k}": box(150, 3 * k, -29) for k in range(8)}}
    with pytest.warns(UserWarning, match="no ping sees drum0, drum1, drum2, drum3, drum4 and 3 more: "):
        image = mitsonar.render(sidescan(shapes, film={"range": 60.0, "bins": 100}, rays=5000))
    assert len(image.attrs["unseen"]) == 8


def test_an_object_that_only_casts_a_shadow_is_seen(recwarn):
    plate = {"type": "rectangle", "bsdf": {"type": "rigid"}, "to_world": mi.ScalarTransform4f().translate(
        [20, 0, -26]).rotate([0, 0, 1], 90).rotate([1, 0, 0], 40).scale([6, 3, 1])}
    image = mitsonar.render(sidescan({"seabed": bed(30.0), "plate": plate}, film={"range": 60.0, "bins": 100},
                                     rays=20_000))
    assert image.attrs["unseen"] == [] and not [w for w in recwarn if "no ping sees" in str(w.message)]
    assert np.any(image["object_shadow"])


def test_of_an_array_too():
    shapes = {"seabed": bed(20.0, size=60.0), "buoy": point_target([0, 5, -15]), "out": point_target([0, 25, -15])}
    scene = array_sonar(shapes, sensor={"receive": "line", "receive_elements": 4, "beams": 9},
                        film={"range": 14.0}, integrator={"cell": 0.5})
    with pytest.warns(UserWarning, match="no ping sees out: "):
        assert mitsonar.render(scene).attrs["unseen"] == ["out"]
