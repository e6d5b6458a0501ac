"""Waves of the sea surface against their spectra.

Closed forms: variance m_0 = H²/16 and mean square slope ∫ k² S df, which the components have exactly, whatever their
number and the seed; the fully developed sea of Pierson and Moskowitz (1964), whose mean square slope of waves longer
than l is a quarter of α ln of a ratio of frequencies; the periodogram of heights at one place; the mean cosine of
cos^2s(θ/2), s/(s + 1); circles of deep-water orbits, whose vertical and horizontal variances are alike.
"""
import numpy as np
import pytest
from scipy.special import exp1

from mitsonar.io.scene_files import wave_spectra
from mitsonar.water.sea_waves import GRAVITY, WaveSpectrum, cut_frequency, developed_sea, wavelength


def test_a_developed_sea_has_the_height_and_period_of_pierson_and_moskowitz():
    """Of 10 m/s at 19.5 m: H = 0.21 U²/g = 2.14 m, f_p = 0.877 g / 2π U = 0.137 Hz."""
    height, period = developed_sea(10.0 / 1.026)
    assert height == pytest.approx(2.14, abs=0.01) and 1 / period == pytest.approx(0.137, abs=0.001)


@pytest.mark.parametrize("enhancement", [1.0, 3.3, 7.0])
def test_a_model_has_the_height_that_was_asked_for(enhancement):
    spectrum = WaveSpectrum.model(1.2, 6.0, enhancement=enhancement)
    assert spectrum.height == pytest.approx(1.2, rel=1e-5)
    assert spectrum.peak_period == pytest.approx(6.0, rel=0.01)


@pytest.mark.parametrize("shortest", [0.5, 5.0, 20.0])
def test_the_mean_square_slope_is_the_integral_of_the_spectrum(shortest):
    """∫ k² S df = 5 H² k_p² / 16 · 1/4 E_1(5/4 (f_p/f_c)⁴) for waves longer than that of f_c."""
    spectrum = WaveSpectrum.model(1.0, 5.0)
    k = 2 * np.pi / wavelength(5.0)
    wanted = 5 / 16 * k**2 / 4 * exp1(1.25 / (5.0 * cut_frequency(shortest)) ** 4)
    assert spectrum.slope_variance(shortest) == pytest.approx(wanted, rel=2e-3)


@pytest.mark.parametrize("components", [16, 256])
@pytest.mark.parametrize("seed", [0, 5])
def test_components_have_the_variance_and_the_slopes_of_the_spectrum(components, seed):
    spectrum = WaveSpectrum.model(0.8, 4.0, enhancement=3.3)
    waves = spectrum.waves(seed, shortest=3.0, components=components)
    assert waves.variance == pytest.approx(spectrum.variance(3.0), rel=1e-9)
    slopes = 0.5 * np.sum((waves.amplitude * waves.wavenumber) ** 2)
    assert slopes == pytest.approx(spectrum.slope_variance(3.0), rel=1e-9)
    np.testing.assert_allclose(waves.rate**2, GRAVITY * np.linalg.norm(waves.vector, axis=1))


def test_heights_at_a_place_have_the_spectrum():
    """Periodogram of 41 minutes in bands of a quarter of an octave, some 30 components each.

    Its lines leak into neighbouring bands; that is below 1 % of the variance.
    """
    spectrum = WaveSpectrum.model(1.0, 5.0, enhancement=3.3, heading=0.4)
    waves, rate = spectrum.waves(2, shortest=4.0), 4.0
    time = np.arange(10000) / rate
    height = np.array([waves.height(np.broadcast_to(place, (len(time), 2)), time)
                       for place in np.random.default_rng(1).uniform(-500, 500, (4, 2))])
    power = np.mean(abs(np.fft.rfft(height)) ** 2, 0) * 2 / len(time) ** 2                 # variance of a line
    frequency = np.fft.rfftfreq(len(time), 1 / rate)
    edges = 0.2 * 2.0 ** np.arange(-0.75, 1.26, 0.25)
    fine = np.geomspace(edges[0], edges[-1], 4001)
    density = np.interp(fine, spectrum.frequency, spectrum.density)
    for low, high in zip(edges, edges[1:]):
        found = power[(frequency >= low) & (frequency < high)].sum()
        part = (fine >= low) & (fine <= high)
        assert found == pytest.approx(np.trapezoid(density[part], fine[part]), rel=0.05, abs=0.01 / 16)


