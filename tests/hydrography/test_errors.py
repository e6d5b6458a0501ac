"""Errors by cause: they add up, and each cause alone makes its own, of the size geometry says."""
from dataclasses import replace

import numpy as np
import pytest
from sounded_line import ARMS, rocking, sounded, swath

from mitsonar.hydrography.reduction.errors import Reduction, disturbed, errors
from mitsonar.hydrography.reduction.reduction import Installation
from mitsonar.water import SoundSpeedProfile

DEPTH = 90.0


def flat(x, y):
    return np.full(np.shape(x), DEPTH)


@pytest.fixture(scope="module")
def level():
    """Ten pings over a level bed from a vessel that rocks, exactly measured."""
    motion, sent = rocking(np.arange(-1, 12, 0.01)), np.repeat(np.arange(10.0)[:, None], 61, 1)
    across = np.broadcast_to(np.linspace(-150, 150, 61), sent.shape)
    return sounded(swath(motion, sent, across, 0 * across, np.full(sent.shape, DEPTH)), sent, motion)


def slope(x, y):
    return 80 + 0.1 * x + 0.05 * y


def truth(line):
    return Reduction(motion=line.motion, installation=line.installation, profile=line.profile, node=False)


def test_exact_soundings_have_no_error(level):
    _, found = errors(level.measured, truth(level), truth(level), flat)
    assert all(np.abs(value).max() < 1e-8 for name, value in found.variables().items() if name != "true_depth")
    assert np.all(found.true_depth == DEPTH)


def test_causes_add_up_to_the_error(level):
    late = replace(level.measured, travel_time=level.measured.travel_time * 1.001)
    used = Reduction(motion=disturbed(level.motion, latency=0.01, roll=0.001), installation=ARMS,
                     profile=SoundSpeedProfile.constant(1480.0))
    places, found = errors(late, truth(level), used, slope)
    total = found.error_detection + found.error_refraction + found.error_motion
    np.testing.assert_allclose(total, places.depth - slope(places.x, places.y), rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.error, total, rtol=0, atol=1e-12)
    assert all(np.abs(getattr(found, f"error_{name}")).max() > 0.05 for name in ("detection", "refraction", "motion"))


def test_each_cause_makes_its_own_error_alone(level):
    longer = replace(level.measured, travel_time=level.measured.travel_time + 1e-4)
    _, found = errors(longer, truth(level), truth(level), flat)
    assert found.error_detection.min() > 0.02 and np.abs(found.error_refraction).max() == 0
    uniform = replace(truth(level), profile=SoundSpeedProfile.constant(1480))
    _, found = errors(level.measured, truth(level), uniform, flat)
    assert np.abs(found.error_detection).max() < 1e-8 and np.abs(found.error_refraction).max() > 0.1
    assert np.abs(found.error_motion).max() == 0


def test_roll_bias_tilts_the_swath(level):
    # A roll of δ turns the swath about the vessel: depth is off by the distance across times δ. Bent rays bend a little
    # differently: 3 % of the size.
    bias = 1e-3
    _, found = errors(level.measured, truth(level),
                      replace(truth(level), motion=disturbed(level.motion, roll=bias)), flat)
    across = np.linspace(-150, 150, 61)
    assert np.abs(found.error_motion - bias * across).max() < 0.03 * bias * 150 * 2
    mounted = replace(truth(level), installation=Installation(
        transmit_offset=ARMS.transmit_offset, receive_offset=ARMS.receive_offset,
        transmit_mounting=ARMS.transmit_mounting + np.array([bias, 0, 0]),
        receive_mounting=ARMS.receive_mounting + np.array([bias, 0, 0])))
    _, same = errors(level.measured, truth(level), mounted, flat)
    np.testing.assert_allclose(same.error, found.error, atol=0.02 * bias * 150)


def test_latency_errs_by_the_roll_rate_times_the_delay(level):
    # Roll of 0.1 sin(1.3 t) told 20 ms late is wrong by 2.6 mrad at most, 0.39 m at 150 m across.
    _, found = errors(level.measured, truth(level),
                      replace(truth(level), motion=disturbed(level.motion, latency=0.02)), flat)
    assert 0.25 < np.abs(found.error_motion).max() < 0.45
    assert np.abs(found.error_motion[:, 30]).max() < 0.05 + 0.02 * 0.5     # heave's share, and that of the arms


def test_unknown_disturbances_are_refused(level):
    with pytest.raises(ValueError, match="a motion has no yaw; give depth, heading"):
        disturbed(level.motion, yaw=0.1)
