"""Closing speeds of what beams hear, against directions at random; and signals with the fewer Doppler classes."""
from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest

from mitsonar.device.arrays import upload
from mitsonar.echoes.scatterers.element_beams import ElementBeams
from mitsonar.survey.pressure import signals
from mitsonar.survey.pressure.pressure import PressureRecord
from mitsonar.survey.pressure.signals import closing_speeds
from mitsonar.validation.scenes import array_sonar, bed

SIDE = {f"{array}_{name}": value for array in ("transmit", "receive") for name, value in {
    "pattern": "rectangular", "element_length": 0.04, "element_height": 0.01, "normal": "0, 1, 0.5",
    "baffle": "hard"}.items()}
THIN = 1e-3


@pytest.fixture(scope="module")
def survey():
    scene = array_sonar({"bed": bed(16.0, size=60.0)}, film={"range": 17.0, "range_min": 14.0},
                        integrator={"cell": 0.08}, sensor={
                            **SIDE, "speed_knots": 8.0, "pulse": "lfm", "pulse_ms": 4.0, "bandwidth_khz": 20.0,
                            "frequency_khz": 200.0})
    return scene.integrator().array_survey(scene, scene.sensors()[0])


def test_without_thinning_echoes_may_come_from_anywhere(survey):
    assert closing_speeds(survey, 0, fastest=4.1, acceleration=0.0, nearest=14.0) == (-4.1, 4.1)


def test_all_that_the_beams_hear_lies_within(survey, rng):
    thinned = replace(survey, thin_below=THIN)
    speed = float(np.linalg.norm(survey.velocity[0]))
    low, high = closing_speeds(thinned, 0, fastest=speed, acceleration=0.0, nearest=14.0)
    direction = rng.normal(size=(200_000, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    beams = ElementBeams(survey.transmit, survey.receive, survey.wavelength)
    bound = beams.bound(mi.Vector3f(*(upload(mi.Float, column) for column in direction.T)), mi.Float(14.0),
                        survey.track.rotation()[0]).numpy()
    closing = (direction @ survey.velocity[0])[bound > THIN]
    assert low <= closing.min() and closing.max() <= high
    assert high - low < 0.6 * 2 * speed                  # the main lobe and the first side lobes, not the half circle


def test_fewer_classes_give_the_signals_of_all(survey, monkeypatch):
    """Echoes from beyond the beams have a sweep that is off at its ends, by up to 3 % of the pulse at this speed.

    Together they are some 20 dB weaker than the others, and their error about 15 dB weaker than they.
    """
    thinned = replace(survey, thin_below=THIN)
    few = signals.received_signals(PressureRecord(thinned), [0]).values
    monkeypatch.setattr(signals, "closing_speeds", lambda survey, ping, *, fastest, **_: (-fastest, fastest))
    every = signals.received_signals(PressureRecord(thinned), [0]).values
    assert 0 < np.linalg.norm(few - every) < 10 ** (-33 / 20) * np.linalg.norm(every)
