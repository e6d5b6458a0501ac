"""Images as intensities: what does not count, and records of other sonars."""
import numpy as np
import pytest
import xarray as xr

from mitsonar.inversion.images.scene_fit import image_intensities


def _image(level=None, *, sonar="sidescan", last=10.0):
    level = np.full((2, 2, 5), 20.0) if level is None else level
    return xr.Dataset({"level": (("ping", "side", "range"), level)}, {"range": np.linspace(2, last, level.shape[2])},
                      {"sonar": sonar})


def test_levels_become_intensities_and_bins_without_one_do_not_count():
    level = np.full((2, 2, 5), 20.0)
    level[0, 1, 2], level[1, 1, 1] = np.nan, -np.inf
    found = image_intensities(_image(level), "sidescan", (2, 2, 5), 10.0)
    assert np.isnan(found[0, 1, 2]) and np.isnan(found[1, 1, 1])
    np.testing.assert_allclose(found[np.isfinite(found)], 100)


@pytest.mark.parametrize("image, words", [
    (_image(sonar="forward_looking"), "of the kind forward_looking, and the scene's is sidescan"),
    (_image(np.zeros((3, 2, 5))), "3 x 2 x 5 pings, rows and bins, and the scene's sonar makes 2 x 2 x 5"),
    (_image(last=20.0), "ends at 20.0 m, and that of the scene's sonar at 10.0 m"),
    (xr.Dataset(), "no levels over pings"),
])
def test_records_of_another_sonar_are_told(image, words):
    with pytest.raises(ValueError, match=words):
        image_intensities(image, "sidescan", (2, 2, 5), 10.0)
