"""Recorded lines with another tide, heights above the ellipsoid, navigation of SBET and POS MV, and delayed heave.

The line of `soundings_line` is exact in water of one speed: a motion that is right gives back the plane bed to the 2 mm
of splines through 50 Hz; a level that is off by h moves all depths by h, and nothing else, to float32 of the file.
"""
import functools
from pathlib import Path

import numpy as np
import pytest
from inertial_files import heave_group, navigation_group, write_sbet
from soundings_line import ORIGIN, _attitude, _place, soundings_line

import mitsonar
from mitsonar.cli.main import main
from mitsonar.device.earth import Frame
from mitsonar.hydrography.record import variable
from mitsonar.io.survey_lines import write
from mitsonar.io.tracks.gps_time import EPOCH, WEEK, instant

FRAME = Frame(crs="EPSG:32632", origin=ORIGIN)
START = instant("2026-05-01T10:00:00Z", "start")
SECONDS = (START - EPOCH) % WEEK
LEAPS = 18.0
TIME = np.arange(-1.0, 6.0, 0.02)
LIFT = 39.0                        # [m] of the datum above the ellipsoid


def line(**wrong):
    """The line with a wrong motion: names of `_moved` and what is added."""
    made = soundings_line(pings=6, column=False, snippets=False)
    for name, more in wrong.items():
        for of in ("motion", "ping"):
            key = f"{of}_{name}"
            made[key] = variable(key, made[key].values + more)
    made["ping_height"] = variable("ping_height", LIFT - _place(made["ping_time"].values)[:, 2])
    return made


def sbet(path="nav.sbet", clock=LEAPS, off=0.0):
    """The true motion, by a clock that is ahead of UTC; heights by the vessel's true depth."""
    place, (roll, pitch, heading) = _place(TIME), _attitude(TIME)
    latitude, longitude, convergence = FRAME.on_globe(place[:, :2])
    return write_sbet(path, SECONDS + TIME + clock, latitude, longitude, LIFT - place[:, 2] + off, roll, pitch,
                      heading + convergence, wander=0.2)


@functools.cache
def file_of(**wrong):
    """The bytes of the line's file; made in the current folder."""
    write(line(**wrong), "line.nc")
    return Path("line.nc").read_bytes()


def reduced(*options, **wrong):
    Path("line.nc").write_bytes(file_of(**wrong))
    return reduced_as_it_is(*options)


def reduced_as_it_is(*options):
    assert main(["soundings", "line.nc", "-o", "out.nc", *options]) == 0
    return mitsonar.read("out.nc")


def off(made):
    """Return how far valid soundings lie below the bed, without the noise of detection."""
    depth, x = made["depth"].values, made["x"].values
    exact = soundings_line(pings=6, column=False, snippets=False)["error_detection"].values
    return (depth - 50.0 - 0.02 * x - exact)[made["valid"].values & np.isfinite(depth)]


@pytest.mark.parametrize("options, moved", [
    (["--tide", "0.75"], -0.75), (["--tide", "tide.csv"], -0.5), (["--tide", "dated.csv"], -0.25),
    (["--heights", "gnss", "--separation", "39"], 0.0), (["--heights", "gnss", "--separation", "39.3"], 0.3)])
def test_a_level_moves_all_depths_by_itself(folder, options, moved):
    (folder / "tide.csv").write_text("time,height\n-10,0.5\n100,0.5\n")
    (folder / "dated.csv").write_text("time,height\n2026-05-01T09:00:00Z,0.25\n2026-05-01T11:00:00Z,0.25\n")
    found = reduced(*options)
    np.testing.assert_allclose(off(found), moved, atol=2e-3)
    np.testing.assert_allclose(found["tide"], -moved, atol=1e-5)
    assert found.attrs["heights"] == ("gnss" if "gnss" in options else "tide")


def test_heights_need_no_right_draft(folder):
    np.testing.assert_allclose(off(reduced("--tide", "0", depth=0.4)), 0.4, atol=2e-3)
    np.testing.assert_allclose(off(reduced("--heights", "gnss", "--separation", "39", depth=0.4)), 0, atol=2e-3)


