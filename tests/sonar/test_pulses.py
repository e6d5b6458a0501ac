"""Pulses: spectra, compressed lengths and Doppler against closed forms.

Closed forms: CW and LFM transforms (sinc; Fresnel integrals' energy T), HFM phase K ln, effective lengths 2T/3 and 1/B.
Bias: Simpson's rule is wrong by less than 1e-4 of the largest value; a spectrum kept to ∓32/T misses 1e-6 of ∫|S|⁴. An
LFM pulse's spectrum is not quite flat: its effective length is 1/B only to some 1/(BT), here 1e-3 at BT = 200.
"""
import json
import pickle

import numpy as np
import pytest
from scipy.fft import fftfreq
from scipy.special import fresnel

from mitsonar.sonar import PULSES, cw, hfm, lfm, pulse_of, sampled

FAMILY = {
    "cw": cw(1e5, 1e-3),
    "cw-hann": cw(1e5, 1e-3, "hann"),
    "lfm": lfm(1e5, 2e4, 10e-3),
    "lfm-tukey": lfm(1e5, 2e4, 5e-3, ("tukey", 0.2)),
    "lfm-down": lfm(1e5, -2e4, 5e-3),
    "hfm": hfm(1e5, 2e4, 5e-3),
    "hfm-down": hfm(1e5, -2e4, 5e-3),
    "sampled": sampled(1e5, np.hanning(65), 40e3),
}
members = pytest.mark.parametrize("pulse", FAMILY.values(), ids=FAMILY)


@members
def test_envelope_is_zero_outside_and_at_most_one_inside(pulse):
    time = np.linspace(-1, 2, 6001) * pulse.duration
    size = np.abs(pulse.envelope(time))
    assert np.all(size[(time < 0) | (time > pulse.duration * (1 + 1e-12))] == 0)
    assert size.max() == pytest.approx(1, abs=2e-3)


@members
@pytest.mark.parametrize("doppler", [1.0, 1.005, 0.99])
def test_spectrum_is_the_transform_of_the_envelope(pulse, doppler):
    """Against the midpoint rule with 400 000 points, wrong by 1e-6; spectrum to 1e-4 of its largest value."""
    rate, samples = 60e3, 401
    step = pulse.duration / doppler / 400_000
    time = (np.arange(400_000) + 0.5) * step
    envelope = pulse.envelope(time, doppler)
    spectrum = pulse.spectrum(rate, samples, doppler)
    largest = np.abs(spectrum).max()
    for index in (0, 7, 60, 200, 201, 333):
        direct = rate * step * np.sum(envelope * np.exp(-2j * np.pi * fftfreq(samples, 1 / rate)[index] * time))
        assert abs(spectrum[index] - direct) < 1e-4 * largest


def test_spectrum_of_a_cw_pulse_is_a_sinc():
    pulse, rate, samples = cw(1e5, 2e-3), 50e3, 1024
    f = fftfreq(samples, 1 / rate)
    expected = rate * 2e-3 * np.sinc(f * 2e-3) * np.exp(-1j * np.pi * f * 2e-3)
    np.testing.assert_allclose(pulse.spectrum(rate, samples), expected, rtol=0, atol=1e-4 * 100)


def test_spectrum_of_a_linear_sweep_is_that_of_fresnel():
    bandwidth, duration, rate, samples = 2e4, 5e-3, 40e3, 512
    f = fftfreq(samples, 1 / rate)
    k = bandwidth / duration
    ends = [np.sqrt(2 * k) * (side * duration / 2 - f / k) for side in (1, -1)]
    (s1, c1), (s0, c0) = (fresnel(x) for x in ends)
    expected = rate / np.sqrt(2 * k) * np.abs(c1 - c0 + 1j * (s1 - s0))
    np.testing.assert_allclose(np.abs(lfm(1e5, bandwidth, duration).spectrum(rate, samples)), expected, rtol=0,
                               atol=1e-4 * expected.max())


@members
def test_samples_are_the_envelope(pulse):
    samples = pulse.sampled_at(50e3)
    assert len(samples) == int(pulse.duration * 50e3 * (1 + 1e-12)) + 1
    np.testing.assert_array_equal(samples, pulse.envelope(np.arange(len(samples)) / 50e3))


def test_bandwidth_of_cw_pulses():
    """sinc² falls to half at 0.44294647; of a Hann window at 0.7203."""
    assert cw(1e5, 1e-3).bandwidth == pytest.approx(0.88589294e3, rel=1e-3)
    assert cw(1e5, 1e-3, "hann").bandwidth == pytest.approx(1.4406e3, rel=1e-3)
    assert cw(1e5, 1e-3).band[0] == pytest.approx(-cw(1e5, 1e-3).band[1], rel=1e-9)


@pytest.mark.parametrize("make", [lfm, hfm])
def test_band_of_sweeps(make):
    assert make(1e5, 2e4, 5e-3).band == (-1e4, 1e4)
    assert make(1e5, -2e4, 5e-3).band == (-1e4, 1e4)


