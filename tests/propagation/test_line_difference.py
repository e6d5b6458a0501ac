"""Delays along a line of elements by a polynomial against the straight vectors that it is made of, and its bound.

Closed form: δ = (√(R² + 2 R s x + x²) - R) / c. The bound ε = (R / 2c) (h / 2R)^N may not be passed but by rounding.
"""
import drjit as dr
import numpy as np
import pytest
from drjit.auto import Float

from mitsonar.device.arrays import upload
from mitsonar.propagation.returns.line_difference import LineChange, polynomial, straight_runs
from mitsonar.propagation.returns.straight_vectors import StraightLeg, hit_fields
from mitsonar.propagation.returns.travel import steady
from mitsonar.propagation.returns.vector_approximation import expected_error, vector_difference, vector_element_fields
from mitsonar.water import SoundSpeedProfile

C = 1500.0


def line_of(half, count=33):
    """Elements across, not quite at equal steps, about a middle a little off the origin."""
    step = np.linspace(-1, 1, count) + np.r_[0, 0.01 * np.cos(np.arange(count - 2)), 0]
    return np.outer(half * step, [0.6, 0.8, 0]) + [0.001, -0.002, 0.0]


@pytest.mark.parametrize("half, nearest, count", [(0.08, 4.0, 5), (0.5, 20.0, 5), (0.5, 5.0, 5), (0.5, 5.0, 6),
                                                  (1.0, 5.0, 7)])
def test_the_polynomial_keeps_its_bound(half, nearest, count, rng):
    offsets = line_of(half)
    line = LineChange.through(offsets, count)
    direction = rng.normal(size=(500, 3))
    place = direction / np.linalg.norm(direction, axis=1, keepdims=True) * rng.uniform(nearest, 60, (500, 1))

    def later(at):
        return (np.linalg.norm(place - at, axis=-1) - np.linalg.norm(place, axis=-1)) / C

    coefficients = LineChange.coefficients([upload(Float, later(node).astype(np.float32)) for node in line.nodes])
    rounding = 4e-7 * 1.1 * half / C
    for offset, u in zip(offsets, line.place):
        found = polynomial(coefficients, dr.opaque(Float, float(u))).numpy()
        assert np.abs(found - later(offset)).max() < line.error(nearest, C) + rounding


def test_what_is_no_line_or_too_near_has_no_polynomial():
    bent = line_of(0.1)
    bent[7, 2] += 1e-6
    assert LineChange.through(bent) is None
    assert LineChange.through(np.zeros((20, 3))) is None
    assert LineChange.through(line_of(0.5)).error(0.9, C) == np.inf
    assert LineChange.through(line_of(0.08)).error(6.0, C) < 1e-11 < LineChange.through(line_of(0.5)).error(1.8, C)


GENTLE = SoundSpeedProfile([0.0, 20.0, 60.0], [1508.0, 1498.0, 1490.0])
KINKED = SoundSpeedProfile([0.0, 9.95, 10.03, 60.0], [1508.0, 1508.0, 1499.0, 1490.0])


def left_over(line, profile, nearest, rng):
    """Largest difference [s] of polynomials from the vector approximation, float64, for echoes that may use that.

    A line 10 m deep heaves and rolls; hits lie up to 60 m off, at 2 to 85 degrees from the level.
    """
    grazing, azimuth = np.radians(rng.uniform(2, 85, 400)), rng.uniform(0, 2 * np.pi, 400)
    length, there = rng.uniform(nearest, 60, 400), np.full(400, profile.at(10.0))
    leg = StraightLeg(length, there - length / 15, np.cos(grazing), np.sin(grazing), np.full(400, 0.02))
    towards = np.cos(grazing) * np.cos(azimuth), np.cos(grazing) * np.sin(azimuth), np.sin(grazing)
    motion = steady([1.5, 0.5, 0.05], [0.01, 0.02, 0.0])
    hits = hit_fields(leg, towards, np.full(400, 0.001), length / 750, motion, there)

    def fields(place):
        return zip(*np.broadcast_arrays(*vector_element_fields(place, 10.0, profile)))

    nodes = np.cos(np.pi * (np.arange(line.count) + 0.5) / line.count)
    at_nodes = [vector_difference(hits, at) for at in fields(line.nodes)]
    powers = np.linalg.solve(np.vander(nodes, increasing=True), at_nodes)
    elements = [*fields(line.middle + line.place[:, None] * line.half)]
    off = [np.abs(u ** np.arange(line.count) @ powers - vector_difference(hits, at))
           for u, at in zip(line.place, elements)]
    sure = np.max([expected_error(hits, at) for at in elements], 0) < 5e-10
    assert sure.mean() > 0.4
    return np.max(off, 0)[sure].max()


def straight_line(*heights):
    """A line of 33 elements, a metre long, between two heights over its middle."""
    return np.column_stack([np.linspace(-0.5, 0.5, 33), np.zeros(33), np.linspace(*heights, 33)])


@pytest.mark.parametrize("tall, height", [((0.0, 0.0), 0.002), ((0.12, 0.12), 0.13), ((-0.02, 0.02), 0.03)])
def test_lines_off_the_level_are_polynomials_in_smooth_water(tall, height, rng):
    """Level, raised like a bank of receivers, and pitched.

    The estimate is 5e-12 s or less, as is what is left of most echoes; rays that nearly turn at the array, which the
    approximation itself gives to 5e-10 s, leave up to 1.5e-11 s. Float32 rounds delays to 1.5e-11 s rms.
    """
    line = LineChange.through(straight_line(*tall), 5)
    assert line.error(20.0, C) + line.water_error(20.0, C, depth=10.0, profile=GENTLE, height=height) < 5e-12
    assert left_over(line, GENTLE, 20.0, rng) < 3e-11


def test_a_kink_of_the_profile_within_the_line_has_no_polynomial(rng):
    """A line pitched through a step of 9 m/s; a level one sees none of it."""
    pitched, level = (LineChange.through(straight_line(-rise, rise), 5) for rise in (0.1, 0.0))
    assert pitched.water_error(20.0, C, depth=10.0, profile=KINKED, height=0.1) > 1e-9
    assert left_over(pitched, KINKED, 20.0, rng) > 1e-10
    assert level.water_error(20.0, C, depth=10.0, profile=KINKED, height=1e-6) < 1e-15


def test_banks_of_an_array_are_lines_of_their_own():
    bank = straight_line(0.0, 0.1)
    assert straight_runs(np.concatenate([bank, bank + [0, 0.03, 0.2]])) == [slice(0, 33), slice(33, 66)]
    assert straight_runs(bank) == [slice(0, 33)] and straight_runs(bank[:1]) == [slice(0, 1)]
    circle = np.column_stack([np.cos(np.arange(8)), np.sin(np.arange(8)), np.zeros(8)])
    assert straight_runs(circle) == [slice(k, k + 2) for k in range(0, 8, 2)]
