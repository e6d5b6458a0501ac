"""Soundings reduced by heights above the ellipsoid: with the right separation they are those of the tide.

Geometry: a level bed 18 m below the datum, a tide of 1 m and more, a vessel that heaves, in water of one speed. A wrong
separation or tide is an error of depth of its own size, to 1 mm of rounded places; the sonar's detection has 1 cm.
"""
import numpy as np
import pytest
from sonar_scenes import bed, multibeam

import mitsonar

DEPTH = 18.0
RISE = "time,height\n-10,0\n0,1\n10,2\n"                          # 1 m at the first ping, then 0.1 m/s
WATER = {"sound_speed": 1500.0, "separation": 40.5, "vertical_datum": "chart datum of nowhere"}
LAUNCH = {"motion": "hull", "pings": 3, "speed_knots": 4.0, "ping_rate_hz": 2.0, "beams": 32}


@pytest.fixture
def tide(tmp_path):
    (tmp_path / "tide.csv").write_text(RISE)
    return str(tmp_path / "tide.csv")


def sounded(water=None, sensor=None, **by):
    scene = multibeam({"bed": bed(DEPTH, size=120.0)}, depth=2.0, water={**WATER, **(water or {})},
                      film={"range": 40.0}, sensor={**LAUNCH, **(sensor or {})})
    return mitsonar.soundings(scene, 3, **by)


def of(line, name):
    return line[name].where(line["valid"]).values


def test_heights_above_the_ellipsoid_give_the_depths_of_the_tide(variant, tide):
    """0.1 m/s of rising water is in the heights as it is in the tide."""
    by_tide, by_heights = (sounded({"tide": tide}, heights=one) for one in ("tide", "gnss"))
    np.testing.assert_allclose(of(by_heights, "depth"), of(by_tide, "depth"), atol=1e-6)
    np.testing.assert_allclose(by_heights["tide"], by_tide["tide"], atol=1e-9)       # followed from the heights
    assert abs(of(by_heights, "error_separation")[by_heights["valid"].values]).max() < 1e-3
    assert "error_tide" not in by_heights and "error_separation" not in by_tide
    for line, name in ((by_tide, "tide"), (by_heights, "gnss")):
        assert line.attrs["heights"] == name and line.attrs["vertical_datum"] == WATER["vertical_datum"]
        np.testing.assert_allclose(line["separation"], 40.5, atol=1e-9)
        np.testing.assert_allclose(line["separation"] - line["ping_height"], line["ping_depth"], atol=1e-6)


def test_a_wrong_separation_is_an_error_of_its_own_size(variant, tide):
    line = sounded({"tide": tide}, heights="gnss", separation=40.8)
    np.testing.assert_allclose(of(line, "error_separation"), 0.3 + 0 * of(line, "depth"), atol=1e-3)
    np.testing.assert_allclose(line["true_separation"], 40.5, atol=1e-9)
    np.testing.assert_allclose(of(line, "error"), sum(of(line, f"error_{cause}") for cause in (
        "detection", "refraction", "motion", "separation")), atol=1e-9)
    declared = sounded({"tide": tide}, {"separation_error": 0.3}, heights="gnss")
    np.testing.assert_allclose(of(declared, "depth"), of(line, "depth"), atol=1e-9)
    # what reduces nothing is stated, and changes no depth
    unused = sounded({"tide": tide}, separation=40.8)
    assert "error_separation" not in unused and float(unused["separation"][0]) == pytest.approx(40.8)


def test_a_wrong_draft_or_heave_does_not_reach_depths_by_heights(variant):
    wrong = {"draft_error": 0.4, "motion_sensor_error": "5, 0, 0", "heave_noise": 0.1}
    right, by_tide, by_heights = (sounded(sensor=sensor, heights=heights) for sensor, heights in (
        ({}, "gnss"), (wrong, "tide"), (wrong, "gnss")))
    np.testing.assert_allclose(of(by_heights, "depth"), of(right, "depth"), atol=1e-6)
    assert abs(of(by_tide, "error_motion")[by_tide["valid"].values]).min() > 0.1


def test_a_wrong_arm_of_the_antenna_reaches_depths_by_heights_alone(variant):
    """An antenna stated 0.25 m lower than it is puts the vessel 0.25 m too high: cos(roll) cos(pitch) > 0.99."""
    wrong = {"antenna": "2, 0, -6", "antenna_error": "0, 0, 0.25"}
    by_tide, by_heights = (sounded(sensor=wrong, heights=one) for one in ("tide", "gnss"))
    assert np.nanmax(abs(of(by_tide, "error_motion"))) < 0.01
    np.testing.assert_allclose(of(by_heights, "error_motion"), -0.25 + 0 * of(by_heights, "depth"), atol=0.01)


def test_a_tide_error_is_one_of_the_tide(variant):
    line = sounded(sensor={"tide_error": -0.2})
    np.testing.assert_allclose(of(line, "error_tide"), 0.2 + 0 * of(line, "depth"), atol=1e-3)
    np.testing.assert_allclose(line["tide"], -0.2, atol=1e-12)
    np.testing.assert_allclose(line["true_tide"], 0.0, atol=1e-12)


@pytest.mark.parametrize("sensor, by, words", [
    ({}, {"heights": "sky"}, "heights is 'sky'; give tide or gnss"),
    ({}, {"heights": "gnss", "tide": 1.0}, "need no tide"),
    ({"antenna": "900, 0, 0"}, {}, "antenna is 900, 0, 0 m; give a lever arm within 500 m"),
    ({}, {"separation": "none.gtx", "heights": "gnss"}, "cannot read the separation none.gtx")])
def test_what_does_not_fit_is_refused_in_a_sentence(variant, sensor, by, words):
    with pytest.raises((ValueError, RuntimeError), match=words):
        sounded(sensor=sensor, **by)


def test_heights_without_any_separation_are_refused(variant):
    scene = multibeam({"bed": bed(DEPTH, size=120.0)}, depth=2.0, film={"range": 40.0}, sensor=LAUNCH)
    with pytest.raises(ValueError, match="need a separation, and neither the water nor"):
        mitsonar.soundings(scene, 3, heights="gnss")
