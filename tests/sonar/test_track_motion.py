"""Random motion and the lever arm: their statistics, rates that are the derivatives of the track, and the way between
pings against closed forms.

The mean square over a long time is rms² by construction, whatever the seed: each of N = 32 sinusoids has its whole
power, and cross terms die out as 1 / (T Δf) (here below 2 %). Their sum is nearly Gaussian; its kurtosis over all times
and phases is 3 - 1.5 / N = 2.95. Rates are second-order differences of 0.2 ms, (ω h)² / 3 = 2e-8 relative, against such
of 0.1 ms. A spline through records d apart errs by 5/384 d⁴ times the fourth derivative: 0.5 µm for 0.3 m in 6 s, read
every 0.1 s.
"""
import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from mitsonar.sonar import Track
from mitsonar.sonar.motion.motion import RandomMotion, strum_frequency
from mitsonar.sonar.motion.trajectory import PingTravel, Recorded, Sailed, SmoothCurve, Trajectory, Voyage
from mitsonar.sonar.motion.waypoints import Course


def voyage(pings, interval, heading=1.0, motion=RandomMotion(), offset=(0, 0, 0)):
    track = Track.straight(start=[0, 0, -5], heading=heading, speed=2.0, interval=interval, pings=pings)
    trajectory = Trajectory(lead=Recorded.through(track), motion=motion, offset=np.array(offset, float))
    return Voyage.of(trajectory, track.time)


@pytest.mark.parametrize("seed", range(4))
def test_mean_squares_are_as_asked_for(seed):
    motion = RandomMotion(roll=0.05, pitch=0.02, yaw=0.01, heave=0.3, period=6.0, seed=seed)
    values, rates = motion.at(np.arange(0, 20_000, 0.5))
    for name in ("roll", "pitch", "yaw", "heave"):
        assert np.std(values[name]) == pytest.approx(getattr(motion, name), rel=0.02)
        assert abs(np.mean(values[name])) < 0.01 * getattr(motion, name)
        # the mean square frequency of the band is (1 + 0.15²) / period², less the tails that 32 lines miss
        assert np.std(rates[name]) / np.std(values[name]) * 6.0 / (2 * np.pi) == pytest.approx(1.01, abs=0.015)
    # two of their 32 lines that fall together correlate 1/32
    assert abs(np.corrcoef(values["roll"], values["heave"])[0, 1]) < 3 / 32


def test_it_is_narrow_band_and_nearly_gaussian():
    values = np.concatenate([RandomMotion(heave=1.0, period=8.0, seed=seed).at(np.arange(0, 4000, 1.0))[0]["heave"]
                             for seed in range(40)])
    assert np.mean(values ** 4) / np.mean(values ** 2) ** 2 == pytest.approx(2.95, abs=0.1)
    spectrum = np.abs(np.fft.rfft(values[:4000])) ** 2
    frequency = np.fft.rfftfreq(4000, 1.0)
    band = np.abs(frequency * 8.0 - 1) < 0.5
    assert spectrum[band].sum() > 0.99 * spectrum.sum()


def test_seeds_and_kinds_differ_and_repeat():
    def roll(**change):
        return RandomMotion(**{"roll": 0.1, "pitch": 0.1, **change}).at(np.arange(50.0))[0]

    assert np.array_equal(roll()["roll"], roll()["roll"]) and np.array_equal(roll()["roll"], roll(heave=1.0)["roll"])
    assert not np.allclose(roll()["roll"], roll(seed=1)["roll"]) and not np.allclose(roll()["roll"], roll()["pitch"])
    assert not roll()["yaw"].any()


def test_velocity_and_turn_rate_are_the_derivatives_of_the_track():
    motion = RandomMotion(roll=0.1, pitch=0.08, yaw=0.1, heave=0.3, period=5.0, seed=3)
    moved = voyage(20_001, 1e-4, motion=motion, offset=[1.0, 0.5, -0.7])
    velocity, turn_rate = moved.track.motion()
    np.testing.assert_allclose(moved.velocity[1:-1], velocity[1:-1], atol=2e-7)
    np.testing.assert_allclose(moved.turn_rate[1:-1], turn_rate[1:-1], atol=2e-7)
    assert np.abs(moved.turn_rate).max(0).min() > 0.01


def test_heave_lifts_and_nothing_changes_nothing():
    still = voyage(50, 0.2)
    straight = Track.straight(start=[0, 0, -5], heading=1.0, speed=2.0, interval=0.2, pings=50)
    np.testing.assert_allclose(still.track.position, straight.position, atol=1e-13)
    heaved = voyage(50, 0.2, motion=RandomMotion(heave=0.5, seed=2))
    values = RandomMotion(heave=0.5, seed=2).at(still.track.time)[0]["heave"]
    np.testing.assert_allclose(heaved.track.position[:, 2], -5 + values, atol=1e-12)
    assert np.array_equal(heaved.track.position[:, :2], still.track.position[:, :2])


