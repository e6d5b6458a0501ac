"""What is said of parameters near their bounds, and what looking takes."""
import tracemalloc

import numpy as np
import pytest
from closed_models import Matrix

from mitsonar.inversion import Gaussian, Prior, Stopping, fit


@pytest.mark.parametrize("lower, upper, deviation", [(0.0, 1.0, 0.5), (0.0, np.inf, 0.1), (-np.inf, 1.0, 0.1)])
def test_deviations_of_numbers_pressed_against_a_bound_are_finite_and_stay_between(lower, upper, deviation):
    # the record says -30, 0.5 and 30, to 0.01: b(q) is the bound itself in float64
    found = fit(Matrix(np.eye(3)), Gaussian(np.array([-30.0, 0.5, 30.0]), 0.01),
                {"x": Prior(deviation=deviation, mean=0.6, lower=lower, upper=upper)},
                stopping=Stopping(iterations=200, noise=None))
    answer = found.parameters["x"]
    for array in (answer.uncertainty, answer.resolved, answer.seen, answer.unseen):
        assert np.isfinite(array).all()
    assert np.all(answer.uncertainty <= 0.5 * (upper - lower))
    assert answer.value[1] == pytest.approx(0.5, abs=0.01)
    # 0.01 of noise, where the bound bends little
    assert answer.uncertainty[1] == pytest.approx(0.01, rel=0.05)
    assert answer.resolved[1] > 0.95


def test_deviations_near_a_bound_are_those_of_both_sides():
    # nothing is heard of the second number: it keeps the prior's deviation of q, 0.3 of 1, mapped to both sides
    prior = Prior(deviation=0.3, mean=0.8, lower=-1.0, upper=1.0)
    found = fit(Matrix(np.array([[1.0, 0.0]])), Gaussian(np.array([0.8]), 0.1), {"x": prior}).parameters["x"]
    q, sigma = np.arctanh(0.8), 0.3 / (1 - 0.8 ** 2)
    assert found.uncertainty[1] == pytest.approx(0.5 * (np.tanh(q + sigma) - np.tanh(q - sigma)), rel=1e-6)
    assert found.resolved[1] == pytest.approx(0, abs=1e-9)


def test_a_prior_wider_than_its_bounds_is_refused():
    with pytest.raises(ValueError, match="a deviation of 5 between the bounds 0 and 1, where none is above 0.5"):
        fit(Matrix(np.eye(1)), Gaussian(np.ones(1), 0.1), {"x": Prior(deviation=5.0, mean=0.5, lower=0.0, upper=1.0)})


def test_looking_at_a_long_record_takes_one_copy_of_its_columns():
    # 30 columns of 40,000 bins are 10 MB; a QR of all at once takes three times that
    matrix = np.random.default_rng(0).standard_normal((40_000, 30))
    model, likelihood = Matrix(matrix), Gaussian(matrix @ np.ones(30), 1.0)
    tracemalloc.start()
    found = fit(model, likelihood, {"x": Prior(deviation=1.0)})
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1.6 * matrix.nbytes
    np.testing.assert_allclose(found.observability.singular_values, np.linalg.svd(matrix, compute_uv=False))
