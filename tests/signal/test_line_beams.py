"""Beams of a line from a grid of sine and time, against the exact sum over elements and frequencies.

What is left is what four taps in time leave of any echo, in beams as in the responses of elements: -57 dB of its peak.
"""
from dataclasses import replace

import drjit as dr
import numpy as np
import pytest
from beam_cases import LEAD, SAMPLES, SPEED, Line, worst_db
from scipy import fft

from mitsonar.device.arrays import arrays_of
from mitsonar.signal.beam_grid import NoiseDensity, kernels
from mitsonar.signal.beam_grid.line_response import LineResponse, ResponseRows, response_of
from mitsonar.signal.reception import absorbed
from mitsonar.sonar.pulses.pulses import cw, hfm, lfm

ECHOES = (100.3, 0.0, 0.6 + 0.8j), (SAMPLES / 2 + 0.77, 0.51, -1.0), (200.5, -0.86, 1j), (420.25, 0.97, 1.0)
LINES = {
    "half a wavelength apart": {},
    "by equal angles": dict(sines=np.sin(np.radians(np.linspace(-60, 60, 31)))),
    "beams at random": dict(sines=[0.3, -1.0, 0.02, 1.0, 0.301]),
    "two": dict(elements=2),
    "a third of a wavelength apart": dict(elements=40, pitch=0.33),
    "a wavelength apart": dict(elements=24, pitch=1.0),
    "shaded, jittered, some dead": dict(jitter=0.05, weight=np.hanning(50)[1:-1] * (np.arange(48) % 11 > 0)),
    "complex weights": dict(weight=np.exp(1j * np.linspace(0, 3, 48))),
    "a third of the carrier wide": dict(elements=32, pulse=lfm(90e3, 30e3, 0.5e-3)),
    "cw": dict(pulse=cw(300e3, 0.2e-3)),
    "hyperbolic": dict(pulse=hfm(300e3, -20e3, 0.5e-3, "hann")),
}


@pytest.fixture
def lib(variant):
    import mitsuba as mi

    return arrays_of(mi.Float)


ORDERS = pytest.mark.parametrize("fewer", [0.0, np.inf], ids=["of spectra", "of records"])


@ORDERS
@pytest.mark.parametrize("name", LINES)
def test_points_are_those_of_the_exact_sum(lib, monkeypatch, name, fewer):
    """Each alone, so that the error is that of one; sines within the beams, at their edge and beyond."""
    monkeypatch.setattr(kernels, "FEWER", fewer)
    line = Line(lib, **LINES[name])
    for echo in ECHOES:
        echo = tuple(np.float32(part) if np.isrealobj(part) else part for part in echo)
        assert worst_db(line.beams.form(line.grid(echo)), line.exact(*echo)) < -54


@pytest.mark.parametrize("exponent", [2.0, 0.5])
def test_absorption_differs_across_the_band(lib, exponent):
    """At 20, 60 and 100 m: 1.4 dB and less between the band's ends, as `absorbed` and as it is exactly."""
    start, samples = 2 * 15 / SPEED, 4500

    def absorption_db(frequency):
        return 0.1 * (frequency / 300e3) ** exponent

    common = dict(elements=2, sines=[0.0], samples=samples)
    alike, line = Line(lib, **common), Line(lib, **common, start=start, absorption_db=absorption_db)
    column = np.round((np.array([20.0, 60.0, 100.0]) * 2 / SPEED - start) * line.rate)
    found, plain = (fft.fft(np.concatenate([one.beams.form(one.grid((c, 0.0, 1.0))) for c in column]), 8192)
                    for one in (line, alike))
    response = np.zeros((3, samples), complex)
    response[np.arange(3), column.astype(int)] = 1
    windowed = fft.fft(absorbed(response, line.rate, 300e3, absorption_db, SPEED, start), 8192)
    f = fft.fftfreq(8192, 1 / line.rate)
    inside = np.abs(f) < 10e3
    loss = 20 * np.log10(np.abs(found / plain))[:, inside]
    exact = -np.multiply.outer(start + column / line.rate, SPEED * (absorption_db(300e3 + f[inside]) - 0.1))
    assert np.ptp(exact[2]) > 0.5
    assert np.abs(loss - exact).max() < 0.02
    assert np.abs(loss - 20 * np.log10(np.abs(windowed))[:, inside]).max() < 0.02
    assert np.abs(np.angle(found / plain))[:, inside].max() < 2e-3


def test_echoes_of_many_calls_add_up(lib, rng):
    line, n = Line(lib), 3000
    column, sine = rng.uniform(-3, SAMPLES + 3, n), rng.uniform(-1, 1, n)
    amplitude = rng.standard_normal(n) + 1j * rng.standard_normal(n)
    whole = line.beams.form(line.grid((column, sine, amplitude)))
    parts = line.beams.form(line.grid(*((column[k::3], sine[k::3], amplitude[k::3]) for k in range(3))))
    assert whole.shape == (len(line.sines), SAMPLES - LEAD) and whole.dtype == np.complex64
    assert worst_db(parts, whole, np.abs(whole).max()) < -110


def test_what_is_no_echo_brings_nothing(lib, rng):
    line = Line(lib)
    before = line.beams.form(line.grid((100.3, 0.2, 1.0)))
    bad = np.array([np.nan, np.inf, -np.inf, 1e30])
    after = line.beams.form(line.grid((100.3, 0.2, 1.0), (bad, 0.1, 1.0), (50.0, bad, 1.0), (50.0, 0.1, bad[:3]),
                                      (50.0, 0.1, np.array([complex(1, np.nan)])), (50.0, 1.001, 1.0),
                                      (-40.0, 0.1, 1.0), (SAMPLES + 40.0, 0.1, 1.0), 3 * (np.zeros(0),)))
    assert after.tobytes() == before.tobytes()
    assert not line.beams.form(line.beams.grid()).any()