def test_heights_are_as_likely_as_a_gaussian_makes_them_and_orbits_are_circles():
    spectrum = WaveSpectrum.model(1.0, 5.0, spreading=4.0)
    waves = spectrum.waves(0, shortest=5.0)
    place = np.random.default_rng(3).uniform(-3000, 3000, (12000, 2))
    moved, velocity = waves.displaced(place, 17.0)
    z = moved[:, 2] / waves.variance**0.5
    assert np.mean(z**2) == pytest.approx(1, abs=0.03)                    # some thousand waves apart
    assert abs(np.mean(z**3)) < 0.08 and np.mean(z**4) == pytest.approx(3, abs=0.25)
    assert np.sum(moved[:, :2] ** 2) == pytest.approx(np.sum(moved[:, 2] ** 2), rel=0.03)
    assert np.sum(velocity[:, :2] ** 2) == pytest.approx(np.sum(velocity[:, 2] ** 2), rel=0.03)


def test_velocities_are_the_rates_of_displacements():
    waves = WaveSpectrum.model(0.8, 4.0).waves(1, shortest=2.0)
    place, step = np.random.default_rng(0).uniform(-50, 50, (20, 2)), 1e-4
    later, earlier = (waves.displaced(place, 8.0 + sign * step)[0] for sign in (1, -1))
    np.testing.assert_allclose((later - earlier) / (2 * step), waves.displaced(place, 8.0)[1], atol=1e-6)


@pytest.mark.parametrize("spreading", [0.0, 2.0, 25.0])
def test_waves_travel_about_their_heading(spreading):
    spectrum = WaveSpectrum.model(0.5, 4.0, heading=1.0, spreading=spreading)
    waves = spectrum.waves(4, components=2000)
    mean = np.mean(np.exp(1j * (waves.heading - 1.0)))
    assert mean == pytest.approx(spreading / (spreading + 1), abs=0.01)


def test_other_seeds_give_other_waves():
    spectrum = WaveSpectrum.model(0.5, 4.0)
    first, second = (spectrum.waves(seed).height([[3.0, 4.0]], [5.0]) for seed in (0, 1))
    assert abs(first - second) > 1e-3


def test_seas_that_cannot_be_are_refused():
    with pytest.raises(ValueError, match="steeper than a sea can be: 1/11"):
        WaveSpectrum.model(1.0, 2.65)
    with pytest.raises(ValueError, match="longer than 100 m"):
        WaveSpectrum.model(0.1, 2.0).waves(shortest=100.0)
    with pytest.raises(ValueError, match="rise from row to row"):
        WaveSpectrum(frequency=np.array([0.2, 0.1]), density=np.array([1.0, 1.0]))
    level = WaveSpectrum(frequency=np.array([0.1, 2.0]), density=np.array([0.05, 0.05]))        # a buoy's noise
    sentence = "longer than 1 m have a mean square slope of 0.49 and would break; give at most 0.12"
    with pytest.raises(ValueError, match=sentence):
        level.waves(shortest=1.0)


def test_a_spectrum_comes_from_a_file(tmp_path):
    path = tmp_path / "buoy.csv"
    path.write_text("frequency_hz,density_m2_hz\n0.1,0\n0.2,0.4\n0.3,0\n")
    spectrum = wave_spectra.read(path, heading=0.3)
    assert spectrum.variance() == pytest.approx(0.04, rel=1e-3) and spectrum.peak_period == 5.0
    assert spectrum.heading == 0.3


@pytest.mark.parametrize("text, message", [
    ("frequency_hz,height\n0.1,0\n0.2,1\n", "no column density_m2_hz"),
    ("frequency_hz,density_m2_hz\n0.1,0\n0.1,1\n", "rise from row to row"),
    ("frequency_hz,density_m2_hz\n0.1,0\n0.2,-1\n", "must be 0 or more"),
    ("frequency_hz,density_m2_hz\n0.4,2\n0.5,2\n", "steeper than a sea can be"),
    ("frequency_hz,density_m2_hz\n0.1,x\n0.2,1\n", "line 2: density_m2_hz is 'x'"),
])
def test_bad_files_of_spectra_are_refused_in_a_sentence(tmp_path, text, message):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=message) as caught:
        wave_spectra.read(path)
    assert "bad.csv" in str(caught.value)
