"""Exact eigenrays: against 60-digit references, closed forms, and what must hold of any ray.

Closed forms in water of one gradient g, c1 and c2 the speeds at the ends, D their distance:

    cosh(g T) = 1 + g^2 D^2 / (2 c1 c2)        A = (c2 sinh(g T) / g)^2

Bias: none, the forms are exact. Tolerances are those of double precision: times 1e-14 relative (a few roundings per
layer), angles 1e-12 rad, spreading 1e-9, since near a turning point it divides by a sine known to 1e-16. Printed
numbers are compared to their last digit.
"""
import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from mitsonar.propagation import eigenray
from mitsonar.propagation.numpy_rays.eigenrays import eigenrays
from mitsonar.water import SoundSpeedProfile

REFERENCE = Path(__file__).resolve().parents[2] / ".." / "shared" / "reference" / "eigenrays.json"
SIX_NODES = SoundSpeedProfile([0, 5, 12, 25, 40, 60], [1508, 1507.5, 1499, 1491, 1489.5, 1490.5])
DUCT = SoundSpeedProfile([0, 30, 70, 90, 200], [1512, 1497, 1480, 1489, 1520])
UNIFORM = SoundSpeedProfile.constant(1500)


def linear(gradient, deepest=200.0, nodes=2):
    depth = np.linspace(0, deepest, nodes)
    return SoundSpeedProfile(depth, 1500 + gradient * depth)


def rough(rng, nodes=40, step=1.0):
    depth = np.sort(rng.uniform(0, 80, nodes))
    return SoundSpeedProfile(depth, 1490 + np.cumsum(rng.normal(0, step, nodes)))


# ---------------------------------------------------------------------------------------------- reference numbers

def test_every_reference_case():
    if not REFERENCE.is_file():
        pytest.skip(f"the reference cases are not beside the checkout ({REFERENCE})")
    reference = json.loads(REFERENCE.read_text())
    profiles = {name: SoundSpeedProfile(nodes["depth"], nodes["c"]) for name, nodes in reference["profiles"].items()}
    for case in reference["cases"]:
        profile = profiles[case["profile"]]
        rays = eigenrays(profile, case["source_depth"], case["target_depth"], case["range"])
        launch = float(case["launch_angle"])
        k = np.nanargmin(np.abs(rays.launch_angle - launch))
        assert rays.travel_time[k] == pytest.approx(float(case["time"]), rel=0, abs=1e-15)
        assert rays.arc_length[k] == pytest.approx(float(case["arc_length"]), rel=1e-14)
        assert rays.launch_angle[k] == pytest.approx(launch, abs=1e-14)
        assert rays.arrival_angle[k] == pytest.approx(float(case["arrival_angle"]), abs=1e-14)
        assert rays.ray_parameter[k] == pytest.approx(float(case["p"]), rel=1e-14, abs=1e-30)
        if case["spreading_m2_per_sr"]:
            assert rays.spreading_area[k] == pytest.approx(float(case["spreading_m2_per_sr"]), rel=1e-12)
        if case["turning_depth"]:
            assert rays.turning_depth[k] == pytest.approx(float(case["turning_depth"]), abs=1e-10)
        else:
            assert np.isnan(rays.turning_depth[k])


