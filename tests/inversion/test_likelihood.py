"""Likelihoods of records: closed forms, slopes against differences, and statistics of speckle."""
import numpy as np
import pytest

from mitsonar.inversion.fitting.likelihood import Gamma, Gaussian


@pytest.mark.parametrize("robust", [None, 1.5])
@pytest.mark.parametrize("kind", [Gamma, Gaussian])
def test_slopes_are_those_of_differences(kind, robust):
    # central differences of float64 at 1e-6: 1e-8 of the slope
    rng = np.random.default_rng(1)
    record, means = rng.gamma(2.0, 1.0, 40), rng.uniform(0.2, 3.0, 40)
    likelihood = kind(record, 3.0 if kind is Gamma else 0.4, robust=robust)
    terms = likelihood.terms(means)
    for bin_ in range(40):
        step = np.where(np.arange(40) == bin_, 1e-6, 0)
        slope = (likelihood.terms(means + step).misfit - likelihood.terms(means - step).misfit) / 2e-6
        assert terms.slope[bin_] == pytest.approx(slope, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("robust", [None, 2.0])
@pytest.mark.parametrize("looks", [1.0, 4.0])
def test_deviance_at_the_truth_is_as_expected(looks, robust):
    # 50,000 draws: the mean deviance is uncertain by its deviation (about 1.6) over 220
    rng = np.random.default_rng(2)
    means = rng.uniform(1, 9, 50_000)
    likelihood = Gamma(means * rng.gamma(looks, 1 / looks, means.size), looks, robust=robust)
    assert 2 * likelihood.terms(means).misfit / likelihood.expected == pytest.approx(1, abs=0.03)
    normal = Gaussian(means + 0.5 * rng.standard_normal(means.size), 0.5, robust=robust)
    assert 2 * normal.terms(means).misfit / normal.expected == pytest.approx(1, abs=0.03)


def test_gamma_finds_the_mean_of_speckle_where_least_squares_does_not():
    # one look, 40,000 bins of mean 5: the mean is known to 0.5 %. Least squares that weighs by what was heard, 1/y²,
    # is drawn to the faint bins (biased without bound as the faintest gets fainter), levels to exp(ψ(1)) = 0.56 of it
    rng = np.random.default_rng(3)
    record = 5 * rng.exponential(1, 40_000)
    grid = np.linspace(1, 9, 1601)
    gamma = Gamma(record, 1.0)
    weighted = Gaussian(record, record)
    best = [grid[np.argmin([one.terms(np.full(record.size, m)).misfit for m in grid[::8]]) * 8]
            for one in (gamma, weighted)]
    assert best[0] == pytest.approx(5, rel=0.01)
    assert best[1] < 2.5
    assert np.exp(np.log(record).mean()) == pytest.approx(5 * np.exp(-0.5772), rel=0.02)


def test_bins_that_are_nan_do_not_count():
    record = np.array([1.0, np.nan, 3.0])
    for likelihood in (Gaussian(record, 1.0), Gamma(record, 1.0)):
        terms = likelihood.terms(np.array([1.0, np.inf, 3.0]))
        assert terms.deviance[1] == terms.slope[1] == terms.weight[1] == 0
        assert likelihood.counted.tolist() == [True, False, True]


def test_a_bin_without_any_echo_does_not_count_for_gamma():
    assert Gamma(np.array([0.0, 2.0])).counted.tolist() == [False, True]


def test_outliers_weigh_less_when_robust():
    record = np.array([0.0, 100.0])
    plain, robust = Gaussian(record, 1.0).terms(np.zeros(2)), Gaussian(record, 1.0, robust=3.0).terms(np.zeros(2))
    assert robust.deviance[1] == pytest.approx(3 * (2 * 100 - 3))
    assert robust.weight[1] == pytest.approx(0.03 * plain.weight[1])


@pytest.mark.parametrize("make, words", [
    (lambda: Gaussian(np.array([np.nan]), 1.0), "the record has no finite value that counts"),
    (lambda: Gaussian(np.zeros(3), np.ones(2)), "deviation has the shape"),
    (lambda: Gamma(np.array([-1.0, 1.0])), "below zero; give intensities"),
    (lambda: Gamma(np.ones(3), 0.0), "looks holds numbers"),
    (lambda: Gamma(np.ones(3), robust=-1.0), "robust is -1"),
    (lambda: Gamma(np.ones(3)).terms(np.ones(4)), "a record of the same sonar"),
    (lambda: Gamma(np.ones(3)).terms(np.full(3, np.nan)), "not finite"),
])
def test_what_cannot_be_is_told(make, words):
    with pytest.raises(ValueError, match=words):
        make()
