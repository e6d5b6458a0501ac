"""Water that changes along a line: every ping has that of its cast, and soundings the errors of another's.

Geometry: a level bed 18 m deep; two casts, NORTH and SOUTH, with the same sound speed at the sonar and the same
extremes, so that a run with several casts has the windows and units of a run with one. Pings are then the same to the
last bit.
"""
import numpy as np
import pytest

import mitsonar
from tests.inputs.sonar_scenes import bed, forward_looking, interferometric, multibeam, point_target, sidescan
from tests.sonars.test_changing_surroundings import by_ping

NORTH = {0: 1510, 2: 1500, 6: 1480, 40: 1490}
SOUTH = {0: 1510, 2: 1500, 14: 1500, 16: 1480, 40: 1490}
SHAPES = {"bed": bed(18.0, size=120.0), "ball": point_target([8.0, 2.0, -17.0], 0.0)}
MOVING = {"pings": 6, "speed_knots": 4.0, "ping_rate_hz": 2.0, "sound_speed": 1500.0}       # 1.03 m between pings
KINDS = {
    "sidescan": lambda water: sidescan(SHAPES, depth=2.0, water=water, rays=4000, sensor={**MOVING, "speckle": True},
                                       film={"range": 30.0, "bins": 100}),
    "forward_looking": lambda water: forward_looking(SHAPES, depth=2.0, water=water, film={"range": 22.0},
                                                     sensor={**MOVING, "beams": 16}),
    "multibeam": lambda water: multibeam(SHAPES, depth=2.0, water=water, film={"range": 30.0},
                                         sensor={**MOVING, "beams": 32}),
    "interferometric": lambda water: interferometric(SHAPES, depth=2.0, water=water, film={"range": 30.0, "bins": 200},
                                                     sensor=MOVING)}


@pytest.fixture
def folder(tmp_path):
    """A folder with both casts, and a function that lists them with their columns."""
    for name, profile in (("north", NORTH), ("south", SOUTH)):
        (tmp_path / f"{name}.csv").write_text("depth,speed\n" + "".join(f"{z},{c}\n" for z, c in profile.items()))

    def listed(header, *rows):
        (tmp_path / "list.txt").write_text("\n".join((f"file,{header}", *rows)) + "\n")
        return {"casts": str(tmp_path / "list.txt")}

    return tmp_path, listed


def halves(listed):
    """Casts at the track's end and beginning: pings 0 to 2 are nearest to the south, 3 to 5 to the north."""
    return listed("x,y", "north.csv,0,5.2", "south.csv,0,0")


@pytest.mark.parametrize("kind", KINDS)
def test_every_ping_of_a_picture_is_that_of_a_run_with_its_cast_alone(variant, folder, kind):
    path, listed = folder
    both = mitsonar.render(KINDS[kind](halves(listed)), 3)
    south, north = (by_ping([mitsonar.render(KINDS[kind]({"cast": str(path / f"{name}.csv")}), 3)])
                    for name in ("south", "north"))
    for name, values in by_ping([both]).items():
        np.testing.assert_array_equal(values[:3], south[name][:3], err_msg=name)
        np.testing.assert_array_equal(values[3:], north[name][3:], err_msg=name)
    assert not np.array_equal(south["level"], north["level"])
    assert both.attrs["casts"] == ["north.csv", "south.csv"] and both.attrs["casts_rule"] == "nearest"
    assert both.attrs["cast_of_ping"] == [1, 1, 1, 0, 0, 0] and both.attrs["casts_by"] == "place"


@pytest.mark.parametrize("rule, header, rows, expected", [
    ("interpolated", "x,y", ("south.csv,5,-1", "north.csv,-5,6.2"), "place"),
    ("interpolated", "time", ("south.csv,0", "north.csv,2.5"), "time"),
    ("nearest", "time", ("south.csv,0", "north.csv,2.5"), "time"),
    ("latest", "time", ("south.csv,-100", "north.csv,1.2"), "time")])
def test_pings_find_their_water_by_time_or_along_the_track(variant, folder, rule, header, rows, expected):
    water = {**folder[1](header, *rows), "casts_rule": rule}
    scene = KINDS["sidescan"]({**water, "casts_step": 0.0} if rule == "interpolated" else water)
    survey = scene.integrator().survey(scene, scene.sensors()[0])
    speed = [survey.waters.sound_speed(ping, 14.0) for ping in range(6)]
    y, time = survey.track.position[:, 1], survey.track.time
    share = {"place": (y + 1) / 7.2, "time": time / 2.5}[expected]
    if rule == "nearest":
        share = np.round(share)
    if rule == "latest":
        share = (time >= 1.2).astype(float)
    ends = [np.interp(14.0, list(cast), list(cast.values())) for cast in (SOUTH, NORTH)]
    np.testing.assert_allclose(speed, ends[0] + share * (ends[1] - ends[0]), atol=1e-9)
    assert survey.waters.attributes["casts_by"] == expected


