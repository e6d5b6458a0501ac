"""Steps that are refused or overshoot, and fits that stop too early."""
import numpy as np
import pytest
from closed_models import Exponential, Matrix

from mitsonar.inversion import LBFGS, Classes, Gaussian, Prior, Stopping, TrustRegion, fit


class Limited(Exponential):
    """No record beyond |x| = 0.2."""

    def value(self, values):
        if np.abs(values["x"]).max() > 0.2:
            raise ValueError("too far")
        return super().value(values)


class Two:
    """y = A a + B b, with b a hundredth as loud, whose backward derivative by b has another sign."""

    def __init__(self, sign=1.0):
        rng = np.random.default_rng(1)
        self.matrices = {"a": rng.standard_normal((20, 3)), "b": 0.01 * rng.standard_normal((20, 3))}
        self.start, self.units, self.sign = {"a": np.zeros(3), "b": np.zeros(3)}, {}, sign

    def value(self, values):
        return sum(self.matrices[name] @ value for name, value in values.items())

    def linearised(self, values):
        line = Two(self.sign)
        line.value = self.value(values)
        return line

    def forward(self, tangents):
        return sum(self.matrices[name] @ value for name, value in tangents.items())

    def backward(self, cotangent):
        return {"a": self.matrices["a"].T @ cotangent, "b": self.sign * self.matrices["b"].T @ cotangent}


@pytest.mark.parametrize("method", [LBFGS(), TrustRegion()], ids=["lbfgs", "trust_region"])
def test_steps_stay_where_a_record_can_be_made(method):
    # the misfit pulls to ln 3 = 1.1, far beyond
    found = fit(Limited(np.eye(3)), Gaussian(np.full(3, 3.0), 0.1), {"x": Prior(deviation=1.0)}, method=method,
                stopping=Stopping(iterations=10))
    assert np.all((found.values["x"] > 0.1) & (found.values["x"] <= 0.2))


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
    assert "stands still" in found.stopped or "no step lowers" in found.stopped


def test_a_quiet_parameter_with_a_wrong_transpose_is_told_by_name():
    # of 10⁻⁴ of the product of both: beside the other it would not be seen
    record, priors = np.ones(20), {"a": Prior(deviation=1.0), "b": Prior(deviation=1.0)}
    fit(Two(), Gaussian(record, 0.1), priors)
    with pytest.raises(ValueError, match="derivatives by b differ"):
        fit(Two(-1.0), Gaussian(record, 0.1), priors)
