"""A scene like a recorded line: loads, sounds the bed that the line's soundings drew, with the line's own settings."""
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import mitsonar
from mitsonar.cli.main import main
from mitsonar.hydrography.record import variable
from mitsonar.io.survey_lines import reading, write
from mitsonar.planning.like_line import _strengths, like
from mitsonar.planning.like_settings import settings_of
from mitsonar.sonar.preset_tables import classes
from tests.inputs.soundings_line import FREQUENCIES, soundings_line

MEASURED = Path(__file__).resolve().parents[2] / "../shared/data/measured/multibeam"


def test_a_scene_has_the_line_s_sectors_depths_and_track(tmp_path):
    line = soundings_line(pings=6, beams=120, column=False, snippets=False)
    write(line, tmp_path / "line.kmall")
    paths = like(tmp_path / "line.kmall", tmp_path / "scene.xml")
    assert [Path(path).name for path in paths] == ["scene.xml", "scene_track.csv", "scene_cast.csv", "scene_bed.tif",
                                                   "scene_backscatter.csv"]
    scene = mitsonar.load_file(tmp_path / "scene.xml", pings=2)
    sensor = scene.sensors()[0]
    assert [round(sector.pulse.frequency) for sector in sensor.sectors] == list(FREQUENCIES)
    simulated, recorded = mitsonar.soundings(scene), reading.read(tmp_path / "line.kmall", water_column=False)
    across = recorded["across_track"].values[0]
    there = np.isfinite(across)
    bed = np.interp(simulated["across_track"].values[0], across[there], recorded["depth"].values[0][there])
    valid = simulated["valid"].values[0]
    assert valid.mean() > 0.9
    assert abs(np.median(simulated["depth"].values[0][valid] - bed[valid])) < 0.1          # of 50 m: 0.2 %
    assert simulated["ping_time"][1] - simulated["ping_time"][0] == pytest.approx(0.4, abs=0.01)
    assert simulated["head_sound_speed"][0] == pytest.approx(float(recorded["head_sound_speed"][0]), abs=1e-3)
    start = np.datetime64(simulated.attrs["start"].removesuffix("Z"))              # the line's date, not 2000
    sent = start + np.timedelta64(round(1e6 * float(simulated["ping_time"][0])), "us")
    assert abs(sent - np.datetime64("2026-05-01T10:00:01")) < np.timedelta64(10, "us")
    assert abs(float(simulated["motion_time"][0])) < 60


def test_steps_between_sectors_are_the_pattern_with_which_the_twin_writes_strengths(tmp_path):
    """Steps of -2, 0 and 3 dB on a curve by angle alone come back by sector, and the bed's curve is even in the angle:
    medians of 36 soundings with a spread of 1 dB, 0.2 dB, and a step's own side of the curve.
    """
    line = soundings_line(pings=8, beams=120, slope=0.0, column=False, snippets=False)
    steps = np.array([-2.0, 0.0, 3.0])[line["sector"].values]
    write(line.assign(backscatter_db=line["backscatter_db"] + steps.astype(np.float32)), tmp_path / "line.kmall")
    paths = like(tmp_path / "line.kmall", tmp_path / "scene.xml")
    pattern = next(path for path in paths if path.endswith("_pattern.csv"))
    sector, angle, level = np.loadtxt(pattern, delimiter=",", skiprows=1).T
    outer = np.abs(angle) > 30
    np.testing.assert_allclose(np.mean(level[outer & (sector == 2)]) - np.mean(level[outer & (sector == 0)]), 5.0,
                               rtol=0, atol=0.5)
    assert "pattern" in (tmp_path / "scene.xml").read_text()
    twin = mitsonar.soundings(mitsonar.load_file(tmp_path / "scene.xml", pings=2))
    valid, added = twin["valid"].values, twin["written_error_db"].values
    far = valid & (np.abs(np.rad2deg(twin["angle"].values)) > 35)
    port, starboard = (np.median(added[far & (side * twin["angle"].values > 0)]) for side in (-1, 1))
    assert starboard - port == pytest.approx(5.0, abs=0.7)


