"""Chance is even, independent from use to use, the same bits as Mitsuba's, and written in one file.

Tests of Kolmogorov and Smirnov fail by chance once in a thousand each; seeds are fixed, so they either hold or do not.
Correlations of N independent uniform numbers have a standard deviation of 1/√N.

Known bias: four rounds of TEA, Mitsuba's default, leave the first word of consecutive numbers uneven by up to 1.2 % of
its distribution, and words of one ray, or of two keys, correlated by 2 % (five rounds would leave nothing). Rays use
the words within strata of some hundredths of a beam, where 2 % is nothing. Tolerances are these figures.
"""
import ast
from pathlib import Path

import drjit as dr
import numpy as np
import pytest
from drjit.llvm.ad import Float, UInt32
from scipy.stats import kstest

from mitsonar.device import chance
from mitsonar.device.arrays import arrays_of

ROOT = Path(__file__).resolve().parents[2]
SIGNIFICANCE, COUNT = 1e-3, 1 << 18
UNEVEN, CORRELATED = (0.015, 0.006), 0.03      # what four rounds leave: of the first and of the second word; of both
SALTS = {name: value for name, value in vars(chance.Salt).items() if name.isupper() and value <= chance.WORD}


@pytest.fixture
def lib():
    return arrays_of(Float)


def drawn(key, other=False):
    """The two words of COUNT numbers under a key, as NumPy arrays."""
    draw = chance.other_pair if other else chance.pair
    return [word.numpy() for word in draw(dr.arange(UInt32, COUNT), UInt32(key))]


def correlation(a, b):
    """Correlation coefficient of two arrays."""
    return np.corrcoef(a.astype(float), b.astype(float))[0, 1]


@pytest.mark.parametrize("seed", [0, 3, 10])
@pytest.mark.parametrize("other", [False, True])
def test_numbers_of_a_key_are_even(lib, seed, other):
    for bits, uneven in zip(drawn(chance.ping_key(seed, 7 * seed), other), UNEVEN):
        assert kstest(chance.uniform(lib, UInt32(bits)).numpy(), "uniform").statistic < uneven
        assert kstest(chance.uniform_inside(lib, UInt32(bits)).numpy(), "uniform").statistic < uneven
        for bit in range(32):
            assert abs(np.mean((bits >> bit) & 1) - 0.5) < uneven


@pytest.mark.parametrize("seed", [0, 3, 10])
def test_the_words_of_a_ray_are_independent(seed):
    """Also those drawn of a word that was drawn before, as rays that bounce on do."""
    key = chance.ping_key(seed, 7 * seed)
    words = [*drawn(key), *drawn(key, other=True)]
    words += [word.numpy() for word in chance.other_pair(UInt32(words[0]), UInt32(key))]
    for i, first in enumerate(words):
        for second in words[i + 1:]:
            assert abs(correlation(first, second)) < CORRELATED
            # the quarters of both, which a wrong salt or a swapped word would leave empty
            quarters = np.bincount(4 * (first >> 30).astype(int) + (second >> 30), minlength=16) / COUNT
            assert np.abs(quarters - 1 / 16).max() < CORRELATED


def test_seeds_pings_numbers_and_uses_are_independent():
    """The same ray of another seed, ping, source or use is another number, though they differ by one."""
    keys = [chance.ping_key(0, 0), chance.ping_key(1, 0), chance.ping_key(0, 1), chance.ping_key(0, 0, 1)]
    keys += [chance.salted(keys[0], salt) for salt in dict.fromkeys(SALTS.values())]
    keys += [chance.salted(keys[0], chance.Salt.PARTNER, 1), chance.salted(keys[0], chance.Salt.DIRECTION, 1)]
    assert len(set(keys)) == len(keys)
    words = np.array([drawn(key)[0] for key in keys], float)
    apart = np.corrcoef(words) - np.eye(len(keys))
    assert np.abs(apart).max() < CORRELATED


def test_salts_differ_but_for_those_that_are_used_in_other_ways():
    values = [value for name, value in SALTS.items() if name != "FAN_TRUTH"]
    assert len(set(values)) == len(values)


