"""Arcs of rays through one layer: the sums of thin slices, the limit of no gradient, and the turning point.

The integrals along depth are dx = p c / s dz, dt = dz / (c s), dl = dz / s, dx/dp = c / s^3 dz, with
s = sqrt(1 - p^2 c^2). Gauss's rule of 40 points integrates them to 1e-13 where s is above 0.1.
"""
import numpy as np
import pytest

from mitsonar.propagation.numpy_rays.layer_arcs import LayerArc, TurningArc, descent_after

PLACES, WEIGHTS = np.polynomial.legendre.leggauss(40)
GRADIENTS = [-2.0, -0.02, -1e-9, 0.0, 1e-9, 0.02, 2.0]


@pytest.mark.parametrize("gradient", GRADIENTS)
@pytest.mark.parametrize("steepness", [0.15, 0.6, 1.0])
def test_an_arc_has_the_integrals_along_its_ray(gradient, steepness):
    thickness, upper = 10.0, 1500.0
    lower = upper + gradient * thickness
    parameter = np.sqrt(1 - steepness ** 2) / max(upper, lower)
    depth = 0.5 * thickness * (1 + PLACES)
    speed = upper + gradient * depth
    sine = np.sqrt(1 - (parameter * speed) ** 2)
    integrals = [0.5 * thickness * WEIGHTS @ f for f in (speed / sine, speed / sine ** 3, 1 / (speed * sine), 1 / sine)]
    arc = LayerArc.of(*(np.array([value]) for value in (parameter, thickness, upper, lower)))
    found = arc.stretch, arc.slope, arc.time, arc.length(np.array([parameter]))
    assert np.concatenate(found) == pytest.approx(np.array(integrals), rel=1e-11)
    back = descent_after(arc.time, np.array([gradient]), np.array([upper]), arc.upper_sine)
    assert back == pytest.approx(thickness, rel=1e-11)


def test_an_arc_that_turns_is_twice_the_limit_of_one_that_nearly_turns():
    """Arcs that end a hair above their turning point leave sqrt(2 g dz / c) of their sine: 1e-6 for 1e-9 m."""
    gradient, upper, sine = np.array([0.5]), np.array([1500.0]), np.array([0.2])
    parameter = np.sqrt(1 - sine ** 2) / upper
    turn = TurningArc(parameter, gradient, sine)
    assert turn.depth(upper) == pytest.approx((1 / parameter - upper) / gradient, rel=1e-12)
    thickness = turn.depth(upper) - 1e-9
    arc = LayerArc.of(parameter, thickness, upper, upper + gradient * thickness)
    halves = parameter * arc.stretch, arc.time, arc.length(parameter)
    for found, half in zip((turn.range, turn.time, turn.length), halves):
        assert found == pytest.approx(2 * half, rel=1e-4)
    step = 1e-6 * parameter
    ranges = [TurningArc(p, gradient, np.sqrt(1 - (p * upper) ** 2)).range
              for p in (parameter - step, parameter + step)]
    assert turn.slope == pytest.approx((ranges[1] - ranges[0]) / (2 * step), rel=1e-6)


def test_rays_that_turn_before_have_no_arc_and_no_depth():
    parameter = np.array([0.999 / 1500])
    arc = LayerArc.of(parameter, np.array([100.0]), np.array([1500.0]), np.array([1510.0]))
    assert np.isnan([arc.stretch, arc.slope, arc.time, arc.length(parameter)]).all()
    assert np.isnan(descent_after(np.array([10.0]), np.array([0.1]), np.array([1500.0]), np.array([0.05])))
