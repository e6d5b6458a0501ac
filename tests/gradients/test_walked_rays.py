"""Range, time and spread of walked rays at a fixed depth, attached to profile, source and launch.

Reference: sixth-order differences of the walk itself, and, in `tests/propagation/test_profile_derivatives.py`, of rays
that know nothing of it. Steps of 1 mm/s, 1 mm and 1e-6 leave 1e-10 of rounding and less of truncation.
"""
import mitsonar  # noqa: F401  isort: skip
import drjit as dr
import drjit.llvm.ad as lib
import numpy as np
import pytest
from drjit.llvm.ad import Bool, Float64

from mitsonar.gradients.attached.walked_rays import walked
from mitsonar.propagation.device_rays.layer_table import layer_table
from mitsonar.water import SoundSpeedProfile

DEPTH = np.array([2.0, 6, 14, 20, 32, 47, 60, 90, 140])
SPEED = np.array([1473.7, 1473.7, 1476, 1513, 1487, 1486, 1484, 1487, 1498])
# straight down; turned below, twice; turned above; turned below; through the uniform water on both sides
SOURCE, LAUNCH = np.array([30.0, 61, 30, 61, 1]), np.sin(np.radians([40.0, 4, -5, 5, 30]))
TARGET, ABOUT = np.array([120.0, 62, 40, 100, 160]), np.array([106.6, 1576.5, 208.0, 642.4, 288.3])


def places(speed=SPEED, source=SOURCE, launch=LAUNCH, attach=()):
    """Range and time as Dr.Jit arrays, and the inputs named in `attach`, attached."""
    given = {"speeds": Float64(speed), "z0": Float64(source), "s0": Float64(launch)}
    for name in attach:
        dr.enable_grad(given[name])
    table = layer_table(SoundSpeedProfile(DEPTH, np.array(speed)), Float64)
    return walked(table, lib, **given, z=Float64(TARGET), x=Float64(ABOUT), active=Bool(True)), given


def numbers(**changed):
    return np.array([value.numpy() for value in places(**changed)[0]])


def difference(f, step):
    return (45 * (f(step) - f(-step)) - 9 * (f(2 * step) - f(-2 * step)) + f(3 * step) - f(-3 * step)) / (60 * step)


def jacobian():
    """By differences: (3, R, K + 2)."""
    columns = [difference(lambda h: numbers(speed=SPEED + h * row), 1e-3) for row in np.eye(len(SPEED))]
    columns += [difference(lambda h: numbers(source=SOURCE + h), 1e-3),
                difference(lambda h: numbers(launch=LAUNCH + h), 1e-6)]
    return np.stack(columns, -1)


@pytest.fixture(scope="module")
def backward():
    """Rows of the Jacobian by backward mode, (3, R, K + 2)."""
    rows = np.zeros((3, len(SOURCE), len(SPEED) + 2))
    for which in range(3):
        for ray in range(len(SOURCE)):
            found, given = places(attach=("speeds", "z0", "s0"))
            dr.backward(dr.sum(found[which] * Float64((np.arange(len(SOURCE)) == ray).astype(float))))
            by_speed, by_depth, by_launch = (dr.grad(value).numpy() for value in given.values())
            rows[which, ray] = np.r_[by_speed, by_depth[ray], by_launch[ray]]
    return rows


def test_gradients_of_direct_and_turned_rays_are_those_of_differences(backward):
    expected = jacobian()
    largest = np.abs(expected[..., :-2]).max(-1, keepdims=True)
    assert np.abs((backward - expected)[..., :-2] / largest).max() < 1e-8
    np.testing.assert_allclose(backward[..., -2:], expected[..., -2:], rtol=1e-7, atol=1e-10)


def test_forward_and_backward_agree(backward):
    rng = np.random.default_rng(3)
    moved = {"speeds": rng.standard_normal(9), "z0": rng.standard_normal(5), "s0": 0.01 * rng.standard_normal(5)}
    found, given = places(attach=moved)
    for name, direction in moved.items():
        dr.set_grad(given[name], Float64(direction))
    dr.forward_to(*found)
    each = np.concatenate([np.tile(moved["speeds"], (5, 1)), moved["z0"][:, None], moved["s0"][:, None]], 1)
    for which in range(3):
        expected = (backward[which] * each).sum(1)
        np.testing.assert_allclose(dr.grad(found[which]).numpy(), expected, rtol=1e-11)


def test_one_source_depth_for_all_rays_gets_the_sum(backward):
    found, given = places(source=[30.0], attach=("z0",))
    dr.backward(dr.sum(found[1]))
    expected = difference(lambda h: numbers(source=[30.0 + h])[1].sum(), 1e-3)
    assert dr.grad(given["z0"]).numpy() == pytest.approx(expected, rel=1e-8)


def test_a_ray_that_comes_by_elsewhere_has_no_gradient():
    table = layer_table(SoundSpeedProfile(DEPTH, SPEED), Float64)
    speeds = Float64(SPEED)
    dr.enable_grad(speeds)
    reach, time, spread = walked(table, lib, speeds, Float64(5.0), Float64(-0.03), Float64(60.0), Float64(300.0, 0.0),
                         Bool(True, False))
    dr.backward(dr.sum(reach + time + spread))
    assert reach.numpy().tolist() == [300, 0] and time.numpy().tolist() == [0, 0]
    assert not dr.grad(speeds).numpy().any()
