"""Scatterers whose echoes arrive before or after a record are not ensonified, and the record misses none of them.

Geometry: a line of receivers over a level bed, 6 m below, a record of 10 to 14 m; the water of the first 100 m has
1500 m/s, deeper water is faster and out of reach. Truth is the record of all scatterers that the fastest and the
slowest water put within reach, with a margin of both arrays' sizes. Tolerance: 2e-5 of the rms, the order of float32
sums; a scatterer that is missed leaves at least a hundredth of it.
"""
import numpy as np
import pytest

from mitsonar.echoes.ensonification import Ensonification
from mitsonar.survey.pressure import ensonified_ping
from mitsonar.survey.pressure.pressure import PressureRecord
from mitsonar.survey.pressure.signals import LEAD, received_signals
from mitsonar.validation.scenes import array_sonar, bed
from mitsonar.water import SoundSpeedProfile

ROUNDED, MISSED = 2e-5, 1e-2
SONARS = {
    "at rest": {},
    "sweep under way": {"speed_knots": 8.0, "pulse": "lfm", "pulse_ms": 2.0, "bandwidth_khz": 12.0},
    "line of transmitters": {"transmit": "line", "transmit_elements": 4, "transmit_pitch": 0.05,
                             "transmit_axis": "starboard", "transmit_steer_deg": "40, 20"},
}


def record_of(sensor, **integrator):
    """The record of a ping of all receivers."""
    scene = array_sonar({"bed": bed(16.0, size=60.0)}, water={"profile": "0:1500, 100:1500, 3000:1600"},
                        film={"range": 14.0, "range_min": 10.0}, integrator={"cell": 0.1, **integrator},
                        sensor={"receive": "line", "receive_elements": 9, "receive_pitch": 0.1, "pings": 2, **sensor})
    return PressureRecord(scene.integrator().array_survey(scene, scene.sensors()[0], lead=LEAD), seed=3)


def echoes(record):
    """The number of echoes of scatterers in the first ping."""
    return sum(block.count for block in record.at(0).ensonified.echoes(0))


def signals(record):
    """Signals of the first ping."""
    return received_signals(record, [0]).values


def off(values, truth):
    """The largest difference, in units of the rms."""
    return np.abs(values - truth).max() / np.sqrt(np.mean(np.abs(truth) ** 2))


@pytest.mark.parametrize("sources", ["centre", "elements"])
@pytest.mark.parametrize("sonar", SONARS)
def test_no_echo_of_a_record_is_missed(variant, monkeypatch, sonar, sources):
    few = record_of(SONARS[sonar], fans=sources)
    found, count = signals(few), echoes(few)
    with monkeypatch.context() as patch:
        patch.setattr(Ensonification, "reach", lambda self, origin: (self.nearest, self.farthest))
        everything = record_of(SONARS[sonar], fans=sources)
        truth = signals(everything)
        assert count < 0.97 * echoes(everything)
    assert off(found, truth) < ROUNDED
    # the test would notice: without the spread, echoes at the ends are missing
    monkeypatch.setattr(ensonified_ping, "arrival_spread", lambda survey, slowest: -1.5e-3)
    assert off(signals(record_of(SONARS[sonar], fans=sources)), truth) > MISSED


def test_only_water_within_reach_counts(variant):
    ensonification = record_of({}).ensonification(0)
    nearest, farthest = ensonification.reach(np.array([0.0, 0.0, -10.0]))
    window, spread = ensonification.window, ensonification.spread
    assert np.isclose(farthest, 750 * (window[1] + spread)) and farthest < ensonification.farthest
    assert np.isclose(nearest, max(750 * (window[0] - spread), ensonification.nearest))


def test_extremes_of_a_profile_between_depths():
    profile = SoundSpeedProfile([0.0, 10.0, 20.0, 30.0], [1500.0, 1480.0, 1520.0, 1490.0])
    assert profile.extremes(5.0, 15.0) == (1480.0, 1500.0)         # a node within, the speeds at both ends
    assert profile.extremes(12.0, 14.0) == (1488.0, 1496.0)
    assert profile.extremes(-50.0, 100.0) == (1480.0, 1520.0)