@pytest.mark.parametrize("source, target, launch, horizontal_range, time, length, arrival, spreading_db", [
    (3, 60, 75, 15.1185743954816716, 0.0394868384425980718, 58.9709623060490129, 75.1750699161581081, 35.32797754),
    (3, 60, 45, 55.9396193437220304, 0.0534764226065878517, 79.8643829953378224, 45.6499636561698523, 37.93293208),
    (3, 60, 30, 95.1653998648636735, 0.0742772126360826264, 110.93196597588887, 31.11346236072382, 40.72665717),
    (3, 60, 15, 188.080543048526316, 0.131585352253516346, 196.543361047942971, 17.2719164968948663, 45.42134942),
    (3, 60, 10, 255.19279681796611, 0.175062613732832263, 261.522806739642341, 13.2014903727212212, 47.58822793),
    (20, 50, 60, 17.2647476890350169, 0.023223081675100254, 34.6131725930382944, 60.0902244756625727, 30.76076381),
    (20, 50, 10, 158.008718872220353, 0.107906172323895977, 160.832681742427327, 10.8508738058798026, 43.84174576),
])
def test_direct_rays_through_six_nodes(source, target, launch, horizontal_range, time, length, arrival, spreading_db):
    ray = eigenray(SIX_NODES, source, target, horizontal_range)
    assert ray.travel_time == pytest.approx(time, rel=1e-14)
    assert ray.arc_length == pytest.approx(length, rel=1e-14)
    assert np.rad2deg(ray.launch_angle) == pytest.approx(launch, abs=1e-12)
    assert np.rad2deg(ray.arrival_angle) == pytest.approx(arrival, abs=1e-12)
    assert 10 * np.log10(ray.spreading_area) == pytest.approx(spreading_db, abs=6e-9)


@pytest.mark.parametrize("gradient, launch, turning, horizontal_range, time, length", [
    (0.5, 5, 11.4595126300421688, 524.931981155544031, 0.349509743848134232, 525.59883785897998),
    (0.016, 3, 128.657437305091551, 9826.45861557022576, 6.54797732084540427, None),
    (5, 20, 19.2533317427736422, 218.382140559721417, 0.142551401889779994, None),
])
def test_turned_rays_back_to_their_depth(gradient, launch, turning, horizontal_range, time, length):
    for nodes in (2, 201):
        ray = eigenray(linear(gradient, nodes=nodes), 1e-3, 1e-3, horizontal_range * (1 + 1e-3 * gradient / 1500))
        assert np.rad2deg(ray.launch_angle) == pytest.approx(launch, abs=1e-11)
        assert ray.arrival_angle == -ray.launch_angle
        assert ray.travel_time == pytest.approx(time, rel=1e-12)
        assert (ray.turning_depth - 1e-3) / (1 + 1e-3 * gradient / 1500) == pytest.approx(turning, rel=1e-12)
        if length:
            assert ray.arc_length / (1 + 1e-3 * gradient / 1500) == pytest.approx(length, rel=1e-12)


# --------------------------------------------------------------------------------------------------- closed forms

@pytest.mark.parametrize("gradient", [-1, -0.1, -1e-3, -1e-7, 1e-7, 1e-3, 0.1, 1, 4])
@pytest.mark.parametrize("nodes", [2, 41])
def test_one_gradient_has_a_closed_form(gradient, nodes, rng):
    profile = linear(gradient, nodes=nodes)
    source, target, horizontal_range = rng.uniform(90, 110, (3, 50))
    target[:5], horizontal_range[5:10] = source[:5], 0
    ray = eigenray(profile, source, target, horizontal_range)
    start, end = 1500 + gradient * source, 1500 + gradient * target
    distance = np.hypot(horizontal_range, target - source)
    time = 2 / gradient * np.arcsinh(gradient * distance / (2 * np.sqrt(start * end)))
    np.testing.assert_allclose(ray.travel_time, time, rtol=1e-14)
    # sinh through the distance: g T would lose digits at small gradients.
    squared = distance**2 * (1 + (gradient * distance) ** 2 / (4 * start * end)) * end / start
    np.testing.assert_allclose(ray.spreading_area, squared, rtol=1e-9)
    np.testing.assert_allclose(np.cos(ray.launch_angle) / start, ray.ray_parameter, rtol=1e-12, atol=1e-18)
    np.testing.assert_allclose(np.cos(ray.arrival_angle) / end, ray.ray_parameter, rtol=1e-12, atol=1e-18)


def test_uniform_water_has_straight_rays(rng):
    source, target = rng.uniform(-10, 100, (2, 100))
    horizontal_range = rng.uniform(0, 1000, 100)
    distance = np.hypot(target - source, horizontal_range)
    for profile in (UNIFORM, SoundSpeedProfile([0, 10, 50], [1500, 1500, 1500])):
        ray = eigenray(profile, source, target, horizontal_range)
        np.testing.assert_allclose(ray.travel_time, distance / 1500, rtol=1e-14)
        np.testing.assert_allclose(ray.arc_length, distance, rtol=1e-14)
        np.testing.assert_allclose(ray.spreading_area, distance**2, rtol=1e-13)
        np.testing.assert_allclose(ray.launch_angle, np.arctan2(target - source, horizontal_range), rtol=1e-13)
        assert np.array_equal(ray.launch_angle, ray.arrival_angle)


