"""Echoes summed on the device, against the same sum in float64, and what the sum must not depend on.

A line of elements half a wavelength apart at 300 kHz, hits 10 to 28 m off, so near that wave fronts are curved; delays
are straight-line ones. Differences of delay are float32: 1e-7 of 0.4 ms at 300 kHz is 1e-5 cycle, or -85 dB of the rms,
and so is what float32 sums lose; the tolerance is -80 dB. Byte for byte means that.
"""
import drjit as dr
import numpy as np
import pytest

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.signal.accumulation import NOWHERE, ImpulseResponses, centre
from mitsonar.signal.impulses import FLAT, KERNELS, element_responses, in_band_error_db, response_spectrum

SPEED, FREQUENCY, RATE, SAMPLES, START = 1500.0, 300e3, 40e3, 1100, 0.013


def straight(hit, element):
    """Delay at an element less that at the centre; the square of both distances is known."""
    x, y, z, distance, speed = hit
    dx, dy, dz = element
    more = dx * (dx - 2 * x) + dy * (dy - 2 * y) + dz * (dz - 2 * z)
    return more / (dr.sqrt(dr.fma(distance, distance, more)) + distance) / speed


class Echoes:
    """Hits around an array, for the device and as float64 delays."""

    def __init__(self, lib, rng, hits, elements, frequency=FREQUENCY, reach=(10.0, 28.0)):
        self.frequency = frequency
        distance, azimuth = rng.uniform(*reach, hits), rng.uniform(-1, 1, hits)
        self.place = np.stack([distance * np.sin(azimuth), distance * np.cos(azimuth), np.full(hits, -4.0)])
        self.place = self.place.astype(np.float32).astype(float)
        self.offset = np.zeros((3, elements))
        self.offset[0] = (np.arange(elements) - (elements - 1) / 2) * 0.5 * SPEED / frequency
        self.offset = self.offset.astype(np.float32).astype(float)
        self.amplitude = (rng.standard_normal(hits) + 1j * rng.standard_normal(hits)).astype(np.complex64)
        distance = np.linalg.norm(self.place, axis=0)
        apart = np.linalg.norm(self.place[:, :, None] - self.offset[:, None], axis=0)
        self.delay = (distance[:, None] + apart) / SPEED
        self.phase, self.sample, self.fraction = centre(upload(lib.Float64, 2 * distance / SPEED), start=START,
                                                        frequency=frequency, sampling_rate=RATE)
        self.fields = [upload(lib.Float, np.asarray(row, np.float32)) for row in (*self.place, distance)]
        self.fields.append(dr.opaque(lib.Float, SPEED))
        self.amplitudes = tuple(upload(lib.Float, part) for part in (self.amplitude.real, self.amplitude.imag))

    def into(self, responses, **changed):
        """Add them."""
        given = dict(amplitude=self.amplitudes, phase=self.phase, sample=self.sample, fraction=self.fraction,
                     hit_fields=self.fields, element_fields=self.offset, difference=straight)
        responses.add(**{**given, **changed})
        return responses

    def reference(self, kernel, amplitude=None):
        """The same in float64."""
        return element_responses(delay=self.delay, amplitude=self.amplitude if amplitude is None else amplitude,
                                 frequency=self.frequency, sampling_rate=RATE, samples=SAMPLES, start=START,
                                 kernel=kernel)


@pytest.fixture
def lib(variant):
    import mitsuba as mi

    return arrays_of(mi.Float)


def empty(lib, elements, kernel="band_limited", **changed):
    return ImpulseResponses(lib.Float, **{**dict(elements=elements, samples=SAMPLES, sampling_rate=RATE,
                                                 frequency=FREQUENCY, kernel=kernel), **changed})


def error_db(found, expected):
    return 20 * np.log10(np.linalg.norm(found - expected) / np.linalg.norm(expected))


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("elements", [1, 2, 7, 40])
def test_sums_are_those_of_float64(lib, rng, kernel, elements):
    echoes = Echoes(lib, rng, 3000, elements)
    assert error_db(echoes.into(empty(lib, elements, kernel)).read(), echoes.reference(kernel)) < -80


