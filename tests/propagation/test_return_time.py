"""Return times to elements: against published numbers, closed forms, exact eigenrays and brute force.

Geometry: the ping leaves O at time 0, the platform moves on at v, element d hears the echo of I when |w + v t| = ev t,
w = O + v t_i + d - I. Closed form in uniform water (the positive root of a quadratic), and in water of one gradient g
between speeds c1, c2 a distance D apart

    T = (2/g) asinh(g D / (2 sqrt(c1 c2)))

Bias: none of the closed forms; `vector` is an expansion whose error is at most twice its estimate, by construction of
the guard below 1 ns. Tolerances: closed forms and brute force 1e-15 s (rounding of 0.1 s), printed errors half a unit
of their last digit, `vector` 1 ns, which is twice `GUARD`.
"""
import json
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from mitsonar.propagation import eigenray, return_time, return_time_error
from mitsonar.propagation.numpy_rays.return_times import GUARD, METHODS
from mitsonar.water import SoundSpeedProfile

REFERENCE = Path(__file__).resolve().parents[2] / ".." / "shared" / "reference" / "eigenrays.json"
SIX_NODES = SoundSpeedProfile([0, 5, 12, 25, 40, 60], [1508, 1507.5, 1499, 1491, 1489.5, 1490.5])
STEEP = SoundSpeedProfile([0, 10], [1449.346570536, 1499.346570536])
KINK = SoundSpeedProfile([0, 1, 10], [1450, 1455, 1455])
UNIFORM = SoundSpeedProfile.constant(1500)
DEPTH = np.arange(0.0, 61.0)
SURE = 1e-9                # [s]
WATERS = {
    "six nodes": SIX_NODES,
    "gradient 0.1 1/s": SoundSpeedProfile([0, 60], [1500, 1506]),
    "gradient -1 1/s": SoundSpeedProfile([0, 60], [1560, 1500]),
    "thermocline": SoundSpeedProfile(DEPTH, 1490 + 9 * (1 - np.tanh((DEPTH - 15) / 4))),
    "random": SoundSpeedProfile(DEPTH, 1490 + np.cumsum(np.random.default_rng(7).uniform(-5, 5, DEPTH.size))),
}


def scene(rng, depth, bottom, count=400, reach=(5, 200)):
    """Hits all around, from O at a depth down to the bottom, the platform at the scene's (3, -2)."""
    azimuth, across = rng.uniform(0, 2 * np.pi, count), rng.uniform(*reach, count)
    below = rng.uniform(depth + 4, bottom, count)
    origin = np.array([3.0, -2.0, -depth])
    return origin, np.stack([3 + across * np.cos(azimuth), -2 + across * np.sin(azimuth), -below], -1)


def offsets(rng, length, count=6):
    """Elements that far from the centre, all around."""
    vector = rng.normal(size=(count, 3))
    return length * vector / np.linalg.norm(vector, axis=1, keepdims=True)


# ---------------------------------------------------------------------------------------------- reference numbers

# Depths of O and I, range, offset down, away from the hit, across; exact time [s]; error of equation 2 [ns].
PUBLISHED = [
    (SIX_NODES, 8, 60, 60, 0.1, 0, 0, 0.05316549203658231, 1382.8),
    (SIX_NODES, 8, 60, 60, 0.5, 0, 0, 0.0529936199400961, 6945.4),
    (SIX_NODES, 8, 60, 60, 0.5, 0.5, 0, 0.05324834181699447, 6982.1),
    (SIX_NODES, 8, 60, 150, 0.5, 0, 0.5, 0.1062887857392196, 13772),
    (SIX_NODES, 30, 60, 100, 0.5, 0, 0, 0.06997384993855351, 803.16),
    (SIX_NODES, 13, 60, 100, 1, 0, 1, 0.07382115940975544, 7983.2),
    (STEEP, 0.5, 10, 11.4, 0.117581, 0, 0, 0.01000399598949515, 9.34),
    (KINK, 0.5, 10, 11.4, 0.1, 0, 0, 0.01015538687276924, -1592.9),
    (KINK, 0.5, 10, 11.4, 0.3, 0, 0, 0.01006827595261742, -4838.5),
    (UNIFORM, 10, 60, 100, 0.5, 0, 0, 0.07438712552884702, 0),
]


