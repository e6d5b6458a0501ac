"""Cells of facets, and the amplitudes and hashes of scatterers, against what makes a seabed's echoes Gaussian.

A facet of n rows has cells 0..n² - 1, each of 1/n² of its area, whose points are uniform over the cell (chi²). |g|² is
exponential with mean 1 and the phase of g uniform (Kolmogorov-Smirnov), neighbours are uncorrelated.
Seeds and hashes are fixed, so a test passes always or never; levels of significance are 1e-3, and bounds of
correlations 4 / √samples.

Known bias: none. The logarithm takes a hash of 24 bits, so |g|² ends at ln 2^25 = 17.3: what is missing of the mean is
6e-7.
"""
import drjit as dr
import numpy as np
import pytest
from drjit.auto import Float
from scipy.stats import chisquare, kstest

from mitsonar.device.arrays import arrays_of
from mitsonar.device.chance import gaussian, hashed, shape_key
from mitsonar.echoes.scatterers.cells import divisions, place

SIGNIFICANCE = 1e-3
PLACE, AMPLITUDE = 11, 12          # what tells the hashes of a cell's point and of its amplitude apart
SEABED = 4147811194
HASHES = ["0xdd669a27", "0x46f0f374", "0xb4bae0f7", "0x2a6463a3"]
GAUSSIANS = [-0.3302429 - 0.19011179j, -1.1227218 - 0.15106925j, 0.3009182 - 0.50756437j, 0.8594418 - 1.0293562j]


@pytest.fixture
def lib():
    return arrays_of(Float)


def placed(lib, s, n, a, b):
    """`place` of NumPy arrays, as NumPy arrays."""
    s, n, a, b = map(np.ravel, np.broadcast_arrays(s, n, a, b))
    u, v = place(lib, lib.UInt32(s.astype(np.uint32)), lib.UInt32(n.astype(np.uint32)),
                 lib.Float64(a.astype(float)), lib.Float64(b.astype(float)))
    return u.numpy(), v.numpy()


def uniform(bits):
    return (bits.numpy() + 0.5) / 2 ** 32


def hashes(lib, count, shape, facet, salt=PLACE):
    """Hashes of cells 0..count - 1 and their hash again, as the scatterers of a scene use them."""
    first = hashed(lib, lib.UInt32(shape), lib.UInt32(facet), dr.arange(lib.UInt32, count), lib.UInt32(salt))
    return first, hashed(lib, first)


# ------------------------------------------------------------------------------------------------ places
@pytest.mark.parametrize("n, s", [(1, 0), (3, 0), (3, 1), (3, 2), (3, 8), (50, 1234)])
def test_points_of_a_cell_are_uniform(lib, n, s, rng):
    """Cut the cell 8-fold: all 64 parts have as many points. A cell's own coordinates are those of a facet, for
    an upside down one turned by half a circle."""
    a, b = rng.uniform(size=(2, 50_000))
    u, v = placed(lib, s, n, a, b)
    u, v = n * u - np.floor(n * u.mean()), n * v - np.floor(n * v.mean())
    if (u + v).mean() > 1:
        u, v = 1 - u, 1 - v
    assert min(u.min(), v.min()) >= 0 and (u + v).max() <= 1 + 1e-9
    rows, columns = np.floor(8 * u).astype(int), np.floor(8 * v).astype(int)
    part = 16 * rows + 2 * columns + ((8 * u) % 1 + (8 * v) % 1 > 1)
    counts = np.bincount(part, minlength=128)
    assert np.count_nonzero(counts) == 64 and chisquare(counts[counts > 0]).pvalue > SIGNIFICANCE


# ------------------------------------------------------------------------------------------------ amplitudes
@pytest.mark.parametrize("shape, facet", [("seabed", 0), ("seabed", 1), ("rock", 70_000)])
def test_amplitudes_are_circular_complex_gaussian(lib, shape, facet):
    bits = hashes(lib, 100_000, shape_key(shape), facet, AMPLITUDE)
    real, imaginary = (part.numpy() for part in gaussian(lib, *bits))
    g = real + 1j * imaginary
    assert kstest(np.abs(g) ** 2, "expon").pvalue > SIGNIFICANCE
    assert kstest(np.angle(g) / (2 * np.pi) % 1, "uniform").pvalue > SIGNIFICANCE
    assert kstest(np.sqrt(2) * real, "norm").pvalue > SIGNIFICANCE
    assert abs(np.mean(np.abs(g) ** 2) - 1) < 4 / np.sqrt(g.size)
    assert abs(np.mean(g ** 2)) < 4 / np.sqrt(g.size)


