"""Compressed signals of one receiver, row by row: against what reception and matched filter make of the same echoes."""
import drjit as dr
import numpy as np
import pytest
from scipy import fft

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.signal.beam_grid import NoiseDensity, RowSignals
from mitsonar.signal.impulses import element_responses
from mitsonar.signal.matched_filter import matched_filter
from mitsonar.signal.reception import absorbed, received
from mitsonar.sonar.pulses.pulses import cw, lfm

SAMPLES, LEAD, PULSE = 800, 25, lfm(300e3, 20e3, 0.5e-3)
RATE = PULSE.suggested_sampling_rate


@pytest.fixture
def lib(variant):
    import mitsuba as mi

    return arrays_of(mi.Float)


def signals(lib, **more):
    return RowSignals(lib.Float, **{**dict(pulse=PULSE, sampling_rate=RATE, samples=SAMPLES, lead=LEAD), **more})


def filled(lib, maker, rows, row, column, amplitude):
    grid = maker.grid(rows)
    grid.add(row=upload(lib.UInt32, np.asarray(row, np.uint32)),
             column=upload(lib.Float, np.asarray(column, np.float32)),
             real=upload(lib.Float, np.real(amplitude).astype(np.float32)),
             imaginary=upload(lib.Float, np.imag(amplitude).astype(np.float32)))
    return grid


def chain(column, amplitude, pulse=PULSE, doppler=1.0):
    """What reception and matched filter make of these echoes."""
    response = element_responses(delay=np.asarray(column, float)[:, None] / RATE, amplitude=amplitude, frequency=0.0,
                                 sampling_rate=RATE, samples=SAMPLES)
    return matched_filter(received(response, pulse, RATE, doppler), pulse, RATE)[:, LEAD:]


@pytest.mark.parametrize("pulse", [PULSE, cw(300e3, 0.4e-3, "hann")], ids=lambda pulse: pulse.kind)
def test_rows_are_those_of_reception_and_matched_filter(lib, rng, pulse):
    """Of echoes that end before the record does: there elements' signals are cut."""
    rows, each = 19, 40
    column, doppler = np.float32(rng.uniform(0, SAMPLES - 40, (rows, each))), 1 + rng.uniform(-1e-3, 1e-3, rows)
    amplitude = (rng.standard_normal((rows, each)) + 1j * rng.standard_normal((rows, each))).astype(np.complex64)
    maker = signals(lib, pulse=pulse)
    row = np.repeat(np.arange(rows), each)
    found = maker.form(filled(lib, maker, rows, row, column.ravel(), amplitude.ravel()), doppler=doppler)
    wanted = np.concatenate([chain(*echoes, pulse, factor) for *echoes, factor in zip(column, amplitude, doppler)])
    assert found.shape == wanted.shape == (rows, SAMPLES - LEAD)
    assert 20 * np.log10(np.linalg.norm(found - wanted) / np.linalg.norm(wanted)) < -54


@pytest.mark.parametrize("exponent", [2.0, 0.5])
def test_absorption_differs_across_the_band(lib, exponent):
    """At 20, 60 and 100 m, 1.4 dB and less between the band's ends, as `absorbed` has it and as it is exactly."""
    start, speed, samples = 2 * 15 / 1500, 1500.0, 4500

    def absorption_db(frequency):
        return 0.1 * (frequency / 300e3) ** exponent

    alike = signals(lib, samples=samples)
    maker = signals(lib, samples=samples, start=start, sound_speed=speed, absorption_db=absorption_db)
    column = np.round((np.array([20.0, 60.0, 100.0]) * 2 / speed - start) * RATE)
    found, plain = (fft.fft(one.form(filled(lib, one, 3, [0, 1, 2], column, np.ones(3))), 8192)
                    for one in (maker, alike))
    response = np.zeros((3, samples), complex)
    response[np.arange(3), column.astype(int)] = 1
    windowed = fft.fft(absorbed(response, RATE, 300e3, absorption_db, speed, start), 8192)
    f = fft.fftfreq(8192, 1 / RATE)
    inside = np.abs(f) < 10e3
    loss = 20 * np.log10(np.abs(found / plain))[:, inside]
    excess = absorption_db(300e3 + f[inside]) - 0.1
    exact = -np.multiply.outer(start + column / RATE, speed * excess)
    assert np.ptp(exact[2]) > 0.5
    assert np.abs(loss - exact).max() < 0.02
    assert np.abs(loss - 20 * np.log10(np.abs(windowed))[:, inside]).max() < 0.02
    assert np.abs(np.angle(found / plain))[:, inside].max() < 2e-3


def test_noise_is_white_over_the_replicas_band_and_each_rows_own(lib):
    maker, rows, noise = signals(lib), 300, NoiseDensity(ambient=0.5, own=1.5)
    keys = np.arange(10, 10 + rows, dtype=np.uint32) * np.uint32(0x85EBCA6B)
    drawn = maker.form(maker.grid(rows), noise=noise, keys=keys)
    few = maker.form(maker.grid(4), noise=noise, keys=keys[96:100])
    assert few.tobytes() == np.ascontiguousarray(drawn[96:100]).tobytes()
    length = 4096
    spectrum = np.abs(PULSE.spectrum(RATE, length)) ** 2
    assert np.mean(np.abs(drawn) ** 2) == pytest.approx(2.0 * RATE / np.mean(spectrum), rel=0.02)
    assert np.abs(np.vdot(drawn[:-1], drawn[1:])) < 0.01 * np.linalg.norm(drawn) ** 2


def test_same_bytes_whatever_the_number_of_threads(lib, rng):
    if dr.backend_v(lib.Float) != dr.JitBackend.LLVM:
        pytest.skip("sums on a GPU are atomic")
    maker, n, threads, found = signals(lib), 20_000, dr.thread_count(), set()
    echoes = rng.integers(0, 33, n), rng.uniform(0, SAMPLES, n), rng.standard_normal(n) + 1j * rng.standard_normal(n)
    try:
        for count in (1, 2, 4):
            dr.set_thread_count(count)
            found.add(maker.form(filled(lib, maker, 33, *echoes), noise=NoiseDensity(own=1e-3),
                                 keys=np.arange(33, dtype=np.uint32)).tobytes())
    finally:
        dr.set_thread_count(threads)
    assert len(found) == 1


def test_bad_input(lib):
    maker = signals(lib)
    with pytest.raises(ValueError, match="3 rows: there are"):
        maker.form(maker.grid(3), doppler=np.ones(2))
    with pytest.raises(ValueError, match="keys of noise"):
        maker.form(maker.grid(3), noise=NoiseDensity(own=1.0))
    with pytest.raises(ValueError, match="800 of 800 samples"):
        signals(lib, lead=SAMPLES)
    outside = maker.form(filled(lib, maker, 3, [3, 4_000_000_000], [50, 60], np.ones(2)))
    assert not outside.any()