def test_a_horizontal_ray_in_uniform_water_is_straight():
    ray = eigenray(UNIFORM, 20, 20, 300)
    assert (ray.travel_time, ray.arc_length, ray.launch_angle, ray.spreading_area) == (0.2, 300, 0, 90000)


def test_a_vertical_ray_takes_the_integral_of_slowness():
    ray = eigenray(linear(0.5), [0, 100], [100, 0], 0)
    np.testing.assert_allclose(ray.travel_time, np.log(1550 / 1500) / 0.5, rtol=1e-14)
    np.testing.assert_allclose(ray.launch_angle, [np.pi / 2, -np.pi / 2], rtol=1e-15)
    np.testing.assert_allclose(ray.arc_length, 100, rtol=1e-15)
    np.testing.assert_allclose(ray.spreading_area[0], (1550 * np.sinh(0.5 * ray.travel_time[0]) / 0.5) ** 2, rtol=1e-12)


@pytest.mark.parametrize("profile", [UNIFORM, SIX_NODES], ids=["uniform", "six nodes"])
def test_no_distance_takes_no_time(profile):
    ray = eigenray(profile, 7, 7, 0)
    assert ray.travel_time == ray.arc_length == ray.spreading_area == ray.launch_angle == ray.arrival_angle == 0


@pytest.mark.parametrize("profile", [linear(0.5, nodes=101), linear(-0.1), SIX_NODES], ids=["up", "down", "six nodes"])
def test_depths_a_hair_apart_agree_with_equal_depths(profile, rng):
    depth = rng.uniform(6, 24, 100)
    equal = eigenrays(profile, depth, depth, 30).travel_time
    for near in (np.nextafter(depth, 0), np.nextafter(depth, 90), depth + 1e-12, depth + 1e-9, depth - 1e-9):
        np.testing.assert_allclose(eigenrays(profile, depth, near, 30).travel_time, equal, rtol=1e-11)


# --------------------------------------------------------------------------------------- what holds of every ray

PROFILES = [SIX_NODES, DUCT, linear(0.3), linear(-0.3), rough(np.random.default_rng(5))]


@pytest.mark.parametrize("profile", PROFILES)
def test_the_way_back_is_the_way_there(profile, rng):
    one, other = rng.uniform(-5, 75, (2, 60))
    horizontal_range = rng.uniform(0, 600, 60)
    there, back = eigenrays(profile, one, other, horizontal_range), eigenrays(profile, other, one, horizontal_range)
    np.testing.assert_allclose(there.travel_time, back.travel_time, rtol=1e-14)
    np.testing.assert_allclose(there.arc_length, back.arc_length, rtol=1e-12)
    np.testing.assert_allclose(there.launch_angle, -back.arrival_angle, atol=1e-10)
    weight = (profile.at(one) / profile.at(other))[:, None] ** 2
    np.testing.assert_allclose(there.spreading_area * weight, back.spreading_area, rtol=1e-7)


@pytest.mark.parametrize("profile", PROFILES)
def test_time_changes_along_the_slowness_at_the_target(profile, rng):
    # dT = p dX + (sin / c) dz; central differences over 1 mm err by less than 1e-11 s/m beside 7e-4 s/m.
    source, target = rng.uniform(0, 35, 40), rng.uniform(40, 75, 40)
    horizontal_range, step = rng.uniform(1, 60, 40), 1e-3
    ray = eigenray(profile, source, target, horizontal_range)
    ahead = eigenray(profile, source, target, horizontal_range + [[step], [-step]]).travel_time
    below = eigenray(profile, source, target + [[step], [-step]], horizontal_range).travel_time
    np.testing.assert_allclose((ahead[0] - ahead[1]) / (2 * step), ray.ray_parameter, atol=1e-10)
    across = np.sin(ray.arrival_angle) / profile.at(target)
    # A node within the step bends the time's second derivative, by less than 1e-7 s/m.
    np.testing.assert_allclose((below[0] - below[1]) / (2 * step), across, atol=1e-7)


