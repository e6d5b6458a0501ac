"""What every scattering law must obey, whatever it says: tests over the table of laws.

σ(θ_i, θ_s) is reciprocal; the scattered power ∫ σ dΩ_s / sin θ_i stays below the incident one; nothing is infinite.
"""
import numpy as np
import pytest

from mitsonar.scattering import LAWS, lambert

STRONGEST = {"lambert": (lambert.STRONGEST,)}          # the parameters at which a law scatters most


@pytest.fixture(params=LAWS)
def law(request):
    parameters = STRONGEST[request.param]
    return lambda sin_i, sin_s: LAWS[request.param].scattering_strength(*parameters, sin_i, sin_s)


SINES = np.sin(np.radians([0.0, 0.1, 1.0, 5.0, 20.0, 45.0, 70.0, 90.0]))


def test_reciprocal(law):
    i, s = np.meshgrid(SINES, SINES)
    np.testing.assert_allclose(law(i, s), law(s, i), rtol=1e-12)


def test_finite_and_not_negative(law):
    i, s = np.meshgrid(SINES, SINES)
    assert np.isfinite(law(i, s)).all()
    assert (law(i, s) >= 0).all()


def test_scatters_no_more_than_it_receives(law):
    """Integral over the hemisphere in u = sin θ_s, dΩ = 2π du, midpoint rule (1e-7 for a smooth law)."""
    u = (np.arange(4000) + 0.5) / 4000
    for sin_i in SINES[1:]:
        assert 2 * np.pi * law(sin_i, u).mean() / sin_i <= 1 + 1e-6


def test_lambert_backscatter_in_decibels():
    """S_b = 10 log μ + 20 log sin θ: numbers at -27 dB (Mackenzie 1961) and -15 dB, to the digits printed."""
    for mu_db, angle, expected in ((-27, 10, -42.20660), (-27, 30, -33.02060), (-27, 60, -28.24939), (-15, 20,
    -24.31897)):
        sine = np.sin(np.radians(angle))
        found = 10 * np.log10(lambert.scattering_strength(10 ** (mu_db / 10), sine, sine))
        assert found == pytest.approx(expected, abs=5e-6)
