"""Steps that are refused or overshoot, and fits that stop too early."""
import numpy as np
import pytest
from closed_models import Exponential, Matrix

from mitsonar.inversion import LBFGS, Adam, Classes, Gaussian, GaussNewton, Prior, Stopping, fit


class Limited(Exponential):
    """No record beyond |x| = 0.2."""

    def value(self, values):
        if np.abs(values["x"]).max() > 0.2:
            raise ValueError("too far")
        return super().value(values)


@pytest.mark.parametrize("method", [Adam(rate=0.1), LBFGS(), GaussNewton()], ids=["adam", "lbfgs", "gauss_newton"])
def test_steps_stay_where_a_record_can_be_made(method):
    # the misfit pulls to ln 3 = 1.1, far beyond
    found = fit(Limited(np.eye(3)), Gaussian(np.full(3, 3.0), 0.1), {"x": Prior(deviation=1.0)}, method=method,
                stopping=Stopping(iterations=10))
    assert np.all((found.values["x"] > 0.1) & (found.values["x"] <= 0.2))


@pytest.mark.parametrize("rate", [0.05, 0.3, 1.0])
def test_adam_goes_on_with_shorter_steps_where_a_step_overshot(rate):
    # 8 unknowns of 100 bins: the posterior mean in closed form; a deviation of it is 0.01
    rng = np.random.default_rng(0)
    matrix = rng.standard_normal((100, 8))
    record = matrix @ np.full(8, 0.5) + 0.1 * rng.standard_normal(100)
    wanted = np.linalg.solve(matrix.T @ matrix + 0.01 * np.eye(8), matrix.T @ record)
    found = fit(Matrix(matrix), Gaussian(record, 0.1), {"x": Prior(deviation=1.0)}, method=Adam(rate=rate),
                stopping=Stopping(iterations=60, noise=None, fall=1e-7))
    np.testing.assert_allclose(found.values["x"], wanted, atol=0.003)
    assert np.all(np.diff(found.cost) < 0)


def test_a_fit_with_classes_does_not_stand_still_before_their_pull_is_whole():
    # the misfit rises while the pull narrows, from one step to the next; at the end each number is the closed form's
    # of its class: (record / 1.5² + class / 0.3² + mean / 10²) / (1.5⁻² + 0.3⁻² + 10⁻²), others weigh exp(-200)
    rng = np.random.default_rng(3)
    wanted = rng.choice([-27.0, -14.0], 30)
    record = wanted + 1.5 * rng.standard_normal(30)
    prior = Prior(deviation=10.0, mean=-20.0, classes=Classes(values=(-27.0, -14.0), spread=0.3))
    found = fit(Matrix(np.eye(30)), Gaussian(record, 1.5), {"x": prior},
                stopping=Stopping(noise=None, iterations=60, fall=1e-9))
    weights = np.array([1.5, 0.3, 10.0]) ** -2
    closed = (weights[0] * record + weights[1] * wanted + weights[2] * -20.0) / weights.sum()
    np.testing.assert_allclose(found.values["x"], closed, atol=2e-3)
    assert "stands still" in found.stopped
