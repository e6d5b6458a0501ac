"""Fits of closed forms: posteriors, speckle, when they stop, what they say of what they cannot see."""
import numpy as np
import pytest
from closed_models import Exponential, Matrix

from mitsonar.inversion import LBFGS, Classes, Gamma, Gaussian, Prior, Stopping, TrustRegion, fit

TO_THE_END = Stopping(iterations=30, noise=None, fall=1e-13)
EXACT = TrustRegion(inner=200, tolerance=1e-12)


def _linear(rows=60, columns=20, seed=0):
    rng = np.random.default_rng(seed)
    matrix, truth = rng.standard_normal((rows, columns)), rng.standard_normal(columns)
    return Matrix(matrix), matrix @ truth + 0.3 * rng.standard_normal(rows), truth


def test_a_linear_fit_is_the_analytic_posterior():
    # float64 and LSMR to 1e-12: closed form to 1e-6 with room
    model, record, _ = _linear()
    deviation = np.linspace(0.5, 2, 20)
    found = fit(model, Gaussian(record, 0.3), {"x": Prior(deviation=deviation, mean=0.1)}, method=EXACT,
                stopping=TO_THE_END)
    covariance = np.linalg.inv(model.matrix.T @ model.matrix / 0.09 + np.diag(deviation ** -2))
    mean = covariance @ (model.matrix.T @ record / 0.09 + 0.1 / deviation ** 2)
    np.testing.assert_allclose(found.values["x"], mean, atol=1e-6)
    np.testing.assert_allclose(found.uncertainty["x"], np.sqrt(np.diag(covariance)), rtol=1e-6)
    np.testing.assert_allclose(found.resolved["x"], 1 - np.diag(covariance) / deviation ** 2, atol=1e-6)
    square = found.observability.singular_values ** 2
    assert found.observability.effective == pytest.approx((square / (1 + square)).sum())


def test_a_smooth_linear_fit_is_the_analytic_posterior():
    rng = np.random.default_rng(5)
    model = Matrix(rng.standard_normal((50, 36)), (6, 6))
    record = rng.standard_normal(50)
    prior = Prior(deviation=1.5, length=2.0, spacing=(1.0, 1.0))
    found = fit(model, Gaussian(record, 0.5), {"x": prior}, method=EXACT, stopping=TO_THE_END)
    root = prior.bound("x", np.zeros((6, 6))).root
    rows = np.stack([root.transpose(one) for one in np.eye(36)])
    before = rows @ rows.T
    gain = before @ model.matrix.T @ np.linalg.inv(model.matrix @ before @ model.matrix.T + 0.25 * np.eye(50))
    np.testing.assert_allclose(found.values["x"].ravel(), gain @ record, atol=1e-6)
    deviation = np.sqrt(np.diag(before - gain @ model.matrix @ before))
    np.testing.assert_allclose(found.uncertainty["x"].ravel(), deviation, rtol=1e-6)


def test_gradients_alone_end_at_the_same_values():
    model, record, _ = _linear(columns=8)
    priors = {"x": Prior(deviation=1.0)}
    wanted, found = (fit(model, Gaussian(record, 0.3), priors, method=method, stopping=TO_THE_END).values["x"]
                     for method in (EXACT, LBFGS(gradients=200)))
    np.testing.assert_allclose(found, wanted, atol=1e-4)


def test_many_unknowns_are_looked_at_by_probes_that_never_say_too_much():
    # 300 unknowns, 12 of them seen well: the probes find all 12, and the deviations are those of the closed form
    rng = np.random.default_rng(1)
    matrix = np.zeros((40, 300))
    matrix[:12] = 5 * rng.standard_normal((12, 300)) / np.sqrt(300)
    model = Matrix(matrix)
    found = fit(model, Gaussian(matrix @ rng.standard_normal(300), 0.1), {"x": Prior(deviation=1.0)}, directions=20,
                method=EXACT, stopping=TO_THE_END)
    exact = np.sqrt(np.diag(np.linalg.inv(np.eye(300) + matrix.T @ matrix / 0.01)))
    assert not found.observability.complete
    np.testing.assert_allclose(found.uncertainty["x"], exact, rtol=1e-6)
    assert found.observability.effective == pytest.approx(12, rel=0.01)
    fewer = fit(model, Gaussian(matrix @ np.ones(300), 0.1), {"x": Prior(deviation=1.0)}, directions=5)
    assert np.all(fewer.uncertainty["x"] > exact - 1e-9)