def test_interpolated_water_changes_in_steps(variant, folder):
    water = {**folder[1]("time", "south.csv,0", "north.csv,2.5"), "casts_rule": "interpolated", "casts_step": 10.0}
    scene = KINDS["sidescan"](water)
    waters = scene.integrator().survey(scene, scene.sensors()[0]).waters
    # 16 m/s apart at 14 m, at most 20 at 6 m: two steps, so that shares are 0, 1/2 and 1
    assert waters.attributes["cast_of_ping"] == [0, 0, 0.5, 0.5, 1, 1] and len(waters.columns) == 3


def test_soundings_have_the_error_of_the_cast_at_the_other_end(variant, folder):
    """All soundings are reduced with the cast of the south: pings of the north have a refraction error."""
    path, listed = folder
    water = halves(listed)
    line = mitsonar.soundings(KINDS["multibeam"](water), 3, path / "south.csv")
    right = mitsonar.soundings(KINDS["multibeam"](water), 3)
    wrong = mitsonar.soundings(KINDS["multibeam"]({"cast": str(path / "north.csv")}), 3, path / "south.csv")
    error, worst = (np.nanmax(np.abs(one["error_refraction"].values), axis=1) for one in (line, right))
    assert error[:3].max() < 1e-6 and error[3:].min() > 0.05 and worst.max() < 1e-6
    np.testing.assert_array_equal(line["error_refraction"].values[3:], wrong["error_refraction"].values[3:])


@pytest.mark.parametrize("water, message", [
    (lambda listed: listed("time", "south.csv,10", "north.csv,5"),
     r"list.txt, line 3: the time 5 is not later than 10 before it; sort the casts by time"),
    (lambda listed: listed("x,y", "south.csv,0,0", "north.csv,0,9e6"),
     "the cast north.csv, at x = 0 m, y = 9000000 m, is 9000 km from the track, in another sea"),
    (lambda listed: listed("latitude,longitude", "south.csv,54,8", "north.csv,54,8"),
     "the cast south.csv is given by latitude and longitude, but the scene has no place on Earth"),
    (lambda listed: listed("time", "south.csv,2020-01-01T10:00:00Z", "north.csv,2020-01-01T11:00:00Z"),
     "the cast south.csv has a date, but the times of the track begin at 0 s"),
    (lambda listed: {**listed("x,y", "south.csv,0,0", "north.csv,2,0"), "casts_rule": "interpolated"},
     "the casts south.csv and north.csv lie at the same place along the track"),
    (lambda listed: {**listed("x,y", "south.csv,0,0"), "casts_rule": "latest"}, 'write casts_by time'),
    (lambda listed: {**listed("x,y", "south.csv,0,0"), "casts_by": "time"}, "the cast south.csv has no time"),
    (lambda listed: listed("depth", "south.csv,0"), "add time, x and y, or latitude and longitude"),
    (lambda listed: listed("x,y", "east.csv,0,0"), "list.txt, line 2: the cast 'east.csv' is not there")])
def test_casts_that_do_not_fit_are_refused(variant, folder, water, message):
    with pytest.raises(Exception, match=message):
        mitsonar.render(KINDS["sidescan"](water(folder[1])))


def test_a_cast_of_other_water_is_refused(variant, folder):
    (folder[0] / "river.csv").write_text("depth,speed\n0,1410\n20,1412\n")
    water = folder[1]("x,y", "south.csv,0,0", "river.csv,0,3", "north.csv,0,5")
    with pytest.raises(Exception, match="the cast river.csv is 8. m/s slower than south.csv before it"):
        KINDS["sidescan"](water)


def test_an_empty_folder_is_refused(variant, tmp_path):
    (tmp_path / "casts").mkdir()
    with pytest.raises(Exception, match="casts holds no casts; put the files of casts into it"):
        KINDS["sidescan"]({"casts": str(tmp_path / "casts")})


def test_gradients_of_a_water_that_changes_are_refused(variant, folder):
    import mitsuba as mi

    scene = KINDS["sidescan"](halves(folder[1]))
    assert not [name for name in mi.traverse(scene).properties if name.endswith("sound_speed")]
    survey = scene.integrator().survey(scene, scene.sensors()[0])
    with pytest.raises(ValueError, match="the survey's pings have 2; write `cast` in place of `casts`"):
        survey.waters.only.profile


def test_pings_that_share_a_cast_have_one_water(variant, folder):
    scene = KINDS["sidescan"](folder[1]("x,y", "north.csv,0,500", "south.csv,0,0"))
    survey = scene.integrator().survey(scene, scene.sensors()[0])
    assert not survey.changes and survey.waters.only.profile.sound_speed[2] == 1500




def test_the_head_s_sound_speed_is_a_node_of_every_cast(variant, folder):
    scene = KINDS["sidescan"]({**halves(folder[1]), "head_sound_speed": 1503.0, "head_depth": 1.5})
    survey = scene.integrator().survey(scene, scene.sensors()[0])
    for ping, cast in ((0, SOUTH), (5, NORTH)):
        profile = survey.waters.at(ping).profile
        assert profile.at(1.5) == 1503.0 and profile.at(20.0) == np.interp(20.0, list(cast), list(cast.values()))