def test_spreading_is_the_change_of_range_with_launch_angle(rng):
    source, target, horizontal_range = rng.uniform(0, 15, 40), rng.uniform(40, 60, 40), rng.uniform(10, 100, 40)
    ray, step = eigenray(SIX_NODES, source, target, horizontal_range), 1e-4
    ahead = eigenray(SIX_NODES, source, target, horizontal_range + [[step], [-step]]).launch_angle
    slope = 2 * step / np.abs(ahead[0] - ahead[1])
    area = horizontal_range * slope * np.abs(np.sin(ray.arrival_angle)) / np.cos(ray.launch_angle)
    np.testing.assert_allclose(ray.spreading_area, area, rtol=1e-7)


def test_the_earliest_is_the_first_of_all(rng):
    for profile in (DUCT, *(rough(rng) for _ in range(5))):
        source, target, horizontal_range = rng.uniform(-2, 82, 200), rng.uniform(20, 60, 200), rng.uniform(0, 2000, 200)
        first, all_rays = (find(profile, source, target, horizontal_range) for find in (eigenray, eigenrays))
        for field in dataclasses.fields(first):
            np.testing.assert_array_equal(getattr(first, field.name), getattr(all_rays, field.name)[:, 0])
        assert (np.diff(all_rays.travel_time) > 0)[all_rays.exists[:, 1:]].all()


def shot_below(profile, upper, lower, horizontal_range, launches=4000):
    """Count the rays turned once below both ends by shooting at many angles, in textbook forms."""
    count, fastest = 0, max(profile.at(upper), profile.at(lower))
    edges = np.unique(np.r_[upper, lower, profile.depth[profile.depth > upper]])
    for near, far in zip(edges, edges[1:]):
        fastest = max(fastest, profile.at(near))
        gradient = (profile.at(far) - profile.at(near)) / (far - near)
        if near < lower or profile.at(far) <= fastest:
            continue
        steepest = np.sqrt(1 - (fastest / profile.at(far)) ** 2)
        parameter = np.sqrt(1 - np.linspace(1e-6, steepest, launches) ** 2) / fastest
        reached = 2 * np.sqrt(1 - (parameter * profile.at(near)) ** 2) / (parameter * gradient)
        for top, bottom in zip(edges, edges[1:]):
            if bottom <= near:
                ends = profile.at(top), profile.at(bottom)
                sines = sum(np.sqrt(1 - (parameter * end) ** 2) for end in ends)
                reached += (2 if top >= lower else 1) * parameter * (bottom - top) * sum(ends) / sines
        count += np.count_nonzero(np.diff(reached < horizontal_range))
    return count


def test_no_turned_ray_is_missed_in_rough_water():
    rng, several = np.random.default_rng(11), 0
    for _ in range(150):
        profile = rough(rng, nodes=rng.integers(3, 40), step=rng.choice([0.1, 1, 10]))
        upper, lower = np.sort(rng.uniform(30, 50) + rng.uniform(-5, 5, 2))
        horizontal_range = 10 ** rng.uniform(1.5, 3.3)
        rays = eigenrays(profile, upper, lower, horizontal_range)
        turned = np.isfinite(rays.turning_depth)
        mirrored = SoundSpeedProfile(-profile.depth[::-1], profile.sound_speed[::-1])
        assert np.sum(turned & (rays.launch_angle > 0)) == shot_below(profile, upper, lower, horizontal_range)
        assert np.sum(turned & (rays.launch_angle < 0)) == shot_below(mirrored, -lower, -upper, horizontal_range)
        several += turned.sum() > 1
    assert several > 10  # else this tests too little