@pytest.mark.parametrize("water, source, target, across, down, away, aside, exact, paper", PUBLISHED)
def test_still_platform_against_published_times(water, source, target, across, down, away, aside, exact, paper):
    geometry = [0, 0, -source], [[across, 0, -target]], [[-away, aside, -down]]
    # printed to 16 digits, from speeds that are printed to 10
    allowed = 1e-15 if water is not STEEP else 1e-11
    assert return_time(water, *geometry, method="eigenray")[0, 0] == pytest.approx(exact, abs=allowed)
    error = return_time(water, *geometry, method="paper")[0, 0] - exact
    assert error * 1e9 == pytest.approx(paper, rel=2e-4, abs=6e-3 if paper != 9.34 else 0.02)
    error = return_time(water, *geometry)[0, 0] - exact
    assert abs(error) < 0.01e-9 + allowed


@pytest.mark.parametrize("velocity, hit, out, back, bias", [
    ((2, 0, 0), (0, 100, -20), 0.067986926847904, 0.067987168579629, 0.18e-3),
    ((2, 0, 0), (70, 70, -20), 0.067330032922414, 0.06720582765283265, -93.15e-3),
    ((5, 0, 0.3), (300, 5, -30), 0.20102515044419, 0.1997042856893292, -0.9906),
    ((2, 0, 0), (100, 0, 0), 0.066666666666667, 0.06648912561029738, -133.16e-3),
])
@pytest.mark.parametrize("method", METHODS)
def test_moving_platform_and_what_stop_and_hop_would_miss(method, velocity, hit, out, back, bias):
    time = return_time(UNIFORM, [0, 0, 0], [hit], [[0, 0, 0]], velocity, method)[0, 0]
    assert time == pytest.approx(back, abs=1e-15)
    still = return_time(UNIFORM, [0, 0, 0], [hit], [[0, 0, 0]], method=method)[0, 0]
    assert still == pytest.approx(out, abs=1e-14)
    assert 0.5 * 1500 * (time - still) == pytest.approx(bias, abs=6e-6 if abs(bias) < 0.5 else 6e-5)


def test_equation_two_misses_table_one_by_23_ns():
    # the uniform gradient, and the incident speed, that reproduce both printed columns
    height = np.array([9.5, 9.382419])
    incident = return_time(STEEP, [0, 0, -0.5], [[11.36981948, 0, -10]], [[0, 0, 0]], method="eigenray")[0, 0]
    assert incident == pytest.approx(0.0100411354117, abs=2e-12)      # x_i is printed to 1e-8 m
    geometry = [0, 0, -0.5], [[11.36981948, 0, -10]], [[11.36981948 - 11.494591, 0, height[1] - height[0]]]
    exact, paper, vector = (return_time(STEEP, *geometry, method=method)[0, 0] for method in
                            ("eigenray", "paper", "vector"))
    distance = np.hypot(11.494591, 9.382419)
    assert exact == pytest.approx(0.0100535551796898, abs=2e-12)
    assert distance / exact == pytest.approx(1475.859495, abs=5e-7)
    assert distance / paper == pytest.approx(1475.856104, abs=5e-7)
    assert (paper - exact) * 1e9 == pytest.approx(23.0995, abs=2e-3)
    assert abs(vector - exact) < 1e-12


# -------------------------------------------------------------------------------------- brute force, closed forms

@pytest.mark.parametrize("velocity", [(0, 0, 0), (2, 0, 0), (-5, 3, 0.5), (40, -20, -10)])
def test_quadratic_is_the_root_in_uniform_water(velocity, rng):
    origin, hits = scene(rng, 10, 60, count=20)
    elements, v = offsets(rng, 0.7), np.array(velocity, float)
    for method in METHODS:
        found = return_time(UNIFORM, origin, hits, elements, v, method)
        for hit, row in zip(hits, found):
            out = np.linalg.norm(hit - origin) / 1500
            for d, time in zip(elements, row):
                start = origin + v * out + d - hit
                root = brentq(lambda t, w=start: np.linalg.norm(w + v * t) - 1500 * t, 0, 1, xtol=1e-16, rtol=1e-15)
                assert time == pytest.approx(root, abs=1e-15)


