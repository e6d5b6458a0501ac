"""Two passes over speckle of a known coherence, one of them shifted and under another carrier's phase.

Speckle fills 0.6 of the band that the grid holds, so that interpolation by quintic splines keeps 0.99 of its coherence.
Shares of false alarms follow the threshold that theory sets: of some 300 independent windows 5 % are 15 +- 4. Shifts of
patches of 64 x 64 points are told to 0.02 points each.
"""
import numpy as np
import pytest
import xarray as xr

from mitsonar.synthetic_aperture.products.change import change_map, laid_on, shift_between

ROWS, COLUMNS, STEP, BAND = 160, 256, 0.02, 0.6
WHOLE = (ROWS // 2, COLUMNS // 2)


def speckle(rng):
    """Spectra of speckle of power 1 that fills part of the band."""
    field = np.fft.fft2(rng.normal(size=(ROWS, COLUMNS, 2)).view(complex)[..., 0])
    keep = [np.abs(np.fft.fftfreq(count)) < 0.5 * BAND for count in (ROWS, COLUMNS)]
    return field * np.multiply.outer(*keep)


def image_of(spectrum, shift=(0.0, 0.0), turn=0.0, gain=1.0):
    """A pass: speckle `shift` points later, on a carrier that the grid holds aliased."""
    late = [np.exp(-2j * np.pi * np.fft.fftfreq(count) * part) for count, part in zip((ROWS, COLUMNS), shift)]
    field = np.fft.ifft2(spectrum * np.multiply.outer(*late)) * gain
    y, x = np.meshgrid(np.arange(ROWS) - shift[0], np.arange(COLUMNS) - shift[1], indexing="ij")
    field = (field * np.exp(1j * (0.3 * y + 2.2 * x + 2e-3 * x ** 2 + turn))).astype(np.complex64)
    along, across = STEP * np.arange(ROWS), 30 + STEP * np.arange(COLUMNS)
    places = np.meshgrid(along, across, indexing="ij")
    dims = ("along_track", "across_track")
    return xr.Dataset({"image": (("bank", *dims), field[None]), "level": (("bank", *dims), np.abs(field)[None]),
                       "along_track": along, "across_track": across, "x": (dims, places[1]), "y": (dims, places[0]),
                       "grid_depth": (dims, np.full((ROWS, COLUMNS), 15.0, np.float32))})


def passes(coherence, shift=(0.0, 0.0), patch=None, gain=1.0):
    """Two passes; within `patch` (rows, columns) nothing is left alike."""
    one, two, three = (speckle(np.random.default_rng(seed)) for seed in (1, 2, 3))
    both = coherence * one + np.sqrt(1 - coherence ** 2) * two
    if patch is not None:
        field, other = np.fft.ifft2(both), np.fft.ifft2(three)
        field[patch] = gain * other[patch]
        both = np.fft.fft2(field)
    return image_of(one), image_of(both, shift, turn=0.8)


@pytest.mark.parametrize("coherence", [0.5, 0.9])
def test_the_coherence_between_passes_is_found(coherence):
    found = change_map(*passes(coherence), window=(0.3, 0.3))
    inside = found["coherence"].values[20:-20, 20:-20]
    assert inside.mean() == pytest.approx(coherence, abs=0.02)
    assert found.attrs["unchanged_coherence"] == pytest.approx(coherence, abs=0.03)
    assert np.angle(np.exp(1j * found["phase"].values[20:-20, 20:-20]).mean()) == pytest.approx(0.8, abs=0.05)


def test_a_shift_by_parts_of_a_point_is_found_and_taken_out():
    before, after = passes(0.9, shift=(1.3, -2.6))
    shift = shift_between(*(image["image"].values[0] for image in (before, after)))
    assert (shift.at(*WHOLE)[0], shift.at(*WHOLE)[1]) == (pytest.approx(1.3, abs=0.02), pytest.approx(-2.6, abs=0.02))
    found = change_map(before, after, window=(0.3, 0.3))
    assert found["coherence"].values[20:-20, 20:-20].mean() > 0.98 * 0.9
    unmoved = change_map(before, after, window=(0.3, 0.3), register=False)
    assert unmoved["coherence"].values[20:-20, 20:-20].mean() < 0.5
    moved = laid_on(before, after)["image"].values[0, 20:-20, 20:-20]
    fixed = before["image"].values[0, 20:-20, 20:-20]
    assert np.abs(np.vdot(fixed, moved)) / np.linalg.norm(fixed) / np.linalg.norm(moved) > 0.98 * 0.9


def test_ground_that_was_stirred_is_marked_and_the_rest_as_rarely_as_theory_says():
    patch = np.s_[60:110, 100:160]
    found = change_map(*passes(0.9, patch=patch), window=(0.3, 0.3), false_alarm=0.05, coherence=0.9)
    marked = found["coherent_change"].values
    assert marked[70:100, 110:150].mean() > 0.95
    assert 0.02 < marked[:, :80].mean() < 0.09
    assert found["incoherent_change"].values[10:-10, 10:80].mean() < 0.08
    assert np.abs(np.nanmean(found["ratio_db"].values[:, 10:80])) < 0.5


def test_ground_that_grew_louder_is_marked_by_its_intensity():
    patch = np.s_[60:110, 100:160]
    found = change_map(*passes(0.9, patch=patch, gain=4.0), window=(0.3, 0.3))
    assert found["incoherent_change"].values[70:100, 110:150].mean() > 0.95
    assert np.mean(found["ratio_db"].values[70:100, 110:150]) == pytest.approx(12.0, abs=1.5)
    assert found["incoherent_change"].values[10:-10, 10:80].mean() < 0.01


def test_what_was_not_focused_is_left_out():
    before, after = passes(0.9)
    after["image"].values[0, :40] = 0
    found = change_map(before, after, window=(0.3, 0.3))
    assert np.isnan(found["coherence"].values[:40]).all() and not found["coherent_change"].values[:40].any()


@pytest.mark.parametrize(("change", "said"), [
    (lambda one, two: change_map(one, two.assign(x=two["x"] + 1)), "grid"),
    (lambda one, two: change_map(one, two, bank=1), "bank 1"),
    (lambda one, two: change_map(one, two, false_alarm=0.0), "false_alarm"),
    (lambda one, two: change_map(one, two, coherence=1.5), "coherence"),
    (lambda one, two: change_map(one, two, search=200), "search"),
    (lambda one, two: change_map(one, passes(0.0)[1]), "alike"),
    (lambda one, two: change_map(one, two, window=(np.nan, 1.0)), "window")])
def test_passes_that_cannot_be_compared_are_refused(change, said):
    with pytest.raises(ValueError, match=said):
        change(*passes(0.9))
