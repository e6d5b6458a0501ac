"""The frozen ray against exact eigenrays of water that changes across, found by shooting (RK45, rtol 1e-11).

Geometry: a thermocline of 8 m/s at 15 m; from 5 m or 10 m depth to 30 m or 60 m, 50 to 400 m away; a front of 2 m/s, a
gradient of 0.01 m/s per metre, an internal wave of 2 m and 30 m. The effect is 0.3 to 360 µs. What remains of it after
the frozen ray and its bending, by 48 steps, was 0.0 to 0.5 ns for front and gradient; for the wave 0.0 ns at 50 m, 1 ns
at 100 m, 6.5 ns at 200 m and 0.7 µs at 400 m, where the profile spreads the bend. Bounds are twice that.
"""
import functools

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import newton

from mitsonar.propagation import eigenray
from mitsonar.propagation.returns.frozen_ray import FrozenLeg, frozen_ray
from mitsonar.water import SoundSpeedProfile
from mitsonar.water.fields import Front, Gradient, InternalWave

EAST = {"y": 0.0, "sine": 1.0, "cosine": 0.0}
NODES = np.arange(0, 100.01, 0.1)          # fine, so that the profile's corners do not count


def speed(z):
    return 1500 - 4 * (1 + np.tanh((z - 15) / 4))


def slope(z):
    return -1 / np.cosh((z - 15) / 4) ** 2


PROFILE = SoundSpeedProfile(NODES, speed(NODES))
#: fields, and their change of speed and its derivatives along x and z, in closed form
FIELDS = {
    "front": (Front(x=100.0, change_of_speed=2.0, width=60.0, **EAST),
              lambda x, z: 1 + np.tanh((x - 100) / 30), lambda x, z: 1 / np.cosh((x - 100) / 30) ** 2 / 30,
              lambda x, z: 0 * z),
    "gradient": (Gradient(x=0.0, gradient=0.01, **EAST), lambda x, z: 0.01 * x, lambda x, z: 0.01 + 0 * x,
                 lambda x, z: 0 * z),
    "internal wave": (InternalWave(x=100.0, height=2.0, length=30.0, **EAST),
                      lambda x, z: speed(z - wave(x)) - speed(z),
                      lambda x, z: slope(z - wave(x)) * wave(x) * np.tanh((x - 100) / 30) / 15,
                      lambda x, z: slope(z - wave(x)) - slope(z))}
LEGS = [(50, 5, 30), (100, 5, 30), (200, 5, 30), (200, 5, 60), (400, 10, 60)]
#: largest remaining error [ns] by distance
BOUNDS = {"front": {50: 0.02, 100: 0.05, 200: 0.4, 400: 1.0}, "gradient": {50: 0.02, 100: 0.06, 200: 0.25, 400: 1.0},
          "internal wave": {50: 0.05, 100: 2.5, 200: 13.0, 400: 1400.0}}


def wave(x):
    return 2 / np.cosh((x - 100) / 30) ** 2


@functools.cache
def exact(kind, x0, z0, x1, z1):
    """The travel time of the eigenray from one place to another, by shooting."""
    change, along, down = FIELDS[kind][1:] if kind else (lambda x, z: 0 * z,) * 3

    def shot(angle):
        def rhs(x, y):
            z, theta, _ = y
            c = speed(z) + change(x, z)
            curve = (along(x, z) * np.sin(theta) - (slope(z) + down(x, z)) * np.cos(theta)) / c
            return [np.tan(theta), curve / np.cos(theta), 1 / (c * np.cos(theta))]
        return solve_ivp(rhs, (x0, x1), [z0, angle, 0], rtol=1e-11, atol=1e-13).y[:, -1]

    angle = np.arctan2(z1 - z0, x1 - x0)
    return shot(newton(lambda theta: shot(theta)[0] - z1, angle, x1=angle + 1e-3, tol=1e-13))[2]


def frozen(kind, distance, z0, z1):
    """Return what the field adds, by the frozen ray."""
    ray = eigenray(PROFILE, float(z0), float(z1), np.array([float(distance)]))
    one = np.ones(1)
    return frozen_ray(FrozenLeg((0 * one, 0 * one, z0 * one), (one, 0 * one), distance * one, z1 * one, ray.arc_length,
                          ray.ray_parameter, np.sin(ray.launch_angle)), FIELDS[kind][0],
                      lambda z: (PROFILE.at(z), PROFILE.gradient(z)))


@pytest.mark.parametrize("distance, z0, z1", LEGS)
@pytest.mark.parametrize("kind", FIELDS)
def test_times_are_those_of_exact_eigenrays(kind, distance, z0, z1):
    effect = exact(kind, 0, z0, distance, z1) - exact("", 0, z0, distance, z1)
    ray = frozen(kind, distance, z0, z1)
    left = 1e9 * abs(effect - ray.later[0])
    assert left < BOUNDS[kind][distance]
    assert left < max(1e9 * ray.bending[0], 0.5)                 # the bending bounds what it leaves
    assert abs(effect) > 100 * 1e-9 * left or distance == 400


@pytest.mark.parametrize("kind, bound", [("front", 4.0), ("gradient", 4.0), ("internal wave", 20.0)])
@pytest.mark.parametrize("distance, z0, z1", [(100, 5, 30), (200, 5, 60)])
def test_the_first_moment_carries_times_to_elements(kind, bound, distance, z0, z1):
    """Elements 0.5 m off: 12 to 452 ns without the moment; what is left is of second order [ns]."""
    ray, start = frozen(kind, distance, z0, z1), (0, z0, distance, z1)
    centre = exact(kind, *start) - exact("", *start)
    bare = []
    for dx, dz in ((0.5, 0), (-0.5, 0), (0, 0.5), (0, -0.5), (0.35, 0.35)):
        there = dx, z0 + dz, distance, z1
        apart = exact(kind, *there) - exact("", *there) - centre
        assert 1e9 * abs(apart - dx * ray.slope[0][0] - dz * ray.slope[2][0]) < bound
        bare.append(1e9 * abs(apart))
    assert max(bare) > 2.5 * bound


def test_a_leg_along_the_thermocline_says_that_it_is_bent():
    """There the bent ray changes between elements: 157 ns are left of the moment, and the bending is as much."""
    assert 1e9 * frozen("internal wave", 200, 5, 30).bending[0] == pytest.approx(170, rel=0.05)


@pytest.mark.parametrize("kind", FIELDS)
def test_derivatives_are_those_of_the_change(kind, rng):
    field, at = FIELDS[kind][0], (lambda z: (speed(z), slope(z)))
    x, y, z = rng.uniform(0, 200, 50), rng.uniform(-50, 50, 50), rng.uniform(1, 40, 50)
    made, h = field.change(x, y, z, at), 1e-4
    np.testing.assert_allclose(made.value, FIELDS[kind][1](x, z), atol=1e-9)
    for slope_, step in ((made.east, (h, 0, 0)), (made.north, (0, h, 0)), (made.down, (0, 0, h))):
        ends = [field.change(x + s * step[0], y + s * step[1], z + s * step[2], at).value for s in (1, -1)]
        np.testing.assert_allclose(slope_, (ends[0] - ends[1]) / (2 * h), atol=1e-6)


def test_a_field_moves_along_its_heading():
    front = Front(x=10.0, y=20.0, sine=0.6, cosine=0.8, speed=0.5, change_of_speed=2.0, width=10.0)
    later = front.at(107.0, 100.0)
    assert (later.x, later.y, later.moves, front.moves) == (10 + 0.6 * 3.5, 20 + 0.8 * 3.5, False, True)
