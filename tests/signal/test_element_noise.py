"""Noise of elements: level, coherence and independence as statistics of a long record with a fixed seed.

Closed forms: level NL + 10 log fs; coherence sinc(kd); after a beamformer lower by 10 log N²/ΣΣ sinc(2md/λ).
Tolerances: of n independent samples a power estimate has relative deviation 1/√n (circular Gaussian), a coherence
1/√n or less; checks stand at 4.5 deviations, so that a right program fails none of a thousand seeds.
"""
import os
import subprocess
import sys

import numpy as np
import pytest
from scipy import stats

from mitsonar.signal import ElementNoise, isotropic_coherence

RATE, WAVELENGTH, N = 40e3, 0.015, 40_000
DEVIATIONS = 4.5


def line(elements, pitch):
    """Elements a multiple `pitch` of the wavelength apart, in a slanted direction."""
    return np.arange(elements)[:, None] * pitch * WAVELENGTH * np.array([[0.6, 0.0, 0.8]])


def noise(position, **levels):
    return ElementNoise(position=position, wavelength=WAVELENGTH, sampling_rate=RATE, **levels)


def db_tolerance(n):
    return 10 / np.log(10) * DEVIATIONS / np.sqrt(n)


@pytest.mark.parametrize("levels, expected", [
    ({"ambient_db": 30.0}, 30.0), ({"self_noise_db": 25.0}, 25.0),
    ({"ambient_db": 30.0, "self_noise_db": 30.0}, 33.010300)])
def test_level_is_that_of_the_band(levels, expected):
    expected += 10 * np.log10(RATE)
    model = noise(line(4, 0.5), **levels)
    assert model.level_db == pytest.approx(expected, abs=1e-5)
    power = np.mean(np.abs(model.drawn(N, 1, 0)) ** 2, -1)
    np.testing.assert_allclose(10 * np.log10(power), expected, rtol=0, atol=db_tolerance(N))
    # the sum of squares, twice over the variance, is chi-squared with 2 N degrees of freedom
    assert 1e-5 < stats.chi2.cdf(2 * N * power[0] / 10 ** (expected / 10), 2 * N) < 1 - 1e-5


def test_samples_are_circular_gaussian_and_white():
    model = noise(line(3, 0.3), ambient_db=40.0, self_noise_db=20.0)
    record = model.drawn(N, 2, 5) / 10 ** (model.level_db / 20)
    for row in record:
        for part in (row.real, row.imag):
            assert stats.kstest(part * np.sqrt(2), "norm").pvalue > 1e-3
        assert stats.kstest(np.abs(row) ** 2, "expon").pvalue > 1e-3
        assert abs(np.mean(row * row)) < DEVIATIONS / np.sqrt(N) * np.sqrt(2)                  # circular
        for lag in (1, 2, 50, 4096):                                                           # white, blocks or not
            assert abs(np.mean(row[lag:] * row[:-lag].conj())) < DEVIATIONS / np.sqrt(N - lag)


def test_coherence_matrix_is_sinc():
    rng = np.random.default_rng(3)
    position = rng.uniform(-1, 1, (12, 3)) * WAVELENGTH
    apart = np.linalg.norm(position[:, None] - position[None], axis=-1)
    expected = np.sinc(2 * apart / WAVELENGTH)
    np.testing.assert_allclose(isotropic_coherence(position, WAVELENGTH), expected, atol=1e-14)
    record = noise(position, ambient_db=0.0).drawn(N, 4, 0) / np.sqrt(RATE)
    assert np.abs(record @ record.conj().T / N - expected).max() < DEVIATIONS / np.sqrt(N)


def test_coherence_is_the_mean_over_plane_waves_from_everywhere():
    """Against Gauss-Legendre quadrature of e^{ik·d} over the sphere, exact here to 1e-12."""
    cosine, weight = np.polynomial.legendre.leggauss(60)
    for apart in (0.1, 0.5, 0.77, 2.2):
        mean = np.sum(weight * np.exp(2j * np.pi * apart * cosine)) / 2
        pair = np.array([[0, 0, 0], [0, apart * WAVELENGTH, 0]])
        assert isotropic_coherence(pair, WAVELENGTH)[0, 1] == pytest.approx(mean.real, abs=1e-12)