def test_two_rays_meet_and_vanish_at_a_caustic():
    # Weak refraction over strong: the range of rays that turn below has a least value, where two of them meet.
    profile = SoundSpeedProfile([0, 40, 60], [1500, 1502, 1530])
    inside, outside = 1500.0, 200.0
    turning_deep = [np.sum(eigenrays(profile, 0, 0, x).turning_depth > 40) for x in (inside, outside)]
    assert turning_deep[1] == 0
    while inside - outside > 1e-9:
        middle = (inside + outside) / 2
        rays = eigenrays(profile, 0, 0, middle)
        inside, outside = (middle, outside) if np.any(rays.turning_depth > 40) else (inside, middle)
    rays = eigenrays(profile, 0, 0, inside)
    deep = rays.turning_depth > 40
    assert 1 <= deep.sum() <= 2
    assert np.ptp(rays.launch_angle[deep]) < 1e-5
    assert rays.spreading_area[deep].max() < 1e-3 * inside**2


def test_a_ray_turning_at_a_node_is_found_once():
    even, plain = linear(0.5, 100, 101), linear(0.5, 100)
    node = np.arange(20, 100, 7)
    horizontal_range = np.sqrt((1500 + 0.5 * node) ** 2 - 1505.0**2) / 0.25
    for nudge in (-1e-12, -2e-16, 0, 2e-16, 1e-12, 1e-8):
        rays = eigenrays(even, 10, 10, horizontal_range * (1 + nudge))
        expected = eigenray(plain, 10, 10, horizontal_range * (1 + nudge))
        assert (rays.exists.sum(-1) == 1).all()
        np.testing.assert_allclose(rays.travel_time[:, 0], expected.travel_time, rtol=1e-14)
        np.testing.assert_allclose(rays.spreading_area[:, 0], expected.spreading_area, rtol=1e-7)


# ------------------------------------------------------------------------------------------- shadows and borders

def test_there_is_no_ray_in_a_shadow_zone():
    ray = eigenray(linear(-0.5), 10, 10, [50, 500])
    assert list(ray.exists) == [True, False]
    for field in dataclasses.fields(ray):
        assert np.isnan(getattr(ray, field.name)[1])


def test_water_beyond_the_ends_never_turns_a_ray():
    assert not eigenray(linear(0.5, deepest=50), 10, 10, 5000).exists
    ray = eigenray(linear(0.5, deepest=50), 60, 80, 15)
    assert ray.travel_time == pytest.approx(25 / 1525, rel=1e-14) and np.isnan(ray.turning_depth)


def test_shapes_broadcast():
    source, target = np.zeros((3, 1)), np.linspace(1, 99, 4)
    one, many = eigenray(DUCT, source, target, 50.0), eigenrays(DUCT, source, target, 50.0)
    for field in dataclasses.fields(one):
        assert getattr(one, field.name).shape == (3, 4)
        assert getattr(many, field.name).shape[:2] == (3, 4) and getattr(many, field.name).ndim == 3
    assert np.ndim(eigenray(DUCT, 1, 2, 3).travel_time) == 0 and eigenrays(DUCT, 1, 2, 3).travel_time.shape == (1,)
    assert eigenray(DUCT, [], 2, 3).travel_time.shape == (0,) and eigenrays(DUCT, [], 2, 3).travel_time.shape == (0, 1)


def test_large_batches_agree_with_single_rays(rng):
    source, target, horizontal_range = rng.uniform(0, 100, (3, 3000))
    profile = rough(rng, nodes=200)
    ray = eigenray(profile, source, target, horizontal_range)
    for k in (0, 1234, 2999):
        alone = eigenray(profile, source[k], target[k], horizontal_range[k])
        np.testing.assert_allclose(ray.travel_time[k], alone.travel_time, rtol=1e-15)


@pytest.mark.parametrize("arguments, message", [
    ((np.nan, 1, 2), "source_depth holds nan"),
    ((0, [1, np.inf], 2), "target_depth holds inf"),
    ((0, 1, -2), "horizontal_range holds -2 m"),
    (([0, 1], [1, 2, 3], 2), "do not broadcast"),
])
@pytest.mark.parametrize("find", [eigenray, eigenrays])
def test_bad_arguments_are_refused_by_name(find, arguments, message):
    with pytest.raises(ValueError, match=message):
        find(SIX_NODES, *arguments)
