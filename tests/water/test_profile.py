"""The sound-speed profile: linear between nodes, constant beyond the ends, checked at the border.

Closed form: linear interpolation, exact to rounding (1e-12 relative); no bias.
"""
import numpy as np
import pytest

from mitsonar.water import SoundSpeedProfile

PROFILE = SoundSpeedProfile([0, 5, 12, 25], [1508, 1507.5, 1499, 1491])


def test_linear_between_nodes_and_constant_beyond():
    depth = [-3, 0, 3, 5, 8.5, 25, 100]
    np.testing.assert_allclose(PROFILE.at(depth), [1508, 1508, 1507.7, 1507.5, 1503.25, 1491, 1491], rtol=1e-12)


def test_gradient_belongs_to_the_layer_below_a_node():
    np.testing.assert_allclose(PROFILE.gradient([-1, 0, 4, 5, 25, 30]), [0, -0.1, -0.1, -8.5 / 7, 0, 0], rtol=1e-12)


def test_scalars_give_scalars():
    assert np.ndim(PROFILE.at(3.0)) == 0 and np.ndim(PROFILE.gradient(3.0)) == 0


def test_one_node_is_constant_water():
    profile = SoundSpeedProfile.constant(1500)
    assert profile.at(-5) == profile.at(500) == 1500
    assert profile.gradient(0.0) == 0 and profile.gradient(7.0) == 0


def test_nodes_are_copied_and_read_only():
    depth = np.array([0.0, 10.0])
    profile = SoundSpeedProfile(depth, [1500, 1510])
    depth[1] = 99
    assert profile.depth[1] == 10
    with pytest.raises(ValueError):
        profile.sound_speed[0] = 1
    with pytest.raises(AttributeError):
        profile.depth = depth


def test_measured_node_joins_the_others_and_replaces_what_is_at_its_depth():
    joined = PROFILE.with_node(6.0, 1490.0)
    assert joined == SoundSpeedProfile([0, 5, 6, 12, 25], [1508, 1507.5, 1490, 1499, 1491])
    assert PROFILE.with_node(5.004, 1490.0) == SoundSpeedProfile([0, 5.004, 12, 25], [1508, 1490, 1499, 1491])
    assert PROFILE.with_node(-1.0, 1490.0).depth[0] == -1 and PROFILE.depth.size == 4


@pytest.mark.parametrize("depth, speed, message", [
    (25.0, 1490, "not above the last of the profile, at 25 m"), (np.nan, 1490, "not above"), (30, 1490, "not above"),
    (6, 100, r"sound_speed\[2\] = 100 m/s")])
def test_measured_node_without_water_below_is_refused(depth, speed, message):
    with pytest.raises(ValueError, match=message):
        PROFILE.with_node(depth, speed)


def test_equality_is_by_value():
    same, other = SoundSpeedProfile(PROFILE.depth, PROFILE.sound_speed), SoundSpeedProfile.constant(1500)
    assert same == PROFILE and hash(same) == hash(PROFILE) and same != other and PROFILE != 3
    assert hash(SoundSpeedProfile([-0.0], [1500])) == hash(SoundSpeedProfile([0.0], [1500]))


@pytest.mark.parametrize("depth, sound_speed, message", [
    ([], [], "at least one"),
    ([[0, 1]], [[1500, 1500]], "one-dimensional"),
    (5.0, 1500.0, "one-dimensional"),
    ([0, 1, 2], [1500, 1500], "3 depths but 2 sound speeds"),
    ([0, np.nan], [1500, 1500], r"depth\[1\] is nan"),
    ([0, 1], [1500, np.inf], r"sound_speed\[1\] is inf"),
    ([0, 5, 4], [1500, 1500, 1500], r"depth\[2\] = 4 m follows depth\[1\] = 5 m"),
    ([0, 5, 5], [1500, 1500, 1500], r"depth\[2\] = 5 m follows depth\[1\] = 5 m"),
    ([0, 5], [1500, 300], r"sound_speed\[1\] = 300 m/s at 5 m"),
    ([0, 5], [3000, 1500], r"sound_speed\[0\] = 3000 m/s"),
    (["a"], [1500], "list of numbers"),
])
def test_bad_profiles_are_refused_in_one_sentence(depth, sound_speed, message):
    with pytest.raises(ValueError, match=message) as error:
        SoundSpeedProfile(depth, sound_speed)
    assert "\n" not in str(error.value)
