"""What a wrong profile does to the depths of a swath: closed forms where the water has one speed, and signs.

With c true and c' used, both constant, Snell's law at the head (p = sin θ / c is right) gives the depth

    d' = d (c' / c) sqrt(1 - (c' sin θ / c)²) / cos θ

Rays are exact. The head's own speed is right, and c' begins at the next node: here 1 cm below, which costs 3e-4 of it.
"""
import numpy as np
import pytest

from mitsonar.hydrography.reduction.attitude import PlatformMotion
from mitsonar.hydrography.reduction.legs import Starts
from mitsonar.hydrography.reduction.reduction import Installation, Measured, located
from mitsonar.hydrography.survey_orders import ORDERS, survey_order, vertical_orders
from mitsonar.planning.uncertainty.cast_errors import cast_error, depth_error, surface_layer_error
from mitsonar.water import SoundSpeedProfile

ANGLES = np.deg2rad(np.linspace(0, 65, 14))


def one_speed(c):
    """A cast of one sound speed that begins right below the head."""
    return SoundSpeedProfile([0, 0.01], [c, c])


@pytest.mark.parametrize("error", [-5.0, 2.0])
def test_error_of_one_sound_speed_for_another(error, c=1500.0, depth=40.0):
    found = depth_error(SoundSpeedProfile.constant(c), one_speed(c + error), 0.0, depth, ANGLES)
    ratio = (c + error) / c
    wanted = depth * (ratio * np.sqrt(1 - (ratio * np.sin(ANGLES)) ** 2) / np.cos(ANGLES) - 1)
    np.testing.assert_allclose(found, wanted, atol=5e-4 * np.abs(wanted).max())
    # too fast a cast: too deep at nadir, too shoal outside
    assert found[0] * error > 0 > found[-1] * error


def test_errors_are_those_that_the_reduction_of_soundings_makes():
    true = SoundSpeedProfile([0, 8, 20, 40], [1513.2, 1511.6, 1494.2, 1492.2])
    used = SoundSpeedProfile([0, 3, 9, 40], [1515.0, 1514.0, 1508.0, 1493.0])
    water = Starts(profile=true, depth=np.full(ANGLES.shape, 2.0))
    time = water.to_depth(np.sin(ANGLES) / true.at(2.0), np.full(ANGLES.shape, 50.0)).time
    rest = PlatformMotion(time=0.0, x=0.0, y=0.0, depth=2.0, roll=0.0, pitch=0.0, heading=0.0)
    measured = Measured(ping_time=0.0, transmit_time=0.0, travel_time=2 * time, angle=ANGLES, transmit_angle=0.0,
                        head_sound_speed=true.at(2.0))
    found = located(measured, rest, Installation(), used)
    np.testing.assert_allclose(depth_error(true, used, 2.0, 50.0, ANGLES), found.depth - 50, atol=1e-8)


def test_right_profile_makes_no_error():
    summer = SoundSpeedProfile([0, 8, 20, 40], [1513.2, 1511.6, 1494.2, 1492.2])
    np.testing.assert_allclose(depth_error(summer, summer, 3.0, 50.0, ANGLES), 0, atol=1e-9)


def test_error_of_a_surface_layer_ends_with_the_layer():
    profile = surface_layer_error(SoundSpeedProfile([0, 30], [1500, 1490]), 2.0, 10.0)
    np.testing.assert_allclose(profile.at(np.array([0.0, 5.0, 10.0])) - np.interp([0, 5, 10], [0, 30], [1500, 1490]), 2)
    np.testing.assert_allclose(profile.at(np.array([10.02, 40.0])) - np.interp([10.02, 40], [0, 30], [1500, 1490]), 0,
                               atol=1e-9)


def test_error_grows_in_proportion_to_the_layer_and_to_its_error():
    true = SoundSpeedProfile.constant(1500.0)
    small, twice, deeper = (depth_error(true, surface_layer_error(true, error, layer), 0.0, 60.0, ANGLES)
                            for error, layer in ((0.01, 5.0), (0.02, 5.0), (0.01, 10.0)))
    # of first order; the second is 1e-5 of it here. The layer's first metre has half of the error, its edge too
    np.testing.assert_allclose(twice, 2 * small, rtol=1e-3, atol=1e-8)
    np.testing.assert_allclose(deeper, 9.505 / 4.505 * small, rtol=1e-3, atol=1e-8)


def test_lost_beams_are_no_number():
    true, used = SoundSpeedProfile.constant(1400.0), SoundSpeedProfile([0, 28, 30], [1400, 1400, 1700])
    found = cast_error(true, used, 0.0, 30.0, np.deg2rad(65), ORDERS["1a"])
    assert np.isnan(found.outer) and np.isfinite(found.error[0]) and 0 < found.good_angle < np.deg2rad(65)


def test_swath_is_good_up_to_where_the_error_meets_the_order():
    true, used = SoundSpeedProfile.constant(1500.0), one_speed(1510.0)
    order = ORDERS["1a"]
    found = cast_error(true, used, 0.0, 40.0, np.deg2rad(70), order)
    assert abs(found.outer) > found.allowed
    edge = depth_error(true, used, 0.0, 40.0, np.array([found.good_angle]))
    assert abs(edge[0]) == pytest.approx(order.vertical(40.0), rel=0.02)                  # by a line between angles


@pytest.mark.parametrize("name, depth, vertical", [("exclusive", 0.0, 0.15), ("special", 40.0, 0.39051),
                                                   ("1a", 100.0, 1.39284), ("2", 1000.0, 23.02173),
                                                   ("exclusive", 10.0, 0.16771), ("special", 100.0, 0.79057),
                                                   ("1b", 50.0, 0.82006), ("2", 200.0, 4.70744)])
def test_orders_allow_what_s_44_says(name, depth, vertical):
    assert survey_order(name).vertical(depth) == pytest.approx(vertical, abs=1e-5)


def test_orders_of_one_vertical_limit_are_drawn_once():
    limits = vertical_orders()
    assert list(limits) == ["exclusive", "special", "1a, 1b", "2"] and limits["1a, 1b"] is ORDERS["1a"]


def test_an_order_that_is_none_is_refused():
    with pytest.raises(ValueError, match="no order '3'; choose one of exclusive, special, 1a, 1b, 2"):
        survey_order("3")
