"""netCDF files of element signals: what is written comes back, whole or not at all."""
import numpy as np
import pytest
import xarray as xr

from mitsonar.io.records import signals as netcdf


@pytest.fixture
def signals(rng):
    """A small array with every kind of coordinate and attribute."""
    values = (rng.normal(size=(2, 1, 3, 7)) + 1j * rng.normal(size=(2, 1, 3, 7))).astype(np.complex64)
    return xr.DataArray(values, dims=("ping", "tx", "rx", "sample"), name="element signals", coords={
        "ping": [4, 9], "time": ("sample", np.arange(7) / 5e4, {"units": "s"}), "rx_x": ("rx", [0.0, 0.1, 0.3])},
        attrs={"units": "µPa", "frequency": 1e5, "seed": 3, "parameters": {"a": [1, 2]}, "file": None, "noise": True})


def test_round_trip(tmp_path, signals):
    netcdf.write(tmp_path / "a.nc", signals)
    back = netcdf.read(tmp_path / "a.nc")
    assert back.identical(signals)
    assert back.attrs["noise"] is True and isinstance(back.attrs["seed"], int)


def test_xarray_alone_reads_it(tmp_path, signals):
    netcdf.write(tmp_path / "a.nc", signals)
    with xr.open_dataset(tmp_path / "a.nc") as dataset:
        assert np.array_equal(dataset["real"], signals.values.real) and dataset["imag"].attrs["units"] == "µPa"


@pytest.mark.parametrize("content", [b"", b"nothing of the kind", b"\x89HDF\r\n\x1a\n" + b"\0" * 100])
def test_other_files_are_refused(tmp_path, content):
    (tmp_path / "a.nc").write_bytes(content)
    with pytest.raises(ValueError, match="a.nc is no netCDF-4 file"):
        netcdf.read(tmp_path / "a.nc")


def test_files_without_signals_are_refused(tmp_path):
    xr.Dataset({"depth": ("x", [1.0])}).to_netcdf(tmp_path / "a.nc", engine="h5netcdf")
    with pytest.raises(ValueError, match="holds no signals: .*, it has depth"):
        netcdf.read(tmp_path / "a.nc")
    with pytest.raises(FileNotFoundError):
        netcdf.read(tmp_path / "b.nc")


def test_an_older_file_stays_if_writing_fails(tmp_path, signals):
    netcdf.write(tmp_path / "a.nc", signals)
    before = (tmp_path / "a.nc").read_bytes()
    with pytest.raises((TypeError, ValueError)):
        netcdf.write(tmp_path / "a.nc", signals.assign_coords(bad=("rx", np.array([{}, {}, {}], object))))
    assert (tmp_path / "a.nc").read_bytes() == before and len(list(tmp_path.iterdir())) == 1
