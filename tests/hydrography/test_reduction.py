"""Soundings from angles and times: against exact eigenrays both ways, and against rays walked in small steps.

The forward problem is solved by another code (`mitsonar.propagation.numpy_rays.eigenrays`, itself checked against
60-digit references, and here against Runge-Kutta steps written in the test), so agreement is limited by rounding: 1e-8
m.
"""
from dataclasses import replace
from time import perf_counter

import numpy as np
import pytest
from sounded_line import ARMS, HEAD, SUMMER, rocking, sounded, swath

from mitsonar.hydrography.reduction.attitude import PlatformMotion
from mitsonar.hydrography.reduction.reduction import Installation, Measured, located
from mitsonar.water import SoundSpeedProfile


def places_of(found):
    return np.stack([found.x, found.y, found.depth], -1)


def test_soundings_lie_where_eigenrays_both_ways_meet(line):
    found = located(line.measured, line.motion, line.installation, line.profile, node=False)
    assert found.found.all()
    np.testing.assert_allclose(places_of(found), line.places, rtol=0, atol=1e-8)
    pose = line.motion.at(line.measured.ping_time)
    np.testing.assert_allclose(np.hypot(found.across_track, found.along_track),
                               np.hypot(*(line.places - pose.place)[..., :2].transpose(2, 0, 1)), atol=1e-8)


def test_arrays_ten_metres_apart_make_no_error():
    motion, far = rocking(np.arange(-1, 3, 0.01)), replace(ARMS, receive_offset=(-8.0, 2.0, 1.0))
    across = np.linspace(-60, 60, 41)
    places = swath(motion, np.full(41, 0.5), across, np.full(41, 3.0), np.full(41, 30.0))
    line = sounded(places, np.full(41, 0.5), motion, far)
    np.testing.assert_allclose(places_of(located(line.measured, motion, far, SUMMER, node=False)), places, atol=1e-8)


def test_arrays_far_apart_in_shallow_water_find_all_soundings():
    # 5 m apart, 7 m over the bed, out to 80 degrees: about one point the two cones often do not even meet.
    rng, motion = np.random.default_rng(0), rocking(np.arange(-1, 12, 0.01))
    far = replace(ARMS, transmit_offset=(2.5, 0.5, 0.3), receive_offset=(-2.5, -0.8, 0.35))
    sent = rng.uniform(0, 9, 500)
    places = swath(motion, sent, rng.uniform(-38, 38, 500), rng.uniform(-3, 3, 500), np.full(500, 12.0))
    line = sounded(places, sent, motion, far)
    np.testing.assert_allclose(places_of(located(line.measured, motion, far, SUMMER, node=False)), places, atol=1e-7)


def test_way_over_ground_while_the_echo_comes_in_may_be_left_out(line):
    # The receiver is 0.13 to 0.3 s at 5.8 m/s further on: half of that, seen from the sounding, moves it.
    stays = located(line.measured, line.motion, line.installation, line.profile, node=False, under_way=False)
    anywhere = replace(line.motion, x=0 * line.motion.x + 7, y=0 * line.motion.y)
    fixed = located(line.measured, anywhere, line.installation, line.profile, node=False)
    for name in ("depth", "across_track", "along_track"):
        np.testing.assert_allclose(getattr(stays, name), getattr(fixed, name), rtol=0, atol=1e-8)
    moved = np.abs(places_of(stays) - line.places).max()
    assert 0.1 < moved < 3


def walked(profile, start, slowness, time, steps=4000):
    """A ray by Runge-Kutta steps of dx/dt = c² q, dz/dt = c √(1 - c² q²): range and depth after a time."""
    h, depth, level = time / steps, start, 0.0

    def rate(z):
        c = profile.at(z)
        return c * np.sqrt(1 - (c * slowness) ** 2), c * c * slowness

    for _ in range(steps):
        a, x = rate(depth)
        b, y = rate(depth + h / 2 * a)
        c, z = rate(depth + h / 2 * b)
        d, w = rate(depth + h * c)
        depth, level = depth + h / 6 * (a + 2 * b + 2 * c + d), level + h / 6 * (x + 2 * y + 2 * z + w)
    return level, depth


