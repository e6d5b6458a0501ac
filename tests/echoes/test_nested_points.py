"""Places of scatterers: nested, one in each triangle of every level, uniform within it, and alike on host and device.

The first 4^L scatterers of a facet lie one in each of its 4^L triangles of level L, so that the number in any region of
the facet is that of an even grid. Within the triangle of its own level a scatterer lies anywhere: chi² over the 64
triangles three levels below, at a significance of 1e-3 with fixed seeds. Barycentric coordinates are dyadic numbers of
17 bits and a third, equal to the bit in NumPy and Dr.Jit.
"""
import drjit as dr
import numpy as np
import pytest
from drjit.auto import Float, UInt32
from scipy.stats import chisquare

from mitsonar.device.chance import scrambled
from mitsonar.echoes.scatterers.nested_points import LEVELS, exists, owner_of, place_of, triangle_of

SEEDS = 0, 1, 12345, 0xDEADBEEF


def numbers(count, seed):
    return np.arange(count, dtype=np.uint32), np.full(count, seed, np.uint32)


def corner_step_by_step(path, level):
    """The corner and the side, digit by digit: 0, 1, 2 at the corners, 3 in the middle, upside down."""
    u, v, side = np.zeros(path.shape), np.zeros(path.shape), np.ones(path.shape)
    for i in range(LEVELS):
        digit, half, deeper = (path >> np.uint32(2 * i)) & 3, side / 2, i < level
        u += np.where(deeper & ((digit == 1) | (digit == 3)), half, 0)
        v += np.where(deeper & ((digit == 2) | (digit == 3)), half, 0)
        side = np.where(deeper, np.where(digit == 3, -half, half), side)
    return u, v, side


@pytest.mark.parametrize("seed", SEEDS)
def test_the_first_ones_lie_one_in_each_triangle_of_every_level(seed):
    path = scrambled(*numbers(4 ** 8, seed))
    for level in range(1, 9):
        ends = path[:4 ** level] & np.uint32(4 ** level - 1)
        assert len(np.unique(ends)) == 4 ** level


@pytest.mark.parametrize("seed", SEEDS)
def test_those_of_a_triangle_follow_from_its_first_one(seed):
    """k = p + 4^L j lies in the triangle of level L of scatterer p."""
    k, seeds = numbers(4 ** 7, seed)
    for level in (1, 3, 5):
        u, v, side = triangle_of(scrambled(k % 4 ** level, seeds), level)
        a, b = ((place - corner) / side for place, corner in zip(place_of(k, seeds), (u, v)))
        assert min(a.min(), b.min()) >= 0 and (a + b).max() <= 1


@pytest.mark.parametrize("level", [0, 1, 3, LEVELS, "any"])
def test_triangles_are_found_by_bits_as_step_by_step(rng, level):
    path = scrambled(*numbers(4 ** 6, 77))
    level = rng.integers(0, LEVELS + 1, path.shape).astype(np.uint32) if level == "any" else level
    on_device = triangle_of(UInt32(path), level if isinstance(level, int) else UInt32(level))
    for expected, host, device in zip(corner_step_by_step(path, level), triangle_of(path, level), on_device):
        np.testing.assert_array_equal(host, expected)
        np.testing.assert_array_equal(np.broadcast_to(device.numpy(), path.shape), expected)


@pytest.mark.parametrize("seed", [5, 424242])
def test_places_within_a_triangle_are_uniform(seed):
    """Each of 4^6 scatterers is alone in a triangle of level 6. Its place there follows from three more digits."""
    digits = (scrambled(*numbers(4 ** 6, seed)) >> np.uint32(12)) & np.uint32(63)
    assert chisquare(np.bincount(digits, minlength=64)).pvalue > 1e-3


def test_host_and_device_have_the_same_places():
    k, seed = numbers(4 ** 6, 99)
    for host, device in zip(place_of(k, seed), place_of(UInt32(k), UInt32(seed))):
        np.testing.assert_array_equal(host, device.numpy())


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 17, 64, 1000, 5000])
@pytest.mark.parametrize("seed", SEEDS[1:3])
def test_every_scatterer_owns_its_place(seed, count):
    k, seeds = numbers(count, seed)
    u, v = place_of(k, seeds)
    owner = owner_of(Float(u), Float(v), UInt32(seeds), dr.full(UInt32, count, count))
    np.testing.assert_array_equal(owner.numpy(), k)


@pytest.mark.parametrize("count, unequal", [(64, 0.0), (100, 0.75)])
def test_scatterers_own_equal_parts_where_their_number_is_a_power_of_four(rng, count, unequal):
    """Others own a triangle, less the quarters that have an owner: at least a quarter of the largest part."""
    u, v = rng.uniform(size=(2, 200_000))
    u, v = np.where(u + v > 1, [1 - u, 1 - v], [u, v])
    seed = np.full(u.shape, 3, np.uint32)
    owner = owner_of(Float(u), Float(v), UInt32(seed), dr.full(UInt32, count, u.size)).numpy()
    share = np.bincount(owner, minlength=count) / u.size * count
    largest = 1.0 if count == 64 else count / 64
    assert share.max() < largest * 1.12 and share.min() > largest * (1 - unequal) * 0.88


def test_sets_are_nested(rng):
    k, threshold = UInt32(np.arange(100, dtype=np.uint32)), Float(0.3)
    few, many = (exists(k, threshold, Float(m)).numpy() for m in (17.5, 40.2))
    assert few.sum() == 18 and many.sum() == 40 and (few <= many).all()
