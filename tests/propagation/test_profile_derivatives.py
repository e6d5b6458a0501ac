"""Derivatives of exact rays by the profile and by their ends.

References: sixth-order differences of the project's own eigenrays (over 50 mm/s: times are right to 1e-15, which leaves
1e-15/1e-1 s / 1e-5 s²/m² = 1e-9), and rays that know nothing of them: X(p) and T(p) by adaptive quadrature, through
turning points by z = z_turn ± u², p by the secant method. Those are right to 1e-13: 1e-8 of the largest is asked for.
"""
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import newton

from mitsonar.propagation import eigenray
from mitsonar.propagation.numpy_rays.eigenrays import eigenrays
from mitsonar.propagation.numpy_rays.profile_derivatives import ray_derivatives
from mitsonar.water import SoundSpeedProfile

DEPTH = np.array([2.0, 6, 14, 20, 32, 47, 60, 90, 140])
PROFILES = {"mixed": np.array([1473.7, 1473.7, 1476, 1513, 1487, 1486, 1484, 1487, 1498]),
            "uniform": np.full(9, 1480.0),
            "nearly uniform": 1480 + 1e-6 * np.arange(9) ** 2}
# direct down and up; from a node; from above the profile to below it; flat; turned above; turned below
SOURCE = np.array([30.0, 120, 60, 1, 20, 30, 61])
TARGET = np.array([120.0, 30, 65, 160, 122, 40, 62])
RANGE = np.array([100.0, 100, 10, 288, 400, 208, 1500])


def difference(f, step):
    return (45 * (f(step) - f(-step)) - 9 * (f(2 * step) - f(-2 * step)) + f(3 * step) - f(-3 * step)) / (60 * step)


@pytest.mark.parametrize("name", PROFILES)
def test_times_between_fixed_ends_by_nodes_are_those_of_exact_rays(name):
    speed = PROFILES[name]

    def time(change):
        return eigenray(SoundSpeedProfile(DEPTH, speed + change), SOURCE, TARGET, RANGE).travel_time

    profile = SoundSpeedProfile(DEPTH, speed)
    ray = eigenray(profile, SOURCE, TARGET, RANGE)
    found = ray_derivatives(profile, SOURCE, TARGET, ray).time_by_speed
    expected = np.stack([difference(lambda h: time(h * node), 0.05) for node in np.eye(9)], -1)
    some = ray.exists & np.isfinite(expected).all(-1)
    assert some.sum() >= 5
    assert np.abs((found - expected)[some] / np.abs(expected[some]).max(-1, keepdims=True)).max() < 1e-8


def test_times_by_the_ends_are_those_of_exact_rays():
    profile = SoundSpeedProfile(DEPTH, PROFILES["mixed"])
    source, target = SOURCE + 0.5, TARGET + 0.5                      # beside nodes, where they have one derivative
    found = ray_derivatives(profile, source, target, eigenray(profile, source, target, RANGE))
    for values, moved in ((found.time_by_source, (1, 0, 0)), (found.time_by_target, (0, 1, 0)),
                          (found.time_by_range, (0, 0, 1))):
        expected = difference(lambda h: eigenray(profile, source + h * moved[0], target + h * moved[1],
                                                 RANGE + h * moved[2]).travel_time, 0.01)
        np.testing.assert_allclose(values, expected, rtol=1e-8, atol=1e-12)


def integrated(speed, p, source, target, turn):
    """Range and time of a ray of parameter p, by quadrature; `turn` says where it turns, -1 above, 1 below, 0 not."""
    def over(top, bottom, near_turn):
        total = np.zeros(2)
        edges = np.r_[top, DEPTH[(DEPTH > top) & (DEPTH < bottom)], bottom]
        for a, b in zip(edges[:-1], edges[1:]):
            last = near_turn is not None and near_turn in (a, b)

            def at(u, which):
                if last:                                             # 1 - p c falls as u² towards the turn
                    c = (1 - (1 - p * np.interp(a + b - near_turn, DEPTH, speed)) * u * u) / p
                    slowed = 2 / np.sqrt((1 - p * np.interp(a + b - near_turn, DEPTH, speed)) * (1 + p * c))
                else:
                    c = np.interp(a + (b - a) * u, DEPTH, speed)
                    slowed = 1 / np.sqrt(1 - (p * c) ** 2)
                return (b - a) * slowed * (p * c if which == 0 else 1 / c)

            for which in range(2):
                total[which] += quad(at, 0, 1, args=(which,), epsabs=0, epsrel=1e-13, limit=200)[0]
        return total

    upper, lower = min(source, target), max(source, target)
    if not turn:
        return over(upper, lower, None)
    order = slice(None, None, turn)
    ahead = DEPTH[order] * turn > turn * (lower if turn > 0 else upper)
    nodes, speeds = DEPTH[order][ahead], speed[order][ahead]
    k = int(np.argmax(speeds > 1 / p))                               # the first node that the ray does not come to
    start = (lower if turn > 0 else upper) if k == 0 else nodes[k - 1]
    turn_depth = start + (nodes[k] - start) * (1 / p - np.interp(start, DEPTH, speed)) / (
        speeds[k] - np.interp(start, DEPTH, speed))
    twice = over(lower, turn_depth, turn_depth) if turn > 0 else over(turn_depth, upper, turn_depth)
    return 2 * twice + over(upper, lower, None)


