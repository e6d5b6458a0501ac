"""The track: directions of the rotated body, interpolation, and what is refused.

Closed forms: the body's axes at right angles; small turns about one axis; scipy's intrinsic z-y-x rotation as an
independent product. Tolerance 1e-14: a few roundings of products of sines. Interpolation of straight motion is exact
but for rounding (1e-12 of the values).
"""
import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mitsonar.sonar.motion.track import Track

EAST, NORTH, UP = np.eye(3)
RIGHT = np.pi / 2


def one_ping(*, roll=0.0, pitch=0.0, heading=0.0):
    return Track(time=[0], position=[[0, 0, -5]], roll=roll, pitch=pitch, heading=heading)


@pytest.mark.parametrize(("attitude", "forward", "starboard", "down"), [
    ({}, NORTH, EAST, -UP),
    ({"heading": RIGHT}, EAST, -NORTH, -UP),
    ({"heading": 2 * RIGHT}, -NORTH, -EAST, -UP),
    ({"pitch": RIGHT}, UP, EAST, NORTH),
    ({"roll": RIGHT}, NORTH, -UP, -EAST),
    ({"heading": RIGHT, "roll": RIGHT}, EAST, -UP, NORTH),
])
def test_axes_of_the_body_in_the_scene(attitude, forward, starboard, down):
    rotation = one_ping(**attitude).rotation()
    assert rotation.shape == (1, 3, 3) and rotation.dtype == np.float64
    np.testing.assert_allclose(rotation[0].T, [forward, starboard, down], atol=1e-14)


@pytest.mark.parametrize("heading", [0.0, 1.0, 4.0])
def test_signs_of_small_turns(heading):
    """Roll lowers the starboard side, pitch lifts the nose, heading turns the nose towards starboard."""
    level = one_ping(heading=heading).rotation()[0]
    assert one_ping(heading=heading, roll=0.1).rotation()[0, 2, 1] == pytest.approx(-np.sin(0.1), abs=1e-14)
    assert one_ping(heading=heading, pitch=0.1).rotation()[0, 2, 0] == pytest.approx(np.sin(0.1), abs=1e-14)
    turned = one_ping(heading=heading + 0.1).rotation()[0, :, 0]
    assert turned @ level[:, 1] == pytest.approx(np.sin(0.1), abs=1e-14)


def test_rotation_is_the_zyx_product():
    rng = np.random.default_rng(0)
    roll, pitch, heading = rng.uniform(-1, 1, (3, 50)) * np.array([[3], [1.5], [9]])
    track = Track(time=np.arange(50), position=np.zeros((50, 3)), roll=roll, pitch=pitch, heading=heading)
    north_east_down = Rotation.from_euler("ZYX", np.c_[heading, pitch, roll]).as_matrix()
    enu = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
    np.testing.assert_allclose(track.rotation(), enu @ north_east_down, atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(track.rotation()), 1, atol=1e-14)


def test_straight_track():
    track = Track.straight(start=[10, 20, -3], heading=RIGHT / 3, speed=2.0, interval=0.25, pings=9, roll=0.02)
    assert track.pings == 9 and track.time[-1] == 2.0
    np.testing.assert_allclose(track.position[-1], [10 + 4 * 0.5, 20 + 4 * np.sqrt(0.75), -3], rtol=1e-14)
    assert track.length == pytest.approx(4.0, rel=1e-12) and track.speed == pytest.approx(2.0, rel=1e-12)
    np.testing.assert_array_equal(track.roll, 0.02)
    # The body moves nose first.
    np.testing.assert_allclose(track.rotation()[0, :, 0] * 4, track.position[-1] - track.position[0], atol=1e-12)


def test_a_single_ping_has_neither_length_nor_speed():
    track = Track.straight(start=[0, 0, -5], heading=0, speed=2, interval=1, pings=1)
    assert track.length == track.speed == 0 and track.at(0.0) == track


