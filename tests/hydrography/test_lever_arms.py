"""Lever arms, latencies and heights of a vessel that rocks: errors of the motion sensors against closed forms.

The reference point is at P with the attitude R; e is a stated arm less the true one. A wrong arm of the antenna moves
the place by -R e and the height by +(R e)_down. One of the motion sensor adds the induced heave (e - R e)_down, that is
e sin(pitch) for an arm ahead and -e cos(pitch) sin(roll) to starboard. A position that is L old lags v L behind.
All are exact, so that the tolerance is that of float64 sums, 1e-12 m.
"""
from dataclasses import replace

import numpy as np
import pytest
from sounded_line import ARMS, rocking, sounded, swath

from mitsonar.device.rotations import mounting_matrix
from mitsonar.hydrography.reduction.errors import Reduction, errors
from mitsonar.hydrography.reduction.motion_errors import MotionErrors
from mitsonar.water import SoundSpeedProfile

TIME = np.arange(-1, 12, 0.01)
TRUE = rocking(TIME)
DOWN = np.stack([TRUE.y, TRUE.x, TRUE.depth], -1)                   # north, east, down


def earlier(age):
    return replace(rocking(TIME - age), time=TIME)


def turned(arm, motion=TRUE):
    """A vector of the body in north, east, down, by the matrices of every sample."""
    return mounting_matrix(motion.roll, motion.pitch, motion.heading) @ np.asarray(arm, float)


def sensed(**wrong):
    made = MotionErrors(**wrong)
    return made.sensed(earlier(made.latency), earlier(made.position_latency), 1)


def test_sensors_without_errors_give_the_motion():
    found = sensed()
    for name in ("x", "y", "depth", "roll", "pitch", "heading"):
        np.testing.assert_array_equal(getattr(found.motion, name), getattr(TRUE, name))
    np.testing.assert_array_equal(found.rise, -TRUE.depth)


@pytest.mark.parametrize("arm", [(3.0, 0.0, 0.0), (0.0, 2.0, 0.0), (1.0, -2.0, -8.0)])
def test_a_wrong_arm_of_the_antenna_moves_place_and_height(arm):
    found, off = sensed(antenna=(5, 1, -9), antenna_error=arm), -turned(arm)
    np.testing.assert_allclose(found.motion.y - TRUE.y, off[:, 0], atol=1e-12)
    np.testing.assert_allclose(found.motion.x - TRUE.x, off[:, 1], atol=1e-12)
    np.testing.assert_allclose(found.rise + TRUE.depth, -off[:, 2], atol=1e-12)
    np.testing.assert_array_equal(found.motion.depth, TRUE.depth)


def test_a_right_arm_of_the_antenna_under_a_wrong_heading_moves_the_place_aside():
    """e = 0, and R' turned by δ: P' - P = R a - R' a, δ a to port of an antenna a ahead."""
    found = sensed(antenna=(10, 0, 0), heading_bias=0.01)
    off = turned((10, 0, 0)) - turned((10, 0, 0), replace(TRUE, heading=TRUE.heading + 0.01))
    np.testing.assert_allclose(np.stack([found.motion.y - TRUE.y, found.motion.x - TRUE.x], -1), off[:, :2], atol=1e-12)
    np.testing.assert_allclose(np.hypot(*off[:, :2].T), 0.1 * np.cos(TRUE.pitch), rtol=1e-4)


def test_a_wrong_arm_of_the_motion_sensor_induces_heave():
    for arm, heave in (((4.0, 0, 0), 4.0 * np.sin(TRUE.pitch)),
                       ((0, 3.0, 0), -3.0 * np.cos(TRUE.pitch) * np.sin(TRUE.roll)),
                       ((0, 0, 5.0), 5.0 * (1 - np.cos(TRUE.pitch) * np.cos(TRUE.roll)))):
        found = sensed(motion_sensor=(2, 1, 3), motion_sensor_error=arm)
        np.testing.assert_allclose(found.motion.depth - TRUE.depth, heave, atol=1e-12)
        np.testing.assert_array_equal(found.rise, -TRUE.depth)