@pytest.mark.parametrize("angle", [-1.1, -0.4, 0.0, 0.9])
def test_sonar_at_rest_sounds_where_a_ray_walked_in_small_steps_ends(angle):
    # Steps of 45 mm cross the kinks of the profile without stopping: 1e-6 of a step is what each costs.
    rest = PlatformMotion(time=0.0, x=10, y=20, depth=4.0, roll=0, pitch=0, heading=np.pi / 2)
    measured = Measured(ping_time=0.0, transmit_time=0.0, travel_time=0.24, angle=angle, transmit_angle=0.0,
                        head_sound_speed=1501.0)
    found = located(measured, rest, Installation(), SUMMER, node=False)
    level, depth = walked(SUMMER, 4.0, abs(np.sin(angle)) / 1501.0, 0.12)
    # Heading east, starboard is south.
    assert found.depth == pytest.approx(depth, abs=1e-5)
    assert found.y == pytest.approx(20 - np.sign(angle) * level, abs=1e-5) and found.x == pytest.approx(10, abs=1e-9)
    assert found.across_track == pytest.approx(np.sign(angle) * level, abs=1e-5)


def test_head_speed_is_a_node_from_which_water_is_linear_to_the_next_of_the_cast(line):
    # At rest and level all rays start at 5.3 m, so that one profile can say the same.
    still = rocking(np.array([0.0, 12.0]), still=True)
    arms = Installation(transmit_offset=(0, 0, 0.3), receive_offset=(0, 0, 0.3))
    joined = SoundSpeedProfile(*np.array([[0, 1500], [5, 1502], [5.3, 1480], [11.2, 1490], [20, 1489], [30, 1488],
                                          [50, 1480], [120, 1465]]).T)
    cast = SoundSpeedProfile(*np.array([[0, 1500], [5, 1502], [11.2, 1490], [20, 1489], [30, 1488], [50, 1480],
                                        [120, 1465]]).T)
    with_node = located(line.measured, still, arms, cast, head_speed=1480.0)
    written_out = located(line.measured, still, arms, joined, head_speed=1480.0, node=False)
    np.testing.assert_allclose(places_of(with_node), places_of(written_out), rtol=0, atol=1e-9)
    without = located(line.measured, still, arms, cast, head_speed=1480.0, node=False)
    assert np.abs(without.depth - with_node.depth).max() > 0.05


@pytest.mark.parametrize("tilt, least, most", [(0.0, 0.0, 2e-3), (0.5, 0.1, 2.0)])
def test_level_array_does_not_mind_a_wrong_head_speed_a_tilted_one_does(tilt, least, most):
    # The array measures the slowness along it, sin(steered) / c_h: a level one's is what Snell's law keeps. A tilted
    # one's holds a share of the vertical slowness, too, and that depends on the speed believed at the array. The
    # node reaches 6 cm down here, so that it bends little by itself.
    motion, arms = rocking(np.array([0.0, 12.0]), still=True), Installation(receive_mounting=(tilt, 0.0, 0.0),
                                                                           receive_offset=(0, 0, 0.3),
                                                                           transmit_offset=(0, 0, 0.3))
    sent, across = np.zeros(61), np.linspace(-100, 100, 61)
    places = swath(motion, sent, across, np.zeros(61), np.full(61, 100.0))
    wrong = sounded(places, sent, motion, arms, head=HEAD + 5).measured
    cast = SoundSpeedProfile(np.insert(SUMMER.depth, 2, 5.36), np.insert(SUMMER.sound_speed, 2, SUMMER.at(5.36)))
    np.testing.assert_allclose(places_of(located(wrong, motion, arms, cast, node=False)), places, atol=1e-8)
    moved = np.abs(places_of(located(wrong, motion, arms, cast)) - places).max()
    assert least <= moved <= most