@pytest.mark.parametrize(("heading", "place"), [(0, [2, 3, -9]), (90, [3, -2, -9]), (180, [-2, -3, -9])])
def test_the_offset_is_forward_starboard_down(heading, place):
    there = voyage(2, 1.0, np.deg2rad(heading), offset=[3, 2, 4]).track.position[0]
    np.testing.assert_allclose(there, place, atol=1e-12)


def crossings(values, step):
    """Mean period [s] by the changes of sign."""
    return 2 * len(values) * step / np.count_nonzero(np.diff(np.sign(values)))


def test_every_axis_has_its_own_period():
    motion = RandomMotion(roll=0.02, pitch=0.01, yaw=0.03, heave=0.1, roll_period=4.0, yaw_period=15.0, period=7.0,
                          seed=1)
    values, _ = motion.at(np.arange(0, 20_000, 0.25))
    for name, period in (("roll", 4.0), ("pitch", 7.0), ("yaw", 15.0), ("heave", 7.0)):
        assert crossings(values[name], 0.25) == pytest.approx(period, rel=0.03)


def test_surge_goes_forward_as_heave_goes_up():
    motion = RandomMotion(heave=0.2, surge=0.1, seed=5)
    values, rates = motion.at(np.arange(50.0))
    np.testing.assert_allclose(values["surge"], 0.5 * values["heave"], atol=1e-15)
    np.testing.assert_allclose(rates["surge"], 0.5 * rates["heave"], atol=1e-15)
    still, moved = voyage(50, 0.2, heading=1.0), voyage(50, 0.2, heading=1.0, motion=motion)
    shift, surge = moved.track.position - still.track.position, motion.at(still.track.time)[0]["surge"]
    np.testing.assert_allclose(shift[:, :2], np.outer(surge, [np.sin(1.0), np.cos(1.0)]), atol=1e-12)


def test_sway_goes_to_starboard_and_leaves_other_motion_as_it_is():
    with_sway, without = RandomMotion(heave=0.2, sway=0.1, sway_period=5.0, seed=5), RandomMotion(heave=0.2, seed=5)
    times = np.arange(0.0, 2000.0, 0.1)
    values = with_sway.at(times)[0]
    assert values["sway"].std() == pytest.approx(0.1, rel=0.02)
    np.testing.assert_array_equal(values["heave"], without.at(times)[0]["heave"])
    still, moved = voyage(50, 0.2, heading=1.0), voyage(50, 0.2, heading=1.0, motion=RandomMotion(sway=0.1))
    shift, sway = moved.track.position - still.track.position, RandomMotion(sway=0.1).at(still.track.time)[0]["sway"]
    np.testing.assert_allclose(shift[:, :2], np.outer(sway, [np.cos(1.0), -np.sin(1.0)]), atol=1e-12)


def test_a_strum_is_a_narrow_band_at_strouhals_frequency():
    frequency = strum_frequency(1.5, 0.02)
    assert frequency == pytest.approx(15.0)                                   # 0.2 x 1.5 m/s / 20 mm
    motion = RandomMotion(heave=0.1, strum_heave=0.002, strum_pitch=1e-3, strum_frequency=frequency)
    values = motion.at(np.arange(0, 400, 0.01))[0]
    assert values["pitch"].std() == pytest.approx(1e-3, rel=0.05)
    window = np.hanning(40_000) / np.sqrt(3 / 8)                              # of mean square 1
    spectrum, at = np.abs(np.fft.rfft(values["heave"] * window)) ** 2, np.fft.rfftfreq(40_000, 0.01)
    near, fast = np.abs(at / frequency - 1) < 0.08, at > 2
    assert spectrum[near].sum() > 0.99 * spectrum[fast].sum()
    assert np.sqrt(2 * spectrum[near].sum()) / 40_000 == pytest.approx(0.002, rel=0.1)
    assert np.array_equal(RandomMotion(heave=0.1).at(np.arange(9.0))[0]["roll"], np.zeros(9))


