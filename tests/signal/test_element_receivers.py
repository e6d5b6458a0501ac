"""Signals of a few elements from echoes as points of time, against the exact sum over echoes and frequencies.

    y_n(f) = Σ_j a_j S_η(f) F(f) R(f) S_r*(f) / g e^{-κ(f) t_j} e^{-2πi (f0 + f) (τ_j - r_n·l_j/c)} e^{2πi f0 τ_j}

Four taps in time err by -57 dB of an echo's peak; this is what is left.
"""
import drjit as dr
import numpy as np
import pytest
from beam_cases import SPEED, worst_db
from scipy import fft

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.signal.beam_grid import ElementReceivers
from mitsonar.signal.impulses import BandLimited
from mitsonar.signal.noise import isotropic_coherence
from mitsonar.signal.reception import band_filter, padded_length
from mitsonar.sonar.pulses.pulses import cw, lfm

SAMPLES, LEAD = 900, 20
PLACE = 0.02 * np.array([[0.0, 0, 0], [1, 1, 0], [1, -1, 0], [-1, 1, 0], [-1, -1, 0]])
ECHOES = (150.3, 0, 0.6 + 0.8j, (0.1, 0.2, 0.97)), (451.77, 1, -1.0, (-0.6, 0.0, 0.8)), (700.5, 1, 1j, (0.0, 0.0, 1.0))
FACTORS = np.array([0.9993, 1.0004])


@pytest.fixture
def lib(variant):
    import mitsuba as mi

    return arrays_of(mi.Float)


def receivers(lib, pulse, **more):
    return ElementReceivers(lib.Float, place=PLACE, pulse=pulse, sampling_rate=pulse.suggested_sampling_rate,
                            samples=SAMPLES, lead=LEAD, sound_speed=SPEED, **more)


def formed(lib, made, echoes, rotation=np.eye(3), **more):
    """Signals of echoes (column, class, amplitude, direction) at the first element, at its centre, and the others."""
    column, sheet, amplitude, towards = (np.array(part) for part in zip(*echoes))
    fields = dict(zip(("column", "real", "imaginary"), (upload(lib.Float, part.astype(np.float32))
                                                        for part in (column, amplitude.real, amplitude.imag))))
    fields["sheet"] = upload(lib.UInt32, sheet.astype(np.uint32))
    sums = made.sums(len(FACTORS))
    made.add(sums, range(1), **fields)
    made.add(sums, range(1, len(PLACE)), **fields, rotation=rotation,
             towards=[upload(lib.Float, part.astype(np.float32)) for part in rotation @ towards.T])
    return made.formed(sums, FACTORS, **more)


def exact_sum(pulse, column, sheet, amplitude, towards, start=0.0, absorption_db=None):
    """The exact signals of one echo, complex128 (E, samples)."""
    rate = pulse.suggested_sampling_rate
    length = padded_length(SAMPLES + 64, pulse.duration, rate)
    f = fft.fftfreq(length, 1 / rate)
    replica, keep = np.conj(pulse.spectrum(rate, length)), band_filter(f, rate)
    transfer = (pulse.spectrum(rate, length, FACTORS[sheet]) * keep * BandLimited().response(f / rate) * replica
                / np.mean(np.abs(replica) ** 2 * keep))
    if absorption_db is not None:
        loss = absorption_db(pulse.frequency + f) - absorption_db(pulse.frequency)
        transfer = transfer * 10 ** (-loss * band_filter(f, rate) * SPEED * (start + np.float32(column) / rate) / 20)
    early = PLACE @ np.float32(towards) / SPEED
    turns = np.multiply.outer(early, pulse.frequency + f) - f * (np.float32(column) + 32) / rate
    return amplitude * fft.ifft(transfer * np.exp(2j * np.pi * turns))[:, 32 + LEAD:32 + SAMPLES]


@pytest.mark.parametrize("pulse", [lfm(300e3, 20e3, 0.5e-3), cw(300e3, 0.2e-3)], ids=lambda pulse: pulse.kind)
@pytest.mark.parametrize("absorption_db", [None, lambda f: 0.1 * (f / 300e3) ** 2], ids=["", "absorbed"])
def test_echoes_are_those_of_the_exact_sum(lib, pulse, absorption_db):
    """Each alone, so that the error is that of one. Twice as absorbed as water is: 0.5 dB across the band."""
    made = receivers(lib, pulse, start=0.02, absorption_db=absorption_db)
    for echo in ECHOES:
        assert worst_db(formed(lib, made, [echo]), exact_sum(pulse, *echo, 0.02, absorption_db)) < -54
        assert worst_db(formed(lib, made, [echo]), 0) > -1


def test_a_turned_array_receives_the_same_from_turned_directions_and_echoes_add_up(lib):
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    made = receivers(lib, cw(300e3, 0.2e-3))
    whole = formed(lib, made, ECHOES, turn)
    assert worst_db(whole, sum(formed(lib, made, [echo]) for echo in ECHOES)) < -110


def test_noise_has_the_covariance_of_elements(lib):
    """20 pings of some 400 numbers that do not depend on each other: 1.6 % of level, 0.011 of correlation."""
    pulse = lfm(300e3, 20e3, 0.5e-3)
    made, wanted = receivers(lib, pulse), 3.0 * isotropic_coherence(0.06 * PLACE, SPEED / 300e3)
    drawn = np.concatenate([made.formed(made.sums(1), np.ones(1), noise=wanted, key=key) for key in range(20)], 1)
    length = padded_length(1, pulse.duration, pulse.suggested_sampling_rate)
    f = fft.fftfreq(length, 1 / pulse.suggested_sampling_rate)
    power = np.abs(pulse.spectrum(pulse.suggested_sampling_rate, length)) ** 2
    gain = np.mean(power) / np.mean(power * band_filter(f, pulse.suggested_sampling_rate)) ** 2
    found = drawn @ np.conj(drawn.T) / drawn.shape[1] / gain
    assert np.abs(wanted[0, 1] / 3) > 0.3
    np.testing.assert_allclose(found, wanted, atol=0.15)


def test_same_bytes_whatever_the_number_of_threads(exact, lib, rng):
    made, n, threads, found = receivers(lib, cw(300e3, 0.2e-3)), 40_000, dr.thread_count(), set()
    towards = rng.standard_normal((n, 3))
    echoes = list(zip(rng.uniform(0, SAMPLES, n), rng.integers(0, 2, n), rng.standard_normal(n) + 1j,
                      towards / np.linalg.norm(towards, axis=1)[:, None]))
    try:
        for count in (1, 2, 4, 7):
            dr.set_thread_count(count)
            found.add(formed(lib, made, echoes, noise=np.eye(5), key=3).tobytes())
    finally:
        dr.set_thread_count(threads)
    assert len(found) == 1
