"""Bottom detection against an independent simulator of beds in a fan of split beams (tests/inputs/swath_echoes.py)."""
import numpy as np
import pytest
from mitsonar.hydrography.detection import Head, detect
from mitsonar.hydrography.record import BY_PHASE

from swath_echoes import SOUND_SPEED, Sounder, bed, halves


def head_of(sounder, **changes):
    return Head(**{"pulse_length": sounder.pulse, "beam_width": sounder.beam_widths, "baseline": sounder.baseline,
                   "transmit_width": np.radians(sounder.along_deg), **changes})


def time_of_plane(sounder, depth, slope_deg=0.0):
    angle = np.arcsin(sounder.sines)
    return 2 * depth / SOUND_SPEED / (np.cos(angle) - np.tan(np.radians(slope_deg)) * np.sin(angle))


@pytest.fixture(scope="module")
def flat():
    """Six pings over a level bed."""
    sounder, chance = Sounder(duration=0.085), np.random.default_rng(1)
    pings = [halves(sounder, *bed(sounder, chance), chance) for _ in range(6)]
    return sounder, [detect(ping, time=sounder.time, sines=sounder.sines, head=head_of(sounder)) for ping in pings]


def test_a_level_bed_is_found_by_amplitude_below_and_by_phase_aside(flat):
    sounder, pings = flat
    steep = np.abs(np.degrees(np.arcsin(sounder.sines)))
    for found in pings:
        assert found.valid.all()
        assert (found.method[steep > 50] == BY_PHASE).all() and (found.method[steep < 20] != BY_PHASE).all()
        assert np.abs(found.time / time_of_plane(sounder, 20.0) - 1).max() < 0.012