def test_rows_of_a_survey_have_keys_of_their_own():
    keys = chance.row_keys(np.arange(1 << 20, dtype=np.uint64))
    assert keys.dtype == np.uint32 and len(np.unique(keys)) == len(keys)
    seeded = chance.seeded(UInt32(keys), 5, chance.Salt.WATER).numpy()
    assert len(np.unique(seeded)) == len(keys)
    assert not np.array_equal(seeded, chance.seeded(UInt32(keys), 6, chance.Salt.WATER).numpy())


def test_hashes_stir_every_bit_into_every_other(lib):
    """Flipping one bit of a word flips half of the hash's 32 bits, each with the chance of a half."""
    index = np.arange(1 << 14, dtype=np.uint32)
    before = chance.hashed(lib, UInt32(index), UInt32(9)).numpy()
    for bit in (0, 1, 7, 16, 31):
        flipped = before ^ chance.hashed(lib, UInt32(index ^ np.uint32(1 << bit)), UInt32(9)).numpy()
        share = np.unpackbits(flipped.view(np.uint8).reshape(-1, 4), axis=1).mean(0)
        assert np.abs(share - 0.5).max() < 5 * 0.5 / np.sqrt(len(index))


def test_the_two_hashes_of_a_pair_make_circular_gaussians(lib):
    first, second = chance.hashed_pair(lib, dr.arange(UInt32, COUNT), UInt32(1))
    assert abs(correlation(first.numpy(), second.numpy())) < 5 / np.sqrt(COUNT)
    real, imaginary = (part.numpy() for part in chance.gaussian(lib, first, second))
    for part in (real, imaginary):
        assert kstest(part * np.sqrt(2), "norm").pvalue > SIGNIFICANCE
    assert abs(correlation(real, imaginary)) < 5 / np.sqrt(COUNT)
    assert abs(correlation(real ** 2, imaginary ** 2)) < 5 / np.sqrt(COUNT)


def test_places_lie_in_their_strata_and_below_one(lib):
    stratum = dr.arange(UInt32, 4096) % 12
    share = np.linspace(0, 1, 4096, endpoint=False).astype(np.float32)
    share[-12:] = np.nextafter(np.float32(1), np.float32(0))
    place = chance.stratified(lib, stratum, Float(share), UInt32(12)).numpy()
    assert place.max() < 1 and place.min() >= 0
    assert np.abs(place * 12 - stratum.numpy() - share).max() < 2e-6


def test_pairs_are_those_of_mitsuba(variant):
    import mitsuba as mi

    index, key = dr.arange(mi.UInt32, 4096), mi.UInt32(chance.ping_key(11, 5))
    for word, expected in zip(chance.pair(index, key), mi.sample_tea_32(index, key)):
        np.testing.assert_array_equal(word.numpy(), expected.numpy())
    for word, expected in zip(chance.other_pair(index, key), mi.sample_tea_32(index, ~key)):
        np.testing.assert_array_equal(word.numpy(), expected.numpy())


# ------------------------------------------------------------------------------------------------ one file
SOURCES = sorted([*(ROOT / "mitsonar").rglob("*.py"), *(ROOT / "plugins").rglob("*.py")])
DRAWING = {"sample_tea_32", "sample_tea_64", "sample_tea_float", "sample_tea_float32", "sample_tea_float64", "PCG32"}
MASKS = {0xFFFFFFFF, 0xFFFFFFFFFFFFFFFF, 0x55555555, 0x33333333, 0x0F0F0F0F,      # of every second, of every third bit
         0x030000FF, 0x0300F00F, 0x030C30C3, 0x09249249}


def test_no_other_file_hashes():
    """Numbers of more than six hexadecimal digits, but for masks, are constants of hashes: there are no others."""
    found = []
    for path in set(SOURCES) - {Path(chance.__file__).resolve()}:
        text = path.read_text(encoding="utf-8")
        for node in ast.walk(ast.parse(text)):
            name = node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else ""
            found += [f"{path.name}: {name}; take what device.chance draws"] if name in DRAWING else []
            if isinstance(node, ast.Constant) and type(node.value) is int and node.value > 0xFFFFFF \
                    and node.value not in MASKS:
                written = ast.get_source_segment(text, node) or ""
                found += [f"{path.name}: {written} looks like the constant of a hash; it belongs into device.chance"
                          ] if written.lower().startswith("0x") else []
    assert len(SOURCES) > 1 and not found, "\n".join(found)
