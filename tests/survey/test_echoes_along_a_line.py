"""Delays and gains along a line of elements by polynomials against those of every pair, through the whole chain.

Known bias: 1e-11 s are 3e-6 cycles of 300 kHz, -94 dB; float32 leaves as much. The pattern's bound is 7e-6, -103 dB.
"""
import numpy as np
import pytest

from mitsonar.survey.pressure import pairs
from mitsonar.survey.pressure.pressure import PressureRecord
from mitsonar.validation.scenes import array_sonar

SUMMER_TEXT = "0:1508, 8:1507, 14:1494, 40:1490"
FACES = {
    "all directions": {},
    "a baffle": {"receive_baffle": "hard"},
    "faces in a baffle": {"receive_pattern": "rectangular", "receive_element_length": 0.004,
                          "receive_element_height": 0.008, "receive_baffle": "hard"},
    "long faces": {"receive_pattern": "rectangular", "receive_element_length": 0.05, "receive_element_height": 0.008,
                   "receive_baffle": "hard", "receive_pitch": 0.02},
    "heaving and pitched": {"receive_baffle": "hard", "motion": "auv", "pitch_deg": 2.0},
    "a plane of rows": {"receive": "planar", "receive_rows": 3, "receive_baffle": "hard", "motion": "auv"},
    "cardioid discs": {"receive_pattern": "circular", "receive_element_length": 0.004, "receive_baffle": "cardioid"},
}


@pytest.mark.parametrize("face", FACES)
def test_polynomials_are_as_good_as_every_pair(variant, monkeypatch, face):
    bed = {"type": "seabed", "depth": 15.0, "length": 40.0, "width": 40.0, "spacing": 0.5, "fractal_rms": 0.05,
           "bsdf": {"type": "lambert"}}
    scene = array_sonar({"bed": bed}, film={"range": 15.0}, integrator={"cell": 0.25}, water={"profile": SUMMER_TEXT},
                        sensor={"frequency_khz": 300.0, "receive": "line", "receive_elements": 24, "speed_knots": 3.0,
                                "receive_normal": "1, 0, 0.2", **FACES[face]})
    survey = scene.integrator().array_survey(scene, scene.sensors()[0])
    along, heard = [], []
    line = pairs.ReceivedEchoes._along
    monkeypatch.setattr(pairs.ReceivedEchoes, "_along", lambda *given: (along.append(1), line(*given))[1])
    for fewest in (16, 25):
        monkeypatch.setattr(pairs, "FEWEST_ON_A_LINE", fewest)
        heard.append(PressureRecord(survey).at(0).responses())
        assert bool(along) == (fewest == 16)
        along.clear()
    assert 20 * np.log10(np.linalg.norm(heard[0] - heard[1]) / np.linalg.norm(heard[1])) < -85
