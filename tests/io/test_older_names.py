"""Files of older versions have the names of today once they are read."""
import numpy as np
import pytest
import xarray as xr
from focused_image import focused_image

import mitsonar
from mitsonar.io.records.records import SonarImage

OLD = {"depth": "measured_depth", "true_depth": "depth", "point_x": "measured_x", "point_y": "measured_y",
       "across_track": "measured_across_track", "error": "error", "level": "level"}


def older():
    """A picture of an interferometric sidescan, whose depth was the measured one."""
    dims, random = ("ping", "side", "range"), np.random.default_rng(1)
    return SonarImage({name: (dims, random.random((3, 2, 5)).astype(np.float32), {"units": "m", "long_name": name})
                       for name in OLD}, {"side": ["port", "starboard"], "range": np.arange(5.0)},
                      {"sonar": "interferometric"})


@pytest.mark.parametrize("suffix", ["exr", "nc"])
def test_what_an_interferometric_sidescan_measured_is_named_so(tmp_path, suffix):
    picture = older()
    mitsonar.write(picture, tmp_path / f"old.{suffix}")
    read = mitsonar.read(tmp_path / f"old.{suffix}")
    assert isinstance(read, SonarImage) and set(read.data_vars) == set(OLD.values())
    for old, new in OLD.items():
        np.testing.assert_array_equal(read[new], picture[old])
    assert read["error"].attrs["long_name"] == "measured_depth - depth"


@pytest.mark.parametrize("suffix", ["exr", "nc"])
def test_the_depth_of_a_focused_image_s_grid_is_named_so(tmp_path, suffix):
    picture = focused_image().drop_vars("depth").rename(grid_depth="depth")
    mitsonar.write(picture, tmp_path / f"old.{suffix}")
    read = mitsonar.read(tmp_path / f"old.{suffix}")
    xr.testing.assert_equal(read["grid_depth"].drop_vars(read.coords), picture["depth"].drop_vars(picture.coords))
    assert "depth" not in read