@pytest.mark.parametrize("elements, pitch, index", [(16, 0.5, 12.041200), (16, 0.25, 9.117833), (64, 0.5, 18.061800),
                                                    (10, 0.8, 11.857444)])
def test_beamformer_lowers_noise_by_its_directivity_index(elements, pitch, index):
    """Steered broadside; the reference carries six decimals."""
    model = noise(line(elements, pitch), ambient_db=35.0)
    weight = np.ones(elements)
    assert model.level_db - model.beam_level_db(weight) == pytest.approx(index, abs=2e-6)
    beam = weight @ model.drawn(N, 6, 1) / elements
    level = 10 * np.log10(np.mean(np.abs(beam) ** 2))
    assert model.level_db - level == pytest.approx(index, abs=db_tolerance(N))


def test_noise_of_receivers_is_lowered_by_their_number():
    model = noise(line(16, 0.25), self_noise_db=20.0)
    assert model.level_db - model.beam_level_db(np.ones(16)) == pytest.approx(10 * np.log10(16), abs=1e-9)


def test_steered_and_shaded_beams_follow_the_covariance():
    model = noise(line(12, 0.4), ambient_db=30.0, self_noise_db=22.0)
    weight = np.hamming(12) * np.exp(2j * np.pi * 0.4 * np.arange(12) * np.sin(0.5))
    beam = weight @ model.drawn(N, 8, 1) / np.abs(weight).sum()
    assert 10 * np.log10(np.mean(np.abs(beam) ** 2)) == pytest.approx(model.beam_level_db(weight), abs=db_tolerance(N))
    assert model.beam_level_db(np.stack([weight, np.ones(12)])).shape == (2,)


def test_same_seed_and_ping_same_bytes():
    model = noise(line(5, 0.5), ambient_db=30.0)
    one = model.drawn(6000, 7, 3)
    assert one.dtype == np.complex64 and one.shape == (5, 6000)
    assert one.tobytes() == noise(line(5, 0.5), ambient_db=30.0).drawn(6000, 7, 3).tobytes()
    np.testing.assert_array_equal(one[:, :4500], model.drawn(4500, 7, 3))


def test_other_seeds_and_pings_are_independent():
    model = noise(line(1, 0.5), ambient_db=30.0)
    records = np.concatenate([model.drawn(N, seed, ping) for seed, ping in [(7, 3), (7, 4), (3, 7), (-7, 3), (8, 3)]])
    coherence = np.abs(records @ records.conj().T / N) / 10 ** (model.level_db / 10)
    assert np.abs(coherence - np.eye(5)).max() < DEVIATIONS / np.sqrt(N)


def test_number_of_threads_changes_no_byte():
    code = ("import hashlib, numpy as np; from mitsonar.signal.noise import ElementNoise; "
            "p = np.random.default_rng(1).normal(size=(70, 3)); "
            "n = ElementNoise(position=p, wavelength=0.5, sampling_rate=1e4, ambient_db=30.0, self_noise_db=10.0); "
            "print(hashlib.sha256(n.drawn(9000, 1, 2).tobytes()).hexdigest())")
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
    prints = {subprocess.run([sys.executable, "-c", code], env=os.environ | dict.fromkeys(names, threads), text=True,
                             capture_output=True, check=True).stdout for threads in ("1", "2", "4")}
    assert len(prints) == 1


def test_no_noise_is_silence():
    model = noise(line(2, 0.5))
    assert model.level_db == -np.inf
    assert not model.drawn(10, 1, 1).any()


def test_crowded_and_coincident_elements_have_noise_in_common():
    record = noise(np.zeros((3, 3)), ambient_db=30.0).drawn(1000, 1, 1)
    np.testing.assert_allclose(record[1], record[0], rtol=0, atol=1e-3 * np.abs(record[0]).max())


@pytest.mark.parametrize("change", [{"position": np.zeros((0, 3))}, {"position": np.zeros(3)}, {"wavelength": 0.0},
                                    {"position": np.full((2, 3), np.nan)}, {"sampling_rate": -1.0},
                                    {"ambient_db": np.inf}, {"self_noise_db": np.nan}])
def test_impossible_noise_is_refused(change):
    settings = {"position": line(2, 0.5), "wavelength": WAVELENGTH, "sampling_rate": RATE} | change
    with pytest.raises(ValueError, match="element noise"):
        ElementNoise(**settings)