def test_water_of_one_speed_has_no_node_to_join_and_is_taken_as_it_is(line):
    still, uniform = rocking(np.array([0.0, 12.0]), still=True), SoundSpeedProfile.constant(1485.0)
    one, other = (located(line.measured, still, Installation(), uniform, node=node) for node in (True, False))
    np.testing.assert_allclose(places_of(one), places_of(other), rtol=0, atol=1e-9)


def test_beams_look_up_and_turned_rays_are_no_soundings():
    deep = PlatformMotion(time=0.0, x=0, y=0, depth=60.0, roll=0.9, pitch=0, heading=0)
    angles = np.array([-1.2, 1.2])                # port side up: from the vertical, -1.2 - 0.9 and 1.2 - 0.9 rad
    measured = Measured(ping_time=0.0, transmit_time=0.0, travel_time=0.04, angle=angles, transmit_angle=0.0,
                        head_sound_speed=1470.0)
    found = located(measured, deep, Installation(), SUMMER, node=False)
    assert found.depth[0] < 50 and found.depth[1] > 80 and found.across_track[0] < 0 < found.across_track[1]
    duct = SoundSpeedProfile([0, 200], [1450, 1650])
    level = Measured(ping_time=0.0, transmit_time=0.0, travel_time=0.6, angle=np.array([0.2, 1.45]),
                     transmit_angle=0.0, head_sound_speed=1450.0)
    found = located(level, replace(deep, depth=np.array([1.0]), roll=np.array([0.0])), Installation(), duct)
    assert found.found.tolist() == [True, False]


def test_cones_that_do_not_meet_and_missing_numbers_are_no_soundings():
    rest = PlatformMotion(time=0.0, x=0, y=0, depth=2.0, roll=0, pitch=0, heading=0)
    measured = Measured(ping_time=0.0, transmit_time=0.0, travel_time=[0.1, 0.1, np.nan], angle=[1.3, 0.2, 0.2],
                        transmit_angle=[1.3, 0.1, 0.1], head_sound_speed=1500.0)
    assert located(measured, rest, Installation(), SUMMER).found.tolist() == [False, True, False]


def test_interpolated_motion_errs_as_splines_do():
    # 5/384 d^4 ω^4 A: 5 degrees in 6 s at 10 Hz err by 1.4e-7 rad, 0.02 mm at 140 m; straight lines by 17 mm.
    time, omega = np.arange(-2, 30, 0.1), 2 * np.pi / 6
    swing = np.radians(5) * np.sin(omega * time)
    motion = PlatformMotion(time=time, x=0 * time, y=0 * time, depth=0 * time, roll=swing, pitch=0 * time,
                    heading=(6.2 + 0.1 * time) % (2 * np.pi))
    asked = np.linspace(0, 28, 5001)
    error = np.abs(motion.at(asked).roll - np.radians(5) * np.sin(omega * asked)).max()
    assert error < 1.1 * 5 / 384 * (0.1 * omega) ** 4 * np.radians(5)
    np.testing.assert_allclose(np.cos(motion.at(asked).heading), np.cos(6.2 + 0.1 * asked), atol=1e-9)


def test_motion_of_a_long_line_is_joined_once():
    # An hour at 100 Hz, asked for ping by ping: the first question takes some 0.2 s, a later one microseconds.
    time = np.arange(0, 3600, 0.01)
    motion = PlatformMotion(**dict.fromkeys(("time", "x", "y", "depth", "roll", "pitch", "heading"), time))
    motion.at(np.array([1.0]))
    start = perf_counter()
    for ping in range(20):
        assert motion.at(np.full(512, 100.0 + ping)).roll[0] == pytest.approx(100.0 + ping)
    assert perf_counter() - start < 0.5


@pytest.mark.parametrize("change, message", [
    (dict(roll=[0.0, np.nan]), r"roll\[1\] is nan"), (dict(time=[1.0, 1.0]), "does not follow"),
    (dict(heading=[0.0]), "heading has the shape")])
def test_motion_is_refused(change, message):
    good = {name: np.arange(2.0) for name in ("time", "x", "y", "depth", "roll", "pitch", "heading")}
    with pytest.raises(ValueError, match=message):
        PlatformMotion(**{**good, **change})
