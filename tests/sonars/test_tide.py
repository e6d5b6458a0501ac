"""Tide and draft: the water level moves the sonar and its water, and the bed stays.

Geometry: a level bed 18 m below the datum, a thermocline from 2 to 6 m below the surface, a sonar 2 m below it. A water
level h above the datum is a run over a bed 18 + h below the surface, to within the rounding of float32 vertices (1 µm)
and of the profile's place (0.01 m, `TIDE_STEP`). Depths reduced with the tide are those of the bed; those reduced with
another one are off by the difference of the two, to the 2 mm by which the rounded place of the cast moves a sounding.
The sonar's own detection has a bias of 1 cm at this depth.
"""
from datetime import datetime, timezone

import numpy as np
import pytest

import mitsonar
from mitsonar.io.tracks import tides
from tests.inputs.sonar_scenes import bed, forward_looking, interferometric, multibeam, point_target, sidescan

PROFILE = {"profile": "0:1510, 2:1500, 6:1480, 40:1490"}
LINE = {"start": None, "heading_deg": 0.0, "speed_knots": 1.0}
MOVING = {"pings": 4, "speed_knots": 4.0, "ping_rate_hz": 2.0, "sound_speed": 1500.0}       # 0.5 s between pings
RISE = "time,height\n-10,0\n0,1\n10,2\n"                          # 1 m at the first ping, then 0.1 m/s


@pytest.fixture
def tide(tmp_path):
    """A function that writes the file of a tide and returns its name."""
    def written(text, name="tide.csv"):
        (tmp_path / name).write_text(text)
        return str(tmp_path / name)

    return written


def level(height):
    return f"time,height\n-10,{height}\n100,{height}\n"


def sounder(water=None, depth=18.0, **sensor):
    shapes = {"bed": bed(depth, size=120.0)}
    return multibeam(shapes, depth=2.0, water={**PROFILE, **(water or {})}, film={"range": 40.0},
                     sensor={**MOVING, "beams": 32, **sensor})


def middle(line, name):
    return line[name].where(line["valid"]).median("beam").values


def test_soundings_reduced_with_the_tide_are_those_of_the_bed(variant, tide):
    still, risen = (mitsonar.soundings(sounder(water), 3) for water in ({}, {"tide": tide(RISE)}))
    height = np.array([1.0, 1.05, 1.1, 1.15])
    np.testing.assert_allclose(risen["tide"], height, atol=1e-9)
    np.testing.assert_allclose(risen["tide"], risen["true_tide"], atol=0)
    np.testing.assert_allclose(risen["ping_depth"], 2.0 - risen["tide"], atol=1e-9)
    for line in (still, risen):
        assert abs(middle(line, "depth") - 18.0).max() < 0.015 and line["valid"].mean() > 0.9
        assert abs((line["error"] - line["error_detection"]).where(line["valid"])).max() < 5e-3      # 0.1 m/s upwards
    assert abs(risen["error_tide"]).max() < 2e-3 and "error_tide" not in still


@pytest.mark.parametrize("used, off", [(0.0, 1.0), (0.7, 0.3), ("other", -0.5)])
def test_soundings_without_the_tide_or_with_another_are_off_by_it(variant, tide, used, off):
    scene = sounder({"tide": tide(level(1.0))})
    line = mitsonar.soundings(scene, 3, tide=tide(level(1.5), "other.csv") if used == "other" else used)
    np.testing.assert_allclose(line["error_tide"].where(line["valid"]), off + 0 * line["depth"].where(line["valid"]),
                               atol=2e-3)
    np.testing.assert_allclose(middle(line, "depth"), 18.0 + off, atol=0.015)
    np.testing.assert_allclose(line["error"], sum(line[f"error_{cause}"] for cause in (
        "detection", "refraction", "motion", "tide")), atol=1e-9)
    assert abs(middle(line, "error_motion")).max() < 1e-3


