"""The commands `convert` and `mosaic`: files that other programs open, and one sentence about what is wrong."""
import json

import numpy as np
import pytest
import xtf_by_bytes
from synthetic_sidescan import sidescan

import mitsonar
from mitsonar.cli import main as cli
from mitsonar.io.records import exr


@pytest.fixture
def record(folder):
    """A sidescan's image in the current folder, at two frequencies."""
    made = sidescan(pings=20, bins=100).assign_attrs(crs="EPSG:32631", local_origin=[512200.0, 5790240.0])
    exr.write(made, folder / "low.exr")
    exr.write(made.assign_attrs(frequency=400e3), folder / "high.exr")
    return made


def test_an_image_becomes_an_xtf_and_what_that_cannot_hold_is_said(record, folder, capfd):
    assert cli.main(["convert", "low.exr", "a.xtf", "--start", "2026-05-01T10:00:00Z"]) == 0
    out, err = capfd.readouterr()
    assert out == "a.xtf\n" and err.count("\n") == 1
    header, _, _, pings = xtf_by_bytes.read(folder / "a.xtf")
    for words in (header["note"].rstrip(b"\0").decode(), "degrees", "mean_level, label, depth, shadow, rays"):
        assert words in err
    assert header["units"] == 3 and (pings[0]["year"], pings[0]["hour"]) == (2026, 10)


def test_two_frequencies_in_metres_without_gain(record, folder):
    assert cli.main(["convert", "high.exr", "low.exr", "a.xtf", "--tvg", "none", "--coordinates", "metres"]) == 0
    header, channels, _, pings = xtf_by_bytes.read(folder / "a.xtf")
    assert header["units"] == 0 and [channel["frequency"] for channel in channels] == [100, 100, 400, 400]
    assert pings[0]["sides"][0]["flags"] == 0


def test_images_become_netcdf_and_exr_again(record, capfd):
    assert cli.main(["convert", "low.exr", "a.nc"]) == 0 and cli.main(["convert", "a.nc", "b.exr"]) == 0
    assert mitsonar.read("b.exr").identical(exr.read("low.exr"))
    assert capfd.readouterr() == ("a.nc\nb.exr\n", "")


def test_a_mosaic_is_a_geotiff_of_the_lines(record):
    import rasterio

    beside = exr.read("low.exr").assign_coords(y=record["y"] + 20.0)
    exr.write(beside, "beside.exr")
    assert cli.main(["mosaic", "low.exr", "beside.exr", "-o", "a.tif", "--resolution", "0.5", "--blend", "mean",
                     "--gain", "none", "--nadir", "10", "--fill", "3"]) == 0
    drawn = mitsonar.imaging.mosaic([exr.read("low.exr"), exr.read("beside.exr")], 0.5, blend="mean", gain=None,
                                    nadir_deg=10, fill=3)
    with rasterio.open("a.tif") as raster:
        np.testing.assert_array_equal(raster.read(1), drawn["level"].values)
        assert raster.crs.to_epsg() == 32631 and np.isnan(raster.nodata) and raster.descriptions == ("level",)
        assert raster.tags()["blend"] == "mean" and raster.tags()["cell"] == "0.5 m"
    assert cli.main(["mosaic", "low.exr", "-o", "b.tif", "--quantity", "label", "--epsg", "32632"]) == 0
    with rasterio.open("b.tif") as raster:
        assert raster.dtypes == ("uint32",) and raster.crs.to_epsg() == 32632
        assert json.loads(raster.tags()["names"]) == record.attrs["labels"]


@pytest.mark.parametrize("arguments, words", [
    (["convert", "low.exr", "a.sdf"], "must end in .xtf, .jsf, .exr, .nc, .tif, .tiff, .h5 or .hdf5"),
    (["convert", "none.exr", "a.xtf"], "there is no such file"),
    (["convert", "scene.xml", "a.xtf"], "it is no EXR, netCDF"),
    (["convert", "low.exr", "none/a.xtf"], "does not exist; make it first"),
    (["convert", "low.exr", "high.exr", "a.nc"], "do not go into one nc file"),
    (["convert", "low.exr", "a.nc", "--tvg", "none"], "--tvg applies to XTF and JSF files"),
    (["convert", "low.exr", "a.xtf", "--start", "noon"], "--start is 'noon'"),
    (["convert", "low.exr", "a.xtf", "--start", "1950-01-01"], "1970 to 9999"),
    (["mosaic", "low.exr", "high.exr", "-o", "a.tif"], "whose levels cannot be combined"),
    (["mosaic", "low.exr", "-o", "a.png"], "must end in .tif"),
    (["mosaic", "low.exr", "-o", "a.tif", "--resolution", "0"], "length above 0"),
    (["mosaic", "low.exr", "-o", "a.tif", "--resolution", "0.00001"], "take cells of"),
    (["mosaic", "low.exr", "-o", "a.tif", "--quantity", "labels"], "no variable 'labels' to lay out"),
    (["mosaic", "low.exr", "-o", "a.tif", "--place", "truth"], "has no seabed_x"),
    (["mosaic", "low.exr", "-o", "a.tif", "--epsg", "4326"], "in degree; give a projected system"),
    (["mosaic", "low.exr", "-o", "a.tif", "--epsg", "1"], "none that PROJ knows"),
    (["mosaic", "low.exr", "-o", "a.tif", "--nadir", "90"], "below 90 degrees"),
    (["mosaic", "low.exr", "-o", "a.tif", "--fill", "-1"], "length of 0 or more")])
def test_what_cannot_be_done_is_said_in_a_sentence(record, arguments, words, refusal):
    assert words in refusal(*arguments)