def test_gamma_is_unbiased_where_least_squares_is_not():
    # one look of speckle, 12,000 bins over 6 unknowns: each is known to 1/sqrt(2000) = 0.022 in ln I, a mean to 0.01
    rng = np.random.default_rng(4)
    matrix = np.kron(np.eye(6), np.ones((2000, 1)))
    truth = rng.uniform(-1, 1, 6)
    record = np.exp(matrix @ truth) * rng.exponential(1, 12_000)
    priors = {"x": Prior(deviation=3.0)}
    gamma = fit(Exponential(matrix), Gamma(record, 1.0), priors)
    squares = fit(Exponential(matrix), Gaussian(record, np.maximum(record, 0.05)), priors,
                  stopping=Stopping(noise=None))
    assert abs(np.mean(gamma.values["x"] - truth)) < 0.03
    np.testing.assert_allclose(gamma.uncertainty["x"], 1 / np.sqrt(2000), rtol=0.05)
    assert np.mean(squares.values["x"] - truth) < -0.5
    assert "noise" in gamma.stopped


def test_it_stops_at_the_noise_and_says_so():
    model, record, truth = _linear(rows=200, columns=50)
    likelihood = Gaussian(record, 0.3)
    # few inner iterations: steps go by the best known directions first
    found = fit(model, likelihood, {"x": Prior(deviation=1.0)}, method=TrustRegion(inner=2))
    assert "fitted to its noise" in found.stopped
    assert found.deviance[-1] <= 1 < found.deviance[-2]
    further = fit(model, likelihood, {"x": Prior(deviation=1.0)}, method=EXACT,
                  stopping=Stopping(noise=None, fall=1e-9))
    assert further.deviance[-1] < found.deviance[-1]
    assert "stands still" in further.stopped


def test_it_says_when_iterations_are_done():
    found = fit(Exponential(np.eye(3)), Gaussian(np.full(3, 50.0), 1e-3), {"x": Prior(deviation=1.0)},
                stopping=Stopping(iterations=1))
    assert found.iterations == 1
    assert "no more were asked for" in found.stopped


def test_steps_that_overshoot_are_taken_back():
    # exp(x) = 50 from x = 0: a whole Gauss-Newton step would go to x = 49
    found = fit(Exponential(np.eye(2)), Gaussian(np.full(2, 50.0), 1.0), {"x": Prior(deviation=10.0)},
                stopping=Stopping(iterations=60, noise=0.0))
    np.testing.assert_allclose(found.values["x"], np.log(50), rtol=1e-3)
    assert np.all(np.diff(found.cost) < 0)


def test_a_model_that_hears_sums_is_told():
    # x1 + x2 and x3 + x4 alone: two patterns of four are left to the prior, differences of opposite signs
    matrix = np.kron(np.eye(2), np.ones((1, 2)))
    found = fit(Matrix(matrix), Gaussian(np.array([2.0, 4.0]), 0.01), {"x": Prior(deviation=1.0)}, method=EXACT,
                stopping=TO_THE_END)
    assert found.unseen == 2
    assert found.observability.effective == pytest.approx(2, abs=1e-3)
    for pattern in found.parameters["x"].unseen[:2]:
        np.testing.assert_allclose(matrix @ pattern, 0, atol=1e-6)
    assert any("2 patterns of the parameters cannot be told" in one for one in found.sentences())
    assert "cannot be told" in repr(found)
    np.testing.assert_allclose(found.uncertainty["x"], np.sqrt(0.5), rtol=1e-3)


def test_derivatives_that_do_not_agree_are_refused():
    model, record, _ = _linear(columns=5)
    other = model.matrix * 1.01
    with pytest.raises(ValueError, match="forward and backward derivatives by x differ"):
        fit(Matrix(model.matrix, backward=other), Gaussian(record, 1.0), {"x": Prior(deviation=1.0)})


def test_parameters_that_nothing_hears_are_refused():
    with pytest.raises(ValueError, match="no value of the record that counts moves"):
        fit(Matrix(np.zeros((3, 2))), Gaussian(np.ones(3), 1.0), {"x": Prior(deviation=1.0)})