@pytest.mark.parametrize("clock, name", [(LEAPS, "in GPS time"), (0.0, "in UTC")])
def test_an_sbet_mends_a_wrong_motion_whatever_its_clock(folder, capfd, clock, name):
    """A roll that is 1 degree off moves the outer beams by 1.5 m."""
    wrong = {"roll": np.radians(1.0), "x": 0.5, "heading": 0.02}
    assert np.abs(off(reduced("--tide", "0", **wrong))).max() > 1.0
    sbet(clock=clock)
    found = reduced("--navigation", "nav.sbet", **wrong)
    np.testing.assert_allclose(off(found), 0.0, atol=3e-3)
    said = capfd.readouterr().err
    assert f"the navigation {name} is 0.5" in said and "m rms from the line's positions" in said
    np.testing.assert_allclose(found["ping_x"], _place(found["ping_time"].values)[:, 0], atol=1e-3)


def test_heights_of_an_sbet_take_the_place_of_the_lines(folder):
    sbet(off=0.2)
    found = reduced("--navigation", "nav.sbet", "--heights", "gnss", "--separation", "39")
    np.testing.assert_allclose(off(found), -0.2, atol=3e-3)


def test_delayed_heave_of_a_posmv_corrects_that_of_its_time(folder):
    """The line's own heave lags: it is too deep by what group 111 tells both heaves apart by."""
    made = line()
    wave = {of: 0.15 * np.sin(made[f"{of}_time"].values) for of in ("motion", "ping")}
    for of, more in wave.items():
        made[f"{of}_depth"] = variable(f"{of}_depth", made[f"{of}_depth"].values + more)
    write(made, "line.nc")
    assert np.abs(off(reduced_as_it_is("--tide", "0"))).max() > 0.1
    groups = [heave_group(SECONDS + time, 0.0, 0.15 * np.sin(time)) for time in TIME]
    (folder / "heave.000").write_bytes(b"".join(groups))
    np.testing.assert_allclose(off(reduced_as_it_is("--heave", "heave.000")), 0.0, atol=3e-3)


def test_a_posmv_is_navigation_by_its_own_clock(folder):
    place, attitude = _place(TIME), np.degrees(_attitude(TIME))
    latitude, longitude, convergence = FRAME.on_globe(place[:, :2])
    groups = [navigation_group(*row) for row in zip(SECONDS + TIME, latitude, longitude, LIFT - place[:, 2],
                                                   *attitude[:2], attitude[2] + np.degrees(convergence))]
    (folder / "nav.000").write_bytes(b"".join(groups))
    found = reduced("--navigation", "nav.000", pitch=np.radians(2.0))
    np.testing.assert_allclose(off(found), 0.0, atol=3e-3)


@pytest.mark.parametrize("options, words", [
    (["--heights", "gnss"], "states no separation"), (["--separation", "3"], "give --heights gnss"),
    (["--tide", "1", "--heights", "gnss"], "need no tide"), (["--tide", "none.csv"], "none.csv"),
    (["--navigation", "late.sbet"], "give the navigation of this line"),
    (["--navigation", "far.sbet"], "from the line's own"),
    (["--navigation", "points.csv"], "has no times or no latitudes"),
    (["--heave", "late.sbet"], "no two valid groups")])
def test_what_does_not_belong_to_the_line_is_refused(folder, refusal, options, words):
    (folder / "line.nc").write_bytes(file_of())
    sbet("late.sbet", clock=4000.0)
    place = _place(TIME)
    latitude, longitude, _ = FRAME.on_globe(place[:, :2] + 900.0)
    write_sbet("far.sbet", SECONDS + TIME, latitude, longitude, 0.0)
    (folder / "points.csv").write_text("x,y\n0,0\n1,1\n")
    assert words in refusal("soundings", "line.nc", "-o", "out.nc", *options)


def test_a_line_without_heights_is_not_reduced_by_them(folder, refusal):
    write(line().drop_vars("ping_height"), "line.nc")
    assert "states no heights above the ellipsoid" in refusal(
        "soundings", "line.nc", "-o", "out.nc", "--heights", "gnss", "--separation", "3")


def test_navigation_is_refused_for_scenes(refusal):
    assert "--navigation applies to recorded lines" in refusal("soundings", "multibeam", "-o", "out.nc", "--navigation",
                                                              "nav.sbet")
