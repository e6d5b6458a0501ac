"""Where a head looks: bearings from ping to ping, mounts, and the attitude of its beam on a platform that moves."""
import numpy as np
import pytest

from mitsonar.device.rotations import attitude_of, rotation_matrix
from mitsonar.sonar.motion.motion import RandomMotion
from mitsonar.sonar.motion.rotating_head import (
    MOUNTS,
    HeadSweep,
    HeadTrajectory,
    RotatingHead,
    turned_voyage,
)
from mitsonar.sonar.motion.track import Track
from mitsonar.sonar.motion.trajectory import Recorded, Trajectory, Voyage

PING = np.arange(10)


def sweep(first=0.0, step=1.0, sector=3.0, back_and_forth=False):
    return HeadSweep(first=first, step=step, sector=sector, back_and_forth=back_and_forth)


def head(mount="down", tilt=0.0, turns_on=True, **how):
    return RotatingHead(mount=mount, tilt=tilt, sweep=sweep(**how), turns_on=turns_on)


def test_a_sector_begins_anew():
    one = sweep()
    assert one.bearing(PING).tolist() == [0, 1, 2, 3, 0, 1, 2, 3, 0, 1]
    assert one.turn(PING).tolist() == [0, 0, 0, 0, 1, 1, 1, 1, 2, 2]
    assert one.onward(PING).tolist() == [1] * 10


def test_a_head_goes_back_as_it_came_and_stands_for_a_ping_at_either_end():
    one = sweep(back_and_forth=True)
    assert one.bearing(PING).tolist() == [0, 1, 2, 3, 3, 2, 1, 0, 0, 1]
    assert one.turn(PING).tolist() == [0, 0, 0, 0, 1, 1, 1, 1, 2, 2]
    assert one.onward(PING).tolist() == [1, 1, 1, 0, -1, -1, -1, 0, 1, 1]


@pytest.mark.parametrize("step_deg, pings", [(0.9, 400), (1.8, 200), (3.6, 100), (0.45, 800), (7.0, 52)])
def test_a_full_circle_goes_on_and_on(step_deg, pings):
    one = sweep(step=np.deg2rad(step_deg), sector=2 * np.pi)
    assert one.pings_per_turn == pings
    assert one.turn(np.array([0, pings - 1, pings])).tolist() == [0, 0, 1]
    assert np.diff(one.bearing(np.arange(3 * pings))) == pytest.approx(np.deg2rad(step_deg))


@pytest.mark.parametrize("mount, ahead, quarter, tilted", [
    ("down", [1, 0, 0], [0, 1, 0], [0, 0, 1]), ("up", [1, 0, 0], [0, 1, 0], [0, 0, -1]),
    ("forward", [0, 0, -1], [0, 1, 0], [1, 0, 0])])
def test_bearings_count_clockwise_and_a_tilt_leads_to_where_the_head_points(mount, ahead, quarter, tilted):
    assert set(MOUNTS) == {"down", "up", "forward"}
    beams = head(mount).rotation(np.array([0, np.pi / 2]))[..., 0]
    np.testing.assert_allclose(beams, [ahead, quarter], atol=1e-15)
    np.testing.assert_allclose(head(mount, tilt=np.pi / 2).rotation(np.array(0.3))[:, 0], tilted, atol=1e-15)
    assert np.linalg.det(head(mount, 0.4).rotation(np.array(1.0))) == pytest.approx(1)


def test_attitudes_are_exact_at_any_pitch(rng):
    roll, heading = rng.uniform(-np.pi, np.pi, (2, 300))
    pitch = np.concatenate([rng.uniform(-1.5, 1.5, 100), np.full(100, np.pi / 2),
                            -np.pi / 2 + 10 ** rng.uniform(-14, -3, 100)])
    rotation = rotation_matrix(roll, pitch, heading)
    np.testing.assert_allclose(rotation_matrix(*attitude_of(rotation).T), rotation, atol=1e-15)


def voyage(speed=2.0, motion=RandomMotion(), offset=(0.0, 0.0, 0.0)):
    """Ten pings a tenth of a second apart, due east."""
    track = Track.straight(start=[0, 0, -5], heading=np.pi / 2, speed=speed, interval=0.1, pings=10)
    return Voyage.of(Trajectory(lead=Recorded.through(track), motion=motion, offset=np.array(offset)), track.time)


@pytest.mark.parametrize("turns_on, angle", [(True, 0.05), (False, 0.0)])
def test_a_head_turns_on_while_echoes_come_in(turns_on, angle):
    """By half a step after half the time to the next ping, about the vertical; clockwise is -z."""
    mounted = turned_voyage(voyage(), head(step=0.1, sector=2 * np.pi, turns_on=turns_on), 0.1)
    travel = mounted.trajectory.during(mounted.track.time, 0.05)
    turn = np.einsum("pkx,k->px", travel.turn, 0.05 ** np.arange(1, 7))
    np.testing.assert_allclose(turn, np.tile([0, 0, -angle], (10, 1)), atol=1e-12)
    np.testing.assert_allclose(mounted.track.heading, np.pi / 2 + 0.1 * PING, atol=1e-12)
    np.testing.assert_allclose(mounted.turn_rate, np.tile([0, 0, -angle / 0.05], (10, 1)), atol=1e-6)


def test_a_head_rocks_with_its_platform_and_sits_where_it_is_mounted():
    """Of its beam: the platform's attitude times the head's, at the platform's lever arm."""
    motion, offset = RandomMotion(roll=0.1, pitch=0.05, yaw=0.1, heave=0.2, seed=3), (1.0, 0.5, 0.7)
    still, one = voyage(motion=motion, offset=offset), head("forward", tilt=0.2, step=0.1, sector=1.0)
    mounted = turned_voyage(still, one, 0.1)
    rotation = still.track.rotation() @ one.rotation(0.1 * PING)
    np.testing.assert_allclose(mounted.track.rotation(), rotation, atol=1e-14)
    np.testing.assert_array_equal(mounted.track.position, still.track.position)
    assert isinstance(mounted.trajectory, HeadTrajectory)
    assert mounted.trajectory.platform.track(still.track.time) == still.track
    ahead = mounted.trajectory.carried([0.3, 0.0, 0.0]).position(still.track.time)
    np.testing.assert_allclose(ahead - still.track.position, 0.3 * rotation[:, :, 0], atol=1e-14)


def test_one_ping_alone_turns_on():
    track = Track.straight(start=[0, 0, -5], heading=0.0, speed=0.0, interval=0.1, pings=1)
    alone = turned_voyage(Voyage(track=track, trajectory=Trajectory(lead=Recorded.through(track))), head(step=0.1), 0.2)
    assert alone.turn_rate[0] == pytest.approx([0, 0, -0.5])
