"""Roughness spectra against their closed forms.

Table: w2 [m^0.75] of TR 9407 Table 2 is given to 7 digits, hence 5e-7. Integrals: quadrature over
ln K, relative 1e-8. Limits K0 -> 0: the first neglected term is (K0/Kc)^(4 - gamma), hence the loose tolerance there.
"""
import numpy as np
import pytest
from scipy.integrate import quad

from mitsonar.seabed.roughness import W2_CM4_TR9407, RoughnessSpectrum, w2_from_cm4


@pytest.mark.parametrize("sediment, w2", [
    ("rough rock", 6.543701e-3), ("rock", 5.888161e-4), ("cobble", 5.059644e-4), ("sandy gravel", 4.091039e-4),
    ("very_coarse_sand", 3.343476e-4), ("muddy sandy gravel", 2.720191e-4), ("Coarse Sand", 2.199997e-4),
    ("gravelly muddy sand", 1.766765e-4), ("medium-sand", 1.405949e-4), ("muddy gravel", 1.106165e-4),
    ("fine sand", 8.585584e-5), ("muddy sand", 6.545915e-5), ("very fine sand", 4.882557e-5),
    ("clayey sand", 3.538589e-5), ("coarse silt", 2.469739e-5), ("sand-silt-clay", 1.638060e-5),
    ("clay", 1.638060e-5),
])
def test_sediment_strengths_in_si(sediment, w2):
    spectrum = RoughnessSpectrum.of_sediment(sediment)
    assert spectrum.w2 == pytest.approx(w2, rel=5e-7)
    assert spectrum.gamma == 3.25


def test_unit_conversion_keeps_the_spectrum():
    # The table's own form: W [cm^4] = w2 (K h0)^-gamma with K in rad/cm and h0 = 1 cm.
    gamma, wavenumber = 3.1, 40.0
    assert w2_from_cm4(0.004, gamma) * wavenumber**-gamma == pytest.approx(0.004 * 1e-8 * (0.01 * wavenumber) ** -gamma)


SPECTRA = [RoughnessSpectrum.of_sediment(name, outer_scale=3.0) for name in ("rough rock", "medium sand", "clay")] + \
    [RoughnessSpectrum(w2=2e-4, gamma=gamma, outer_scale=20.0) for gamma in (2.4, 3.0, 3.7)]


@pytest.mark.parametrize("spectrum", SPECTRA, ids=str)
def test_variance_and_slope_are_integrals_of_the_spectrum(spectrum):
    def moment(power, low, high):
        return quad(lambda k: 2 * np.pi * np.exp((2 + power) * k) * spectrum.at(np.exp(k)), np.log(low), np.log(high),
                    limit=300, epsrel=1e-11)[0]
    assert spectrum.height_variance() == pytest.approx(moment(0, 1e-8, 1e40), rel=1e-8)
    assert spectrum.height_variance(30.0) == pytest.approx(moment(0, 1e-8, 30.0), rel=1e-8)
    assert spectrum.mean_square_slope(30.0) == pytest.approx(moment(2, 1e-8, 30.0), rel=1e-8)


def test_far_above_the_outer_scale_it_is_the_pure_power_law():
    spectrum = RoughnessSpectrum.of_sediment("medium sand", outer_scale=1e9)
    w2, gamma = spectrum.w2, spectrum.gamma
    assert spectrum.at(12.0) == pytest.approx(w2 * 12.0**-gamma, rel=1e-12)
    power_law = 2 * np.pi * w2 * 400 ** (4 - gamma) / (4 - gamma)
    assert spectrum.mean_square_slope(400.0) == pytest.approx(power_law, rel=1e-6)


def test_of_height_has_that_height():
    spectrum = RoughnessSpectrum.of_height(0.03, gamma=3.0, outer_scale=5.0)
    assert spectrum.height_variance() == pytest.approx(0.03**2, rel=1e-12)


@pytest.mark.parametrize("make, said", [
    (lambda: RoughnessSpectrum(w2=-1.0), "w2 is -1.0"),
    (lambda: RoughnessSpectrum(w2=float("nan")), "w2 is nan"),
    (lambda: RoughnessSpectrum(w2=1e-4, gamma=4.0), "gamma is 4.0; it must be between 2 and 4"),
    (lambda: RoughnessSpectrum(w2=1e-4, outer_scale=0.0), "outer_scale is 0.0"),
    (lambda: RoughnessSpectrum.of_height(-0.1), "rms_height is -0.1"),
    (lambda: RoughnessSpectrum.of_sediment("quicksand"), 'no sediment is called "quicksand".*; known are rough rock'),
])
def test_refusals(make, said):
    with pytest.raises(ValueError, match=said):
        make()


def test_table_is_ordered_from_coarse_to_fine():
    strengths = list(W2_CM4_TR9407.values())
    assert strengths == sorted(strengths, reverse=True)
