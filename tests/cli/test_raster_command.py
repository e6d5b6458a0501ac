"""The command `raster`: fans in metres as records and pictures, and one sentence about what is wrong."""
import numpy as np
import pytest
from PIL import Image
from synthetic_fan import fan

import mitsonar
from mitsonar.cli import main as cli
from mitsonar.io.records import exr


@pytest.fixture
def record(folder):
    """A fan of two pings in the current folder."""
    made = fan(pings=2, beams=64, bins=200)
    exr.write(made, folder / "fan.exr")
    return made


def test_all_frames_with_their_labels(record, capfd):
    assert cli.main(["raster", "fan.exr", "--cell", "0.2"]) == 0
    assert capfd.readouterr().out == "fan_raster.exr\n"
    assert mitsonar.read("fan_raster.exr").identical(mitsonar.imaging.cartesian(exr.read("fan.exr"), 0.2))
    assert cli.main(["raster", "fan.exr", "--cell", "0.2", "--only", "level, label", "--frame", "1", "-o", "b.nc"]) == 0
    one = mitsonar.read("b.nc")
    assert set(one.data_vars) == {"level", "label"} and one["ping"].values.tolist() == [1]


def test_a_png_is_one_frame_in_grey(record):
    assert cli.main(["raster", "fan.exr", "--cell", "0.2", "-o", "a.png"]) == 0
    picture = np.array(Image.open("a.png"))
    drawn = mitsonar.imaging.cartesian(record, 0.2)
    assert picture.shape == drawn["level"].shape[1:] and picture.dtype == np.uint8
    assert not picture[np.isnan(drawn["level"].values[0])].any()
    assert picture[drawn["label"].values[0] == 2].mean() > 200


@pytest.mark.parametrize("arguments, words", [
    (["fan.exr", "--frame", "2"], "there is no frame 2; there are 2, the first is 0"),
    (["fan.exr", "-o", "a.tif"], "its name must end in .exr, .nc or .png"),
    (["fan.exr", "-o", "a.png", "--only", "label"], "a PNG shows levels only"),
    (["fan.exr", "--cell", "0"], "length above 0"), (["fan.exr", "--only", "depth"], "no variable 'depth' to draw"),
    (["none.exr"], "there is no such file"), (["fan.exr", "-o", "none/a.exr"], "does not exist; make it first")])
def test_what_cannot_be_done_is_said_in_a_sentence(record, arguments, words, capfd, folder):
    before = sorted(folder.iterdir())
    assert cli.main(["raster", *arguments]) == 2
    said = capfd.readouterr().err
    assert words in said and said.startswith("mitsonar: ") and said.count("\n") == 1
    assert sorted(folder.iterdir()) == before
