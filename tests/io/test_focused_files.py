"""Focused images in GeoTIFF and HDF5: every value at its place, other programs read them, and refusals.

Tolerance of places: 1e-6 m, what is left of UTM northings of 6e6 m in float64 and a transform of six numbers.
"""
import os

import h5py
import numpy as np
import pytest
import rasterio
from focused_image import focused_image

import mitsonar

TIGHT = 1e-6


@pytest.mark.parametrize("heading", [0.0, 0.3, 2.5, -1.2])
def test_every_value_of_a_turned_grid_lies_at_its_place(tmp_path, heading):
    image = focused_image(heading=heading)
    mitsonar.write(image, tmp_path / "a.tif")
    with rasterio.open(tmp_path / "a.tif") as raster:
        assert raster.crs.to_epsg() == 32632 and raster.transform.determinant < 0         # not mirrored
        bands = {name: raster.read(number) for number, name in enumerate(raster.descriptions, 1)}
        assert raster.units[:2] == ("dB re 1 m²", "m") and raster.tags()["labels"] == '{"1": "bed", "2": "mine"}'
        for row, column in ((0, 0), (7, 11), (19, 29)):
            x, y = (float(image[name][row, column]) + start for name, start in (("x", 500000.0), ("y", 6000000.0)))
            found = raster.index(x, y)
            assert found == (19 - row, column)
            assert np.allclose(raster.xy(*found), (x, y), rtol=0, atol=TIGHT)
            whole = bands["bank1.image.real"][found] + 1j * bands["bank1.image.imag"][found]
            assert whole == image["image"].values[1, row, column]
            assert bands["coherence"][found] == image["coherence"].values[row, column]
            assert bands["label"][found] == image["label"].values[row, column]
    assert list(bands)[:6] == ["bank0.level", "bank0.image.real", "bank0.image.imag", "bank1.level",
                               "bank1.image.real", "bank1.image.imag"]
    assert "x" not in bands


def test_a_scene_without_coordinate_system_gives_plain_metres(tmp_path):
    image = focused_image().assign_attrs(crs=None, local_origin=None)
    mitsonar.write(image, tmp_path / "a.tif")
    with rasterio.open(tmp_path / "a.tif") as raster:
        assert raster.crs is None
        assert np.allclose(raster.xy(19, 0), (float(image["x"][0, 0]), float(image["y"][0, 0])), rtol=0, atol=TIGHT)


@pytest.mark.parametrize("change, words", [
    (lambda image: image.assign(x=image["x"] + 0.001 * image["across_track"] ** 2), "no even grid on the map"),
    (lambda image: image.assign(x=image["x"] * np.nan), "no even grid on the map"),
    (lambda image: image.isel(along_track=[0]), "at least 2 x 2 points"),
    (lambda image: image.assign(label=image["label"] + (1 << 25)), "label has numbers above 16777216"),
    (lambda image: image.assign_attrs(crs="EPSG:4326"), "give a projected system in metres"),
    (lambda image: image.drop_vars("level"), "lacks level"),
    (lambda image: image.rename(along_track="ping"), "GeoTIFF takes focused images")])
def test_what_has_no_place_on_a_map_is_refused(tmp_path, change, words):
    with pytest.raises(ValueError, match=words):
        mitsonar.write(change(focused_image()), tmp_path / "a.tif")
    assert not os.listdir(tmp_path)


@pytest.mark.parametrize("suffix", [".h5", ".hdf5"])
def test_hdf5_comes_back_and_is_complex_elsewhere(tmp_path, suffix):
    image = focused_image()
    image["image"].values[0, 0, :2] = complex(np.nan, -0.0), complex(-np.inf, 1)
    mitsonar.write(image, tmp_path / f"a{suffix}")
    back = mitsonar.read(tmp_path / f"a{suffix}")
    assert back.attrs == image.attrs and set(back.variables) == set(image.variables)
    for name in image.variables:
        assert back[name].values.tobytes() == image[name].values.tobytes() and back[name].attrs == image[name].attrs
    with h5py.File(tmp_path / f"a{suffix}") as file:
        assert file["image"].dtype == np.complex64 and file["image"].attrs["units"] == "m"
        assert np.array_equal(file["image"][1], image["image"].values[1])
        assert file["image"].dims[2][0].name == "/across_track"


def test_signals_are_no_image(tmp_path):
    import xarray as xr

    for suffix in (".h5", ".tif"):
        with pytest.raises(ValueError, match="signals are no image"):
            mitsonar.write(xr.DataArray(np.ones(3)), tmp_path / f"a{suffix}")
