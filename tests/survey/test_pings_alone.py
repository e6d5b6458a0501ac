"""What one ping of a moving array hears is the same, to the last bit, whichever other pings are asked for."""
import numpy as np

import mitsonar
from mitsonar.validation.scenes import array_sonar, bed


def test_a_ping_is_the_same_alone_and_among_others(variant):
    face = {"normal": "0, 1, 0.5", "element_length": 0.04, "element_height": 0.01, "baffle": "hard"}
    scene = array_sonar({"bed": bed(14.0, size=60.0)}, film={"range": 8.0}, integrator={"cell": 0.2}, sensor={
        **{f"{array}_{name}": value for array in ("transmit", "receive") for name, value in face.items()},
        "receive": "line", "receive_elements": 20, "pings": 4, "speed_knots": 4.0, "pulse": "lfm", "pulse_ms": 1.0,
        "bandwidth_khz": 20.0})
    alone = mitsonar.element_signals(scene, [2]).values[0]
    assert np.abs(alone).max() > 0
    np.testing.assert_array_equal(mitsonar.element_signals(scene, [3, 0, 2]).values[2], alone)
