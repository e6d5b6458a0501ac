"""Theory of coherence beside closed forms and beside chance itself.

Gaussian pairs of known coherence are drawn; 20000 windows tell means to 0.7 % of the estimate's spread, so 0.006 holds
four deviations for the widest of them. Elements of one length far longer than a wavelength have the triangle for an
aperture, and its correlation is the cubic B-spline: at 0.5 and 1 of its knots 23/32 and 1/4; the half circle's Jacobian
takes 3e-3 from that.
"""
import numpy as np
import pytest

from mitsonar.synthetic_aperture.products.coherence import (
    aperture_coherence,
    baseline_coherence,
    delay_deviation,
    noise_coherence,
    phase_deviation,
    shift_coherence,
)
from mitsonar.synthetic_aperture.products.coherence_statistics import (
    coherence_at,
    coherence_chance,
    independent_looks,
    mean_coherence,
    phase_spread,
    unbiased_coherence,
    windowed_coherence,
)

WINDOWS = 20000


def pairs(coherence, looks, seed=1):
    """Complex Gaussian pairs (windows, looks) of a coherence."""
    one, two = np.random.default_rng(seed).normal(size=(2, WINDOWS, looks, 2)).view(complex)[..., 0]
    return one, coherence * one + np.sqrt(1 - coherence ** 2) * two


def estimates(coherence, looks):
    one, two = pairs(coherence, looks)
    return np.sum(two * one.conj(), 1) / np.sqrt(np.sum(np.abs(one) ** 2, 1) * np.sum(np.abs(two) ** 2, 1))


@pytest.mark.parametrize(("coherence", "looks"), [(0.0, 4), (0.5, 6), (0.6, 2), (0.9, 10)])
def test_estimates_have_the_mean_the_chance_and_the_phase_of_theory(coherence, looks):
    found = estimates(coherence, looks)
    assert np.abs(found).mean() == pytest.approx(mean_coherence(coherence, looks), abs=0.006)
    assert np.mean(np.abs(found) < 0.7) == pytest.approx(coherence_chance(0.7, coherence, looks), abs=0.012)
    assert np.angle(found).std() == pytest.approx(phase_spread(coherence, looks), rel=0.03)
    low = coherence_at(0.05, coherence, looks)
    assert np.mean(np.abs(found) < low) == pytest.approx(0.05, abs=0.006)


def test_the_bias_of_few_looks_is_taken_out():
    assert np.abs(estimates(0.5, 6)).mean() > 0.55
    assert unbiased_coherence(mean_coherence(0.5, 6), 6) == pytest.approx(0.5, abs=1e-3)
    assert unbiased_coherence(0.2, 6) == 0


def test_phases_spread_as_cramer_and_rao_say_where_that_is_little():
    assert phase_spread(0.97, 30) == pytest.approx(phase_deviation(0.97, 30), rel=0.03)
    assert phase_spread(0.3, 2) > phase_deviation(0.3, 2) * 0.5
    assert delay_deviation(0.9, 50, 3e5) == pytest.approx(phase_deviation(0.9, 50) / (2 * np.pi * 3e5))


def test_two_equal_elements_lose_coherence_as_a_cubic_spline():
    found = aperture_coherence([0, 0.01, 0.02, 0.04], 0.04, 0.04, 0.001)
    assert found == pytest.approx([1, 23 / 32, 1 / 4, 0], abs=3e-3)


def test_noise_a_shift_and_another_view_take_what_their_laws_say():
    assert noise_coherence(9.0) == pytest.approx(0.9)
    assert noise_coherence(np.inf, 3.0) == pytest.approx(np.sqrt(0.75))
    assert shift_coherence([0, 0.0125], 3e4, 1500.0) == pytest.approx([1, 2 / np.pi])
    assert baseline_coherence(3e5, 3e4, np.pi / 4, [0, 0.01, 0.2]) == pytest.approx([1, 0.9, 0])


def test_windows_find_coherence_and_phase_and_leave_out_what_is_no_number():
    one, two = (part[:4096].reshape(64, 64) for part in (part.ravel() for part in pairs(0.8, 4)))
    two = two * np.exp(0.7j)
    found = windowed_coherence(one, two, (9, 9))[4:-4, 4:-4]
    assert np.abs(found).mean() == pytest.approx(mean_coherence(0.8, 81), abs=0.02)
    assert np.angle(found.mean()) == pytest.approx(0.7, abs=0.02)
    two[20, 20] = np.nan
    assert np.isnan(windowed_coherence(one, two, (9, 9))).sum() == 81


def test_looks_are_counted_by_the_correlation_of_neighbours():
    white = pairs(0, 4)[0].ravel()[:16384].reshape(128, 128)
    assert independent_looks(white, (5, 7)) == pytest.approx(35, rel=0.02)
    paired = white[:, 1:] + white[:, :-1]                # neighbours' correlation is 1/2
    assert independent_looks(paired, (5, 20)) == pytest.approx(100 / (1 + 2 * 0.25 * 19 / 20), rel=0.03)


@pytest.mark.parametrize("call", [
    lambda: noise_coherence(-1.0), lambda: aperture_coherence(0, 0.0, 0.04, 0.005), lambda: coherence_at(2.0, 0.5, 4),
    lambda: shift_coherence(0, -1.0, 1500.0), lambda: mean_coherence(0.5, 1.0), lambda: phase_spread(1.5, 3),
    lambda: windowed_coherence(np.ones((4, 4), complex), np.ones((4, 5), complex), (2, 2)),
    lambda: windowed_coherence(np.ones((4, 4), complex), np.ones((4, 4), complex), (1, 1))])
def test_what_has_no_meaning_is_refused(call):
    with pytest.raises(ValueError, match="; give|compared"):
        call()
