"""The point response of images whose response is known."""
import numpy as np
import pytest
import xarray as xr

from mitsonar.synthetic_aperture.products.point_response import point_response


def picture(place=(0.0123, 20.0077), width=(0.02, 0.0125), carrier=300.0):
    """sinc by sinc about a place, on a carrier that the grid folds."""
    along, across = np.arange(-60, 61) * 0.008, 20 + np.arange(-60, 61) * 0.005
    line = [np.sinc((axis - at) / size) for axis, at, size in zip((along, across), place, width)]
    value = 0.1 * np.outer(*line) * np.exp(2j * np.pi * carrier * (across - place[1]))
    value = value[None].astype(np.complex64)
    plane = np.zeros(value.shape[1:])
    both = ("along_track", "across_track")
    return xr.Dataset({"image": (("bank", *both), value), "level": (("bank", *both), np.abs(value)),
                       "along_track": along, "across_track": across,
                       **dict.fromkeys(("x", "y", "grid_depth"), (both, plane))})


def test_a_sinc_has_its_place_width_level_and_side_lobes():
    """Place within 1 % of a cell, width 0.886 cells within 1 %, side lobes -13.26 dB within 0.5: the grid cuts it."""
    found = point_response(picture())
    assert found.along_track.place == pytest.approx(0.0123, abs=2e-4)
    assert found.across_track.place == pytest.approx(20.0077, abs=1e-4)
    assert found.along_track.width == pytest.approx(0.886 * 0.02, rel=0.01)
    assert found.across_track.width == pytest.approx(0.886 * 0.0125, rel=0.01)
    assert found.level_db == pytest.approx(-20, abs=0.05)
    assert found.along_track.side_lobe_db == pytest.approx(-13.26, abs=0.5)
    assert found.across_track.integrated_db == pytest.approx(-9.7, abs=0.7)


def test_images_without_a_point_are_refused():
    image = picture()
    with pytest.raises(ValueError, match="no value within"):
        point_response(image, (5.0, 5.0))
    with pytest.raises(ValueError, match="even steps"):
        point_response(image.isel(along_track=slice(0, 4)))
