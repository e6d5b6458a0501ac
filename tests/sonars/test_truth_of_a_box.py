"""Truth of a sidescan's bins against geometry: a box on a level bed in uniform water, lit by straight rays.

The sonar is H above the bed, the box h high from x0 to x1 abeam. At slant range R

    highlight       hypot(x0, H - h) .. hypot(x1, H - h)          face and top
    layover         hypot(x0, H - h) .. hypot(x0, H)              bed before the box, face, and top: 3 places
    shadow          hypot(x1, H - h) .. hypot(x1 H / (H - h), H)
    seabed          at x = √(R² - H²)

Edges fall within a bin of w = 5 cm; they may be off by one bin, for a bin that is cut counts as a whole.
"""
import mitsuba as mi
import numpy as np
import pytest
from mean_intensity import render

import mitsonar.scene.loading  # tells Dr.Jit its libraries before Mitsuba is imported
from mitsonar.validation.scenes import bed, lambert, sidescan

H, HEIGHT, NEAR, FAR, WIDTH = 10.0, 1.0, 28.0, 30.0, 0.05


def _box(mu_db=-20.0):
    to_world = mi.ScalarTransform4f().translate([0.5 * (NEAR + FAR), 0, -20 + HEIGHT / 2])
    return {"type": "cube", "id": "box.1", "bsdf": lambert(mu_db),
            "to_world": to_world.scale([0.5 * (FAR - NEAR), 3, HEIGHT / 2])}


@pytest.fixture(scope="module")
def image():
    mitsonar.scene.loading.prepare()
    scene = sidescan({"seabed": bed(20), "box": _box()}, rays=200_000, film={"range": 60.0, "bins": 1200},
                     sensor={"start": [0, 0, -H], "beam_width_deg": 0.5, "pulse_ms": 0.05})
    return render(scene)[0]


def _span(image, flags):
    """Slant ranges from where to where `flags` (bins,) hold, without gaps."""
    found = np.flatnonzero(flags)
    assert len(found) == found[-1] - found[0] + 1, "there are gaps"
    return image["range"].values[[found[0], found[-1]]] + np.array([-0.5, 0.5]) * WIDTH


def test_highlight_shadow_and_layover_lie_where_geometry_puts_them(image):
    abeam = image.isel(ping=0, side=1)
    top = np.hypot(NEAR, H - HEIGHT), np.hypot(FAR, H - HEIGHT)
    end = np.hypot(FAR * H / (H - HEIGHT), H)
    # within the shadow the box is heard as well, aside of the beam and 80 dB below its face
    heard = abeam["mean_level"] > abeam["mean_level"].max() - 45
    np.testing.assert_allclose(_span(image, heard & (abeam["share"].sel(shape="box.1") > 0.5)), top, atol=WIDTH)
    np.testing.assert_allclose(_span(image, abeam["object_shadow"] > 0), (top[1], end), atol=WIDTH)
    np.testing.assert_allclose(_span(image, abeam["hidden"] > 0.5), (np.hypot(NEAR, H), end), atol=WIDTH)
    np.testing.assert_allclose(_span(image, abeam["layover"] > 1), (top[0], np.hypot(NEAR, H)), atol=WIDTH)
    assert (abeam["layover"].values[[590, 591, 592]] == 3).all()
    assert not image["object_shadow"].sel(side="port").any()


def test_the_seabed_of_a_bin_is_where_its_slant_range_meets_it(image):
    abeam = image.isel(ping=0, side=1)
    slant = abeam["range"].values
    seen = np.isfinite(abeam["seabed_x"].values) & (slant > 1.05 * H)
    assert seen.sum() > 850
    ground = np.sqrt(np.maximum(slant**2 - H**2, 0))
    # the mean over a bin is not quite its middle: rays are drawn, and energy falls across it
    np.testing.assert_allclose(abeam["seabed_x"].values[seen], ground[seen], atol=0.02)
    np.testing.assert_allclose(abeam["seabed_depth"].values[seen], 20, atol=1e-4)
    assert np.abs(abeam["seabed_y"].values[seen]).max() < 0.1
    assert np.isnan(abeam["seabed_x"].values[abeam["object_shadow"].values > 0][2:-2]).all()


def test_the_place_of_a_faint_seabed_far_off_is_known():
    """Mud at a grazing angle of 1.2 degrees in bins of 5 cm, a hundredth of a millionth of a full echo."""
    scene = sidescan({"seabed": bed(20, lambert(-35), size=2000.0)}, sensor={"start": [0, 0, -14]},
                     film={"range": 300.0, "bins": 6000})
    image = render(scene)[0].isel(side=1)
    seen = image["label"].values > 0
    x = image["seabed_x"].values
    assert np.isnan(x[seen]).mean() < 0.01
    far = seen & np.isfinite(x) & (image["range"].values > 100)
    ground = np.broadcast_to(np.sqrt(np.maximum(image["range"].values ** 2 - 6 ** 2, 0)), x.shape)
    np.testing.assert_allclose(x[far], ground[far], atol=0.08)