@pytest.mark.parametrize("gradient", [-5, -0.5, 0.05, 1])
@pytest.mark.parametrize("velocity", [(0, 0, 0), (2, 1, 0.3)])
def test_eigenray_solves_the_moving_problem_in_one_gradient(gradient, velocity, rng):
    deepest = 20 if abs(gradient) > 1 else 80
    water = SoundSpeedProfile([0, deepest], [1500 - min(gradient, 0) * deepest, 1500 + max(gradient, 0) * deepest])
    origin, hits = scene(rng, 6, deepest - 2, count=15, reach=(5, 60))
    elements, v = offsets(rng, 0.4, count=3), np.array(velocity, float)

    def closed(hit, place):
        product = water.at(-hit[2]) * water.at(-place[2])
        return 2 / gradient * np.arcsinh(gradient * np.linalg.norm(hit - place) / (2 * np.sqrt(product)))

    found = return_time(water, origin, hits, elements, v, "eigenray")
    for hit, row in zip(hits, found):
        out = closed(hit, origin)
        for d, time in zip(elements, row):
            root = brentq(lambda t, h=hit, d=d, o=out: closed(h, origin + v * (o + t) + d) - t, 0, 1, xtol=1e-17,
                          rtol=1e-15)
            assert time == pytest.approx(root, abs=2e-15)


def test_equation_one_is_the_quadratic(rng):
    """B = asin(|h|/|m| sin C) and its double give the centre's place at reception where both speeds are one."""
    origin, hits = scene(rng, 10, 60, count=50)
    v = np.array([2.0, 0.5, 0])
    out = np.linalg.norm(hits - origin, axis=1) / 1500
    incident, h = hits - origin, np.multiply.outer(out, v)
    m, length = np.linalg.norm(origin + h - hits, axis=1), np.linalg.norm(incident, axis=1)
    c = np.arccos(np.sum(incident * h, 1) / length / np.linalg.norm(h, axis=1))
    b = np.arcsin(np.linalg.norm(h, axis=1) / m * np.sin(c))
    back = length * np.sin(c) / np.sin(c + 2 * b)
    time = return_time(UNIFORM, origin, hits, [[0, 0, 0]], v, "paper")[:, 0]
    np.testing.assert_allclose(time, back / 1500, rtol=1e-13)


# ------------------------------------------------------------------------------------------------ vector, guarded

@pytest.mark.parametrize("name", WATERS)
@pytest.mark.parametrize("velocity", [(0, 0, 0), (5, 2, 0.3)])
@pytest.mark.parametrize("length", [0.1, 0.5, 1.0])
def test_vector_stays_within_twice_the_guard(name, velocity, length, rng):
    origin, hits = scene(rng, 8.3, 58)
    geometry = WATERS[name], origin, hits, offsets(rng, length), velocity
    exact, vector, error = (return_time(*geometry, method="eigenray"), return_time(*geometry),
                            return_time_error(*geometry))
    np.testing.assert_array_equal(np.isnan(vector), np.isnan(exact))
    assert np.nanmax(np.abs(vector - exact)) < SURE
    assert np.mean(error > GUARD) < 0.35


@pytest.mark.parametrize("upside_down", [False, True])
def test_up_is_down_in_mirrored_water(upside_down, rng):
    origin, hits = scene(rng, 20, 58, count=50)
    elements, v = offsets(rng, 0.5), np.array([3, 1, 0.2])
    mirrored = SoundSpeedProfile(60 - SIX_NODES.depth[::-1], SIX_NODES.sound_speed[::-1])
    flip = np.array([1, 1, -1])
    down = np.array([0, 0, -60])
    np.testing.assert_allclose(return_time(mirrored, flip * origin + down, flip * hits + down, flip * elements,
                                           flip * v), return_time(SIX_NODES, origin, hits, elements, v), atol=2e-15)


def test_every_reference_profile_to_half_a_metre(rng):
    if not REFERENCE.is_file():
        pytest.skip(f"the reference profiles are not beside the checkout ({REFERENCE})")
    for name, nodes in json.loads(REFERENCE.read_text())["profiles"].items():
        water = SoundSpeedProfile(nodes["depth"], nodes["c"])
        bottom = min(water.depth[-1], 80)
        origin, hits = scene(rng, 0.2 * bottom, 0.95 * bottom, count=100)
        geometry = water, origin, hits, offsets(rng, 0.5, count=3), (2, 1, 0.1)
        exact, vector = return_time(*geometry, method="eigenray"), return_time(*geometry)
        assert np.nanmax(np.abs(vector - exact)) < SURE, name


# ---------------------------------------------------------------------------------------------- guard, edge cases

