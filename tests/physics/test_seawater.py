"""Sound speed of seawater against TEOS-10's own numbers and the other two common formulas.

The column `exact` was computed by the reference code of TEOS-10 at 45 N 20 W and printed to 1e-5 m/s: tolerance 6e-6.
The column `chen_millero` is another standard altogether; the two differ by up to 0.28 m/s at 1000 m, so 0.3 m/s only
guards against a wrong unit.
"""
import numpy as np
import pytest

from mitsonar.water import sound_speed

TEMPERATURE, SALINITY, DEPTH, EXACT, CHEN_MILLERO = np.transpose([
    (10, 35, 0, 1489.78863, 1489.83212),
    (10, 35, 50, 1490.60958, 1490.66208),
    (15, 35, 20, 1507.00371, 1507.01051),
    (4, 35, 1000, 1482.98378, 1483.25596),
    (20, 30, 5, 1515.94989, 1515.97919),
    (8, 0, 5, 1439.23023, 1439.22061),
    (25, 38, 50, 1538.43433, 1538.49333),
])


def test_agrees_with_teos_10():
    np.testing.assert_allclose(sound_speed(TEMPERATURE, SALINITY, DEPTH), EXACT, rtol=0, atol=6e-6)


def test_stays_near_the_older_standard():
    np.testing.assert_allclose(sound_speed(TEMPERATURE, SALINITY, DEPTH), CHEN_MILLERO, rtol=0, atol=0.3)


def test_arguments_broadcast():
    assert sound_speed([[5], [10]], 35, [0, 50, 100], latitude=60, longitude=20).shape == (2, 3)


def test_position_matters_little():
    here, there = sound_speed(10, 35, 100), sound_speed(10, 35, 100, latitude=-10, longitude=150)
    assert 0 < abs(here - there) < 0.1


@pytest.mark.parametrize("name, value", [("temperature", 50), ("salinity", -1), ("salinity", np.nan),
                                         ("depth", 2e4), ("latitude", 91)])
def test_nonsense_is_refused_by_name(name, value):
    with pytest.raises(ValueError, match=name):
        sound_speed(**{"temperature": 10, "salinity": 35, "depth": 0, name: value})