@pytest.mark.skipif(not MEASURED.is_dir(), reason="the shared survey lines are not here")
@pytest.mark.parametrize("name, beams, swaths", [("em710_122m.all", 400, 1), ("em2040_56m.all", 798, 2),
                                                 ("em2042_os01.kmall", 379, 1)])
def test_real_lines_make_scenes_that_load(tmp_path, name, beams, swaths):
    like(MEASURED / name, tmp_path / "scene.xml")
    scene = mitsonar.load_file(tmp_path / "scene.xml")
    sectors = scene.sensors()[0].sectors
    assert sum(len(sector.beams) for sector in sectors) == beams * swaths


def test_strengths_are_of_the_mean_intensity_of_the_mode_s_pings_on_the_sloping_bed():
    """A bed that slopes by 0.1: its strength falls by 1 dB a degree from the normal, which lies 5.7 degrees aside.

    Intensities are 0.18 and 1.82 times the mean in turn, whose median is arbitrary. A row averages windows of 1 or 2.5
    degrees, in which one of seven soundings may be odd: 0.5 dB, and as much by the law in it. Tolerance 1.3 dB; a level
    bed would be wrong by 5.7 dB, a median by 4.
    """
    line = soundings_line(pings=8, beams=241, slope=0.0, column=False, snippets=False)
    across = line["across_track"]
    depth = 50 + 0.1 * across
    incidence = np.degrees(np.arctan2(across, depth - line["ping_depth"]) + np.arctan(0.1))
    law = -10 - np.abs(incidence)
    louder = np.where(np.arange(241) % 2 == 0, 10 * np.log10(20 / 11), 10 * np.log10(2 / 11))
    angles, strengths = _strengths(line.assign(depth=depth.where(line["valid"]), backscatter_db=law + louder))
    assert angles.max() == 90 and (np.diff(angles)[angles[1:] > 81] == 1).all()
    assert strengths == pytest.approx(-10 - (90 - angles), abs=1.3)


@pytest.mark.parametrize("depth, kilohertz, pulse_ms", [(50.0, None, None), (4000.0, 12, 0.75 * 83.67 / 12)])
def test_a_file_without_frequencies_gets_a_usual_one_for_its_depth(depth, kilohertz, pulse_ms):
    """At 70 degrees or less in 50 m, 400 kHz loses 96 dB/km of 0.2 km; 30 kHz in 4 km at least 6.9 dB/km of 8 km.

    Arrays are those of the preset in wavelengths: pulses have as many periods, and the level grows with their area.
    """
    line = soundings_line(pings=3, beams=60, depth=depth, column=False, snippets=False)
    unknown = line.assign(sector_frequency=np.nan * line["sector_frequency"])
    made = settings_of(unknown, classes("multibeam"))
    rows = {name: value for _, name, value in made.rows}
    assert any("states no frequencies" in words for words in made.words)
    if kilohertz is None:
        assert made.preset == "shallow_400khz" and "frequency_khz" not in rows
    else:
        assert rows["frequency_khz"] == "12" and float(rows["pulse_ms"]) == pytest.approx(pulse_ms, rel=1e-3)
        assert float(rows["source_level_db"]) == pytest.approx(222 + 20 * np.log10(83.67 / 12), abs=0.01)


