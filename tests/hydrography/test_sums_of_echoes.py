"""Sums of a ping's echoes: from parts of larger arrays, found again between times, and their quiet level.

Sums are exact: they are compared bit by bit with the plain way.
"""
import numpy as np
import pytest

from mitsonar.hydrography.detection.bottom_track import _summed_rows, in_rows, noise_level, reduced
from mitsonar.hydrography.detection.side_lobes import mean_between
from mitsonar.hydrography.detection.windows import windows_about

TIME = 1e-3 + 2e-5 * np.arange(2001)


def halves(rng):
    return tuple((rng.standard_normal((7, 2050)) + 1j * rng.standard_normal((7, 2050))).astype(np.complex64)
                 for _ in range(2))


def test_beams_within_a_larger_array_are_not_copied(rng):
    whole = halves(rng)[0]
    assert np.shares_memory(in_rows(whole[:, 20:2021]), whole)
    assert in_rows(whole[:, ::2]).flags.c_contiguous


def test_beams_within_a_larger_array_have_the_sums_of_copies(rng):
    parts = [half[:, 20:2021] for half in halves(rng)]
    one, other = reduced(tuple(parts), TIME, 9e-5), reduced(tuple(part.copy() for part in parts), TIME, 9e-5)
    assert one.power.tobytes() == other.power.tobytes() and one.common.tobytes() == other.common.tobytes()


def test_a_mean_between_times_is_that_of_their_blocks(rng):
    echoes = reduced(tuple(half[:, :2001] for half in halves(rng)), TIME, 9e-5)
    whole = (echoes.power + echoes.common) / 2
    begin, end = (TIME[0] - 1e-5 + echoes.step * np.array(blocks) for blocks in ([0, 3, 40], [2, 4, 90]))
    found = mean_between(echoes, begin + 1e-9, end - 1e-9)
    for column, (first, last) in enumerate(((0, 2), (3, 4), (40, 90))):
        np.testing.assert_allclose(found[:, column], whole[:, first:last].mean(1), rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("beams", [100, 700])
def test_the_noise_is_that_of_a_beam_between_echoes(rng, beams):
    """White noise of unit power in each half has 1/2 in the whole beam; a third of the beams have echoes, too.

    Of independent samples `echoes` is 1 a sample; a tenth of 140,000 blocks and more tells the level within 1 %,
    and the echoes, which leave 2/3 of the blocks quiet, raise it by what a quantile of 0.15 is above one of 0.1.
    """
    noise = tuple(rng.standard_normal((beams, 2 * len(TIME))).view(complex).astype(np.complex64) / np.sqrt(2)
                  for _ in range(2))
    assert abs(noise_level(reduced(noise, TIME, 2e-6)) / 0.5 - 1) < 0.03
    for half in noise:
        half[::3] *= 100
    raised = np.log(1 - 0.15) / np.log(1 - 0.1)
    assert abs(noise_level(reduced(noise, TIME, 2e-6)) / (0.5 * raised) - 1) < 0.03


@pytest.mark.parametrize("together", [1, 2, 3, 5])
def test_beams_are_summed_in_groups_and_the_last_may_be_smaller(rng, together):
    values = rng.exponential(size=(14, 300)).astype(np.float32)
    found = _summed_rows(values, together)
    np.testing.assert_array_equal(found, np.add.reduceat(values, np.arange(0, 14, together), axis=0))


@pytest.mark.parametrize("length", [1, 4, 61, 9000])
def test_running_sums_end_where_their_window_ends(rng, length):
    windows = windows_about(TIME, np.array([2e-3, 1.5e-2, 4.09e-2]), np.array([5e-4, 3e-3, 1e-4]))
    values, half = rng.standard_normal(len(windows.beam)), length // 2
    found = windows.smoothed(values, np.full(3, length))
    for beam in range(3):
        own = values[windows.beam == beam]
        plain = [own[max(k - half, 0):k + half + 1].sum() for k in range(len(own))]
        np.testing.assert_allclose(found[windows.beam == beam], plain, atol=1e-9)


def test_samples_of_windows_are_those_of_the_record(rng):
    record = halves(rng)[0][:, 20:2021]
    windows = windows_about(TIME, np.linspace(2e-3, 4e-2, 7), np.full(7, 4e-4))
    np.testing.assert_array_equal(windows.taken(record), record[windows.beam, windows.sample])
