"""Layers attached to the nodes of a profile.

Closed form: the rows of `layer_table` made of a moved profile, at the same reference. Central differences over 10 mm/s
are right to 1e-9 of the largest: the third derivative of 1/c² gives 24 (h/c)²/6 = 2e-10.
"""
import mitsonar  # noqa: F401  isort: skip
import drjit as dr
import numpy as np
import pytest
from drjit.llvm.ad import Float64

from mitsonar.gradients.attached.layers import attached_layers
from mitsonar.propagation.device_rays.layer_table import layer_table
from mitsonar.water import SoundSpeedProfile

DEPTH = np.array([2.0, 6, 14, 20, 32, 47, 140])
SPEED = np.array([1473.7, 1473.7, 1476, 1513, 1487, 1486, 1488])      # a layer of 2.5 %, which the table splits
AT = np.array([-5.0, 1, 2, 3, 6, 19, 25, 100, 140, 200])


def made(speed):
    return layer_table(SoundSpeedProfile(DEPTH, speed), Float64)


def looked_up(table, reference):
    """Speed, and the integrals of 1/c² and 1/c⁴ down to each depth: they depend on no reference."""
    speed, moments = table.at(Float64(AT))
    e1, e2 = moments[0], moments[1]
    below = Float64(AT - DEPTH[0])
    r0 = Float64(reference)
    slowness = r0 * (e1 + below)                                       # ∫ 1/c²
    fourth = r0 * r0 * (e2 + 2 * e1 + below)                           # ∫ 1/c⁴
    return [speed, 1e6 * slowness, 1e12 * fourth]


def test_numbers_are_those_of_the_table():
    table, speeds = made(SPEED), Float64(SPEED)
    dr.enable_grad(speeds)
    attached = attached_layers(table, speeds)
    assert np.array_equal(dr.detach(attached.layers).numpy(), table.layers.numpy())
    assert dr.grad_enabled(attached.layers) and not dr.grad_enabled(table.layers)


@pytest.mark.parametrize("row", [0, 1, 2], ids=["speed", "squared slowness", "its square"])
def test_gradients_by_nodes_are_those_of_differences(row):
    weights = np.random.default_rng(row).standard_normal(AT.size)
    table, speeds = made(SPEED), Float64(SPEED)
    dr.enable_grad(speeds)
    value = looked_up(attached_layers(table, speeds), table.reference.numpy())[row]
    dr.backward(dr.sum(value * Float64(weights)))
    expected = []
    for k in range(len(SPEED)):
        step = 0.01 * (np.arange(len(SPEED)) == k)
        ends = [made(SPEED + sign * step) for sign in (1, -1)]
        up, down = (looked_up(end, end.reference.numpy())[row].numpy() @ weights for end in ends)
        expected.append((up - down) / 0.02)
    np.testing.assert_allclose(dr.grad(speeds).numpy(), expected, atol=2e-8 * np.abs(expected).max())


def test_forward_and_backward_agree():
    table, speeds = made(SPEED), Float64(SPEED)
    direction, weights = np.random.default_rng(5).standard_normal((2, 10))
    dr.enable_grad(speeds)
    value = attached_layers(table, speeds).at(Float64(AT))[1][1]
    dr.backward(dr.sum(value * Float64(weights)))
    back = dr.grad(speeds).numpy() @ direction[:7]
    speeds = Float64(SPEED)
    dr.enable_grad(speeds)
    dr.set_grad(speeds, Float64(direction[:7]))
    ahead = dr.forward_to(attached_layers(table, speeds).at(Float64(AT))[1][1]).numpy() @ weights
    assert ahead == pytest.approx(back, rel=1e-12)


def test_water_of_one_speed_has_one_node():
    table, speeds = layer_table(SoundSpeedProfile.constant(1500.0), Float64), Float64([1500.0])
    dr.enable_grad(speeds)
    speed, _ = attached_layers(table, speeds).at(Float64([-3.0, 0.5, 40.0]))
    dr.backward(dr.sum(speed))
    assert dr.grad(speeds).numpy() == pytest.approx(3.0)


def test_speeds_that_do_not_fit_the_profile_are_refused():
    with pytest.raises(ValueError, match="3 sound speeds for the 7 nodes of the profile; give one for each"):
        attached_layers(made(SPEED), Float64([1.0, 2.0, 3.0]))
