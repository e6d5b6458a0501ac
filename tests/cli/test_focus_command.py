"""The command `focus`: of a scene and of its raw echoes in a file, its options, and what it refuses in one sentence.

The target of 0 dB lies on the grid's plane, 18 m abeam and 0.3 m ahead, 13.8 degrees below the axis of beams that are
3 dB down at 15: both together are down by 2 x 3 (13.8 / 15)² = 5.1 dB, which images keep.
"""
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from focused_image import focused_image
from small_strip import TEXT

import mitsonar
from mitsonar.cli import main as cli, progress


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder for the scene, its raw echoes and a focused image, which the first test makes."""
    return tmp_path_factory.mktemp("strip")


@pytest.fixture
def here(variant, made, monkeypatch, tmp_path, capfd):
    """A folder of its own with the same files."""
    if not (made / "i.nc").exists():
        (made / "strip.xml").write_text(TEXT.replace('name="pings" value="4"', 'name="pings" value="12"'),
                                        encoding="utf-8")
        assert cli.main(["signals", str(made / "strip.xml"), "-o", str(made / "raw.nc")]) == 0
        mitsonar.write(focused_image(), made / "i.nc")
    for path in made.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    monkeypatch.chdir(tmp_path)
    capfd.readouterr()
    return tmp_path


def peak(image):
    """Where it is brightest [m], and the level there [dB]."""
    level = image["level"].isel(bank=0)
    at = np.unravel_index(int(np.argmax(level.values)), level.shape)
    return float(image["x"][at]), float(image["y"][at]), float(level[at])


def test_scenes_and_files_of_their_echoes_give_the_same_image(here, capfd, monkeypatch):
    with monkeypatch.context() as context:             # what takes longer is told after the first ping
        context.setattr(progress, "WORTH_SAYING", 0.0)
        assert cli.main(["focus", "raw.nc", "-o", "a.exr"]) == 0
    assert "mitsonar: 12 pings onto 41 x " in capfd.readouterr().err
    assert cli.main(["focus", "strip.xml", "-o", "b.h5", "--preview", "b.png"]) == 0
    assert capfd.readouterr() == ("b.h5\nb.png\n", "")
    one, other = mitsonar.read("a.exr"), mitsonar.read("b.h5")
    assert np.array_equal(one["image"].values, other["image"].values) and (here / "b.png").exists()
    assert peak(one) == (pytest.approx(18, abs=0.01), pytest.approx(0.3, abs=0.02), pytest.approx(-5.1, abs=0.5))
    assert "label" in other and "label" not in one and set(other.attrs["labels"].values()) == {"bed", "ball"}
    given = mitsonar.focus("strip.xml")
    assert set(given.variables) == set(other.variables) and given.attrs == other.attrs
    assert all(np.array_equal(given[name].values, other[name].values) for name in ("image", "label", "shadow"))


def test_options_lay_the_grid(here, capfd):
    assert cli.main(["focus", "raw.nc", "-o", "a.tif", "--across", "17.5", "18.5", "--along", "-0.2", "0.8",
                     "--spacing", "0.05x0.01"]) == 0
    import rasterio

    with rasterio.open("a.tif") as raster:
        assert (raster.height, raster.width) == (21, 101)
        level = raster.read(1)
        assert raster.xy(*np.unravel_index(np.argmax(level), level.shape)) == pytest.approx((18, 0.3), abs=0.03)
    assert cli.main(["focus", "raw.nc", "-o", "b.nc", "--grid", "slant", "--across", "20.3", "20.9", "--depth", "20",
                     "--pings", "2", "9"]) == 0
    image = mitsonar.read("b.nc")
    assert image.attrs["grid"] == "slant" and image.attrs["pings"] == 8 and np.all(image["grid_depth"].values == 20)
    assert image["across_track"].values[[0, -1]] == pytest.approx((20.3, 20.9), abs=0.007)
    assert np.hypot(image["x"].values[0], 20 - 10.3) == pytest.approx(image["across_track"].values, abs=1e-3)


def test_water_windows_and_trajectory_are_those_asked_for(here, capfd):
    options = ("--across", "17.5", "18.5", "-o")
    asked = {"plain": (), "same": ("--profile", "1500", "--trajectory", "raw.nc", "--window", "taylor 4 30"),
             "slow": ("--profile", "1490", "--range-window", "hann"), "narrow": ("--window", "none", "--angle", "1")}
    for name, more in asked.items():
        assert cli.main(["focus", "raw.nc", *more, *options, f"{name}.nc"]) == 0
    images = {name: mitsonar.read(f"{name}.nc") for name in asked}
    assert np.array_equal(images["plain"]["image"].values, images["same"]["image"].values)
    assert peak(images["slow"])[0] == pytest.approx(18 - 0.14 / np.cos(np.arcsin(9.9 / 20.5)), abs=0.03)
    assert [images[name].attrs["range_window"] for name in ("plain", "slow")] == ["taylor 4 30", "hann"]
    assert images["narrow"].attrs["window"] == "none"
    assert images["narrow"].attrs["aperture"] == pytest.approx(np.sin(np.deg2rad(1)))


def test_two_banks_give_an_interferogram(here, capfd):
    raw = mitsonar.read("raw.nc")
    mitsonar.write(raw.assign(rx_bank=("rx", np.array([0, 0, 1, 1], np.int32))), "two.nc")
    assert cli.main(["focus", "two.nc", "-o", "a.exr", "--interferogram", "--across", "17.5", "18.5"]) == 0
    image = mitsonar.read("a.exr")
    assert image.sizes["bank"] == 2 and {"phase", "coherence", "height", "height_deviation"} <= set(image)
    assert cli.main(["plot", "a.exr", "--what", "coherence"]) == 0


@pytest.mark.parametrize("options, words", [
    (("raw.nc", "-o", "e.jpg"), "its name must end in .exr, .nc, .h5"),
    (("raw.nc", "-o", "e.tif", "--grid", "slant"), "a slant grid is not even on a map"),
    (("raw.nc", "-o", "raw.nc"), "raw.nc holds the raw echoes; give another name"),
    (("raw.nc", "-o", "e.exr", "--seed", "3"), "--seed applies to scenes only, and raw.nc holds raw echoes"),
    (("raw.nc", "-o", "e.exr", "-D", "a=1"), "-D applies to scenes only"),
    (("raw.nc", "-o", "e.exr", "--pings", "8", "2"), "pings 8 to 2 were asked for, and there are 12"),
    (("raw.nc", "-o", "e.exr", "--spacing", "a"), "--spacing is 'a'; give metres"),
    (("raw.nc", "-o", "e.exr", "--spacing", "1e-9"), "points"),
    (("raw.nc", "-o", "e.exr", "--across", "900", "1000"), "the grid lies outside the beam"),
    (("raw.nc", "-o", "e.exr", "--grid", "slant", "--across", "-21", "21"), "slant ranges to starboard"),
    (("raw.nc", "-o", "e.exr", "--interferogram"), "--interferogram needs two banks of receivers"),
    (("raw.nc", "-o", "e.exr", "--window", "taylo"), 'did you mean "taylor"'),
    (("raw.nc", "-o", "e.exr", "--angle", "89"), "--angle is 89 degrees from abreast"),
    (("raw.nc", "-o", "e.exr", "--profile", "none.csv"), "cannot read the cast none.csv: there is no such file"),
    (("raw.nc", "-o", "e.exr", "--profile", "nan"), "sound_speed[0] is nan"),
    (("raw.nc", "-o", "e.exr", "--trajectory", "i.nc"), "i.nc holds no trajectory"),
    (("raw.nc", "-o", "e.exr", "--preview", "a.bmp"), "cannot write a.bmp"),
    (("i.nc", "-o", "e.exr"), "i.nc holds no raw echoes"),
    (("none.nc", "-o", "e.exr"), "none.nc"), (("sidescan_flat", "-o", "e.exr"), "this sensor is a sidescan")])
def test_what_cannot_be_focused_is_said_in_a_sentence(here, capfd, options, words):
    before = {path: path.read_bytes() for path in here.iterdir()}
    assert cli.main(["focus", *options]) == 2
    out, err = capfd.readouterr()
    assert out == "" and err.startswith("mitsonar: ") and err.count("\n") == 1 and words in err, err
    assert {path: path.read_bytes() for path in here.iterdir()} == before


def test_a_scene_says_what_is_not_asked_for(here, capfd):
    text = (here / "strip.xml").read_text(encoding="utf-8")
    (here / "slant.xml").write_text(text.replace('name="pings" value="$pings"/>', 'name="pings" value="$pings"/> '
                                                 '<string name="image_grid" value="slant"/>'), encoding="utf-8")
    assert cli.main(["focus", "slant.xml", "-o", "a.tif"]) == 2
    assert "a slant grid is not even on a map" in capfd.readouterr().err and not (here / "a.tif").exists()


def test_python_focuses_files_before_a_variant_is_set(tmp_path):
    code = "import mitsonar; mitsonar.focus('none.nc')"
    ended = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True,
                           env={**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[2])})
    assert "FileNotFoundError: cannot read the raw echoes none.nc" in ended.stderr
