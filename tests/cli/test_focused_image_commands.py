"""What commands for images say of a focused image: plot and convert do it, the others refuse it in one sentence."""
import numpy as np
import pytest
from focused_image import focused_image
from raw_record import raw_record

import mitsonar
from mitsonar.cli import main as cli


@pytest.fixture
def image(folder):
    """A focused image and raw echoes in the current folder."""
    made = focused_image(30, 40)
    mitsonar.write(made, folder / "i.exr")
    mitsonar.write(made, folder / "i.nc")
    mitsonar.write(raw_record(), folder / "raw.nc")
    return made


def test_convert_writes_every_kind_of_file(image, folder, capfd):
    for name in ("a.nc", "a.tif", "a.h5"):
        assert cli.main(["convert", "i.exr", name]) == 0
    assert cli.main(["convert", "a.h5", "b.exr"]) == 0
    assert capfd.readouterr() == ("a.nc\na.tif\na.h5\nb.exr\n", "")
    for name in ("a.nc", "a.h5", "b.exr"):
        back = mitsonar.read(name)
        assert back.attrs == image.attrs and np.array_equal(back["image"].values, image["image"].values)


def test_plot_draws_the_image_or_what_is_asked_for(image, folder, capfd):
    assert cli.main(["plot", "i.exr", "--bank", "1", "--colours", "grey"]) == 0
    assert cli.main(["plot", "i.nc", "--what", "coherence", "-o", "c.png"]) == 0
    assert capfd.readouterr() == ("i_image.png\nc.png\n", "") and (folder / "c.png").exists()


@pytest.mark.parametrize("arguments, words", [
    (["plot", "raw.nc"], "raw.nc holds raw echoes, .*; focus them by `mitsonar focus` first"),
    (["plot", "i.exr", "--what", "waterfall"], "choose one of image, phase"),
    (["raster", "i.exr"], "a focused image has no fans"),
    (["video", "i.exr", "o.gif"], "a video is made of records of two or more beams"),
    (["mosaic", "i.exr", "-o", "o.tif"], "a mosaic is made of sidescans"),
    (["convert", "i.exr", "o.xtf"], "XTF takes a sidescan's"),
    (["convert", "raw.nc", "o.exr"], "cannot write signal as EXR: its type is complex64"),
    (["convert", "raw.nc", "o.tif"], "GeoTIFF takes focused images")])
def test_other_commands_refuse_it_in_a_sentence(image, refusal, arguments, words):
    import re

    assert re.search(words, refusal(*arguments))