def test_guard_hands_turned_and_level_rays_to_the_eigenray():
    water = SoundSpeedProfile([0, 100], [1500, 1600])
    hits = np.array([[200, 0, -20.0], [150, 0, -20.2], [20, 0, -50]])
    geometry = water, [0, 0, -20], hits, [[0, 0, 0.3], [0, 0, -0.3]]
    error = return_time_error(*geometry)
    assert np.isinf(error[:2]).all() and (error[2] < GUARD).all()
    np.testing.assert_array_equal(return_time(*geometry)[:2], return_time(*geometry, method="eigenray")[:2])


def test_error_estimate_grows_with_the_array(rng):
    origin, hits = scene(rng, 8.3, 58)
    directions = offsets(rng, 1.0)
    medians = [np.median(return_time_error(SIX_NODES, origin, hits, length * directions)) for length in (0.1, 1, 10)]
    assert medians[0] < medians[1] / 100 < medians[2] / 1e4


def test_no_ray_no_time():
    duct = SoundSpeedProfile([0, 100], [1600, 1500])     # a shadow near the surface
    times = return_time(duct, [0, 0, -1], [[500, 0, -1.5], [20, 0, -50]], [[0, 0, 0]])
    for method in METHODS:
        np.testing.assert_array_equal(np.isnan(return_time(duct, [0, 0, -1], [[500, 0, -1.5], [20, 0, -50]],
                                                           [[0, 0, 0]], method=method)), np.isnan(times))
    assert np.isnan(times[0, 0]) and np.isfinite(times[1, 0])
    assert np.isnan(return_time_error(duct, [0, 0, -1], [[500, 0, -1.5]], [[0, 0, 0]])).all()


@pytest.mark.parametrize("method", METHODS)
def test_degenerate_places(method):
    hits = [[0, 0, -30], [0, 0, -8], [40, 0, -8], [1e-9, 0, -30]]
    for water in (UNIFORM, SIX_NODES):
        times = return_time(water, [0, 0, -8], hits, [[0, 0, 0], [0.3, 0, 0], [0, 0, -0.2]], (1, 0, 0.1), method)
        straight = np.linalg.norm(np.array(hits) - [0, 0, -8], axis=1) / 1500
        there = np.isfinite(times[:, 0])
        assert there[[0, 1, 3]].all()
        np.testing.assert_allclose(times[there, 0], straight[there], rtol=0.02, atol=1e-15)
    assert return_time(UNIFORM, [0, 0, -8], np.empty((0, 3)), [[0, 0, 0]], method=method).shape == (0, 1)


def test_blocks_do_not_show(rng):
    origin, hits = scene(rng, 8.3, 58, count=30_000)
    elements = offsets(rng, 0.5, count=3)
    whole = return_time(SIX_NODES, origin, hits, elements)
    np.testing.assert_array_equal(return_time(SIX_NODES, origin, hits[29_990:], elements), whole[29_990:])


def test_centre_of_a_still_array_hears_the_outgoing_time(rng):
    origin, hits = scene(rng, 8.3, 58)
    out = eigenray(SIX_NODES, 8.3, -hits[:, 2], np.hypot(*(hits - origin)[:, :2].T)).travel_time
    for method in METHODS:
        np.testing.assert_allclose(return_time(SIX_NODES, origin, hits, [[0, 0, 0]], method=method)[:, 0], out,
                                   rtol=1e-14)


@pytest.mark.parametrize("change, words", [
    ({"method": "exact"}, "paper, vector, eigenray"),
    ({"elements": np.empty((0, 3))}, "at least one offset"),
    ({"elements": [0, 0, 0]}, r"elements must have shape \(E, 3\), got \(3,\)"),
    ({"origin": [[0, 0, 0]]}, r"origin must have shape \(3,\)"),
    ({"hits": [[0, 0]]}, r"hits must have shape \(H, 3\)"),
    ({"hits": [[0, np.nan, 0]]}, "hits holds nan"),
    ({"hits": "here"}, "must be numbers"),
    ({"velocity": [1500, 0, 0]}, "not slower than the sound"),
])
def test_bad_arguments_are_named(change, words):
    arguments = {"origin": [0, 0, -5], "hits": [[10, 0, -20]], "elements": [[0, 0, 0]], **change}
    with pytest.raises(ValueError, match=words):
        return_time(UNIFORM, **arguments)
