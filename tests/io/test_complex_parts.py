"""Complex variables of datasets in netCDF files: bit for bit, lazily, and refused where parts do not fit."""
import numpy as np
import pytest
import xarray as xr

import mitsonar
from mitsonar.io.records import netcdf
from mitsonar.io.records.complex_parts import joined, split
from mitsonar.io.records.records import SonarImage


@pytest.fixture
def image():
    """Three complex variables of two types, one a coordinate, with numbers that sums would spoil."""
    values = np.array([[1 + 2j, complex(np.nan, 1)], [complex(np.inf, -0.0), complex(-0.0, np.inf)]], np.complex64)
    return SonarImage({"image": (("along_track", "across_track"), values, {"units": "m", "about": {"a": [1, None]}}),
                       "level": (("along_track", "across_track"), np.ones((2, 2), np.float32)),
                       "other": ("along_track", np.array([1e-300 + 1e300j, 0j]))},
                      {"along_track": [0.0, 1.0], "weight": ("across_track", np.array([1j, 2], np.complex64))},
                      {"seed": 3, "altered": None})


def test_they_come_back_bit_for_bit(tmp_path, image):
    image.to_netcdf(tmp_path / "a.nc")
    mitsonar.write(image, tmp_path / "b.nc")
    for name in "ab":
        back = mitsonar.read(tmp_path / f"{name}.nc")
        assert set(back.variables) == set(image.variables) and set(back.coords) == set(image.coords)
        assert back.attrs == image.attrs and back["image"].attrs == image["image"].attrs
        for key in image.variables:
            assert back[key].dtype == image[key].dtype
            assert back[key].values.tobytes() == image[key].values.tobytes()


def test_xarray_alone_reads_plain_numbers(tmp_path, image):
    image.to_netcdf(tmp_path / "a.nc")
    with xr.open_dataset(tmp_path / "a.nc") as plain:
        assert plain["image_real"].attrs["units"] == "m"
        assert np.array_equal(plain["image_imag"].values, image["image"].values.imag, equal_nan=True)


def test_values_are_read_where_they_are_used(tmp_path, image):
    mitsonar.write(image, tmp_path / "a.nc")
    with netcdf.opened(tmp_path / "a.nc") as record:
        assert not record["image"].variable._in_memory
        assert record["image"].isel(along_track=1, across_track=[1]).values.tolist() == [complex(-0.0, np.inf)]
        assert not record["image"].variable._in_memory


def test_infinite_signals_stay_infinite(tmp_path):
    signals = xr.DataArray(np.array([complex(1, np.inf), 2], np.complex64), dims="sample", name="beams")
    mitsonar.write(signals, tmp_path / "a.nc")
    assert mitsonar.read(tmp_path / "a.nc").values.tobytes() == signals.values.tobytes()


def test_a_name_that_is_taken_is_refused(image):
    with pytest.raises(ValueError, match="would be written as image_real, and there is one already"):
        split(image.assign(image_real=1.0))


@pytest.mark.parametrize("spoil, words", [
    (lambda parts: parts.drop_vars("image_imag"), "image_imag is missing"),
    (lambda parts: parts.drop_vars("image_real"), "image_real is missing"),
    (lambda parts: parts.assign(image=1.0), "image is there too"),
    (lambda parts: parts.assign(image_imag=parts["image_imag"].astype(np.float64)), "do not fit together")])
def test_parts_that_do_not_fit_are_refused(tmp_path, image, spoil, words):
    with pytest.raises(ValueError, match=words):
        joined(spoil(split(image)))


def test_a_file_of_one_part_is_refused_by_name(tmp_path, image):
    split(xr.Dataset({"image": ("y", image["image"].values[0])}))[["image_real"]].to_netcdf(tmp_path / "a.nc",
                                                                                            engine="h5netcdf")
    with pytest.raises(ValueError, match="a.nc holds parts that do not fit: .*image_imag is missing"):
        mitsonar.read(tmp_path / "a.nc")


def test_text_that_was_spoilt_is_refused_in_a_sentence(tmp_path):
    path = tmp_path / "a.nc"
    level = ("row", "range"), np.zeros((2, 3), np.float32)
    mitsonar.write(SonarImage({"level": level}, attrs={"scene": "word " * 60}), path)
    whole = path.read_bytes()
    assert whole.count(b"word word") > 1
    path.write_bytes(whole.replace(b"word word", b"word \xff\xfe\xfdd"))
    with pytest.raises(ValueError, match="a.nc is damaged: it holds .*, which is no text"):
        mitsonar.read(path)
