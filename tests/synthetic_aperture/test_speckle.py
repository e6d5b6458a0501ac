"""Speckle of known laws: Rayleigh's, and K distributions of a shape.

The scintillation index of n looks of Rayleigh's speckle deviates by √(20 / n): 0.03 of the 20000 here.
"""
import numpy as np
import pytest
import xarray as xr

from mitsonar.synthetic_aperture.products.speckle import speckle

ROWS, COLUMNS, STEP = 256, 320, 0.05


def picture(shape=np.inf, seed=5, oversampled=2):
    """An image of speckle, two points a look along both axes; its texture is gamma with the shape, look by look."""
    rng = np.random.default_rng(seed)
    coarse = ROWS // oversampled, COLUMNS // oversampled
    field = rng.normal(size=(*coarse, 2)).view(complex)[..., 0]
    if np.isfinite(shape):
        field = field * np.sqrt(rng.gamma(shape, 1 / shape, coarse))
    spectrum = np.zeros((ROWS, COLUMNS), complex)
    inside = [np.fft.fftfreq(size, 1 / size).astype(int) for size in coarse]
    spectrum[np.ix_(*inside)] = np.fft.fft2(field)
    level = 1 + 0.5 * np.sin(np.arange(COLUMNS) * STEP * 0.4)             # slow change of level
    image = (np.fft.ifft2(spectrum) * level).astype(np.complex64)
    dims = ("along_track", "across_track")
    return xr.Dataset({"image": (("bank", *dims), image[None]), "level": (("bank", *dims), np.abs(image)[None]),
                       "along_track": STEP * np.arange(ROWS), "across_track": STEP * np.arange(COLUMNS),
                       **{name: (dims, np.zeros((ROWS, COLUMNS))) for name in ("x", "y", "grid_depth")}})


def test_developed_speckle_scintillates_by_one():
    found = speckle(picture())
    assert found.looks == pytest.approx(ROWS * COLUMNS / 4, rel=0.15)
    assert found.scintillation == pytest.approx(1.0, abs=4 * found.deviation)
    assert found.variation == pytest.approx(0.523, abs=0.01)
    assert found.contrast == pytest.approx(1.0, abs=0.08)
    assert found.shape > 20


def test_patchy_speckle_has_the_shape_of_its_texture():
    # Between looks the picture is a mean of several: two thirds of the texture's variance are left, ⅔² along both axes.
    found = speckle(picture(shape=4.0))
    assert 1.15 < found.scintillation < 1.6
    assert 3.5 < found.shape < 13


def test_only_ground_that_counts_is_measured():
    image = picture()
    image["image"].values[0, :50] *= 30
    keep = np.ones((ROWS, COLUMNS), bool)
    keep[:110] = False
    assert speckle(image, keep=keep).scintillation == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize(("change", "said"), [
    (lambda image: speckle(image, bank=2), "bank 2"), (lambda image: speckle(image, trend=0.0), "window"),
    (lambda image: speckle(image, keep=np.ones((2, 2), bool)), "keep"),
    (lambda image: speckle(image.isel(along_track=slice(8), across_track=slice(8))), "looks")])
def test_what_is_no_speckle_is_refused(change, said):
    with pytest.raises(ValueError, match=said):
        change(picture())
