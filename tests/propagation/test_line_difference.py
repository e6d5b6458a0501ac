"""Delays along a line of elements by a polynomial against the straight vectors that it is made of, and its bound.

Closed form: δ = (√(R² + 2 R s x + x²) - R) / c. The bound ε = (R / 2c) (h / 2R)^N may not be passed but by rounding.
"""
import drjit as dr
import numpy as np
import pytest
from drjit.auto import Float

from mitsonar.device.arrays import upload
from mitsonar.propagation.returns.line_difference import LineChange, polynomial

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
