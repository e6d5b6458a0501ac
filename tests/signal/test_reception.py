"""Element signals from impulse responses made by hand, against the delayed pulse itself.

Geometry: none; responses are sums of impulses a δ(t - τ) e^{-i2πf0 τ}. Closed form: a s_b((t - τ)η) e^{i2πf0(η-1)(t-τ)}
e^{-i2πf0 τ}. Bias: the receiver's filter rounds what a pulse has beyond 0.4 of the sampling rate; tapered pulses at
three times their band have 1e-3 there, unshaded ones ring by 1e-2 within ten samples of their ends.
"""
import numpy as np
import pytest

from mitsonar.signal import absorbed, delayed, doppler_class, doppler_classes, received, received_classes, transmitted
from mitsonar.signal.reception import band_filter
from mitsonar.sonar import cw, hfm, lfm, sampled
from mitsonar.water import absorption_db

FREQUENCY, RATE, SAMPLES = 1e5, 60e3, 2000
TIME = np.arange(SAMPLES) / RATE
TAPER = ("tukey", 0.5)
PULSES = {
    "cw": cw(FREQUENCY, 2e-3, "hann"),
    "lfm": lfm(FREQUENCY, 2e4, 8e-3, TAPER),
    "lfm-down": lfm(FREQUENCY, -2e4, 8e-3, TAPER),
    "hfm": hfm(FREQUENCY, 2e4, 8e-3, TAPER),
    "sampled": sampled(FREQUENCY, lfm(FREQUENCY, 1e4, 8e-3, "hann").sampled_at(40e3), 40e3),
}
members = pytest.mark.parametrize("pulse", PULSES.values(), ids=PULSES)


def impulse(delay, samples=SAMPLES, amplitude=1.0):
    """One echo, band-limited, at any delay [s]."""
    whole = int(delay * RATE)
    response = np.zeros(samples, complex)
    response[whole] = amplitude * np.exp(-2j * np.pi * FREQUENCY * whole / RATE)
    return delayed(response, delay - whole / RATE, RATE, FREQUENCY)


def echo(pulse, delay, doppler=1.0):
    return pulse.envelope(TIME - delay, doppler) * np.exp(-2j * np.pi * FREQUENCY * delay)


@members
@pytest.mark.parametrize("delay", [0.005, 0.0100037, 0.0123456])
@pytest.mark.parametrize("doppler", [1.0, 1.004, 0.993])
def test_echo_is_the_delayed_pulse(pulse, delay, doppler):
    signal = received(impulse(delay), pulse, RATE, doppler)
    np.testing.assert_allclose(signal, echo(pulse, delay, doppler), rtol=0, atol=4e-3)


@pytest.mark.parametrize("pulse", [cw(FREQUENCY, 2e-3), lfm(FREQUENCY, 2e4, 8e-3), hfm(FREQUENCY, 2e4, 8e-3)],
                         ids=lambda pulse: pulse.kind)
def test_energy_does_not_depend_on_where_samples_fall(pulse):
    """Unshaded, too: T, less what lies beyond the receiver's band (1/(π² 0.45 RATE T) of a CW pulse: 0.2 %)."""
    energy = [np.sum(np.abs(received(impulse(0.01 + part / RATE), pulse, RATE)) ** 2) / RATE
              for part in (0, 0.25, 0.5, 0.9)]
    assert np.ptp(energy) < 1e-6 * pulse.energy
    assert energy[0] == pytest.approx(pulse.energy, rel=3e-3)


def test_echoes_add_and_dimensions_stay(rng):
    pulse = PULSES["lfm"]
    responses = rng.standard_normal((2, 3, SAMPLES)) + 1j * rng.standard_normal((2, 3, SAMPLES))
    signals = received(responses, pulse, RATE)
    assert signals.shape == (2, 3, SAMPLES)
    np.testing.assert_allclose(received(responses.sum(1), pulse, RATE), signals.sum(1), atol=1e-9)
    single = received(responses.astype(np.complex64), pulse, RATE)
    assert single.dtype == np.complex64
    np.testing.assert_allclose(single, signals, rtol=0, atol=3e-5 * np.abs(signals).max())


