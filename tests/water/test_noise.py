"""Ambient and thermal noise levels against an independent implementation of the same formulas.

Bias: none; the table is printed to 1e-4 dB, so 6e-5 dB. Thermal values carry six decimals: 1e-6 dB.
"""
import numpy as np
import pytest

from mitsonar.water import ambient_noise_db, noise_components_db, thermal_noise_db

FREQUENCIES = np.array([10, 30, 100, 300, 500]) * 1e3
AMBIENT = {  # wind [m/s]: level at the five frequencies, shipping 0.5
    0: [29.3547, 21.2689, 25.1331, 34.5441, 38.9796],
    5: [46.0899, 37.0227, 28.9437, 34.6219, 38.9898],
    10: [53.0359, 43.9496, 34.2035, 34.9222, 39.0306],
}


@pytest.mark.parametrize("wind_speed", AMBIENT)
def test_ambient_noise_agrees_with_an_independent_implementation(wind_speed):
    np.testing.assert_allclose(ambient_noise_db(FREQUENCIES, wind_speed, 0.5), AMBIENT[wind_speed], rtol=0, atol=6e-5)


@pytest.mark.parametrize("frequency, level", [(1e3, -14.636762), (1e5, 25.363238), (5e5, 39.342638)])
def test_thermal_noise_agrees_with_an_independent_implementation(frequency, level):
    assert thermal_noise_db(frequency, 290 - 273.15, 1500, 1025) == pytest.approx(level, abs=1e-6)


def test_thermal_noise_rises_six_decibels_an_octave():
    assert thermal_noise_db(4e5) - thermal_noise_db(2e5) == pytest.approx(20 * np.log10(2), abs=1e-12)


def test_wind_and_shipping_only_add():
    assert ambient_noise_db(3e4, 10) > ambient_noise_db(3e4, 5)
    assert ambient_noise_db(100, 5, 1) > ambient_noise_db(100, 5, 0)


def test_components_take_over_from_each_other_as_frequency_rises():
    """Turbulence, shipping, wind and heat each rule a band (Wenz 1962)."""
    levels = noise_components_db([5.0, 100.0, 1e4, 5e5], wind_speed=5.0, shipping=0.5)
    names = list(levels)
    assert [names[i] for i in np.argmax(list(levels.values()), axis=0)] == ["turbulence", "shipping", "wind", "thermal"]


def test_arguments_broadcast():
    assert ambient_noise_db(FREQUENCIES[:, None], [0, 5, 10]).shape == (5, 3)
    assert thermal_noise_db(FREQUENCIES[:, None], [0, 5, 10], [1450, 1470, 1490]).shape == (5, 3)


@pytest.mark.parametrize("level", [ambient_noise_db, thermal_noise_db])
@pytest.mark.parametrize("frequency", [0, -1, np.nan])
def test_frequency_must_be_above_zero(level, frequency):
    with pytest.raises(ValueError, match="frequency"):
        level(frequency)


def test_impossible_weather_is_refused_by_name():
    with pytest.raises(ValueError, match="wind_speed"):
        ambient_noise_db(1e5, -1)
    with pytest.raises(ValueError, match="shipping"):
        ambient_noise_db(1e5, 5, 2)