@pytest.mark.parametrize("lower, upper", [(-0.5, 0.5), (-np.inf, 0.5), (-0.5, np.inf)])
def test_answers_stay_between_bounds_and_begin_with_the_deviation_asked_for(lower, upper):
    truth = np.array([-1.0, 0.2, 1.0])
    prior = Prior(deviation=0.3, lower=lower, upper=upper)
    found = fit(Matrix(np.eye(3)), Gaussian(truth, 0.01), {"x": prior}, stopping=TO_THE_END)
    assert np.all((found.values["x"] > lower) & (found.values["x"] < upper))
    assert found.values["x"][1] == pytest.approx(0.2, abs=0.02)
    bound = prior.bound("x", np.zeros(3))
    np.testing.assert_allclose(bound.limits.inside(bound.mean), 0, atol=1e-12)
    np.testing.assert_allclose(bound.limits.slope(bound.mean) * bound.root.forward(np.ones(3)), 0.3)


def test_classes_end_in_labels_with_probabilities():
    # noise of half the gap: a fit without classes is off by it, with classes all that noise did not carry over
    rng = np.random.default_rng(7)
    wanted = rng.integers(0, 3, 200)
    levels = np.array([-27.0, -20.0, -14.0])
    record = levels[wanted] + 1.5 * rng.standard_normal(200)
    prior = Prior(deviation=10.0, mean=-20.0, classes=Classes(values=tuple(levels), spread=0.3))
    found = fit(Matrix(np.eye(200)), Gaussian(record, 1.5), {"x": prior},
                stopping=Stopping(noise=None, iterations=30)).parameters["x"]
    assert np.mean(found.labels == wanted) > 0.95
    assert np.abs(found.value - levels[wanted])[found.labels == wanted].max() < 1.0
    np.testing.assert_allclose(found.probabilities.sum(1), 1)
    assert found.probabilities.shape == (200, 3)


def test_the_answer_is_a_dataset_that_files_hold(tmp_path):
    import mitsonar

    model = Matrix(np.random.default_rng(1).standard_normal((30, 6)), (2, 3))
    found = fit(model, Gaussian(np.ones(30), 1.0), {"x": Prior(deviation=1.0)})
    dataset = found.to_dataset()
    mitsonar.write(dataset, tmp_path / "fit.nc")
    again = mitsonar.read(tmp_path / "fit.nc")
    np.testing.assert_array_equal(again["x"].values, found.values["x"])
    assert again["x_deviation"].dims == ("x_0", "x_1")
    assert again["x"].attrs["units"] == "m"
    assert again.attrs["stopped"] == found.stopped
    assert again.attrs["parameters"] == ["x"]


@pytest.mark.parametrize("make, words", [
    (lambda: {"y": Prior(deviation=1.0)}, "'y' is not a parameter of the model"),
    (lambda: {}, "no parameter has a prior"),
    (lambda: {"x": Prior(deviation=0.0)}, "not above zero"),
    (lambda: {"x": Prior(deviation=np.ones(3))}, "deviation of the shape"),
    (lambda: {"x": Prior(deviation=1.0, lower=1.0)}, "not between the bounds"),
    (lambda: {"x": Prior(deviation=1.0, lower=1.0, upper=0.0)}, "bounds 1 and 0"),
    (lambda: {"x": Prior(deviation=1.0, length=1.0)}, "needs the nodes' spacing"),
    (lambda: {"x": Prior(deviation=1.0, spacing=(1.0,))}, "needs a length"),
    (lambda: {"x": Prior(deviation=1.0, length=1.0, spacing=(1.0, 1.0))}, "2 spacings"),
])
def test_priors_that_cannot_be_are_told(make, words):
    model, record, _ = _linear()
    with pytest.raises(ValueError, match=words):
        fit(model, Gaussian(record, 1.0), make())


def test_a_record_of_another_sonar_is_told():
    with pytest.raises(ValueError, match="a record of the same sonar"):
        fit(Matrix(np.eye(3)), Gaussian(np.ones(4), 1.0), {"x": Prior(deviation=1.0)})


def test_a_record_with_less_noise_than_was_said_is_fitted_all_the_same():
    """Its deviance is below what was expected from the start: that is no answer while steps still help."""
    truth, wide = np.array([1.0, -2.0, 0.5]), 2.5
    found = fit(Matrix(np.repeat(np.eye(3), 200, 0)), Gaussian(np.repeat(truth, 200), wide),
                {"x": Prior(deviation=3.0)})
    assert found.deviance[0] < 1 and found.iterations >= 1
    assert found.values["x"] == pytest.approx(truth, abs=0.01)
    assert any("of the stated noise: the record probably has less" in sentence for sentence in found.sentences())
