"""Scores of normal variables against their closed forms, and of ties against chance.

For scores of objects N(d, 1) and others N(0, 1), AUC = Φ(d / √2). With 20,000 of each its standard error is below
0.004; the tolerance is three times that. The probability of an object given its score is then 1 / (1 + exp(d²/2 - d s))
and has no calibration error but that of chance, some √(p (1 - p) / n) in each class: below 0.01 in all.
"""
import numpy as np
import pytest
from scipy import stats

from mitsonar.dataset.scores import auc, average_precision, calibration, calibration_error

COUNT, APART = 20_000, 1.5
wanted = np.arange(2 * COUNT) < COUNT
scores = np.random.default_rng(3).standard_normal(2 * COUNT) + APART * wanted


def test_auc_is_that_of_two_normal_variables():
    assert abs(auc(scores, wanted) - stats.norm.cdf(APART / np.sqrt(2))) < 0.012
    assert auc(-scores, wanted) == pytest.approx(1 - auc(scores, wanted))


def test_average_precision_is_the_mean_over_recall():
    """Against the integral of precision over recall, on its threshold."""
    at = np.linspace(-6, 8, 4001)
    recall, alarms = stats.norm.sf(at - APART), stats.norm.sf(at)
    expected = -np.trapezoid(recall / (recall + alarms), recall)
    assert abs(average_precision(scores, wanted) - expected) < 0.012
    assert average_precision(np.array([3.0, 2, 1]), np.array([True, False, True])) == pytest.approx((1 + 2 / 3) / 2)


def test_equal_scores_are_worth_chance():
    rare = np.arange(1000) % 50 == 0
    assert auc(np.ones(1000), rare) == 0.5 and average_precision(np.ones(1000), rare) == pytest.approx(0.02)


def test_true_probabilities_have_no_calibration_error():
    probability = 1 / (1 + np.exp(APART ** 2 / 2 - APART * scores))
    assert calibration_error(probability, wanted) < 0.01
    assert calibration_error(np.full(wanted.size, 0.7), wanted) == pytest.approx(0.2)


def test_calibration_finds_the_true_probabilities():
    """Also of scores that were scaled and moved; the tolerance is three standard errors of a and b."""
    true = 1 / (1 + np.exp(APART ** 2 / 2 - APART * scores))
    fitted = calibration(30 * scores - 400, wanted)(30 * scores - 400)
    assert np.abs(fitted - true).max() < 0.02 and calibration_error(fitted, wanted) < 0.01


@pytest.mark.parametrize(("values", "labels", "said"), [
    ([1, 2], [True], "one finite score"), ([np.nan, 2], [True, False], "one finite score"),
    ([1, 2], [True, True], "both kinds")])
def test_what_cannot_be_judged_is_refused(values, labels, said):
    with pytest.raises(ValueError, match=said):
        auc(np.array(values), np.array(labels))
    with pytest.raises(ValueError, match="0 to 1"):
        calibration_error(np.array([1.0, 2]), np.array([True, False]))
