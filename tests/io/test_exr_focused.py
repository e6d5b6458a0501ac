"""Focused images as OpenEXR: complex numbers, exact places, a layer a bank; identical in every bit."""
import numpy as np
import OpenEXR
import pytest
from focused_image import focused_image

import mitsonar
from mitsonar.io.records import exr


@pytest.mark.parametrize("banks", [1, 2])
def test_a_focused_image_comes_back_bit_for_bit(tmp_path, banks):
    image = focused_image(banks=banks)
    image["image"].values[0, 0, :3] = complex(np.nan, -0.0), complex(-np.inf, 1), complex(1e-44, 0)
    image["x"].values[0, :4] = np.inf, -0.0, np.nan, np.nextafter(1, 2)
    mitsonar.write(image, tmp_path / "a.exr")
    back = mitsonar.read(tmp_path / "a.exr")
    assert back.identical(image)
    for name in image.variables:
        assert back[name].dtype == image[name].dtype and back[name].values.tobytes() == image[name].values.tobytes()


def test_other_programs_find_a_channel_a_part_and_bank(tmp_path):
    image = focused_image()
    exr.write(image, tmp_path / "a.exr")
    file = OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True)
    channels = {name: channel.pixels for name, channel in file.channels(1).items()}
    assert {"bank0.image.real", "bank1.image.imag", "bank1.level", "x", "x.rest", "label.id", "shadow", "phase"} <= set(
        channels)
    assert np.array_equal(channels["bank1.image.imag"], image["image"].values[1].imag)
    assert np.array_equal(channels["x"], image["x"].values.astype(np.float32))          # what viewers show is a place
    assert file.channels(0)["Y"].pixels.shape == (20, 2 * 30)


def test_numbers_that_no_float32_is_near_are_refused(tmp_path):
    image = focused_image()
    image["x"].values[0, 0] = 1e300
    with pytest.raises(ValueError, match="cannot write x as EXR: some of it is no number near any float32"):
        exr.write(image, tmp_path / "a.exr")
    with pytest.raises(ValueError, match="cannot write image as EXR: its type is complex128"):
        exr.write(image.assign(image=image["image"].astype(complex)), tmp_path / "a.exr")


@pytest.mark.parametrize("old, new", [(b'"dtype": "<c8"', b'"dtype": "<c9"'), (b'"dtype": "<c8"', b'"dtype": "<U8"'),
                                      (b'"bank": 2', b'"bank": 9')])
def test_damaged_headers_are_refused(tmp_path, old, new):
    exr.write(focused_image(), tmp_path / "a.exr")
    content = (tmp_path / "a.exr").read_bytes()
    assert old in content
    (tmp_path / "a.exr").write_bytes(content.replace(old, new))
    with pytest.raises(ValueError, match="cannot read .*a.exr: .* is damaged"):
        exr.read(tmp_path / "a.exr")