def test_the_reduction_of_a_record_again_gives_its_depths(variant, tide):
    from mitsonar.hydrography.reduction.resounding import resounded

    line = mitsonar.soundings(sounder({"tide": tide(level(1.0))}), 3, tide=0.25)
    again = resounded(line)
    np.testing.assert_allclose(again["depth"], line["depth"], atol=2e-4)


KINDS = {
    "sidescan": lambda water, depth: sidescan(
        {"bed": bed(depth, size=120.0)}, depth=2.0, water=water, rays=4000, sensor={**MOVING, "speckle": False},
        film={"range": 30.0, "bins": 100}),
    "forward_looking": lambda water, depth: forward_looking(
        {"bed": bed(depth, size=120.0), "ball": point_target([0.5, 15.0, 8.0 - depth], 10.0)}, depth=2.0, water=water,
        film={"range": 22.0}, sensor={**MOVING, "beams": 16, "noise": False}),
    "interferometric": lambda water, depth: interferometric(
        {"bed": bed(depth, size=120.0)}, depth=2.0, water=water, film={"range": 30.0, "bins": 200}, sensor=MOVING)}


def test_a_sonar_above_the_datum_hears_what_one_over_a_deeper_bed_does(variant, tide):
    """2 m below a surface 3 m above the datum the sonar is at z = 1 m: levels show the absorption on the way."""
    water = {**PROFILE, "absorption_db_per_km": "0:400, 40:50"}
    high = mitsonar.render(KINDS["sidescan"]({**water, "tide": tide(level(3.0))}, 15.0), 3)
    deep = mitsonar.render(KINDS["sidescan"](water, 18.0), 3)
    power = [np.log10(np.mean(10 ** (one["level"].values[:, :, 70:] / 10))) * 10 for one in (high, deep)]
    assert power[0] == pytest.approx(power[1], abs=0.02)


@pytest.mark.parametrize("kind", KINDS)
def test_a_water_level_is_a_deeper_bed(variant, tide, kind):
    """At 1 m above the datum, steps of 0.02 m place the profile exactly; what is left is float32 of places."""
    high = mitsonar.render(KINDS[kind]({**PROFILE, "tide": tide(level(1.0))}, 18.0), 3)
    deep = mitsonar.render(KINDS[kind](PROFILE, 19.0), 3)
    there = np.isfinite(high["level"].values) & np.isfinite(deep["level"].values)
    assert there.mean() > 0.3
    difference = (high["level"] - deep["level"]).values[there]
    assert np.sqrt(np.mean(difference ** 2)) < 0.1 * np.std(deep["level"].values[there])
    bottom = high["depth"].values[np.isfinite(high["depth"].values)]
    assert np.median(bottom) == pytest.approx(np.median(deep["depth"].values[np.isfinite(deep["depth"].values)]) - 1.0,
                                              abs=0.01)
    assert high.attrs["tide_of_ping"] == [1.0] * 4


def test_a_tide_of_zero_changes_no_byte(variant, tide):
    with_tide, without = (mitsonar.render(KINDS["sidescan"]({**PROFILE, **water}, 18.0), 3)
                          for water in ({"tide": tide(level(0.0))}, {}))
    for name, values in without.variables.items():
        np.testing.assert_array_equal(values, with_tide[name], err_msg=name)


def test_a_sonar_at_an_altitude_does_not_ride_on_the_tide(variant, tide):
    shapes = {"bed": bed(18.0, size=120.0)}
    for sensor, z in (({"depth": 2.0}, -1.0), ({"altitude": 5.0}, -13.0)):
        one = multibeam(shapes, water={**PROFILE, "tide": tide(level(1.0))}, sensor={**LINE, **sensor})
        survey = one.integrator().survey(one, one.sensors()[0])
        assert survey.track.position[0, 2] == pytest.approx(z, abs=1e-5)