@pytest.mark.parametrize("hits", [1, 63, 40_000])
def test_any_number_of_hits(lib, rng, hits):
    echoes = Echoes(lib, rng, hits, 3)
    assert error_db(echoes.into(empty(lib, 3)).read(), echoes.reference("band_limited")) < -80


def test_error_within_the_flat_band(lib, rng):
    echoes = Echoes(lib, rng, 3000, 8)
    offset = np.linspace(-FLAT, FLAT, 33) * RATE
    exact = response_spectrum(delay=echoes.delay, amplitude=echoes.amplitude, frequency=FREQUENCY, offset=offset,
                              start=START)
    found = {kernel: in_band_error_db(echoes.into(empty(lib, 8, kernel)).read(), sampling_rate=RATE, offset=offset,
                                      exact=exact) for kernel in KERNELS}
    assert found["band_limited"] < -54
    assert found["peterson"] < -58
    assert found["nearest"] < -7


@pytest.mark.parametrize("elements", [1, 7, 40])
def test_each_hit_is_on_its_own_sheet(lib, rng, elements):
    """What a sheet holds is what the hits of its number alone would make."""
    echoes, sheet = Echoes(lib, rng, 3000, elements), rng.integers(0, 3, 3000).astype(np.uint32)
    responses = echoes.into(empty(lib, elements, sheets=3), sheet=upload(lib.UInt32, sheet))
    for number in range(3):
        alone = echoes.reference("band_limited", np.where(sheet == number, echoes.amplitude, 0))
        assert error_db(responses.read(number), alone) < -80


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("elements", [1, 6, 70])
def test_same_bytes_whatever_the_number_of_threads(exact, lib, rng, kernel, elements):
    echoes, threads, found = Echoes(lib, rng, 30_000, elements), dr.thread_count(), []
    try:
        for count in (2, 4, 3, 40, 2):
            dr.set_thread_count(count)
            found.append(echoes.into(empty(lib, elements, kernel)).read().tobytes())
    finally:
        dr.set_thread_count(threads)
    assert len(set(found)) == 1


def test_numbers_and_sizes_make_no_new_kernel(lib, rng):
    if dr.backend_v(lib.Float) != dr.JitBackend.LLVM:
        pytest.skip("what is compiled is looked at on the CPU")
    Echoes(lib, rng, 500, 5).into(empty(lib, 5)).read()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        for hits, elements, samples, frequency in ((700, 5, 1100, 300e3), (20_000, 12, 1300, 120e3), (99, 33, 37, 7e5)):
            Echoes(lib, rng, hits, elements, frequency).into(
                empty(lib, elements, samples=samples, frequency=frequency, sampling_rate=0.1 * frequency)).read()
        kernels = [kernel for kernel in dr.kernel_history() if kernel["type"] == dr.KernelType.JIT]
        dr.kernel_history_clear()
    assert len(kernels) >= 6
    assert all(kernel["cache_hit"] for kernel in kernels)


def test_blocks_add_up_and_memory_does_not_grow(lib, rng):
    first, second = Echoes(lib, rng, 2000, 5), Echoes(lib, rng, 1500, 5)
    responses = empty(lib, 5)
    size = dr.width(responses.sums)
    second.into(first.into(responses))
    assert dr.width(responses.sums) == size
    total = first.reference("band_limited") + second.reference("band_limited")
    assert error_db(responses.read(), total) < -80
    responses.clear()
    assert error_db(first.into(responses).read(), first.reference("band_limited")) < -80


def test_copies_stay_within_their_budget(lib):
    long = empty(lib, 2, samples=1_000_000)
    assert 1 <= long.copies < 16
    assert 4 * dr.width(long.sums) < 300e6


