"""Matched filter on pulses received from impulses at known delays, and on noise.

Closed forms: peak a e^{-i2πf0 τ} at τ; LFM 0.8859/B wide at -3 dB with side lobes of -13.3 dB; noise N0/E;
range-Doppler coupling δR = (c/2) f_d T/B. Bias: an LFM spectrum has ripples, so width and side lobe are those of BT
(references of an independent computation at BT = 200 and 30); peaks are read by band-limited interpolation and a
parabola, 1e-3 of 1/B.
"""
import numpy as np
import pytest
from scipy import fft

from mitsonar.signal import ElementNoise, delayed, matched_filter, received, two_way_doppler
from mitsonar.sonar import cw, hfm, lfm, sampled

FREQUENCY, RATE, SAMPLES = 1e5, 60e3, 2000
PULSES = {
    "cw": cw(FREQUENCY, 0.5e-3),
    "cw-hann": cw(FREQUENCY, 1e-3, "hann"),
    "lfm": lfm(FREQUENCY, 2e4, 10e-3),
    "lfm-down": lfm(FREQUENCY, -2e4, 10e-3, ("tukey", 0.2)),
    "hfm": hfm(FREQUENCY, 2e4, 10e-3),
    "sampled": sampled(FREQUENCY, lfm(FREQUENCY, 1e4, 8e-3, "hann").sampled_at(40e3), 40e3),
}
members = pytest.mark.parametrize("pulse", PULSES.values(), ids=PULSES)


def impulse(delay, rate=RATE, samples=SAMPLES):
    whole = int(delay * rate)
    response = np.zeros(samples, complex)
    response[whole] = np.exp(-2j * np.pi * FREQUENCY * whole / rate)
    return delayed(response, delay - whole / rate, rate, FREQUENCY)