@pytest.mark.parametrize("swings", [0.5, 1.0, 1.5, 1.85])
def test_a_strum_is_followed_while_echoes_come_in(swings):
    """To 2 % of its root mean square, in float32 as on the device."""
    motion = RandomMotion(strum_heave=0.002, strum_pitch=1e-3, strum_frequency=swings / 0.1)
    trajectory, elapsed = voyage(40, 0.5, motion=motion).trajectory, np.linspace(0, 0.1, 41)
    travel = trajectory.during(np.array([3.0]), 0.1).trimmed()
    powers = travel.displacement[0].astype(np.float32)
    moved = np.zeros((41, 3), np.float32)
    for row in powers[::-1]:
        moved = (moved + row) * elapsed[:, None].astype(np.float32)
    place = trajectory.position(3.0 + elapsed)
    np.testing.assert_allclose(moved, place - place[0], atol=0.02 * 0.002)
    assert np.ptp(place[:, 2]) > 0.001


def test_a_strum_too_fast_to_follow_is_refused():
    motion = RandomMotion(strum_heave=0.002, strum_frequency=30.0)
    with pytest.raises(ValueError, match="swings 3.2 times .* give a strum_hz of at most 18.9 or a shorter range"):
        voyage(40, 0.5, motion=motion).trajectory.during(np.zeros(1), 0.1)


@pytest.mark.parametrize("change", [{"roll": -0.1}, {"period": 0}, {"heave": np.nan}, {"pitch": np.inf},
                                    {"yaw_period": 0.0}, {"strum_frequency": 0.0}, {"surge": -1.0}])
def test_motion_that_is_none(change):
    with pytest.raises(ValueError, match=f"random motion: {next(iter(change))} is"):
        RandomMotion(**change)


# ------------------------------------------------------------------------------------------ the way within a ping

def after(trajectory, ping, elapsed, duration=0.4):
    """Displacement (N, 3) and rotation (N, 3, 3) since a ping at times elapsed (N,), by its polynomials."""
    travel = trajectory.during(np.array([ping]), duration).trimmed()
    powers = elapsed[:, None] ** np.arange(1, travel.turn.shape[1] + 1)
    return powers @ travel.displacement[0], Rotation.from_rotvec(powers @ travel.turn[0]).as_matrix()


def test_heave_between_records_is_that_of_the_wave():
    time = np.arange(0, 30, 0.1)
    track = Track(time=time, position=np.stack([1.5 * time, 0 * time, -8 + 0.3 * np.sin(time * 2 * np.pi / 6)], -1),
                  roll=0.0, pitch=0.0, heading=np.pi / 2)
    trajectory = Trajectory(lead=Recorded.through(track))
    elapsed = np.linspace(0, 0.4, 41)
    for ping in (7.03, 10.55, 12.4):
        moved, _ = after(trajectory, ping, elapsed)
        heave = 0.3 * (np.sin((ping + elapsed) * 2 * np.pi / 6) - np.sin(ping * 2 * np.pi / 6))
        np.testing.assert_allclose(moved, np.stack([1.5 * elapsed, 0 * elapsed, heave], -1), atol=1.5e-6)


def test_a_lever_arm_turns_with_the_body():
    """Roll of 8 degrees in 5 s, 1 m below the track's point: against its closed form, exact but for the fit."""
    motion = RandomMotion(roll=np.deg2rad(8), period=5.0, seed=4)
    trajectory = voyage(40, 0.5, heading=0.0, motion=motion, offset=[0, 0, 1]).trajectory
    ping, elapsed = 6.3, np.linspace(0, 0.4, 21)
    roll = motion.at(ping + elapsed)[0]["roll"]
    arm = np.stack([-np.sin(roll), 2.0 * (ping + elapsed), -5 - np.cos(roll)], -1)      # down, swung to port
    moved, turned = after(trajectory, ping, elapsed)
    np.testing.assert_allclose(moved, arm - arm[0], atol=1e-8)
    starboard = turned @ [np.cos(roll[0]), 0, -np.sin(roll[0])]
    np.testing.assert_allclose(starboard, np.stack([np.cos(roll), 0 * roll, -np.sin(roll)], -1), atol=1e-8)


def test_a_turn_is_an_arc():
    course = Course(np.array([[0, 0], [0, 100], [100, 100]]), turn_radius=12.0)
    lead = Sailed(course=course, speed=2.0, height=SmoothCurve(np.array([0.0]), np.array([-5.0])))
    begin, elapsed = (100 - 12) / 2.0 + 1.0, np.linspace(0, 0.4, 21)
    moved, turned = after(Trajectory(lead=lead), begin, elapsed)
    angle = 2.0 / 12 * (1.0 + elapsed)
    radius = 12 * np.sinc(2.0 / 12 / 8 / np.pi) ** 4                # as `Course.rounded` says of a second at 2 m/s
    place = radius * np.stack([1 - np.cos(angle), np.sin(angle), 0 * angle], -1)
    np.testing.assert_allclose(moved, place - place[0], atol=1e-9)
    forward = turned @ [np.sin(angle[0]), np.cos(angle[0]), 0]
    np.testing.assert_allclose(forward, np.stack([np.sin(angle), np.cos(angle), 0 * angle], -1), atol=1e-9)


