"""Levels and depths of a level bed do not depend on how far apart the transmitting and receiving arrays stand.

Lambert bed 5 m below the head, uniform water. With both arrays at one place each sounding's strength is that of the bed,
-20 dB at normal incidence. An offset of 0.3 m turns the directions from either array by up to 3.4 degrees: beams of half
a degree miss each other's place, but their footprint is the transmit beam's all the same. The instrument's formula takes
one incidence angle for both, which is worth 0.3 dB at 0.3 m of height.

Strengths of 90 soundings scatter by 0.3 dB (mean of intensities, footprints half overlapping), so that a difference of
two is known to 0.45 dB: 1.2 dB are allowed. Before, 0.23 m ahead took 9 to 14 dB away.
"""
import functools

import numpy as np
import pytest

import mitsonar
from mitsonar.validation.scenes import bed, interferometric, lambert, multibeam

SONAR, H, MU_DB = 1.0, 5.0, -20.0
PLACES = ["0.23, 0, 0", "-0.23, 0, 0", "1, 0, 0", "0, 0.3, 0", "0, -0.3, 0", "0, 0, 0.3", "0, 0, -0.3",
          "0.2, -0.2, 0.2"]


@functools.cache
def soundings(place, pulse_ms, which="receive_place"):
    """Mean strength at normal incidence [dB] and rms error of depth [m]."""
    scene = multibeam({"seabed": bed(SONAR + H, lambert(MU_DB), size=40.0)}, depth=SONAR, film={"range": 12.0},
                      sensor={"preset": "narrow_600khz", "swath_deg": 80.0, "beams": 60, "noise": False, "pings": 3,
                              "speed_knots": 4.0, "ping_rate_hz": 5.0, "pulse_ms": ", ".join(3 * [str(pulse_ms)]),
                              which: place})
    line = mitsonar.soundings(scene)
    valid = line["valid"].values
    assert valid.mean() > 0.97
    there = valid & (np.abs(line["angle"].values) > np.deg2rad(10))       # the nadir echo is of its own statistics
    lambert_law = np.cos(line["angle"].values[there]) ** 2
    level = np.mean(10 ** (line["backscatter_db"].values[there] / 10) / lambert_law)
    return 10 * np.log10(level), np.sqrt(np.mean(line["error"].values[valid] ** 2))


@pytest.mark.parametrize("pulse_ms", [0.05, 0.22])
@pytest.mark.parametrize("place", PLACES)
def test_soundings_do_not_depend_on_where_the_receiver_stands(place, pulse_ms):
    level, rms = soundings(place, pulse_ms)
    level_of_one_place, rms_of_one_place = soundings("0, 0, 0", pulse_ms)
    assert level == pytest.approx(level_of_one_place, abs=1.2)
    assert rms < 1.5 * rms_of_one_place


def test_soundings_do_not_depend_on_where_the_transmitter_stands():
    level, rms = soundings("-0.3, 0.1, 0.1", 0.22, which="transmit_place")
    assert level == pytest.approx(soundings("0, 0, 0", 0.22)[0], abs=1.2)
    assert rms < 1.5 * soundings("0, 0, 0", 0.22)[1]


def test_arrays_at_one_place_give_the_strength_of_the_bed():
    assert soundings("0, 0, 0", 0.05)[0] == pytest.approx(MU_DB, abs=0.6)