def test_phase_of_far_echoes(lib, rng):
    """500 kHz at 100 m: 0.05 degrees, where float32 delays would be wrong by 5; one echo at a time."""
    worst = 0.0
    for _ in range(5):
        echo = Echoes(lib, rng, 1, 100, 500e3, (98.0, 100.0))
        z = echo.into(empty(lib, 100, "nearest", frequency=500e3, samples=6000)).read()
        assert np.count_nonzero(z) == 100
        cycles = echo.delay[0] * 500e3
        ratio = z.sum(1) / (echo.amplitude[0] * np.exp(-2j * np.pi * (cycles % 1)))
        worst = max(worst, np.abs(np.angle(ratio, deg=True)).max())
    assert worst < 0.05


def test_gain_and_rows(lib, rng):
    """Two faces, one after the other, each element with a gain of its own that depends on the hit."""
    echoes = Echoes(lib, rng, 2000, 9)
    offset = np.concatenate([echoes.offset, np.linspace(0.5, 2, 9)[None]])
    gain = echoes.place[1][:, None] * np.linspace(0.5, 2, 9)
    responses = empty(lib, 9)
    for rows in ([0, 1, 5, 8, 2], [7, 3, 4, 6]):
        echoes.into(responses, rows=rows, element_fields=offset[:, rows], difference=lambda h, e: straight(h, e[:3]),
                    gain=lambda h, e: h[1] * e[3])
    expected = echoes.reference("band_limited", echoes.amplitude[:, None] * gain)
    assert error_db(responses.read(), expected) < -80


@pytest.mark.parametrize("kernel", KERNELS)
def test_hits_that_are_none_bring_nothing(lib, rng, kernel):
    """NaN delays, and delays far before and after the record, whatever else these hits carry."""
    good, many = Echoes(lib, rng, 10, 3), Echoes(lib, rng, 1000, 3)
    delay = rng.choice([np.nan, np.inf, -np.inf, START - 1.0, START + 7.0, 1e9], 1000)
    phase, sample, fraction = centre(upload(lib.Float64, delay), start=START, frequency=FREQUENCY, sampling_rate=RATE)
    assert np.all(sample.numpy()[~np.isfinite(delay)] == NOWHERE)
    broken = upload(lib.Float, rng.choice(np.array([np.nan, np.inf, 0.0], np.float32), 1000))
    responses = good.into(empty(lib, 3, kernel))
    before = responses.read()
    many.into(responses, phase=phase, sample=sample, fraction=fraction, amplitude=(broken, broken),
              hit_fields=[broken, *many.fields[1:]])
    many.into(responses, sample=upload(lib.Int32, np.full(1000, NOWHERE, np.int32)), phase=broken)
    assert responses.read().tobytes() == before.tobytes()
    assert np.isfinite(before).all()


def test_centre_splits_in_double_precision(lib, rng):
    delay = rng.uniform(0.2, 5.0, 1000)
    phase, sample, fraction = (part.numpy() for part in centre(upload(lib.Float64, delay), start=0.1, frequency=5e5,
                                                               sampling_rate=3e4))
    assert np.abs((phase - delay * 5e5 + 0.5) % 1 - 0.5).max() < 1e-6
    assert sample + fraction.astype(float) == pytest.approx((delay - 0.1) * 3e4, abs=1e-6)
    assert fraction.min() >= 0 and fraction.max() <= 1


def test_bad_input(lib, rng):
    echoes = Echoes(lib, rng, 10, 3)
    with pytest.raises(ValueError, match="0 elements and 1100 samples"):
        empty(lib, 0)
    with pytest.raises(ValueError, match="there is no kernel 'sinc'"):
        empty(lib, 3, "sinc")
    with pytest.raises(ValueError, match="GiB, and 16 is the limit"):
        empty(lib, 600, samples=1 << 20)
    with pytest.raises(ValueError, match="at most once"):
        echoes.into(empty(lib, 3), rows=[0, 1, 1])
    with pytest.raises(ValueError, match="at most once"):
        echoes.into(empty(lib, 3), rows=[0, 1, 3])
    with pytest.raises(ValueError, match="have 3 values for 4 elements"):
        echoes.into(empty(lib, 4))
    with pytest.raises(ValueError, match="fields of 10 hits have 7 values"):
        echoes.into(empty(lib, 3), phase=dr.zeros(lib.Float, 7) + dr.opaque(lib.Float, 1.0))
