"""Transposes of linear stages: Re <w, A x> = Re <A^H w, x>, 1e-6 of the lengths, float32."""
import numpy as np
import pytest
import xarray as xr

from mitsonar.signal.beamforming import delay_and_sum, directions
from mitsonar.signal.beamforming.transposed import delay_and_sum_transposed
from mitsonar.signal.impulses import Later
from mitsonar.signal.matched_filtering import matched_filter
from mitsonar.signal.reception import absorbed, delayed, received, transposed
from mitsonar.sonar import lfm

SAMPLES = 200
RATE = 20e3
PULSE = lfm(100e3, 10e3, 2e-3)


def numbers(rng, *shape):
    return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)).astype(np.complex64)


def agree(weights, value, back, signals):
    there, here = np.vdot(weights.astype(complex), value), np.vdot(back.astype(complex), signals)
    assert abs(there) > 0 and abs(there - here) < 1e-6 * np.linalg.norm(weights) * np.linalg.norm(value)


@pytest.mark.parametrize("stage", [
    lambda x: matched_filter(x, PULSE, RATE), lambda x: received(x, PULSE, RATE, 1.001),
    lambda x: delayed(x, np.array([1e-3, -3e-4, 2e-5]), RATE, 1e5), Later(frequency=1e5, sampling_rate=RATE).finish],
    ids=["matched filter", "pulse and receiver", "delays", "derivative by delay"])
def test_filters_have_a_transpose(rng, stage):
    signals, weights = numbers(rng, 3, SAMPLES), numbers(rng, 3, SAMPLES)
    agree(weights, stage(signals), transposed(stage, weights), signals)


@pytest.mark.parametrize("loss", [0.02, 2.0], ids=["little", "much"])
def test_absorption_that_grows_with_range_has_a_transpose(rng, loss):
    signals, weights = numbers(rng, 3, 5 * SAMPLES), numbers(rng, 3, 5 * SAMPLES)
    water = RATE, 100e3, lambda frequency: loss * (frequency / 100e3) ** 2, 1500.0, 0.01
    assert np.linalg.norm(absorbed(signals, *water) - signals) > 1e-3 * np.linalg.norm(signals)
    agree(weights, absorbed(signals, *water), absorbed(weights, *water, transposed=True), signals)


@pytest.mark.parametrize("transmitters", [1, 2])
def test_beams_have_a_transpose(rng, transmitters):
    places = {f"{side}_{axis}": (side, 0.02 * rng.standard_normal(count)) for axis in "xyz"
              for side, count in (("rx", 5), ("tx", transmitters))}
    signals = xr.DataArray(
        numbers(rng, 2, transmitters, 5, SAMPLES), dims=("ping", "tx", "rx", "sample"),
        coords={"time": ("sample", 0.004 + np.arange(SAMPLES) / RATE), "rx_weight": ("rx", [1.0, 2, 0, 1, 1]),
                **places}, attrs={"frequency": 100e3, "sound_speed": 1500.0, "sampling_rate": RATE})
    look = directions(np.linspace(-0.6, 0.6, 7))
    beams = delay_and_sum(signals, look).values
    weights = numbers(rng, *beams.shape)
    back = delay_and_sum_transposed(signals, look, weights)
    agree(weights, beams, back, signals.values)
    assert not back[:, :, 2].any()                           # what an element without weight hears does not count
    assert np.array_equal(back, delay_and_sum_transposed(signals, look, weights))


def test_weights_of_other_beams_are_refused(rng):
    signals = xr.DataArray(numbers(rng, 2, SAMPLES), dims=("rx", "sample"),
                           coords={"time": ("sample", np.arange(SAMPLES) / RATE), **{f"rx_{axis}": ("rx", [0.0, 0.1])
                                                                         for axis in "xyz"}},
                           attrs={"frequency": 100e3, "sound_speed": 1500.0, "sampling_rate": RATE})
    with pytest.raises(ValueError, match="one for every sample"):
        delay_and_sum_transposed(signals, directions([0.0]), np.zeros((1, 2, SAMPLES)))