def finely(signal, rate, times=32):
    """The signal at `times` its rate, by zeros in its spectrum."""
    spectrum = np.pad(fft.fftshift(fft.fft(signal)), len(signal) * (times - 1) // 2)
    return times * fft.ifft(fft.ifftshift(spectrum)), rate * times


def peak(signal, rate=RATE):
    """Time [s] and size of the largest value."""
    fine, rate = finely(signal, rate)
    size = np.abs(fine)
    i = int(size.argmax())
    a, b, c = size[i - 1:i + 2]
    return (i + 0.5 * (a - c) / (a - 2 * b + c)) / rate, size[i]


@members
@pytest.mark.parametrize("window", [None, "hann"])
@pytest.mark.parametrize("delay", [0.005, 0.0100037, 0.0123456])
def test_echo_peaks_at_its_delay_with_its_amplitude(pulse, window, delay):
    """Time to 1/1000 of a range cell, amplitude to 1e-3, phase to 0.001 cycle."""
    filtered = matched_filter(received(impulse(delay), pulse, RATE), pulse, RATE, window)
    time, size = peak(filtered)
    assert time == pytest.approx(delay, abs=1e-3 / pulse.bandwidth)
    assert size == pytest.approx(1, abs=1e-3)
    value = delayed(filtered, -delay, RATE, FREQUENCY)[0] * np.exp(-2j * np.pi * FREQUENCY * delay)
    assert abs(np.angle(value * np.exp(2j * np.pi * FREQUENCY * delay))) < 2 * np.pi * 1e-3


@pytest.mark.parametrize("product, width, side_lobe", [(200, 0.88516, -13.324), (30, 0.88074, -13.708)])
def test_compressed_sweep_has_the_width_and_side_lobes_of_theory(product, width, side_lobe):
    """Width to 1e-3 of itself, side lobe to 0.02 dB: what the receiver's filter and fine sampling leave."""
    bandwidth, rate = 2e4, 3.2e5
    pulse = lfm(FREQUENCY, bandwidth, product / bandwidth)
    filtered = matched_filter(received(impulse(6e-3, rate, 8000), pulse, rate), pulse, rate)
    fine, rate = finely(filtered, rate)
    size = np.abs(fine)
    i = int(size.argmax())
    half = np.flatnonzero(size[i - 2000:i + 2000] ** 2 > 0.5 * size[i] ** 2)
    assert len(half) / rate * bandwidth == pytest.approx(width, abs=1e-3)
    assert width == pytest.approx(0.8859, abs=6e-3)
    first_null = i + int(np.argmax(np.diff(size[i:]) > 0))
    assert 20 * np.log10(size[first_null:].max()) == pytest.approx(side_lobe, abs=0.02)


@pytest.mark.parametrize("window, lowest", [("hann", -28), ("hamming", -35), (("taylor", 4, 35), -32)])
def test_windows_lower_the_side_lobes(window, lowest):
    pulse = lfm(FREQUENCY, 2e4, 10e-3)
    size = np.abs(matched_filter(received(impulse(0.012), pulse, RATE), pulse, RATE, window))
    assert 20 * np.log10(size[720 + 8:].max()) < lowest


@members
@pytest.mark.parametrize("window", [None, "hann"])
def test_effective_length_is_that_of_the_compressed_echo(pulse, window):
    """∫|m|² dt of an echo against `compressed_length`; the receiver's filter keeps 97 % of a CW pulse's skirts."""
    filtered = matched_filter(received(impulse(0.012), pulse, RATE), pulse, RATE, window)
    assert np.sum(np.abs(filtered) ** 2) / RATE == pytest.approx(pulse.compressed_length(window), rel=2e-2)


@pytest.mark.parametrize("pulse", [PULSES["lfm"], PULSES["hfm"], PULSES["cw-hann"]], ids=lambda pulse: pulse.kind)
def test_noise_leaves_with_its_level_over_the_energy(pulse):
    """N0/E, by 200 000 samples of which about one in RATE τ_eff is independent: 4.5 deviations.

    Against noise in the pulse's band B, an echo gains E B, which is BT of an unshaded sweep: 23.01 dB at BT = 200.
    """
    samples = 200_000
    noise = ElementNoise(position=np.zeros((1, 3)), wavelength=0.015, sampling_rate=RATE, ambient_db=30.0)
    filtered = matched_filter(noise.drawn(samples, 5, 0), pulse, RATE)[0, :-1000]
    level = 10 * np.log10(np.mean(np.abs(filtered) ** 2))
    independent = samples / RATE / pulse.compressed_length()
    tolerance = 4.34 * 4.5 / np.sqrt(independent)
    assert tolerance < 0.6
    assert level == pytest.approx(30 - 10 * np.log10(pulse.energy), abs=tolerance)
    if pulse.kind == "lfm":
        assert 30 + 10 * np.log10(pulse.bandwidth) - level == pytest.approx(23.0103, abs=tolerance)


# ---------------------------------------------------------------------------------------------------- moving sonar
def test_range_doppler_coupling_of_a_linear_sweep():
    """2 m/s, 100 kHz, 20 kHz, 10 ms: (c/2) f_d T/B = 0.100 m nearer than the target is at mid pulse.

    Closed form to first order; to second, the sweep's own stretching and η - 1 = 0.27 %: 0.5 mm.
    """
    pulse, c, speed = lfm(FREQUENCY, 2e4, 10e-3), 1500.0, 2.0
    eta = two_way_doppler(speed, c)
    time, _ = peak(matched_filter(received(impulse(0.012), pulse, RATE, eta), pulse, RATE))
    # the pulse's first instant came back after 0.012 s; its middle, speed T/2 further on, from nearer
    half_way = 0.012 - 0.5 * pulse.duration * (1 - 1 / eta)
    assert 0.5 * c * (half_way - time) == pytest.approx(0.100, abs=5e-4)
    assert 0.5 * c * (0.012 - time) == pytest.approx(0.100 + speed * pulse.duration / 2, abs=6e-4)


def test_hyperbolic_sweeps_tolerate_motion():
    """BT = 1000 and 10 m/s. Of a hyperbolic sweep what stays in the replica's band adds up in phase.

    Closed forms: 1 - f0 (η - 1)/B = 0.933, to 0.01 as its spectrum is not flat; of a linear one, whose slope changes by
    η², the stationary phase leaves 1/√((η² - 1) BT) = 0.19, with Fresnel's ripple of a quarter.
    """
    eta, kept = two_way_doppler(10.0, 1500.0), {}
    for make in (lfm, hfm):
        pulse = make(FREQUENCY, 2e4, 50e-3)
        response = impulse(0.012, RATE, 8000)
        kept[make] = peak(matched_filter(received(response, pulse, RATE, eta), pulse, RATE))[1]
    assert kept[hfm] == pytest.approx(1 - FREQUENCY * (eta - 1) / 2e4, abs=0.01)
    assert kept[lfm] == pytest.approx(1 / np.sqrt((eta**2 - 1) * 1000), rel=0.25)


@pytest.mark.parametrize("pulse", [PULSES["lfm"], PULSES["cw-hann"]], ids=lambda pulse: pulse.kind)
def test_replica_that_moves_with_the_echo_restores_its_peak(pulse):
    eta = two_way_doppler(-5.0, 1500.0)
    filtered = matched_filter(received(impulse(0.012), pulse, RATE, eta), pulse, RATE, doppler=eta)
    time, size = peak(filtered)
    assert time == pytest.approx(0.012, abs=1e-3 / pulse.bandwidth)
    assert size == pytest.approx(1, abs=1e-3)


# ---------------------------------------------------------------------------------------------------- shapes, refusals
def test_dimensions_and_precision_stay(rng):
    signals = (rng.standard_normal((2, 3, SAMPLES)) + 0j).astype(np.complex64)
    filtered = matched_filter(signals, PULSES["lfm"], RATE)
    assert filtered.shape == signals.shape and filtered.dtype == np.complex64
    np.testing.assert_allclose(filtered[1, 2], matched_filter(signals[1, 2].astype(complex), PULSES["lfm"], RATE),
                               rtol=0, atol=1e-5)


@pytest.mark.parametrize("rate, samples, window, message", [
    (17e3, SAMPLES, None, "below the band"), (RATE, 500, None, "longer than the record"),
    (RATE, SAMPLES, "round", "window 'round'")])
def test_what_does_not_fit_is_refused(rate, samples, window, message):
    with pytest.raises(ValueError, match=message):
        matched_filter(np.zeros(samples, complex), PULSES["lfm"], rate, window)