def test_the_command_says_what_it_wrote_and_refuses_in_a_sentence(tmp_path, capsys):
    write(soundings_line(pings=3, column=False, snippets=False), tmp_path / "line.gsf")
    assert main(["like", str(tmp_path / "line.gsf"), "-o", str(tmp_path / "scene.xml"), "--cell", "5"]) == 0
    assert "scene_bed.tif" in capsys.readouterr().out
    assert main(["like", str(tmp_path / "line.gsf"), "-o", str(tmp_path / "scene.txt")]) == 2
    assert "a scene's name ends in .xml" in capsys.readouterr().err
    assert main(["like", str(tmp_path / "line.gsf"), "-o", str(tmp_path / "one.xml"), "--pings", "1"]) == 2
    assert "--pings is 1; a track takes two or more" in capsys.readouterr().err
    assert not (tmp_path / "one.xml").exists()


def made_like(folder, line, suffix="kmall", write_line=True):
    """The words on a scene like a line, the scene's text and its track (R, 7), times [s] of the line."""
    if write_line:
        write(line, folder / f"line.{suffix}")
    words: list[str] = []
    like(folder / f"line.{suffix}", folder / "scene.xml", say=words.append)
    rows = (folder / "scene_track.csv").read_text().splitlines()[1:]
    first = np.datetime64(rows[0].partition("Z")[0])
    track = np.array([[(np.datetime64(row.partition("Z")[0]) - first) / np.timedelta64(1, "us") * 1e-6,
                       *map(float, row.split(",")[1:])] for row in rows])
    return "; ".join(words), (folder / "scene.xml").read_text(), track


def plain(**more):
    return soundings_line(**{"pings": 4, "beams": 32, "column": False, "snippets": False, **more})


def test_the_track_has_no_steps_of_the_record_and_says_what_it_leaves_out(tmp_path):
    # Roll of 4 degrees in 5 s turns by 5 degrees a second at most. The record holds it in steps of 0.2 s, up to 1
    # degree: a spline through all records turns by 50 degrees a second at each. A held record is late by half its step.
    line = plain(pings=8)
    time = line["motion_time"].values
    for name in ("roll", "pitch", "heading"):
        line[f"motion_{name}"] = line[f"motion_{name}"].copy(
            data=np.interp(np.floor(time / 0.2) * 0.2, time, line[f"motion_{name}"].values))
    words, _, track = made_like(tmp_path, line)
    roll = CubicSpline(track[:, 0], track[:, 4])
    when = np.arange(0.3, track[-1, 0] - 0.8, 0.01)
    assert np.abs(roll(when, 1)).max() < 7
    true = 4 * np.sin(2 * np.pi * (when + 1.0 - 0.1) / 5)
    assert np.abs(roll(when) - true).max() < 0.25
    assert "smoothed by splines with a knot every 0.5 s" in words
    left = float(re.search(r"depth and ([\d.e-]+),", words)[1])
    assert 0.1 < left < 0.5                            # steps of v x 0.2 s, evenly spread: v 0.2 s / sqrt(12) = 0.2


def test_pings_before_the_first_motion_record_go_on_at_their_own_places(tmp_path):
    line = plain(pings=8)
    whole = made_like(tmp_path, line)[2]
    late = line.isel(motion=line["motion_time"].values > 2.0)                  # pings at 1.0, 1.4 and 1.8 s come before
    track = made_like(tmp_path, late)[2]
    speed = np.hypot(*np.diff(track[:, 1:3], axis=0).T) / np.diff(track[:, 0])
    assert 2.5 < speed.min() and speed.max() < 4.7                             # 3.6 m/s, and the arm's swing
    assert np.hypot(*(track - whole)[:, 1:3].T).max() < 0.5


def test_the_head_s_sound_speed_is_a_node_where_the_soundings_were_made_so(tmp_path):
    line = plain(depth=4.6, slope=0.0)
    words, scene, _ = made_like(tmp_path, line)
    assert "head_sound_speed" in scene and "the times do not decide which sound speed" in words
    wrong = line.assign(head_sound_speed=line["head_sound_speed"] + 48.4)                 # places made by the cast
    words, scene, _ = made_like(tmp_path, wrong)
    assert "head_sound_speed" not in scene
    assert "made with the cast's sound speed at the arrays" in words and "with the ship's way" in words
    assert "made with the cast's" in scene                                               # in its comment, too