@pytest.mark.parametrize("speed", [2.4, 4.5])
def test_a_turn_begins_and_ends_without_a_kink(speed):
    """Where leg and arc meet, the polynomials of a ping follow arms of 1 m to 3 µm, 2 ns of sound."""
    course = Course(np.array([[0, 0], [0, 60], [60, 60]]), turn_radius=10.0)
    trajectory = Trajectory(lead=Sailed(course=course, speed=speed, height=SmoothCurve(np.zeros(1), np.full(1, -5.0))))
    elapsed = np.linspace(0, 0.3, 31)
    for bend in (50.0, 50 + 5 * np.pi):
        for ping in bend / speed + np.arange(-0.8, 0.6, 0.1):
            moved, turned = after(trajectory, ping, elapsed, duration=0.3)
            place, there = trajectory.position(ping + elapsed), trajectory.rotation(ping + elapsed)
            np.testing.assert_allclose(moved, place - place[0], atol=1e-6)
            np.testing.assert_allclose(turned @ there[0], there, atol=2e-6)


def test_nobody_turns_in_a_corner_while_echoes_come_in():
    course = Course(np.array([[0, 0], [0, 10], [10, 10]]))
    lead = Sailed(course=course, speed=2.0, height=SmoothCurve(np.array([0.0]), np.array([-5.0])))
    moved, turned = after(Trajectory(lead=lead), 4.9, np.array([0.0, 0.1, 0.4]))
    np.testing.assert_allclose(moved, [[0, 0, 0], [0, 0.2, 0], [0, 0.8, 0]], atol=1e-12)
    np.testing.assert_allclose(turned, np.tile(np.eye(3), (3, 1, 1)), atol=1e-12)


def test_a_sonar_at_rest_has_no_way_and_a_straight_one_goes_straight():
    def powers(speed):
        track = Track.straight(start=[0, 0, -5], heading=1.0, speed=speed, interval=0.2, pings=30)
        trajectory = Trajectory(lead=Recorded.through(track))
        return trajectory.during(track.time, 0.2).trimmed().displacement.shape[1]

    assert powers(0.0) == 0 and powers(2.0) == 1


@pytest.mark.parametrize("powers, kept", [(2, 4), (3, 4), (4, 4), (5, 6), (6, 6), (7, 12), (12, 12)])
def test_few_numbers_of_powers_occur_so_that_few_kernels_are_compiled(powers, kept):
    displacement = np.r_[np.ones((powers, 3)), np.zeros((12 - powers, 3))][None]
    travel = PingTravel(displacement=displacement, turn=np.zeros_like(displacement), duration=0.5)
    trimmed = travel.trimmed()
    assert trimmed.displacement.shape[1] == trimmed.turn.shape[1] == kept
    np.testing.assert_array_equal(trimmed.displacement, displacement[:, :kept])


def test_a_track_goes_straight_on_beyond_its_ends():
    track = Track(time=np.array([0.0, 1, 2, 3]), position=np.array([[0.0, 0, -5], [1, 0, -5], [4, 0, -5], [9, 0, -5]]),
                  roll=0.0, pitch=0.0, heading=0.0)
    place = Trajectory(lead=Recorded.through(track)).position(np.array([-1.0, 1.5, 3.5]))
    np.testing.assert_allclose(place[:, 0], [0, 2.25, 12], atol=1e-12)


def test_a_body_that_tumbles_within_a_ping_is_refused():
    track = Track(time=np.arange(4.0), position=np.zeros((4, 3)) - [0, 0, 5], roll=0.0, pitch=0.0,
                  heading=np.arange(4) * 3.0)
    with pytest.raises(ValueError, match="turns by 171 degrees"):
        Trajectory(lead=Recorded.through(track)).during(track.time, 1.0)


@pytest.mark.parametrize("shape", [(), (3,), (2, 3)])
def test_two_poses_are_joined_as_the_spline_would_bit_for_bit(shape):
    rng = np.random.default_rng(7)
    for scale in 10.0 ** np.arange(-8, 8):
        time, values = np.sort(rng.normal(size=2)), scale * rng.normal(size=(2, *shape))
        at = 3 * rng.normal(size=(5, 4))
        spline, inside = CubicSpline(time, values), np.clip(at, *time)
        beyond = np.reshape(at - inside, inside.shape + (1,) * len(shape)) * spline.derivative()(inside)
        np.testing.assert_array_equal(SmoothCurve(time, values).at(at), spline(inside) + beyond, strict=True)
