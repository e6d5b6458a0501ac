"""The record of powers: put together from blocks of pings."""
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from mitsonar.imaging import sidescan
from mitsonar.imaging.energy_record import CoherentRecord, EnergyRecord, gathered
from mitsonar.imaging.truth import BinTruth


def block(random, pings, rows=2, bins=5, labels=3, cells=2):
    """A record of some pings, every array of its own shape and kind, full of numbers."""
    size = pings * rows, bins

    def numbers(*more):
        return random.integers(0, 9, (size[0], *more, bins)).astype(np.uint32)

    truth = BinTruth(label=numbers(), share=random.random((size[0], labels, bins)).astype(np.float32), hidden=numbers(),
                     object_shadow=numbers(), layover=numbers(), seabed_place=random.random((*size, 3)))
    coherent = CoherentRecord(intensity=random.random(size), in_beam=numbers(), depth=numbers(),
                              pressure=np.exp(1j * random.random((*size, cells))).astype(np.complex64))
    return EnergyRecord(intensity=random.random(size), depth=random.random(size), rays=numbers(),
                        rays_in_beam=numbers(), truth=truth, coherent=coherent)


def test_blocks_make_one_record_in_the_order_of_their_pings():
    random = np.random.default_rng(1)
    blocks = [block(random, pings) for pings in (3, 3, 1)]
    whole = gathered(iter(blocks), pings=7, rows=2)
    for of in (lambda record: record.intensity, lambda record: record.rays, lambda record: record.coherent.pressure,
               lambda record: record.truth.share, lambda record: record.truth.seabed_place):
        expected = np.concatenate([of(one) for one in blocks])
        np.testing.assert_allclose(of(whole), expected.reshape(7, 2, *expected.shape[1:]), rtol=1e-7)


def test_a_record_keeps_single_precision_and_counts_stay_whole():
    whole = gathered([block(np.random.default_rng(2), 2)], pings=2, rows=2)
    assert whole.intensity.dtype == whole.coherent.intensity.dtype == whole.truth.seabed_place.dtype == np.float32
    assert whole.rays.dtype == whole.truth.label.dtype == np.uint32 and whole.coherent.pressure.dtype == np.complex64
    assert whole.path_intensity is None and whole.coherent.path_intensity is None


def test_what_arrives_in_the_main_lobe_counts_coherent_echoes():
    one = block(np.random.default_rng(3), 1)
    np.testing.assert_array_equal(one.echoes_in_beam, one.rays_in_beam + one.coherent.in_beam)


def test_blocks_that_are_not_all_are_refused():
    with pytest.raises(ValueError, match="blocks of 2 pings were given for a record of 3"):
        gathered([block(np.random.default_rng(4), 2)], pings=3, rows=2)


def test_a_sidescan_image_wants_the_pressures_of_coherent_echoes():
    whole = gathered([block(np.random.default_rng(5), 1)], pings=1, rows=2)
    of_beams = replace(whole, coherent=replace(whole.coherent, pressure=None, depth=None))
    with pytest.raises(ValueError, match="adds coherent echoes as pressures, .* take a record of sides"):
        sidescan.image(of_beams, sonar=SimpleNamespace(pulse_length=1e-3), track=None, depth_below=None, window=(0, 1),
                       labels={}, class_of={}, noise_db=None, speckle=False, seed=0, absorption_db=0.0)
