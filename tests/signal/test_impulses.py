"""Kernels that put an echo into a record, against closed forms and against sums of exponentials.

Peterson's taps, fc = fs/2, window 40 samples, delay 0.3 sample: -0.072910068 ... -0.063885627 (n = -3..4), sum
1.0000167; largest errors over fractional delays {0, .1, .25, .5}: 16 taps 3.7e-3 dB and 2.1e-4 sample to 0.1 fs,
0.014 dB and 4.8e-4 sample to 0.25 fs; 40 taps 2.7e-4 dB and 1.4e-5. Tolerances are the digits printed there. Errors in
the band of random echoes: nearest 2 (1 - mean of sinc f) = -9.2 dB; -61 and -57 dB by measurement, rms over echoes, of
which 1000 are enough to 1 dB.
"""
import numpy as np
import pytest

from mitsonar.signal.impulses import (
    FLAT,
    KERNELS,
    BandLimited,
    Peterson,
    element_responses,
    in_band_error_db,
    make_kernel,
    response_spectrum,
)

FREQUENCY, RATE, SAMPLES, START = 300e3, 40e3, 512, 0.0123
IN_BAND_DB = {"nearest": -9.2, "peterson": -61.0, "band_limited": -57.0}


def test_peterson_taps():
    taps = Peterson(40).impulse(np.arange(-3, 5) - 0.3)
    assert taps == pytest.approx([-0.072910068, 0.108350410, -0.196032966, 0.857917229, 0.366772180, -0.148796797,
                                  0.091152029, -0.063885627], abs=5e-10)
    assert Peterson(40).impulse(np.arange(-30, 31) - 0.3).sum() == pytest.approx(1.0000167, abs=5e-8)


@pytest.mark.parametrize("taps, edge, level_db, delay", [(8, 0.1, 0.0309, 1.9e-3), (16, 0.1, 3.7e-3, 2.1e-4),
                                                         (16, 0.25, 0.014, 4.8e-4), (40, 0.1, 2.7e-4, 1.4e-5)])
def test_peterson_errors(taps, edge, level_db, delay):
    n, f = np.arange(-50, 51), np.linspace(edge / 50, edge, 50)
    ratio = np.array([np.exp(-2j * np.pi * np.outer(f, n - place)) @ Peterson(taps).impulse(n - place)
                      for place in (0.0, 0.1, 0.25, 0.5)])
    assert np.abs(20 * np.log10(np.abs(ratio))).max() == pytest.approx(level_db, rel=0.05)
    assert np.abs(np.angle(ratio) / (2 * np.pi * f)).max() == pytest.approx(delay, rel=0.05)


@pytest.mark.parametrize("name", KERNELS)
def test_spectrum_is_the_transform_of_the_impulse(name):
    kernel, step = make_kernel(name), 1e-4
    x = (np.arange(-20 / step, 20 / step) + 0.5) * step
    f = np.array([0.0, 0.1, 1 / 3, 0.5, 0.7, 1.0])
    numeric = (kernel.impulse(x) * np.cos(2 * np.pi * np.outer(f, x))).sum(1) * step
    assert kernel.spectrum(f) == pytest.approx(numeric, abs=1e-5)


def test_the_bell_grows_to_one_at_its_edge_of_series():
    """sinh(r)/r at r = 0, where β = πwf, is 1."""
    kernel = BandLimited()
    edge = kernel.shape / (np.pi * kernel.taps)
    assert kernel.spectrum(edge) == pytest.approx(kernel.spectrum(edge * (1 + 1e-9)), rel=1e-6)


def echoes(rng, count=1000, elements=4, samples=SAMPLES):
    delay = START + rng.uniform(20, samples - 20, (count, elements)) / RATE
    amplitude = rng.standard_normal(count) + 1j * rng.standard_normal(count)
    return dict(delay=delay, amplitude=amplitude, frequency=FREQUENCY, start=START)


@pytest.mark.parametrize("name", KERNELS)
def test_error_within_the_flat_band(name, rng):
    found = echoes(rng)
    offset = np.linspace(-FLAT, FLAT, 301) * RATE
    responses = element_responses(**found, sampling_rate=RATE, samples=SAMPLES, kernel=name)
    error = in_band_error_db(responses, sampling_rate=RATE, offset=offset,
                             exact=response_spectrum(**found, offset=offset))
    assert error == pytest.approx(IN_BAND_DB[name], abs=1.0)