CASES = [pytest.param(30.0, 120.0, 100.0, 0, id="direct"), pytest.param(1.0, 160.0, 288.0, 0, id="beyond the profile"),
         pytest.param(30.0, 40.0, 208.0, -1, id="turned above"), pytest.param(61.0, 85.0, 1000.0, 1, id="turned below")]


@pytest.mark.parametrize(("source", "target", "distance", "turn"), CASES)
def test_rays_found_by_quadrature_move_alike(source, target, distance, turn):
    """Times between fixed ends, and range and time at fixed launch angle, by two nodes that the ray passes."""
    speed = PROFILES["mixed"]
    profile = SoundSpeedProfile(DEPTH, speed)
    rays = eigenrays(profile, source, target, distance)
    kinds = np.where(np.isnan(rays.turning_depth), 0, np.sign(rays.turning_depth - source))
    number = int(np.flatnonzero(rays.exists & (kinds == turn))[0])
    found = ray_derivatives(profile, source, target, rays)
    p, launch = rays.ray_parameter[number], rays.launch_angle[number]

    def at_launch(change):
        water = speed + change
        return integrated(water, np.cos(launch) / np.interp(source, DEPTH, water), source, target, turn)

    def between_ends(change):
        own = newton(lambda q: integrated(speed + change, q, source, target, turn)[0] - distance, p,
                     x1=p * (1 + 1e-7), tol=1e-13 * p)
        reach, time = integrated(speed + change, own, source, target, turn)
        return time + own * (distance - reach)

    assert integrated(speed, p, source, target, turn) == pytest.approx([distance, rays.travel_time[number]], rel=1e-11)
    largest = np.abs(found.range_by_speed[number]).max(), np.abs(found.time_by_speed[number]).max()
    for node in (4, 5, 6, 7):
        step = 1.0 * (np.arange(9) == node)
        reach, time = difference(lambda h: at_launch(h * step), 2e-3)
        by_speed, fermat = found.range_by_speed[number, node], found.time_by_speed[number, node]
        assert by_speed == pytest.approx(reach, abs=1e-8 * largest[0])
        assert fermat + p * by_speed == pytest.approx(time, abs=1e-8 * largest[0] * p)
        if node == 5:
            expected = difference(lambda h: between_ends(h * step), 2e-2)
            assert fermat == pytest.approx(expected, abs=1e-8 * largest[1])


@pytest.mark.parametrize(("source", "target", "distance", "turn"), CASES)
def test_range_at_a_depth_by_source_and_launch_is_that_of_quadrature(source, target, distance, turn):
    speed, source, target = PROFILES["mixed"], source + 0.25, target + 0.25
    profile = SoundSpeedProfile(DEPTH, speed)
    rays = eigenrays(profile, source, target, distance)
    kinds = np.where(np.isnan(rays.turning_depth), 0, np.sign(rays.turning_depth - source))
    number = int(np.flatnonzero(rays.exists & (kinds == turn))[0])
    found, launch = ray_derivatives(profile, source, target, rays), rays.launch_angle[number]

    def reach(depth, angle):
        return integrated(speed, np.cos(angle) / np.interp(depth, DEPTH, speed), depth, target, turn)[0]

    by_source = difference(lambda h: reach(source + h, launch), 1e-3)
    by_launch = difference(lambda h: reach(source, launch + h), 1e-6)
    assert found.range_by_source[number] == pytest.approx(by_source, rel=1e-7)
    assert found.range_by_launch[number] == pytest.approx(by_launch, rel=1e-7)


def test_rays_that_are_not_there_have_no_derivatives_and_level_ones_have_times():
    profile = SoundSpeedProfile([0.0, 50, 100], [1500.0, 1500, 1490])
    rays = eigenray(profile, [20.0, 80], [20.0, 80], [300.0, 30000])
    found = ray_derivatives(profile, [20.0, 80], [20.0, 80], rays)
    np.testing.assert_allclose(found.time_by_speed[0], [-0.6 * 300 / 1500 ** 2, -0.4 * 300 / 1500 ** 2, 0], rtol=1e-12)
    assert np.isnan(found.time_by_speed[1]).all() and not rays.exists[1]


def test_water_of_one_speed_has_one_node():
    profile = SoundSpeedProfile.constant(1500.0)
    ray = eigenray(profile, 10.0, 90.0, 60.0)
    found = ray_derivatives(profile, 10.0, 90.0, ray)
    assert found.time_by_speed == pytest.approx(-100 / 1500 ** 2)
    assert found.range_by_speed == pytest.approx(0, abs=1e-15)


def test_depths_that_do_not_fit_are_refused():
    profile = SoundSpeedProfile.constant(1500.0)
    ray = eigenray(profile, 10.0, 90.0, [60.0, 70.0])
    with pytest.raises(ValueError, match="do not fit rays of the shape \\(2,\\)"):
        ray_derivatives(profile, np.zeros(3), 90.0, ray)