def test_neighbours_are_independent(lib):
    """Next cell, cell of the next row, of the next facet, of the next shape, and the cell's place."""
    count = 100_000

    def of(shape, facet):
        real, imaginary = gaussian(lib, *hashes(lib, count, shape, facet, AMPLITUDE))
        return real.numpy() + 1j * imaginary.numpy()

    g = of(5, 7)
    first, second = (uniform(part) - 0.5 for part in hashes(lib, count, 5, 7, PLACE))
    others = [np.roll(g, -lag) for lag in (1, 2, 3, 256, 511)] + [of(5, 8), of(6, 7), of(7, 5), first, second]
    for other in others:
        scale = np.sqrt(np.mean(np.abs(other) ** 2) * count)
        assert abs(np.vdot(other, g) / count ** 0.5 / scale) < 4 / np.sqrt(count)
        power = np.abs(other) ** 2 - np.mean(np.abs(other) ** 2)
        assert abs(np.mean((np.abs(g) ** 2 - 1) * power)) < 6 * power.std() / np.sqrt(count)


def test_loudest_and_faintest_amplitudes_are_finite(lib):
    bits = lib.UInt32(np.array([0, 1, 2 ** 31, 2 ** 32 - 1], np.uint32))
    real, imaginary = (part.numpy() for part in gaussian(lib, bits, bits))
    assert (np.abs(real + 1j * imaginary) ** 2).max() == pytest.approx(25 * np.log(2), rel=1e-6)


# ------------------------------------------------------------------------------------------------ hashes, areas
def test_hashes_never_change(lib):
    """A seabed rendered once is rendered alike in years to come."""
    assert shape_key("seabed") == SEABED
    some = hashed(lib, lib.UInt32(SEABED), lib.UInt32(12), lib.UInt32(np.arange(4, dtype=np.uint32)), lib.UInt32(99))
    assert [hex(value) for value in some.numpy()] == HASHES
    real, imaginary = gaussian(lib, some, hashed(lib, some))
    assert real.numpy() + 1j * imaginary.numpy() == pytest.approx(GAUSSIANS, rel=1e-5)


@pytest.mark.parametrize("bit", [0, 5, 13, 31])
def test_every_bit_stirs_every_other(lib, bit):
    """Half of the bits flip, each of them in half of the cases: 5 standard errors of 32 binomial counts."""
    s = np.arange(20_000, dtype=np.uint32)
    a, b = (hashed(lib, lib.UInt32(3), lib.UInt32(part)).numpy() for part in (s, s ^ np.uint32(1 << bit)))
    flips = ((a ^ b)[:, None] >> np.arange(32, dtype=np.uint32) & 1).mean(0)
    assert np.abs(flips - 0.5).max() < 5 * 0.5 / np.sqrt(s.size)


def test_divisions_keep_the_longest_side_below_the_cell_size():
    side, size = np.array([0.0, 0.05, 0.1, 0.1000001, 1.0, 30.0]), 0.1
    n = divisions(side, size)
    assert n.tolist() == [1, 1, 1, 2, 10, 300]
    assert (side / n <= size * (1 + 1e-8)).all()


@pytest.mark.parametrize("n", [1, 3, 20])
def test_cells_are_congruent_and_their_areas_add_up(lib, n, rng):
    """Corners of each cell, from the extremes of its points: sides of 1/n, so all areas are 1/n² of the facet."""
    grid = np.linspace(0, 1, 41)
    a, b = (part.ravel()[:, None] for part in np.meshgrid(grid, grid))
    u, v = (part.reshape(a.size, n * n) for part in placed(lib, np.arange(n * n), n, a, b))
    assert np.ptp(u, axis=0) == pytest.approx(np.full(n * n, 1 / n))
    assert np.ptp(v, axis=0) == pytest.approx(np.full(n * n, 1 / n))
    assert np.ptp(u + v, axis=0) == pytest.approx(np.full(n * n, 1 / n))
