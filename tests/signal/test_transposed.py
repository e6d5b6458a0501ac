"""Transposes of linear stages: Re <w, A x> = Re <A^H w, x>, 1e-6 of the lengths, float32."""
import numpy as np
import pytest
import xarray as xr

from mitsonar.signal.beamforming import delay_and_sum, directions
from mitsonar.signal.beamforming.transposed import delay_and_sum_transposed
from mitsonar.signal.matched_filter import matched_filter, matched_filter_transposed
from mitsonar.sonar import lfm

SAMPLES = 200
RATE = 20e3


def numbers(rng, *shape):
    return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)).astype(np.complex64)


def agree(weights, value, back, signals):
    there, here = np.vdot(weights.astype(complex), value), np.vdot(back.astype(complex), signals)
    assert abs(there) > 0 and abs(there - here) < 1e-6 * np.linalg.norm(weights) * np.linalg.norm(value)


def test_a_matched_filter_has_a_transpose(rng):
    pulse = lfm(100e3, 10e3, 2e-3)
    signals, weights = numbers(rng, 3, SAMPLES), numbers(rng, 3, SAMPLES)
    agree(weights, matched_filter(signals, pulse, RATE), matched_filter_transposed(weights, pulse, RATE), signals)


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