def test_same_bytes_whatever_the_number_of_threads(exact, lib, rng):
    line, n, threads, found = Line(lib, elements=64), 40_000, dr.thread_count(), set()
    echoes = rng.uniform(0, SAMPLES, n), rng.uniform(-1, 1, n), rng.standard_normal(n) + 1j * rng.standard_normal(n)
    try:
        for count in (1, 2, 4, 7):
            dr.set_thread_count(count)
            found.add(line.beams.form(line.grid(echoes), doppler=np.linspace(0.999, 1.001, 5), key=5,
                                      noise=NoiseDensity(ambient=1e-6, own=1e-6)).tobytes())
    finally:
        dr.set_thread_count(threads)
    assert len(found) == 1


@pytest.mark.parametrize("pulse", [lfm(300e3, 20e3, 0.5e-3), cw(300e3, 0.5e-3)], ids=lambda pulse: pulse.kind)
def test_rows_have_doppler_factors_of_their_own(lib, pulse):
    line, at = Line(lib, pulse=pulse), np.linspace(-1, 1, 33)
    factors = 1 + 2e-3 * at
    for column, sine in ((100.25, -0.5), (300.5, 0.125), (350.0, 0.75)):
        found = line.beams.form(line.grid((column, sine, 1.0)), doppler=factors)
        assert worst_db(found, line.exact(column, sine, 1.0, 1 + 2e-3 * sine)) < -44
        assert worst_db(found, line.exact(column, sine, 1.0)) > -20


def test_numbers_and_sizes_make_no_new_kernel(lib, rng):
    if dr.backend_v(lib.Float) != dr.JitBackend.LLVM:
        pytest.skip("what is compiled is looked at on the CPU")

    def form(elements, samples, key):
        line = Line(lib, elements=elements, samples=samples)
        line.beams.form(line.grid((rng.uniform(0, samples, 50), rng.uniform(-1, 1, 50), rng.standard_normal(50))),
                        doppler=np.linspace(1, 1 + 1e-6 * key, 3), noise=NoiseDensity(ambient=1e-6 * key, own=1e-6),
                        key=key)

    form(48, SAMPLES, 1)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        form(30, 500, 2)
        form(51, 731, 3)
        kernels = [kernel for kernel in dr.kernel_history() if kernel["type"] == dr.KernelType.JIT]
        dr.kernel_history_clear()
    assert len(kernels) >= 10
    assert all(kernel["cache_hit"] for kernel in kernels)


def test_bad_input(lib):
    with pytest.raises(ValueError, match=r"positions have shape \(48,\), weights \(3,\)"):
        Line(lib, weight=np.ones(3))
    with pytest.raises(ValueError, match="one of them other than 0"):
        Line(lib, weight=np.zeros(48))
    with pytest.raises(ValueError, match="reach 1.2; give one or more within"):
        Line(lib, sines=[0.0, 1.2])
    with pytest.raises(ValueError, match="600 of 600 samples are to be dropped"):
        Line(lib, lead=SAMPLES)
    with pytest.raises(ValueError, match="longer than the record"):
        Line(lib, samples=15, lead=2)
    with pytest.raises(ValueError, match="belongs to another line"):
        Line(lib).beams.form(Line(lib).beams.grid())
    line = Line(lib)
    with pytest.raises(ValueError, match="Doppler factors"):
        line.beams.form(line.beams.grid(), doppler=np.array([1.0, np.nan]))
    with pytest.raises(ValueError, match="ambient is -1"):
        NoiseDensity(ambient=-1)


@ORDERS
@pytest.mark.parametrize("sines", [np.linspace(-0.8, 0.8, 9), np.linspace(0.4, 0.9, 9)], ids=["both sides", "aside"])
def test_beams_of_halves_are_those_of_the_exact_sum(lib, monkeypatch, sines, fewer):
    """Halves are read from every second row, turned back, and need fewer rows where beams look aside."""
    monkeypatch.setattr(kernels, "FEWER", fewer)
    weights = np.stack([np.where(side * (np.arange(48) - 23.5) < 0, np.linspace(0.7, 1, 48), 0) for side in (1, -1)])
    echoes = [(300.2, 0.43, 1.0), (310.7, -0.9, 0.5), (200.4, 0.98, 1j)]
    scale = np.array([2.0, 0.5])
    line = Line(lib, weight=weights, sines=sines, scale=scale, lead=LEAD + 1)
    found = line.beams.form_each(line.grid(*echoes))
    for number, weight in enumerate(weights):
        expected = sum(Line(lib, weight=weight, sines=sines).exact(*echo) for echo in echoes)[:, 1:]
        assert worst_db(found[number] / scale[number], expected) < -50        # each alone within -54 dB


def test_a_line_is_kept_for_the_next_image_and_made_anew_for_another():
    rows = ResponseRows(step=0.01, period=256, before=128)
    position, wavenumber = np.linspace(-0.05, 0.05, 24), np.linspace(190.0, 210.0, 5)
    weight, other = np.ones(24), np.hanning(26)[1:-1]
    kept = response_of(position, weight, wavenumber, rows, 1)
    assert response_of(position.copy(), weight.copy(), wavenumber.copy(), replace(rows), 1) is kept
    assert response_of(position, other, wavenumber, rows, 1) is not kept
    for farthest in (0.5, 0.9, 0.5):
        fresh = LineResponse(position, weight, wavenumber, rows).own_noise(farthest)
        assert (kept.own_noise(farthest) == fresh).all()
    for number in range(20):
        response_of(position, weight, wavenumber + number, rows, 1)
    assert response_of(position, weight, wavenumber, rows, 1) is not kept