def test_a_draft_replaces_the_z_of_a_track_and_its_error_is_one_of_motion(variant, tide):
    track = tide("time,x,y,z,heave\n0,0,-5,-9,0.1\n1,0,-3,-9,0.1\n2,0,-1,-9,0.1\n", "track.csv")
    scene = multibeam({"bed": bed(18.0, size=120.0)}, film={"range": 40.0}, water=PROFILE, sensor={
        "track": track, "draft": 1.5, "draft_error": 0.2, "beams": 32, "pings": 2})
    line = mitsonar.soundings(scene, 3)
    np.testing.assert_allclose(line["ping_depth"], 1.5 - 0.1 + 0.2, atol=1e-6)
    # a head that is thought 0.2 m too deep has another part of the thermocline below it
    np.testing.assert_allclose(middle(line, "error_motion"), 0.2, atol=3e-3)


@pytest.mark.parametrize("text, words", [
    ("0,1\n100,1\n", "numbers where the names of columns belong"),
    ("time,level\n0,1\n100,1\n", "it needs the columns time and height"),
    ("time,height\n0,1\n", "it has one reading"),
    ("time,height\n0,1\n5,1\n5,2\n", "line 4: the time 5 is not later than 5 before it"),
    ("time,height\n0,1\n5,nan\n", "line 3: height is 'nan', which is not a finite number"),
    ("time,height\n0,1\n5,30\n", "no tide is more than 20 m from its datum"),
    ("time,height\n0,1\n1.2,1\n", "lasts from 0 to 1.2 s after the first ping, and the pings last until 1.5 s"),
    ("time,height\n2026-05-01T10:00:00Z,1\n2026-05-02T10:00:00Z,1\n", "give the track dates")])
def test_bad_tides_are_refused_in_a_sentence(variant, tide, text, words):
    with pytest.raises((ValueError, RuntimeError), match=words):
        mitsonar.soundings(sounder({"tide": tide(text)}), 3)


def test_a_tide_of_another_day_is_refused_with_both_dates(tide):
    read = tides.load(tide("time,height\n2026-05-01T10:00:00Z,1\n2026-05-02T10:00:00Z,1\n"))
    pings = datetime(2027, 3, 4, 5, 6, tzinfo=timezone.utc).timestamp()
    with pytest.raises(ValueError, match="from 2026-05-01 10:00:00 UTC to 2026-05-02 10:00:00 UTC, and the pings from "
                                         "2027-03-04 05:06:00 UTC to 2027-03-04 05:07:00 UTC"):
        read.over(pings, pings + 60.0)


def test_a_sonar_above_the_water_level_is_refused(variant, tide):
    scene = multibeam({"bed": bed(18.0, size=120.0)}, water={**PROFILE, "tide": tide(level(-3.0))},
                      sensor={**LINE, "altitude": 16.0})
    with pytest.raises(ValueError, match=r"1.00 m above the sea surface \(z = -3\)"):
        mitsonar.soundings(scene, 3)


def test_a_sea_surface_takes_no_tide(variant, tide):
    scene = forward_looking({"bed": bed(18.0, size=120.0), "top": {"type": "sea_surface"}},
                            water={**PROFILE, "tide": tide(level(1.0))}, sensor={"beams": 16})
    with pytest.raises(ValueError, match="the scene has a sea_surface, which stays there"):
        mitsonar.render(scene, 3)


def test_the_command_takes_a_water_level_or_a_file(variant, tide, tmp_path):
    from mitsonar.cli.main import main

    for given, height in (("-0.5", -0.5), (tide(level(0.25)), 0.25)):
        output = tmp_path / f"line{height}.nc"
        assert main(["soundings", "multibeam", "-D", "pings=1", "-D", "range=40", "-o", str(output),
                     "--tide", given]) == 0
        line = mitsonar.read(output)
        assert float(line["tide"][0]) == height and float(line["true_tide"][0]) == 0.0
        assert float(line["error_tide"].median()) == pytest.approx(-height, abs=2e-3)