@pytest.mark.parametrize("make", [lfm, hfm])
@pytest.mark.parametrize("bandwidth", [2e4, -2e4])
def test_sweeps_run_from_end_to_end(make, bandwidth):
    """Instantaneous frequency from the phase's difference over 1 ns."""
    pulse = make(1e5, bandwidth, 5e-3)
    for time, expected in ((1e-6, -bandwidth / 2), (5e-3 - 1e-6, bandwidth / 2)):
        step = np.angle(pulse.envelope(time + 1e-9) / pulse.envelope(time)) / (2 * np.pi * 1e-9)
        assert step == pytest.approx(expected, abs=15)


def test_phase_of_a_hyperbolic_sweep():
    """90 to 110 kHz in 5 ms: K = 2475, 496.659971 cycles to the end, 99 kHz in the middle."""
    pulse = hfm(1e5, 2e4, 5e-3)
    cycles = np.angle(pulse.envelope(5e-3)) / (2 * np.pi) + 1e5 * 5e-3
    assert cycles % 1 == pytest.approx(496.659971 % 1, abs=1e-6)
    middle = np.angle(pulse.envelope(2.5e-3 + 1e-9) / pulse.envelope(2.5e-3)) / (2 * np.pi * 1e-9)
    assert 1e5 + middle == pytest.approx(99e3, abs=1)


def test_moving_pulse_is_the_passband_pulse_in_squeezed_time():
    """Re{s_b(ηt) e^{i2πf0 ηt}} written over the carrier f0, to rounding."""
    pulse, eta = lfm(1e5, 2e4, 5e-3), 1.004
    time = np.linspace(0, 4.9e-3, 997)
    passband = pulse.envelope(time * eta) * np.exp(2j * np.pi * 1e5 * eta * time)
    np.testing.assert_allclose(pulse.envelope(time, eta) * np.exp(2j * np.pi * 1e5 * time), passband, atol=1e-8)


def test_energies():
    """Of |s|² = 1: T; of a Hann taper: 3T/8."""
    assert cw(1e5, 1e-3).energy == pytest.approx(1e-3, rel=1e-12)
    assert hfm(1e5, 2e4, 5e-3).energy == pytest.approx(5e-3, rel=1e-12)
    assert lfm(1e5, 2e4, 5e-3, "hann").energy == pytest.approx(0.375 * 5e-3, rel=1e-6)


def test_effective_length_after_compression():
    assert cw(1e5, 1e-3).compressed_length() == pytest.approx(2e-3 / 3, rel=1e-5)
    assert lfm(1e5, 2e4, 10e-3).compressed_length() * 2e4 == pytest.approx(1, abs=2e-3)
    # a taper on a flat spectrum: ∫w² / (∫w)² = 1.5 of a Hann window
    assert lfm(1e5, 2e4, 10e-3).compressed_length("hann") * 2e4 == pytest.approx(1.5, abs=4e-3)


def test_sampled_pulse_is_what_was_sampled():
    """A sweep within 0.38 of the sampling rate, tapered, comes back between its samples to 2e-3."""
    source = lfm(1e5, 2e4, 5e-3, "hann")
    pulse = sampled(1e5, source.sampled_at(26e3), 26e3)
    time = np.linspace(0, pulse.duration, 3001)
    np.testing.assert_allclose(pulse.envelope(time), source.envelope(time), rtol=0, atol=2e-3)
    assert pulse.energy == pytest.approx(source.energy, rel=1e-3)


@members
def test_pulses_travel_to_other_processes(pulse):
    other = pickle.loads(pickle.dumps(pulse))
    np.testing.assert_array_equal(other.sampled_at(50e3), pulse.sampled_at(50e3))


@pytest.mark.parametrize("make", PULSES.values(), ids=PULSES)
@pytest.mark.parametrize("change", [{"frequency": 0}, {"frequency": np.nan}, {"duration": -1e-3}, {"duration": 1e-6},
                                    {"window": "round"}, {"window": ("tukey", "x")}])
def test_impossible_pulses_are_refused(make, change):
    numbers = {"frequency": 1e5, "duration": 1e-3} | ({} if make is cw else {"bandwidth": 1e4})
    with pytest.raises(ValueError, match="pulse"):
        make(**(numbers | change))


@pytest.mark.parametrize("make", [lfm, hfm])
@pytest.mark.parametrize("bandwidth", [0, np.inf, 2e5])
def test_impossible_sweeps_are_refused(make, bandwidth):
    with pytest.raises(ValueError, match="bandwidth"):
        make(1e5, bandwidth, 1e-3)


@pytest.mark.parametrize("samples, rate", [([1], 1e4), ([[1, 1]], 1e4), ([1, np.nan], 1e4), ([1, 1], 0)])
def test_impossible_samples_are_refused(samples, rate):
    with pytest.raises(ValueError, match="sampled pulse"):
        sampled(1e5, samples, rate)


@pytest.mark.parametrize("name", [name for name in FAMILY if name != "sampled"])
def test_numbers_make_the_same_pulse_again(name):
    pulse = FAMILY[name]
    again = pulse_of(json.loads(json.dumps(pulse.numbers)))
    assert again.numbers == pulse.numbers and np.array_equal(again.sampled_at(1e5), pulse.sampled_at(1e5))


def test_what_describes_no_pulse_is_refused():
    assert FAMILY["sampled"].numbers is None
    for numbers in ({}, {"kind": "chirp"}, {**FAMILY["lfm"].numbers, "colour": 1}):
        with pytest.raises(ValueError, match=r"describe no pulse; give kind \(cw, lfm, hfm\)"):
            pulse_of(numbers)
