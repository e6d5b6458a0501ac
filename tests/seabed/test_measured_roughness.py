"""Spectra measured on beds of a known one, and beds continued below the distance of their nodes.

Beds are sampled at every fourth node of finer ones, so that what a survey cannot resolve is folded into it, as in
reality. 16 patches of 64 x 64 nodes: the few long waves scatter, so exponents are good to 0.2 and levels at the highest
wavenumber to 1.5 dB (worst of 12 realisations tried 0.17 and 1.1 dB); white noise of 0.3 of the spectrum there, 3 % of
it at half, must not flatten the fit. Continued: over rings of hundreds of modes the spectrum scatters by 0.2 dB: a
survey of cell means, which hold no shorter waves, goes on within 0.5 dB (0.2 found); one of samples has folded power of
its own about its highest wavenumber: 2 dB (1.6 found).
"""
import numpy as np
import pytest

from mitsonar.io.grids.survey_relief import refine
from mitsonar.scattering import Fractal, RoughnessSpectrum
from mitsonar.seabed.measured_roughness import fit_power_law, radial_spectrum

STEP = 2.0
HIGHEST = np.pi / STEP


def survey(spectrum, seed, nodes=256, finer=4):
    axis = np.arange(nodes * finer) * STEP / finer
    return Fractal(spectrum=spectrum, seed=seed).on_grid(axis, axis)[::finer, ::finer]


def patches(bed, size=64):
    rows, columns = bed.shape
    return [bed[i:i + size, j:j + size] for i in range(0, rows - size + 1, size)
            for j in range(0, columns - size + 1, size)]


@pytest.mark.parametrize("gamma, noise", [(2.6, 0.0), (3.25, 0.0), (3.25, 0.3), (3.7, 0.3)])
def test_power_law_is_measured_beside_noise(gamma, noise):
    spectrum = RoughnessSpectrum(w2=1e-4, gamma=gamma, outer_scale=200.0)
    bed = survey(spectrum, seed=2)
    variance = noise * spectrum.at(HIGHEST) * (2 * np.pi / STEP) ** 2
    bed += np.sqrt(variance) * np.random.default_rng(1).standard_normal(bed.shape)
    found = fit_power_law(patches(bed + 0.1 * np.arange(256.0) - 40), (STEP, STEP))     # a slope is not roughness
    assert found.gamma == pytest.approx(gamma, abs=0.2)
    assert abs(10 * np.log10(found.at(HIGHEST) / spectrum.at(HIGHEST))) < 1.5
    known = fit_power_law(patches(bed), (STEP, STEP), gamma)
    assert known.gamma == gamma and abs(10 * np.log10(known.w2 / spectrum.w2)) < 1.0


def test_oblong_cells():
    spectrum = RoughnessSpectrum(w2=1e-4, gamma=3.0, outer_scale=200.0)
    bed = Fractal(spectrum=spectrum, seed=1).on_grid(np.arange(512) * 1.0, np.arange(256) * 1.0)[:, ::2]
    found = fit_power_law(patches(bed), (2.0, 1.0))
    assert found.gamma == pytest.approx(3.0, abs=0.2) and abs(10 * np.log10(found.at(1.0) / spectrum.at(1.0))) < 1.5


def test_level_bed_has_no_spectrum():
    with pytest.raises(ValueError, match="the survey is level to the last digit"):
        fit_power_law([np.zeros((32, 32))], (1.0, 1.0))


@pytest.fixture(scope="module", params=[(4, 2.0), (1, 0.5)], ids=["samples", "means"])
def continued(request):
    """A surveyed bed, the same on a grid of a quarter of its steps without and with relief, its spectrum, decibels."""
    finer, tolerance_db = request.param
    spectrum = RoughnessSpectrum(w2=1e-4, gamma=3.25, outer_scale=200.0)
    bed, axis = survey(spectrum, 3, 200, finer), 1000 + np.arange(200) * STEP
    places = np.arange(axis[0], axis[-1] + 0.1, STEP / 4)
    smooth, rough = (refine(axis, axis, bed, places, places, RoughnessSpectrum(
        w2=w2, gamma=3.25, outer_scale=1e6), 5) for w2 in (0.0, 1e-4))
    return spectrum, bed, smooth, rough, tolerance_db


def test_spectrum_goes_on_across_the_survey_s_highest_wavenumber(continued):
    spectrum, _, smooth, rough, tolerance_db = continued
    steps = (STEP / 4, STEP / 4)
    k, power, modes = radial_spectrum([rough[:780, :780]], steps)
    ratio = power / spectrum.at(k)
    edges = HIGHEST * np.array([0.3, 0.5, 0.7, 0.85, 1.0, 1.2, 1.5, 2.0, 3.0, 4.0])
    for low, high in zip(edges, edges[1:]):
        ring = (k >= low) & (k < high)
        off_db = 10 * np.log10(np.average(ratio[ring], weights=modes[ring]))
        assert abs(off_db) < tolerance_db, (low / HIGHEST, high / HIGHEST, off_db)
    # What was there to be mended: splines alone end at the highest wavenumber.
    _, power, _ = radial_spectrum([smooth[:780, :780]], steps)
    ring = (k >= 1.5 * HIGHEST) & (k < 2 * HIGHEST)
    assert 10 * np.log10(np.mean(power[ring] / spectrum.at(k[ring]))) < -10


def test_what_was_surveyed_stays(continued):
    _, bed, smooth, rough, _ = continued
    assert np.abs(smooth[::4, ::4] - bed).max() < 1e-5          # splines pass through the nodes
    added = np.fft.fft2((rough - smooth) * np.outer(np.hanning(797), np.hanning(797)))
    k = np.hypot(*np.meshgrid(2 * np.pi * np.fft.fftfreq(797, STEP / 4), 2 * np.pi * np.fft.fftfreq(797, STEP / 4)))
    whole = np.fft.fft2((smooth - smooth.mean()) * np.outer(np.hanning(797), np.hanning(797)))
    for below, share in ((0.3, 1e-4), (0.5, 5e-4), (0.7, 1.5e-3)):   # of the power below; 0.5: waves of 4 nodes
        low = k < below * HIGHEST
        assert np.sum(np.abs(added[low]) ** 2) < share * np.sum(np.abs(whole[low]) ** 2)


def test_relief_has_the_variance_of_what_is_missing(continued):
    _, _, smooth, rough, _ = continued
    spectrum = RoughnessSpectrum(w2=1e-4, gamma=3.25, outer_scale=1e6)
    highest = 4 * HIGHEST
    # Between a disc and a square of wavenumbers, above and below.
    least = spectrum.height_variance(highest) - spectrum.height_variance(np.sqrt(2) * HIGHEST)
    most = spectrum.height_variance(np.sqrt(2) * highest) - spectrum.height_variance(0.8 * HIGHEST)
    assert least < np.var(rough - smooth) < most


def test_relief_belongs_to_its_place_and_seed():
    spectrum = RoughnessSpectrum(w2=1e-4, gamma=3.25, outer_scale=1e6)
    axis = 620000 + np.arange(400) * 0.25
    whole, other = (Fractal(spectrum=spectrum, seed=seed, surveyed=(2.0, 2.0)).on_grid(axis, axis) for seed in (1, 2))
    part = Fractal(spectrum=spectrum, seed=1, surveyed=(2.0, 2.0)).on_grid(axis[100:220], axis[40:90])
    assert np.abs(whole[40:90, 100:220] - part).max() < 3e-3 * whole.std()
    assert abs(np.corrcoef(whole.ravel(), other.ravel())[0, 1]) < 0.05