def test_nothing_wraps_round_the_record():
    """An echo that begins 20 samples before the end leaves the beginning silent."""
    pulse = PULSES["lfm"]
    delay = (SAMPLES - 20) / RATE
    signal = received(impulse(delay), pulse, RATE)
    np.testing.assert_allclose(signal, echo(pulse, delay), rtol=0, atol=4e-3)
    assert np.abs(signal[:SAMPLES // 2]).max() < 1e-5


def test_classes_of_doppler_add_up_to_each_echo_by_itself(rng):
    """Forty echoes of a sonar under way, each exactly, against 0.02 cycle of phase: 2π 0.02 of each pulse's edge."""
    pulse = PULSES["lfm"]
    factors = rng.uniform(1.0, 1.006, 40)
    delays = rng.uniform(0.002, 0.022, 40)
    classes = doppler_classes(pulse, 1.0, 1.006)
    index, extra = doppler_class(factors, classes, pulse)
    responses = np.zeros((len(classes), SAMPLES), complex)
    for k, delay in zip(index, delays + extra):
        responses[k] += impulse(delay)
    exact = sum(echo(pulse, delay, factor) for delay, factor in zip(delays, factors))
    error = received_classes(responses, pulse, RATE, classes) - exact
    assert np.sqrt(np.mean(np.abs(error) ** 2) / np.mean(np.abs(exact) ** 2)) < 2 * np.pi * 0.02
    at_rest = sum(echo(pulse, delay) for delay in delays) - exact
    assert np.sqrt(np.mean(np.abs(at_rest) ** 2) / np.mean(np.abs(exact) ** 2)) > 1


# ---------------------------------------------------------------------------------------------------- transmit beams
@pytest.mark.parametrize("delay", [0.0, 1e-6, 7.3e-6, -4.4e-6, 1.23e-3])
def test_delayed_signals_are_those_of_a_later_echo(delay):
    pulse = PULSES["hfm"]
    signal = delayed(received(impulse(0.01), pulse, RATE), delay, RATE, FREQUENCY)
    np.testing.assert_allclose(signal, echo(pulse, 0.01 + delay), rtol=0, atol=4e-3)


def test_elements_are_weighted_and_delayed_into_one_transmission():
    pulse = PULSES["lfm"]
    weight, delay = np.array([1.0, 0.5, 0.0]), np.array([0.0, 3.7e-6, 2e-6])
    arrivals = np.array([[0.0100, 0.0101], [0.0102, 0.0103], [0.0104, 0.0105]])              # (tx, rx)
    response = np.stack([[impulse(t) for t in row] for row in arrivals])
    signals = received(transmitted(response, weight, delay, RATE, FREQUENCY), pulse, RATE)
    for receiver in range(2):
        expected = sum(w * echo(pulse, t + d) for w, d, t in zip(weight, delay, arrivals[:, receiver]))
        np.testing.assert_allclose(signals[receiver], expected, rtol=0, atol=6e-3)


def test_transmission_needs_a_weight_and_a_delay_of_every_element():
    with pytest.raises(ValueError, match="transmit elements"):
        transmitted(np.zeros((3, 2, 50), complex), np.ones(2), np.zeros(2), RATE, FREQUENCY)


# ---------------------------------------------------------------------------------------------------- absorption
@pytest.mark.parametrize("start", [0.0, 0.05])
@pytest.mark.parametrize("place", [64, 777, 9000, 19900])
def test_absorption_differs_across_the_band(place, start):
    """One impulse against 10^{-(α(f) - α(f0)) c t/20} in the flat band (2 m to 600 m two-way, 80 to 120 kHz): 1e-4."""
    response = np.zeros(20000, complex)
    response[place] = 1
    spectrum = np.fft.fft(absorbed(response, RATE, FREQUENCY, absorption_db, 1500.0, start))
    offset = np.fft.fftfreq(20000, 1 / RATE)
    inside = np.abs(offset) < RATE / 3
    two_way = 1500.0 * (start + place / RATE)
    excess = absorption_db(FREQUENCY + offset[inside]) - absorption_db(FREQUENCY)
    expected = 10 ** (-excess * two_way / 20) * np.exp(-2j * np.pi * offset[inside] * place / RATE)
    np.testing.assert_allclose(spectrum[inside], expected, rtol=0, atol=1.2e-4 * np.abs(expected).max())


def test_absorption_that_is_the_same_everywhere_changes_nothing(rng):
    response = rng.standard_normal((2, 500)).astype(np.complex64)
    same = absorbed(response, RATE, FREQUENCY, lambda f: np.full(np.shape(f), 0.03), 1500.0)
    assert same.dtype == np.complex64
    np.testing.assert_allclose(same, response, rtol=0, atol=2e-6)


# ---------------------------------------------------------------------------------------------------- refusals
def test_receivers_filter_is_flat_and_ends_at_half_the_sampling_rate():
    np.testing.assert_allclose(band_filter(np.array([0, 0.4, -0.4, 0.45, 0.5]) * RATE, RATE), [1, 1, 1, 0.5, 0],
                               atol=1e-12)


@pytest.mark.parametrize("doppler", [1.0, 1.006])
def test_sampling_below_nine_tenths_of_the_band_is_refused(doppler):
    needed = 0.9 * (2e4 * doppler + 2 * FREQUENCY * (doppler - 1))
    received(np.zeros(SAMPLES, complex), PULSES["lfm"], needed * 1.001, doppler)
    with pytest.raises(ValueError, match="sampling rate is .* below the band of 20000 Hz"):
        received(np.zeros(SAMPLES, complex), PULSES["lfm"], needed * 0.99, doppler)


@pytest.mark.parametrize("share, lost_db", [(1.0, 0.58), (0.9, 1.04), (1.25, 0.0)])
def test_what_a_low_rate_takes_of_the_energy(share, lost_db):
    """Exact for a flat spectrum: 0.8 of the rate passes whole, 3/8 of the skirts' 0.2; ripples are within 2 %."""
    rate, pulse = share * 2e4, lfm(FREQUENCY, 2e4, 8e-3)
    response = np.zeros(512, complex)
    response[100] = 1.0
    energy = np.sum(np.abs(received(response, pulse, rate)) ** 2) / rate
    assert 10 * np.log10(pulse.energy / energy) == pytest.approx(lost_db, abs=0.1)


def test_pulse_longer_than_the_record_is_refused():
    with pytest.raises(ValueError, match="longer than the record of 400 samples"):
        received(np.zeros(400, complex), PULSES["lfm"], RATE)


def test_every_response_needs_its_doppler_factor():
    with pytest.raises(ValueError, match="2 responses for 1 Doppler"):
        received_classes(np.zeros((2, SAMPLES), complex), PULSES["lfm"], RATE, [1.0])
