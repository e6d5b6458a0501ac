"""A scene like a recorded line: loads, sounds the bed that the line's soundings drew, with the line's own settings."""
from pathlib import Path

import numpy as np
import pytest

import mitsonar
from mitsonar.cli.main import main
from mitsonar.io.like_line import like
from mitsonar.io.survey_lines import reading, write
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


@pytest.mark.skipif(not MEASURED.is_dir(), reason="the shared survey lines are not here")
@pytest.mark.parametrize("name, beams, swaths", [("em710_122m.all", 400, 1), ("em2040_56m.all", 798, 2),
                                                 ("em2042_os01.kmall", 379, 1)])
def test_real_lines_make_scenes_that_load(tmp_path, name, beams, swaths):
    like(MEASURED / name, tmp_path / "scene.xml")
    scene = mitsonar.load_file(tmp_path / "scene.xml")
    sectors = scene.sensors()[0].sectors
    assert sum(len(sector.beams) for sector in sectors) == beams * swaths


def test_the_command_says_what_it_wrote_and_refuses_in_a_sentence(tmp_path, capsys):
    write(soundings_line(pings=3, column=False, snippets=False), tmp_path / "line.gsf")
    assert main(["like", str(tmp_path / "line.gsf"), "-o", str(tmp_path / "scene.xml"), "--cell", "5"]) == 0
    assert "scene_bed.tif" in capsys.readouterr().out
    assert main(["like", str(tmp_path / "line.gsf"), "-o", str(tmp_path / "scene.txt")]) == 2
    assert "a scene's name ends in .xml" in capsys.readouterr().err
    assert main(["like", str(tmp_path / "line.gsf"), "-o", str(tmp_path / "one.xml"), "--pings", "1"]) == 2
    assert "--pings is 1; a track takes two or more" in capsys.readouterr().err
    assert not (tmp_path / "one.xml").exists()
