"""A hull on waves: that of a boat without size is the surface's own height and slope, by differences of heights.

A hull of a size feels the mean of the surface over its waterline (closed form: the mean by 41 x 41 points).
"""
import numpy as np
import pytest

from mitsonar.sonar.motion.riding import Riding
from mitsonar.sonar.motion.trajectory import Lead, Steered, Trajectory
from mitsonar.water.sea_waves import WaveSpectrum

WAVES = WaveSpectrum.model(0.8, 4.0, heading=0.7).waves(3, shortest=2.0)
COURSE = Steered(start=np.array([5.0, -8.0, -1.0]), attitude=np.array([0.0, 0.0, 2.1]), speed=2.0)
TIMES = np.linspace(0.0, 30.0, 61)


def ridden(length, beam) -> Lead:
    return Riding(course=COURSE, waves=WAVES, length=length, beam=beam)


def axes(attitude):
    heading = attitude[:, 2]
    return (np.stack([np.sin(heading), np.cos(heading)], 1), np.stack([np.cos(heading), -np.sin(heading)], 1))


def test_a_boat_without_size_has_the_height_and_slope_of_the_surface():
    place, _ = COURSE.at(TIMES, TIMES)
    position, attitude = ridden(1e-6, 1e-6).at(TIMES, TIMES)
    np.testing.assert_allclose(position[:, 2] - place[:, 2], WAVES.height(place[:, :2], TIMES), atol=1e-12)
    np.testing.assert_array_equal(position[:, :2], place[:, :2])
    step, slopes = 1e-4, []
    for way in axes(attitude):
        far, near = (WAVES.height(place[:, :2] + sign * step * way, TIMES) for sign in (1, -1))
        slopes.append((far - near) / (2 * step))
    np.testing.assert_allclose(np.tan(attitude[:, 1]), slopes[0], atol=1e-6)             # nose up where it rises ahead
    np.testing.assert_allclose(np.tan(attitude[:, 0]), -slopes[1], atol=1e-6)            # starboard side down if lower


def test_a_hull_feels_the_mean_over_its_waterline():
    length, beam = 7.0, 2.5
    place, _ = COURSE.at(TIMES, TIMES)
    position, attitude = ridden(length, beam).at(TIMES, TIMES)
    ahead, starboard = axes(attitude)
    share = (np.arange(41) - 20) / 41
    points = (place[:, None, None, :2] + length * share[:, None, None] * ahead[:, None, None]
              + beam * share[:, None] * starboard[:, None, None])
    mean = WAVES.height(points, TIMES[:, None, None]).mean((1, 2))
    np.testing.assert_allclose(position[:, 2] - place[:, 2], mean, atol=5e-4)
    assert np.std(mean) < 0.95 * np.std(WAVES.height(place[:, :2], TIMES))


def test_a_long_ship_lies_still():
    position, attitude = ridden(400.0, 50.0).at(TIMES, TIMES)
    assert np.std(position[:, 2]) < 0.02 and np.abs(attitude[:, :2]).max() < 5e-3


def test_poses_at_any_times_have_their_shape():
    """Trajectories ask for times of any shape, and for the same time alone."""
    trajectory = Trajectory(lead=ridden(3.0, 1.0), offset=np.array([0.0, 0.0, 0.5]))
    whole = trajectory.pose(TIMES[:60].reshape(3, 20))
    assert whole[0].shape == whole[1].shape == (3, 20, 3)
    np.testing.assert_array_equal(trajectory.pose(np.array(TIMES[27]))[0], whole[0][1, 7])


def test_a_scene_without_waves_carries_no_hull(variant):
    import mitsonar
    from mitsonar.validation.scenes import array_sonar, buried_bed

    scene = array_sonar({"bed": buried_bed(60.0)}, sensor={"ride_waves": "6, 2", "pings": 2})
    with pytest.raises(ValueError, match="ride_waves is given, and the scene has no waves"):
        mitsonar.impulse_response(scene)
    with pytest.raises((ValueError, RuntimeError), match="give length and beam of the hull above 0 m"):
        array_sonar({"bed": buried_bed(60.0)}, sensor={"ride_waves": "6, 0"})


def test_a_sonar_under_a_hull_rides_with_it(variant):
    import mitsonar
    from mitsonar.validation.scenes import array_sonar, buried_bed

    sea = {"type": "sea_surface", "waves": "jonswap", "wave_height": 0.5, "wave_period": 4.0, "wind_speed": 5.0}
    signals = mitsonar.element_signals(array_sonar(
        {"bed": buried_bed(40.0), "sea": sea}, film={"range": 5.0}, integrator={"cell": 0.2},
        sensor={"ride_waves": "0.01, 0.01", "pings": 3, "ping_rate_hz": 1.0, "start": [0.0, 0.0, -2.0]}),
        ping=[0, 1, 2])
    import mitsuba as mi

    waves = mi.load_dict(sea).waves
    wanted = -2.0 + waves.height(np.zeros((3, 2)), np.arange(3.0))
    np.testing.assert_allclose(signals["z"].values, wanted, atol=1e-6)
    assert np.ptp(wanted) > 0.02
