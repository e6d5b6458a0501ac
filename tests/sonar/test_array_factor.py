"""The array factor at evenly spaced sines, held against the sum over elements at each sine: rounding, 1e-12 of Σ|w|."""
import numpy as np
import pytest

from mitsonar.sonar.arrays.array_factor import array_factor


@pytest.mark.parametrize("elements, first, step, count", [
    (1, 0.0, 1.0, 1), (7, -2.0, 0.013, 308), (40, 0.3, -1e-3, 1001), (40, -0.7, 0.02, 64), (3, 1.0, 0.5, 2)])
def test_array_factor_is_the_sum_over_elements(elements, first, step, count):
    random = np.random.default_rng(elements)
    place, weight = random.normal(0, 30, elements), random.normal(size=elements) + 1j * random.normal(size=elements)
    found = array_factor(place, weight, first=first, step=step, count=count)
    sines = first + step * np.arange(count)
    assert found.shape == (count,)
    assert np.abs(found - np.exp(2j * np.pi * np.outer(sines, place)) @ weight).max() < 1e-12 * np.abs(weight).sum()
