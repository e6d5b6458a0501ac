"""Gathered weights are the transpose of summed echoes: Re⟨w, A a⟩ = Re⟨A* w, a⟩ to float32."""
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import upload

ECHOES, RATE, FREQUENCY = 500, 20e3, 100e3


def test_weights_of_echoes_are_the_transpose_of_their_sums(variant, rng):
    from mitsonar.signal.accumulation import ImpulseResponses, centre
    from mitsonar.signal.gathering import DelayChange, EchoPairs, GatheredWeights
    from mitsonar.signal.impulses import BandLimited, Later
    delay, offsets = rng.uniform(0.0, 0.01, ECHOES), rng.uniform(-2e-4, 2e-4, 6)
    phase, sample, fraction = centre(upload(mi.Float64, delay), start=0.0, frequency=FREQUENCY, sampling_rate=RATE)
    real, imaginary, change = (upload(mi.Float, rng.standard_normal(ECHOES).astype(np.float32)) for _ in range(3))
    sheet = upload(mi.UInt32, rng.integers(0, 2, ECHOES).astype(np.uint32))
    echoes = dict(amplitude=(real, imaginary), phase=phase, sample=sample, fraction=fraction, hit_fields=[change],
                  element_fields=[offsets], difference=lambda hit, at: at[0], rows=np.arange(6)[::-1], sheet=sheet)
    for kernel in (BandLimited(), Later(frequency=FREQUENCY, sampling_rate=RATE)):
        sums = ImpulseResponses(mi.Float, elements=6, samples=200, sampling_rate=RATE, frequency=FREQUENCY,
                                kernel=kernel, sheets=2)
        sums.add(**echoes, gain=lambda hit, at: hit[0])
        moved = np.stack([sums.read(0), sums.read(1)])
        weights = (rng.standard_normal(moved.shape) + 1j * rng.standard_normal(moved.shape)).astype(np.complex64)
        gathered = GatheredWeights(mi.Float, weights, kernel=kernel, sampling_rate=RATE, frequency=FREQUENCY)
        pairs = EchoPairs(**echoes)
        # each element has a number of its own, which counts as often as its place; one number is shared
        change_of = DelayChange(lambda hit, at, own, shared: hit[0] * (own[0] + at[0] * own[1] + shared[0]), 2, 1)
        each, common = gathered.gather(pairs, change_of)
        wanted = np.real(np.conj(weights) * moved).sum((0, 2))[::-1]
        size = np.linalg.norm(weights) * np.linalg.norm(moved)
        assert np.abs(each[:, 0] - wanted).max() < 1e-6 * size
        assert np.abs(each[:, 1] - offsets * wanted).max() < 1e-6 * size * np.abs(offsets).max()
        assert abs(common[0] - wanted.sum()) < 1e-6 * size
        of_pairs = gathered.of_pairs(pairs, change_of)
        assert np.abs(of_pairs[:2].sum(1).T - each).max() < 1e-6 * size
        assert abs(of_pairs[2].sum() - common[0]) < 1e-6 * size
