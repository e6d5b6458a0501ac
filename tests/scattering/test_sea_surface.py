"""The law of the sea surface against what is known of it without it.

Closed form: in backscatter the formulas of TR 9407, whose numbers `test_checkpoints` walks; beyond, the integral of σ
over the hemisphere, which energy and the loss to bubbles bound. The integral's rule is a midpoint one in the grazing
angle and the square root of azimuth, 250 x 500 points: 1e-3 from 2 degrees up, found by doubling it.
"""
import numpy as np
import pytest
from exhaustive import thinned

from mitsonar.scattering import SeaSurface, backscatter_strength_db, bistatic_strength_db, bubble_loss_db
from mitsonar.scattering.laws.sea_surface import facet_density, roughness

WINDS = [0.5, 2.0, 5.0, 8.0, 11.0, 15.0, 25.0]
FREQUENCIES = [10e3, 30e3, 100e3, 400e3]
ANGLES = np.radians([0.01, 1.0, 4.0, 15.0, 45.0, 80.0, 90.0])


def hemisphere(steps=250):
    """Grazing angle and azimuth of directions, and their solid angles (for azimuths of both signs)."""
    grazing = (np.arange(steps) + 0.5) / steps * np.pi / 2
    root = (np.arange(2 * steps) + 0.5) / (2 * steps)
    grazing, root = np.meshgrid(grazing, root, indexing="ij")
    solid_angle = np.cos(grazing) * (np.pi / 2 / steps) * 2 * np.pi * 2 * root / (2 * steps)
    return grazing, np.pi * root**2, solid_angle


def albedo(wind, angle, frequency):
    grazing, azimuth, solid_angle = hemisphere()
    law = SeaSurface(wind_speed=wind)
    return (law.scattering_strength(angle, grazing, azimuth, frequency, 1500.0) * solid_angle).sum() / np.sin(angle)


@pytest.mark.parametrize("wind", WINDS)
def test_reciprocal_finite_and_not_negative(wind):
    i, s, azimuth, f = np.meshgrid(ANGLES, ANGLES, np.radians([0, 1, 30, 179, 180]), FREQUENCIES)
    law = SeaSurface(wind_speed=wind)
    there, back = law.scattering_strength(i, s, azimuth, f, 1500.0), law.scattering_strength(s, i, azimuth, f, 1500.0)
    assert np.isfinite(there).all() and (there >= 0).all()
    np.testing.assert_allclose(there, back, rtol=1e-12)


@pytest.mark.parametrize("wind", thinned(WINDS, 0.5, 8.0, 25.0))
def test_scatters_no_more_than_it_receives(wind):
    for frequency in FREQUENCIES:
        for angle in np.radians([0.5, 2.0, 5.0, 10.0, 20.0, 45.0, 70.0, 90.0]):
            assert albedo(wind, angle, frequency) < 1.0


@pytest.mark.parametrize("wind", [3.0, 5.0, 10.0, 15.0])
def test_forward_lobe_carries_what_bubbles_leave(wind):
    """What goes on from 20 degrees up is 10^(-SBL/10), less the tails that TR 9407's blend takes from the facets
    (0.4 dB) and more what bubbles scatter (0.2 dB)."""
    for angle in np.radians([20.0, 45.0, 70.0]):
        assert abs(10 * np.log10(albedo(wind, angle, 30e3)) + bubble_loss_db(angle, 30e3, wind)) < 0.5


def test_forward_lobe_is_where_a_mirror_sends_sound():
    grazing, azimuth = np.radians(np.meshgrid(np.arange(1, 90), np.arange(0, 180)))
    sigma = bistatic_strength_db("sea_surface", np.radians(40), grazing, azimuth, 60e3, wind_speed=6)
    place = np.unravel_index(np.argmax(sigma), sigma.shape)
    assert azimuth[place] == 0 and abs(np.degrees(grazing[place]) - 40) < 2


def test_facets_at_the_vertical_follow_from_their_slopes():
    """At 90 degrees and low loss σ = 1/(4π s²), whatever the frequency; 0.01 dB is left for ripples, bubbles, blend."""
    variance = roughness(4.0).slope_variance
    level = backscatter_strength_db("sea_surface", np.pi / 2, 10e3, wind_speed=4)
    assert level + bubble_loss_db(np.pi / 2, 10e3, 4.0) == pytest.approx(-10 * np.log10(4 * np.pi * variance), abs=0.01)


def test_two_ways_by_the_mirror_add_in_pressure_near_backscatter_only():
    """A thin layer of bubbles: of four ways two add in pressure, 6 to 4 or 1.76 dB; ripples take 0.06 dB of it."""
    turn = np.radians([180.0, 170.0])
    level = bistatic_strength_db("sea_surface", np.radians(20), np.radians(20), turn, 100e3, wind_speed=3)
    assert level[0] - level[1] == pytest.approx(10 * np.log10(6 / 4), abs=0.1)


@pytest.mark.parametrize("angle", [6.0, 25.0, 70.0])
def test_density_of_drawn_facets_is_that_of_directions_above_the_surface(angle):
    """Its integral is the share of slopes that throw sound up: Monte-Carlo over a million slopes, 0.002."""
    variance, angle = 0.02, np.radians(angle)
    grazing, azimuth, solid_angle = hemisphere(1000)
    wi = -np.cos(angle), 0.0, np.sin(angle)
    wo = np.cos(grazing) * np.cos(azimuth), np.cos(grazing) * np.sin(azimuth), np.sin(grazing)
    integral = (facet_density(None, variance, wi, wo) * solid_angle).sum()
    x, y = np.random.default_rng(3).normal(0, np.sqrt(variance / 2), (2, 1_000_000))
    twice = 2 * (-x * wi[0] + wi[2]) / (1 + x * x + y * y)
    assert integral == pytest.approx((twice - wi[2] > 0).mean(), abs=0.002)


def test_no_wind_scatters_nothing():
    assert backscatter_strength_db("sea_surface", 0.5, 30e3, wind_speed=0) == -np.inf


@pytest.mark.parametrize("wind", [-1, 61, np.nan])
def test_wind_out_of_range_is_refused(wind):
    with pytest.raises(ValueError, match="wind_speed is .* 0..60 m/s"):
        SeaSurface(wind_speed=wind)