def test_interpolation_is_linear_and_exact_at_the_pings():
    track = Track(time=[0, 1, 3], position=[[0, 0, -5], [1, 2, -5], [5, 2, -9]], roll=[0, 0.1, 0.3],
                  pitch=[0.1, 0, 0], heading=[0, 1, 2])
    assert track.at(track.time) == track
    between = track.at([0.5, 2.0])
    np.testing.assert_allclose(between.position, [[0.5, 1, -5], [3, 2, -7]], rtol=1e-12)
    np.testing.assert_allclose(between.roll, [0.05, 0.2], rtol=1e-12)
    np.testing.assert_allclose(between.pitch, [0.05, 0], rtol=1e-12)


@pytest.mark.parametrize(("before", "after", "middle"), [(350, 10, 0), (10, 350, 0), (-20, 20, 0), (170, -170, 180),
                                                         (719, 723, 1),
                                                         (-1e-15, -1e-15, 0)])
def test_heading_goes_the_short_way_round(before, after, middle):
    track = Track(time=[0, 2], position=np.zeros((2, 3)), roll=0, pitch=0, heading=np.deg2rad([before, after]))
    heading = track.at(1.0).heading[0]
    assert 0 <= heading < 2 * np.pi
    np.testing.assert_allclose(np.exp(1j * heading), np.exp(1j * np.deg2rad(middle)), atol=1e-14)


@pytest.mark.parametrize("times", [[-0.1], [0.5, 2.1], [np.nan]])
def test_times_outside_the_record_are_refused(times):
    track = Track.straight(start=[0, 0, -5], heading=0, speed=1, interval=1, pings=3)
    with pytest.raises(ValueError, match="recorded from 0 s to 2 s"):
        track.at(times)


GOOD = {"time": [0, 1, 2], "position": np.zeros((3, 3)), "roll": [0, 0, 0], "pitch": 0, "heading": [0, 0, 0]}


@pytest.mark.parametrize(("change", "words"), [
    ({"time": [0, 2, 1]}, "time of ping 2 is 1.0; each ping must be later"),
    ({"time": [0, 1, 1]}, "time of ping 2 is 1.0"),
    ({"time": [0, np.nan, 1]}, "time of ping 1 is nan"),
    ({"time": []}, "at least one number"),
    ({"time": "now"}, "time must be numbers"),
    ({"position": np.zeros((3, 2))}, r"position has shape \(3, 2\), but 3 times need \(3, 3\)"),
    ({"position": [[0, 0, 0], [0, 0, np.inf], [0, 0, 0]]}, "position of ping 1"),
    ({"roll": [0, 0]}, r"roll has shape \(2,\)"),
    ({"roll": [0, 0, 4]}, "roll of ping 2 is 4.0; it must lie within .* convert degrees"),
    ({"pitch": -1.6}, "pitch of ping 0 is -1.6"),
    ({"heading": [0, np.nan, 0]}, "heading of ping 1 is nan"),
])
def test_bad_tracks_are_refused(change, words):
    with pytest.raises(ValueError, match=words):
        Track(**{**GOOD, **change})


@pytest.mark.parametrize(("change", "words"), [
    ({"pings": 0}, "pings is 0"), ({"pings": 2.5}, "pings is 2.5"), ({"interval": 0}, "interval is 0"),
    ({"interval": np.nan}, "interval is nan"), ({"speed": -1}, "speed is -1"), ({"start": [0, 0]}, "start has shape"),
    ({"heading": np.inf}, "inf, speed 1 or interval 1 is not finite"),
])
def test_bad_straight_tracks_are_refused(change, words):
    with pytest.raises(ValueError, match=words):
        Track.straight(**{"start": [0, 0, -5], "heading": 0, "speed": 1, "interval": 1, "pings": 3, **change})


def test_records_are_frozen_copies_equal_by_value():
    time = np.arange(3.0)
    track = Track(**{**GOOD, "time": time})
    time[0] = -9
    assert track.time[0] == 0 and track == Track(**GOOD) and hash(track) == hash(Track(**GOOD))
    assert track != Track(**{**GOOD, "heading": 1.0}) and track != 3
    with pytest.raises(ValueError, match="read-only"):
        track.position[0] = 1
    with pytest.raises(dataclasses.FrozenInstanceError):
        track.time = time
    with pytest.raises(TypeError):
        Track([0], np.zeros((1, 3)), 0, 0, 0)