def test_what_the_scene_leaves_out_is_said(tmp_path):
    line = plain(pings=6)
    frequency = line["sector_frequency"].values.copy()
    frequency[3:5] += 50e3
    frequency[5] -= 90e3
    words = made_like(tmp_path, line.assign(sector_frequency=line["sector_frequency"].copy(data=frequency)))[0]
    assert ("pings of 3 modes; the scene takes the mode of 91 of 184 soundings, 300/320/290 kHz, and leaves out "
            "350/370/340 kHz; 210/230/200 kHz") in words
    assert "settings of the run" in words and "extra detections" not in words
    arms = np.stack([line["receive_offset"].values] * 2)
    turned = np.radians([[35.0, 0, 0], [-34.0, 0, 0]])
    twin = line.assign({name: variable(name, value) for name, value in {
        "head": np.arange(6) % 2, "head_receive_offset": arms, "head_receive_mounting": turned}.items()})
    assert "2 receive arrays, rolled by 35.0 and -34.0 degrees, became one" in made_like(tmp_path, twin)[0]
    time = np.repeat(1.0 + 0.4 * np.arange(3), 2) + np.tile([0.0, 0.003], 3)
    frequency[:] = line["sector_frequency"].values
    frequency[1::2] += 4e3
    dual = line.assign(ping_time=("ping", time), sector_frequency=line["sector_frequency"].copy(data=frequency))
    assert ("both swaths are sent at 300/320/290 kHz, though the line's other swath is at 304/324/294 kHz"
            in made_like(tmp_path, dual)[0])


def test_extra_detections_of_a_kmall_line_are_counted(tmp_path):
    write(plain(), tmp_path / "line.kmall")
    data, at, found = bytearray((tmp_path / "line.kmall").read_bytes()), 0, 0
    while at < len(data):
        length = int.from_bytes(data[at:at + 4], "little")
        if data[at + 5:at + 8] == b"MRZ":
            receiver = at + 20 + 4 + 12 + 152 + 3 * 48
            main = int.from_bytes(data[receiver + 2:receiver + 4], "little")
            data[receiver + 2:receiver + 4] = (main - 2).to_bytes(2, "little")
            data[receiver + 26:receiver + 28] = (2).to_bytes(2, "little")
            found += 2
        at += length
    (tmp_path / "line.kmall").write_bytes(data)
    words = made_like(tmp_path, None, write_line=False)[0]
    assert f"{found} extra detections in the water column are left out" in words


def test_a_line_of_several_casts_makes_a_scene_of_them(tmp_path):
    """Two files one after the other, the second of later pings with another cast: pings have the latest one."""
    line = soundings_line(pings=6, beams=120, column=False, snippets=False)
    write(line, tmp_path / "line.kmall")
    first = (tmp_path / "line.kmall").read_bytes()
    later = line.assign(cast_sound_speed=line["cast_sound_speed"] + 5.0,
                        **{name: line[name] + 3.0 for name in ("ping_time", "motion_time")})
    write(later, tmp_path / "line.kmall")
    (tmp_path / "line.kmall").write_bytes(first + (tmp_path / "line.kmall").read_bytes())
    paths = like(tmp_path / "line.kmall", tmp_path / "scene.xml")
    assert {"scene_casts.csv", "scene_cast.csv", "scene_cast_2.csv"} < {Path(path).name for path in paths}
    scene = mitsonar.load_file(tmp_path / "scene.xml")
    survey = scene.integrator().survey(scene, scene.sensors()[0])
    number = survey.waters.attributes["cast_of_ping"]
    assert set(number) == {0, 1} and sorted(number) == number
    apart = [survey.waters.at(ping).profile.at(20.0) for ping in (0, len(number) - 1)]
    assert apart[1] - apart[0] == pytest.approx(5.0, abs=1e-3)