def test_positions_that_are_late_lag_by_speed_times_age():
    found = sensed(position_latency=0.4)
    np.testing.assert_allclose(found.motion.x, TRUE.x - 3 * 0.4, atol=1e-12)
    np.testing.assert_allclose(found.motion.y, TRUE.y - 5 * 0.4, atol=1e-12)
    np.testing.assert_allclose(found.rise, -(5 + 0.5 * np.sin(TIME - 0.4)), atol=1e-12)
    np.testing.assert_array_equal(found.motion.roll, TRUE.roll)
    late = sensed(latency=0.4)
    np.testing.assert_array_equal(late.motion.x, TRUE.x)
    np.testing.assert_allclose(late.motion.roll, 0.1 * np.sin(1.3 * (TIME - 0.4)), atol=1e-12)


# ---- soundings: the sum of causes closes, and each is that of its arm

DEPTH = 90.0


@pytest.fixture(scope="module")
def line():
    sent = np.repeat(np.arange(10.0)[:, None], 31, 1)
    across = np.broadcast_to(np.linspace(-100, 100, 31), sent.shape)
    return sounded(swath(TRUE, sent, across, 0 * across, np.full(sent.shape, DEPTH)), sent, TRUE)


def flat(x, y):
    return np.full(np.shape(x), DEPTH)


def slope(x, y):
    return 80 + 0.1 * x + 0.05 * y


def reduced(line, bed, motion=TRUE, installation=ARMS, **last):
    truth = Reduction(motion=TRUE, installation=line.installation, profile=line.profile, node=False)
    used = replace(truth, motion=motion, installation=installation)
    return errors(line.measured, truth, used, bed, **{name: replace(used, motion=one) for name, one in last.items()})


def test_a_wrong_arm_of_the_sonar_moves_soundings_by_itself():
    """In water of one speed a sounding moves by the mean of R e at transmission and at reception, as both legs are of
    one length; what is left is a part of the turn between them, 0.023 at the outer beams, of an arm of 1.2 m: 1 cm."""
    sent = np.repeat(np.arange(10.0)[:, None], 31, 1)
    across = np.broadcast_to(np.linspace(-100, 100, 31), sent.shape)
    line = sounded(swath(TRUE, sent, across, 0 * across, np.full(sent.shape, DEPTH)), sent, TRUE,
                   profile=SoundSpeedProfile.constant(1490.0), head=1490.0)
    e = np.array([1.0, -0.5, 0.3])
    moved = replace(ARMS, transmit_offset=np.add(ARMS.transmit_offset, e),
                    receive_offset=np.add(ARMS.receive_offset, e))
    places, found = reduced(line, flat, installation=moved)
    north, east, down = np.moveaxis(np.mean([turned(e, TRUE.at(sent + part * line.measured.travel_time))
                                             for part in (0, 1)], 0), -1, 0)
    np.testing.assert_allclose(found.error_motion, down, atol=0.01)
    np.testing.assert_allclose(places.x - line.places[..., 0], east, atol=0.01)
    np.testing.assert_allclose(places.y - line.places[..., 1], north, atol=0.01)


@pytest.mark.parametrize("cause", ["tidal", "separated"])
def test_a_wrong_level_is_an_error_of_its_own_and_the_sum_closes(line, cause):
    """Depths that are all 0.25 m too deep: 0.25 m more, less what refraction makes of it, 2 mm."""
    induced = sensed(motion_sensor_error=(4, 0, 0), antenna_error=(1, 0, 0)).motion
    lower = replace(induced, depth=induced.depth + 0.25)
    places, found = reduced(line, slope, motion=induced, **{cause: lower})
    own, other = ("error_tide", "error_separation")[::1 if cause == "tidal" else -1]
    assert getattr(found, other) is None
    np.testing.assert_allclose(getattr(found, own), 0.25, atol=0.02)
    total = found.error_detection + found.error_refraction + found.error_motion + getattr(found, own)
    np.testing.assert_allclose(total, places.depth - slope(places.x, places.y), rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.error, total, rtol=0, atol=1e-12)
