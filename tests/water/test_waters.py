"""Water of a survey's pings: columns that change on the way, and what holds for all pings."""
import numpy as np
import pytest

from mitsonar.water import SoundSpeedProfile
from mitsonar.water.column import AbsorptionColumn
from mitsonar.water.volume import VolumeScattering
from mitsonar.water.waters import WaterColumn
from tests.inputs.changing_surroundings import two_waters

FAST = WaterColumn(profile=SoundSpeedProfile([0.0, 30.0], [1520.0, 1500.0]), absorption=AbsorptionColumn(0.0, 0.02))
SLOW = WaterColumn(profile=SoundSpeedProfile([0.0, 30.0], [1500.0, 1480.0]), absorption=AbsorptionColumn(0.0, 0.01),
                   volume=VolumeScattering([0.0], [-70.0]))
TWO = two_waters(FAST, SLOW, change=3, pings=10)


def test_a_ping_has_the_water_of_its_own():
    assert [TWO.at(ping) for ping in (0, 2, 3, 9)] == [FAST, FAST, SLOW, SLOW]
    assert (TWO.sound_speed(2, 15.0), TWO.sound_speed(3, 15.0)) == (1510.0, 1490.0)
    assert TWO.first is FAST


def test_the_water_within_a_ping_is_the_only_one():
    assert TWO.within(3).only is SLOW and TWO.within(0).only is FAST
    single = TWO.within(3)
    assert single.within(0) is single
    np.testing.assert_array_equal(single.number(np.arange(4)), np.zeros(4))


def test_windows_and_units_take_the_extremes_of_all_pings():
    assert (TWO.slowest, TWO.fastest, TWO.least_absorption_db) == (1480.0, 1520.0, 0.01)
    assert TWO.scatter and not TWO.within(0).scatter


def test_one_water_for_all_is_refused_where_pings_differ():
    with pytest.raises(ValueError, match="one water was asked for, but the survey's pings have 2"):
        TWO.only.profile


def test_mixed_water_lies_between_and_is_that_of_an_end_at_its_end():
    assert FAST.mixed(SLOW, 0.0) is FAST and FAST.mixed(SLOW, 1.0) is SLOW
    middle = FAST.mixed(SLOW, 0.25)
    np.testing.assert_allclose(middle.profile.at(np.array([0.0, 12.0, 30.0])), [1515.0, 1507.0, 1495.0])
    assert middle.absorption.at(5.0) == pytest.approx(0.0175)