def test_band_limited_rolls_off_to_nothing_at_half_the_sampling_rate():
    kernel = BandLimited()
    assert kernel.response(np.array([0.0, 0.2, -FLAT, 5 / 12, 0.5])) == pytest.approx([1, 1, 1, 0.5, 0])
    lone = element_responses(delay=np.array([[START + 200 / RATE]]), amplitude=[1.0], frequency=0.0, start=START,
                             sampling_rate=RATE, samples=SAMPLES)[0]
    assert lone[200] == pytest.approx(5 / 6, abs=0.02)        # the roll-off is not free of aliases


@pytest.mark.parametrize("name", KERNELS)
def test_carrier_phase(name):
    """300 kHz, 1.2345678 ms: -f0 τ = 0.62966 cycles after whole ones, at the sample the echo falls on."""
    delay = 1.2345678e-3
    z = element_responses(delay=[[delay]], amplitude=[1.0], frequency=300e3, start=delay - 30 / RATE,
                          sampling_rate=RATE, samples=61, kernel=name)[0]
    assert np.angle(z[30]) / (2 * np.pi) % 1 == pytest.approx(0.62966, abs=1e-5)


def test_a_pulse_comes_out_delayed():
    """A Gaussian pulse whose band ends (-80 dB) at the flat one's edge: the worst sample within -50 dB of its peak."""
    width = np.sqrt(8 * np.log(10) / 2) / (np.pi * FLAT)             # [samples], spectrum exp(-(π f width)²)
    time = np.arange(SAMPLES)
    for place in (200.0, 200.31, 255.5):
        z = element_responses(delay=[[START + place / RATE]], amplitude=[1.0], frequency=0.0, start=START,
                              sampling_rate=RATE, samples=SAMPLES)[0]
        pulse = np.exp(-((np.arange(-40, 41) / width) ** 2))
        heard = np.convolve(z, pulse, mode="same")
        assert np.abs(heard - np.exp(-(((time - place) / width) ** 2))).max() < 10 ** (-50 / 20)


@pytest.mark.parametrize("name", KERNELS)
def test_echoes_at_the_edge_stay_whole(name):
    """A record that begins in the middle of an echo holds what a longer record holds there."""
    delay = START + np.array([[0.3], [-1.2], [99.6]]) / RATE
    given = dict(delay=delay, amplitude=[1.0, 1j, -1.0], frequency=FREQUENCY, sampling_rate=RATE, kernel=name)
    short = element_responses(**given, start=START, samples=100)
    long = element_responses(**given, start=START - 100 / RATE, samples=300)
    assert np.abs(short - long[:, 100:200]).max() < 1e-4


def test_bad_kernels():
    with pytest.raises(ValueError, match="known are nearest, peterson, band_limited"):
        make_kernel("linear")
    with pytest.raises(ValueError, match="only peterson takes it"):
        make_kernel("nearest", taps=4)
    with pytest.raises(ValueError, match="multiple of 4"):
        make_kernel("peterson", taps=15)


@pytest.mark.parametrize("name, energy, spread", [("nearest", 1.0, 1e-12), ("peterson", 0.949, 0.052),
                                                  ("band_limited", 0.7921, 0.0097)])
def test_energy_of_a_lone_echo(name, energy, spread):
    """|a|² times the kernel's energy on the mean; the rest is where the echo falls between samples."""
    place = 200 + np.arange(200) / 200
    found = np.array([np.sum(np.abs(element_responses(
        delay=np.array([[START + late / RATE]]), amplitude=np.array([0.3 - 0.4j]), frequency=FREQUENCY,
        sampling_rate=RATE, samples=SAMPLES, start=START, kernel=name)) ** 2) for late in place]) / 0.25
    assert make_kernel(name).energy == pytest.approx(energy, abs=1e-4)
    assert found.mean() == pytest.approx(make_kernel(name).energy, rel=1e-4)
    assert np.abs(found - found.mean()).max() < spread
