"""Where rays to a depth are said to be alone they are, and of most they are said to be.

Truth: every direct and once-turned ray as NumPy's solver lists them. Profiles at random, of 2 to 12 nodes, uniform
layers among them, that end above the points; ends close to one another, at nodes and beyond them.
"""
import drjit as dr
import numpy as np
import pytest
from drjit.auto import Float, Float64
from summer import SUMMER

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.propagation.device_rays.layer_table import layer_table
from mitsonar.propagation.device_rays.sole_range import sole_range
from mitsonar.propagation.numpy_rays import exact_returns
from mitsonar.propagation.numpy_rays.eigenrays import eigenrays
from mitsonar.propagation.returns.travel import REST
from mitsonar.water import SoundSpeedProfile

PROFILES, POINTS = 25, 1500


def any_profile(rng):
    depth = np.cumsum(rng.uniform(0.3, 8, rng.integers(2, 13)))
    change = rng.normal(0, 4, len(depth)) * (rng.random(len(depth)) > 0.2)
    return SoundSpeedProfile(depth - depth[0] * (rng.random() > 0.3), 1500 + np.cumsum(change))


def cells(sole, depth):
    return np.clip(np.searchsorted(sole.edge, depth, side="right") - 1, 0, len(sole.edge) - 2)


def known(sole, depth, other):
    """The range of two depths: that of their cells, or that within which no ray turns that climbs as high."""
    height = np.minimum(np.abs(depth - other), sole.radius)
    return np.maximum(sole.range[cells(sole, depth), cells(sole, other)],
                      np.sqrt(height * (2 * sole.radius - height)))


def test_no_two_rays_lead_to_points_within(rng):
    crowded = 0
    for profile in (any_profile(rng) for _ in range(PROFILES)):
        sole, bottom = sole_range(profile), profile.depth[-1]
        depth, other = rng.uniform(-2, bottom + 5, (2, POINTS))
        close, node = slice(0, POINTS // 2), slice(0, POINTS, 7)
        other[close] = depth[close] + rng.normal(0, 1, POINTS // 2)
        depth[node] = rng.choice(profile.depth, depth[node].size)
        x = rng.uniform(1, 250, POINTS)
        arrivals = eigenrays(profile, depth, other, x).exists.sum(-1)
        assert not (arrivals[x < known(sole, depth, other)] > 1).any()
        crowded += (arrivals > 1).sum()
    assert crowded > 500


def test_the_device_looks_up_the_same(rng):
    for profile in (any_profile(rng), SoundSpeedProfile.constant(1500.0), SUMMER):
        sole = sole_range(profile)
        depth, other = rng.uniform(-60, 90, (2, POINTS))
        found = layer_table(profile, Float).sole_range(upload(Float64, depth), upload(Float64, other)).numpy()
        np.testing.assert_allclose(found, known(sole, depth, other), rtol=1e-5)


def test_rays_that_turn_go_no_shorter_way_than_an_arc_of_the_tightest_bend(rng):
    """In water of one gradient that arc is the shortest ray of a turn: level at the deeper end, of radius c / g."""
    profile = SoundSpeedProfile([0.0, 500.0], [1500.0, 1530.0])
    depth, other = rng.uniform(0, 400, (2, POINTS))
    sole = sole_range(profile)
    deeper, height = np.maximum(depth, other), np.abs(depth - other)
    speed = profile.at(deeper)                     # sound bends up: the arc is level where sound is fastest
    arc = np.sqrt(height * (2 * speed / 0.06 - height))
    bound = np.sqrt(height * (2 * sole.radius - height))
    assert (bound <= arc).all() and (bound > 0.98 * arc).all()


def test_depths_of_one_cell_are_told_apart():
    """A bed 10 m below the sonar in the upper 20 m of a deep cast whose gradient wavers in the last digit."""
    depth = np.arange(0, 6000, 5.0)
    profile = SoundSpeedProfile(depth, 1490 + 0.0164 * depth + 2e-4 * np.sin(depth))
    found = layer_table(profile, Float).sole_range(Float64(5.0), Float64(15.0))
    assert found[0] > 1000


@pytest.mark.parametrize(("depth", "bed", "reach", "most"), [(17.0, 30.0, 200.0, 0.0), (10.0, 22.0, 150.0, 0.0),
                                                             (17.0, 22.0, 150.0, 0.03)])
def test_beds_under_a_thermocline_are_left_to_the_device(rng, monkeypatch, depth, bed, reach, most):
    """Elements about the sonar and a rough bed: 3, 12 and 31 % of these pairs were looked for in NumPy."""
    asked = []
    reference = exact_returns.eigenray
    monkeypatch.setattr(exact_returns, "eigenray", lambda profile, *ends: asked.append(ends[1].size) or reference(
        profile, *ends))
    distance, bearing = rng.uniform(20, reach, 4000), rng.uniform(0, 2 * np.pi, 4000)
    down = rng.normal(bed, 0.2, 4000) - depth
    lib, table = arrays_of(Float), layer_table(SUMMER, Float)
    place = lib.Array3f64(*(upload(Float64, part) for part in (distance * np.cos(bearing), distance * np.sin(bearing),
                                                                -down)))
    first = upload(Float64, np.hypot(distance, down) / 1495)
    for height in (-0.5, -0.25, 0.0, 0.25, 0.5):
        offset = [dr.opaque(Float64, part) for part in (0.0, 0.0, height)]
        time, _ = exact_returns.exact_return(table, lib, dr.opaque(Float64, depth), place, Float64(0), offset, REST,
                                             first)
        dr.eval(time)
    assert sum(asked) <= most * 5 * 4000
