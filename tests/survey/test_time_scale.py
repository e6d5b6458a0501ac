"""Time scale of echoes under way against kinematics: x(t) = v t, uniform water, receptions by fixed point.

Factor and time of the middle of a pulse are first order in v T / r beyond the plane wave. Here v T / r is 6e-3, so that
the next order is about 2 (v / c) (v T / r)² / 4 = 3e-8 in the factor and T / 2 times as much in time, 0.3 ns.
"""
import mitsuba as mi
import numpy as np
import pytest

from mitsonar.survey.pressure.doppler import time_scale
from mitsonar.survey.pressure.pressure import PressureRecord
from mitsonar.validation.scenes import array_sonar, bed

C, PULSE = 1500.0, 0.02


@pytest.mark.parametrize("later", [0.0, 0.5 * PULSE], ids=["from the beginning", "from the middle"])
@pytest.mark.parametrize("element", [0, -1])
def test_factor_and_time_of_the_middle(variant, later, element):
    """Whichever moment the way back is known at, for elements at both ends of the line."""
    scene = array_sonar({"bed": bed(16.0, size=60.0)}, film={"range": 14.0, "range_min": 8.0}, integrator={"cell": 0.4},
                        water={"sound_speed": C},
                        sensor={"speed_knots": 6.0, "pulse": "cw", "pulse_ms": 1e3 * PULSE, "frequency_khz": 200.0})
    survey = scene.integrator().array_survey(scene, scene.sensors()[0])
    ping = PressureRecord(survey).at(0).ensonified
    source, echoes = ping.source(0), next(iter(ping.echoes(0)))
    place = survey.receive.position[element]
    factor, when = time_scale(source, echoes, source.way_back(echoes, later=later), sender=survey.transmit.position[0],
                              receiver=place, moment=0.5 * PULSE)
    point = np.stack([part.numpy() for part in echoes.out.offset], 1) + source.rotation @ source.position
    sender, arm = (source.rotation @ position for position in (survey.transmit.position[0], place))
    velocity = survey.velocity[0]

    def received(sent):
        """When what is sent at a time arrives (R,) [s]."""
        met = sent + np.linalg.norm(point - sender - velocity * sent, axis=1) / C
        time = met
        for _ in range(20):
            time = met + np.linalg.norm(point - arm - velocity * time[:, None], axis=1) / C
        return time

    step = 1e-4
    exact = 2 * step / (received(0.5 * PULSE + step) - received(0.5 * PULSE - step))
    assert echoes.count > 100 and np.ptp(exact) > 4e-3
    assert np.abs(factor.numpy() - exact).max() < 6e-8
    assert np.abs(mi.Float64(when).numpy() - (received(0.5 * PULSE) - received(0.0))).max() < 6e-10
