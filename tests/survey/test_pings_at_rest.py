"""Echoes of a ping that the next one takes over: only from the very same place, and then to the last bit."""
import numpy as np
import pytest

from mitsonar.echoes.ensonification import Ensonification
from mitsonar.survey.pressure.pressure import PressureRecord
from mitsonar.validation.scenes import array_sonar


@pytest.mark.parametrize("knots, made", [(0.0, 1), (2.0, 2)])
def test_a_platform_at_rest_ensonifies_its_scatterers_once(variant, monkeypatch, knots, made):
    bed = {"type": "seabed", "depth": 15.0, "length": 30.0, "width": 30.0, "spacing": 0.5, "fractal_rms": 0.05,
           "bsdf": {"type": "lambert"}}
    scene = array_sonar({"bed": bed}, film={"range": 12.0}, integrator={"cell": 0.25}, sensor={
        "pings": 2, "speed_knots": knots, "receive": "line", "receive_elements": 3, "receive_normal": "forward"})
    survey = scene.integrator().array_survey(scene, scene.sensors()[0])
    alone = PressureRecord(survey).at(1).responses()
    counted, scatterer_echoes = [], Ensonification.scatterer_echoes
    monkeypatch.setattr(Ensonification, "scatterer_echoes", lambda self, *given, **named: (
        counted.append(given), scatterer_echoes(self, *given, **named))[1])
    record = PressureRecord(survey)
    ping = record.at(0)
    first, second = ping.responses(), record.at(1, ping).responses()
    assert len(counted) == made
    assert np.array_equal(second, alone) and alone.any()
    assert np.array_equal(first, second) == (knots == 0)
