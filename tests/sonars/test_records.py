"""What the verbs give goes into files and comes back as it was: images, responses, signals and beams.

No tolerance: files are containers, so equality is exact.
"""
import numpy as np
import pytest
import xarray as xr

import mitsonar
from mitsonar.io.records import signals as signal_files
from mitsonar.signal import matched_filter
from mitsonar.signal.beamforming import delay_and_sum, directions
from mitsonar.validation.scenes import array_sonar, bed, point_target, sidescan


def image():
    """A sidescan's, with a target on the bed: attributes of every kind."""
    shapes = {"bed": bed(30.0), "buoy": point_target([15, 0, -29])}
    return mitsonar.render(sidescan(shapes, film={"bins": 40}, rays=4000))


def fan():
    """An array's picture."""
    return mitsonar.render(small_array())


def response():
    return mitsonar.impulse_response(small_array())


def signals():
    return mitsonar.element_signals(small_array(), seed=2)


def beams():
    return delay_and_sum(signals(), directions(np.deg2rad([-30.0, 0.0, 30.0])))


def small_array():
    sensor = {"receive": "line", "receive_elements": 4, "pulse": "hfm", "bandwidth_khz": -8.0,
              "pulse_window": "tukey 0.1", "beams": 5, "noise": True}
    return array_sonar({"bed": bed(20.0, size=40.0), "buoy": point_target([0, 5, -15])}, sensor=sensor,
                       film={"range": 14.0, "range_min": 8.0}, integrator={"cell": 0.5})


RECORDS = {"image": image, "fan": fan, "response": response, "signals": signals, "beams": beams}


@pytest.fixture(params=RECORDS)
def record(request):
    return RECORDS[request.param]()


def test_to_netcdf_and_back(record, tmp_path):
    record.to_netcdf(tmp_path / "a.nc")
    back = mitsonar.read(tmp_path / "a.nc")
    xr.testing.assert_identical(back, record)
    assert {name: value.dtype for name, value in back.coords.items()} == {
        name: value.dtype for name, value in record.coords.items()}
    with xr.open_dataset(tmp_path / "a.nc") as plain:
        assert plain.attrs["versions"].startswith('json:{"mitsonar"')     # text that any program reads


def test_to_zarr_and_back(record, tmp_path):
    pytest.importorskip("zarr")
    record.to_zarr(tmp_path / "a.zarr")
    xr.testing.assert_identical(mitsonar.read(tmp_path / "a.zarr"), record)


def test_what_xarray_makes_of_a_record_is_written_by_name(tmp_path):
    loud = (whole := image()[["level", "depth"]]).where(whole["level"] > 60)    # an ordinary Dataset
    for name in ("a.nc", "a.exr"):
        mitsonar.write(loud, tmp_path / name)
        xr.testing.assert_equal(mitsonar.read(tmp_path / name)["level"], loud["level"])
    with pytest.raises(ValueError, match="the name has no known suffix; let it end in one of .exr"):
        mitsonar.write(loud, tmp_path / "a.txt")
    with pytest.raises(ValueError, match="signals are no image; give a name that ends in .nc"):
        mitsonar.write(response(), tmp_path / "b.exr")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.exr", "a.nc"]


def test_signals_know_their_pulse(tmp_path):
    """The echo is compressed without the scene, to the last bit as with it."""
    heard = signals()
    signal_files.write(tmp_path / "a.nc", heard)
    there = signal_files.read(tmp_path / "a.nc")
    sent, rate = small_array().sensors()[0].pulse, heard.attrs["sampling_rate"]
    assert there.pulse.numbers == sent.numbers == {"kind": "hfm", "frequency": 1e5, "duration": 1e-3, "bandwidth": -8e3,
                                                   "window": ["tukey", 0.1]}
    assert np.array_equal(matched_filter(there.values, there.pulse, rate), matched_filter(heard.values, sent, rate))
    with xr.open_dataset(tmp_path / "a.nc") as plain:
        replica = plain["replica_real"] + 1j * plain["replica_imag"]
        assert np.array_equal(replica, sent.sampled_at(rate)) and replica.size == 16


def test_signals_without_a_pulse_say_so():
    with pytest.raises(ValueError, match="do not say which pulse"):
        _ = signals().drop_attrs().pulse
