"""Stratified draws: even over every block of 2^m samples, independent by name, and the same however many follow.

A share w of a distribution is met by n stratified draws to within the number of binary digits of n at worst, as each
digit is a block of its own that is off by less than 1 at either end; it is tried to 3, where independent draws of the
same plan are off by more. Correlations of two names are those of chance: sd 1/sqrt(n), tried to 4 sd.
"""
import numpy as np
import pytest

from mitsonar.sweep.strata import BITS, draw, stratified_bits
from mitsonar.sweep.values import random_bits


def fractions(name, count, seed=1):
    return np.array([stratified_bits(seed, name, number) / 2**BITS for number in range(count)])


@pytest.mark.parametrize("exponent", [0, 1, 3, 6, 9])
def test_a_block_of_samples_has_one_in_every_part(exponent):
    parts = 2**exponent
    for block in fractions("species", 1024).reshape(-1, parts):
        assert sorted((block * parts).astype(int)) == list(range(parts))


def test_shares_are_met_at_every_number_of_samples():
    inside = np.cumsum(fractions("species", 1000) < 0.3)
    assert np.abs(inside - 0.3 * np.arange(1, 1001)).max() < 3
    chance = np.cumsum([random_bits(1, "species", number) / 2**BITS < 0.3 for number in range(1000)])
    assert np.abs(chance - 0.3 * np.arange(1, 1001)).max() > 3


def test_parameters_are_independent():
    several = [fractions(name, 1024) for name in ("species", "count", "range")] + [fractions("species", 1024, seed=2)]
    correlations = np.corrcoef([*several, np.arange(1024)])
    assert np.abs(correlations - np.eye(5)).max() < 4 / np.sqrt(1024)
    pairs = np.histogram2d(several[0], several[1], bins=4, range=[[0, 1]] * 2)[0]
    assert ((pairs - 64) ** 2 / 64).sum() < 30.6       # chi² of 15 degrees of freedom, 1 in 100


def test_a_redrawn_value_stays_in_its_part():
    first, again = (stratified_bits(1, "place", 5, *more) / 2**BITS for more in ((), ("again", 1)))
    assert first != again and int(first * 2**20) == int(again * 2**20)


@pytest.mark.parametrize("given, expected", [
    ({"choice": ["a", "b", "c", "d"]}, dict.fromkeys("abcd", 16)),
    ({"choice": ["a", "b"], "weights": [3, 1]}, {"a": 48, "b": 16}),
    ({"integer": [1, 8]}, dict.fromkeys(range(1, 9), 8)),
    ({"choice": [False, True]}, {False: 32, True: 32})])
def test_values_come_as_often_as_asked_in_64_draws(given, expected):
    drawn = draw({**given, "stratified": True}, "draw.x")
    values = [drawn.at(stratified_bits(7, "x", number)) for number in range(64)]
    assert {value: values.count(value) for value in values} == expected


def test_continuous_values_fill_their_range():
    drawn = draw({"uniform": [10, 20], "stratified": True}, "draw.x")
    values = sorted(drawn.at(stratified_bits(7, "x", number)) for number in range(64))
    np.testing.assert_allclose(values, 10 + 10 * (np.arange(64) + 0.5) / 64, atol=10 / 128)


def test_a_flag_of_another_kind_is_refused():
    with pytest.raises(ValueError, match=r"draw\.x: stratified is 'yes'; give true or false"):
        draw({"integer": [1, 8], "stratified": "yes"}, "draw.x")
    assert not draw({"integer": [1, 8], "stratified": False}, "draw.x").stratified
