"""The command soundings on recorded lines, and like: what they refuse, they refuse in a sentence and leave nothing."""
import os

import numpy as np
import pytest

from mitsonar.cli.main import main
from mitsonar.io.survey_lines import read_blocks, reading, write
from tests.inputs.soundings_line import soundings_line


@pytest.fixture
def line(folder):
    """A line of soundings in the current folder."""
    write(soundings_line(pings=3, beams=40, column=False, snippets=False), "line.kmall")
    return "line.kmall"


OPTIONS = {
    "month": (["--start", "2026-13-01"], "the start is '2026-13-01'; give a date"),
    "century": (["--start", "1900-01-01"], "give one between 1970 and 2106"),
    "no date": (["--start", ""], "the start is ''; give a date"),
    "nowhere": (["--place", "91", "200"], "place is 91, 200; give latitude and longitude"),
    "threads": (["--threads", "4"], "--threads applies to scenes only"),
    "seed": (["--seed", "4"], "--seed applies to scenes only"),
    "speed": (["--head-speed", "nan"], "is nan"),
}


@pytest.mark.parametrize("arguments, words", OPTIONS.values(), ids=OPTIONS)
def test_options_that_do_not_fit_a_recorded_line(line, refusal, arguments, words):
    assert words in refusal("soundings", line, "-o", "out.csv", *arguments)


def test_a_line_is_not_replaced_by_what_is_made_of_it(line, refusal):
    os.link(line, "same.gsf")
    for output in (line, "./" + line, "same.gsf"):
        assert "is the line itself" in refusal("soundings", line, "-o", output)


def test_a_line_is_known_by_its_content_where_its_name_says_nothing(line, capsys):
    os.rename(line, "line")
    assert main(["soundings", "line", "-o", "out.kmall"]) == 0
    assert reading.read("out.kmall").sizes["ping"] == 3


def test_a_scene_like_a_line_is_there_with_all_its_files_or_not_at_all(line, refusal):
    os.mkdir("s_bed.tif")
    assert "s_bed.tif: it is a folder" in refusal("like", line, "-o", "s.xml")


@pytest.mark.parametrize("pings", ["0", "1", "-1"])
def test_a_scene_like_a_line_takes_two_pings(line, refusal, pings):
    assert f"--pings is {pings}; a track takes two or more" in refusal("like", line, "-o", "s.xml", "--pings", pings)


def test_lines_are_laid_on_a_map(folder, capfd):
    """The shared line's slope in cells of 5 m: no depth is beyond those of the soundings."""
    import rasterio

    made = soundings_line()
    write(made, "a.nc")
    assert main(["grid", "a.nc", "-o", "depth.tif", "--cell", "5"]) == 0
    assert capfd.readouterr().out == "depth.tif\n"
    with rasterio.open("depth.tif") as raster:
        depth, tags = raster.read(1), raster.tags()
        assert raster.crs == made.attrs["crs"] and raster.res == (5.0, 5.0) and tags["rule"] == "mean"
    sounded = made["depth"].values[made["valid"].values]
    assert np.nanmin(depth) >= sounded.min() - 1e-3 and np.nanmax(depth) <= sounded.max() + 1e-3
    assert np.isfinite(depth).sum() > 10


@pytest.mark.parametrize("options, words", [
    (["-o", "b.png"], "must end in .tif"), (["-o", "b.tif", "--cell", "1e-9"], "take cells of"),
    (["-o", "b.tif", "--layer", "uncertainty"], "give --rule weighted"), (["-o", "b.tif", "--cell", "nan"], "cell"),
])
def test_a_map_that_cannot_be_is_refused_in_a_sentence(line, folder, capfd, options, words):
    assert main(["grid", line, *options]) == 2
    told = capfd.readouterr().err
    assert words in told and told.count("\n") == 1 and not os.path.exists("b.tif")


def test_a_line_is_reduced_anew_by_the_rules_that_it_was_made_by(folder, capsys):
    """Made with the cast at the arrays, though the head's sensor says 48 m/s more: the node would be 3 % too deep."""
    line = soundings_line(pings=3, beams=40, depth=4.6, slope=0.0, column=False, snippets=False)
    write(line.assign(head_sound_speed=line["head_sound_speed"] + 48.4), "line.nc")
    (folder / "cast.csv").write_text("depth,sound speed\n0,1500\n200,1500\n")
    assert main(["soundings", "line.nc", "-o", "anew.nc", "--profile", "cast.csv"]) == 0
    assert "made with the cast's sound speed at the arrays" in capsys.readouterr().err
    before, after = (next(read_blocks(name)) for name in ("line.nc", "anew.nc"))
    valid = before["valid"].values
    assert np.abs(after["depth"].values - before["depth"].values)[valid].max() < 1e-6
    assert main(["soundings", "line.nc", "-o", "node.nc", "--profile", "cast.csv", "--head-speed", "1548.4"]) == 0
    node = next(read_blocks("node.nc"))
    assert np.abs(node["depth"].values - before["depth"].values)[valid].min() > 0.02