def test_names_classes_and_boxes_are_said(image):
    assert image.attrs["labels"] == {"1": "box.1", "2": "seabed"}
    assert image.attrs["classes"] == {"1": "box", "2": "seabed"}
    assert image.attrs["label_class"] == {"1": 1, "2": 2}
    assert image.attrs["objects"] == {"1": {"class": "box", "lower": [NEAR, -3, -20], "upper": [FAR, 3, -19],
                                            "exposed": 1.0}}
    assert len(image.attrs["seabed"]) == 16
    assert (image["class"].values == image["label"].values).all()          # one instance of each class


def test_an_instance_of_a_group_is_heard_as_the_shape_itself():
    T, crate = mi.ScalarTransform4f, {"type": "cube", "bsdf": lambert(-20)}
    place = T().translate([20, 0, -20]).scale([1, 2, 1])
    group = {"group": {"type": "shapegroup", "inner": crate},
             "crate": {"type": "instance", "of": {"type": "ref", "id": "group"}, "to_world": place}}
    made = [render(sidescan({"seabed": bed(20), **shapes}, sensor={"start": [0, 0, -H]}, rays=20_000))[0]
            for shapes in ({"crate": {**crate, "to_world": place}}, group)]
    assert (made[0]["label"] == 1).any()
    for name in ("label", "object_shadow", "layover"):
        assert (made[0][name].values == made[1][name].values).mean() > 0.999
    np.testing.assert_allclose(made[1]["mean_level"], made[0]["mean_level"], atol=0.5)


def test_a_seabed_of_one_rectangle_is_known_by_its_tilt():
    """Two planes whose boxes are the same."""
    tilts = [render(sidescan({"seabed": bed(20, size=200.0, tilt=tilt)}, rays=1000, film={"bins": 50},
                             sensor={"start": [0, 0, -H]}))[0] for tilt in (0.05, -0.05, 0.05)]
    assert tilts[0].attrs["seabed"] == tilts[2].attrs["seabed"] != tilts[1].attrs["seabed"]


def test_shares_add_to_one(image):
    total = image["share"].sum("shape").values
    assert np.abs(total[total > 0] - 1).max() < 1e-6
    np.testing.assert_array_equal(total > 0, image["mean_level"].values > -200)


def test_a_point_target_that_lasts_into_the_next_bin_has_its_share_there():
    """A pulse of 7.5 cm whose middle is a tenth of the way into a bin of 10 cm."""
    slant = 16.41
    point = {"type": "point_target", "position": [np.sqrt(slant**2 - 6**2), 0, -16], "target_strength_db": -5.0}
    scene = sidescan({"seabed": bed(20, lambert(-35)), "point": point}, sensor={"start": [0, 0, -10]},
                     film={"range": 40.0, "bins": 400})
    abeam = render(scene)[0].isel(ping=0, side=1)
    level = abeam["mean_level"].values
    assert level[163] > level[162] + 40
    np.testing.assert_allclose(abeam["share"].sel(shape="point").values[162:166], [0, 1, 1, 0], atol=1e-3)


def test_a_record_that_begins_within_an_echo_says_whose_it_is():
    """The middle of a pulse of 22 cm lies 1.5 cm before the first bin."""
    point = {"type": "point_target", "position": [18, 0, -19], "target_strength_db": 0.0}
    scene = sidescan({"seabed": bed(20), "point": point}, sensor={"start": [0, 0, -10], "pulse_ms": 0.3},
                     film={"range_min": 20.14, "range": 60.0, "bins": 400})
    abeam = render(scene)[0].isel(ping=0, side=1)
    assert abeam["mean_level"].values[0] > abeam["mean_level"].values[3] + 30
    np.testing.assert_allclose(abeam["share"].sel(shape="point").values[[0, 3]], [1, 0], atol=0.02)


def test_shares_of_smooth_bodies_and_points_add_to_one():
    """What has a phase is shared out as well: a rigid ball and a point target over a bed."""
    T = mi.ScalarTransform4f
    ball = {"type": "sphere", "radius": 0.5, "to_world": T().translate([15, 0, -16]), "bsdf": {"type": "rigid"}}
    point = {"type": "point_target", "position": [-12.0, 0, -16], "target_strength_db": -5.0}
    scene = sidescan({"seabed": bed(20, lambert(-35)), "ball": ball, "point": point}, rays=40_000,
                     sensor={"start": [0, 0, -H]}, film={"range": 40.0, "bins": 400})
    image = render(scene)[0]
    total = image["share"].sum("shape").values
    assert np.abs(total[total > 0] - 1).max() < 1e-6
    for name, side, where in (("ball", 1, np.hypot(15, 6) - 0.5), ("point", 0, np.hypot(12, 6))):
        bin = int(where / 0.1)
        assert image["share"].sel(shape=name).values[0, side, bin - 1:bin + 2].max() > 0.9
