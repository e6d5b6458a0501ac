"""Water columns of a multibeam's soundings as the recorder writes them, and the ring of side lobes."""
import functools

import numpy as np
import pytest
from sonar_scenes import bed, multibeam, point_target

import mitsonar
from mitsonar.sonar.arrays.channels import diffuse_level

H, SONAR = 30.0, 2.0
SENSOR = {"preset": "shallow_400khz", "beams": 64, "swath_deg": 120.0, "receive_beam_width_deg": 2.0,
          "transmit_beam_width_deg": 2.0, "noise": False, "pings": 2, "ping_rate_hz": 4.0, "motion": "none"}
BLEED = {"recorder": "water_column_8bit", "recorder_line_db": -40, "recorder_line_ms": 1.0, "recorder_ringing_ms": 6.0,
         "recorder_noise_db": -200, "recorder_crosstalk_db": -200, "recorder_row_gain_db": 0, "recorder_tvg": 0,
         "recorder_full_scale_db": 180.0}


@functools.cache
def sounded(**more):
    scene = multibeam({"seabed": bed(SONAR + H, {"type": "lambert", "mu_db": -20.0})}, depth=SONAR,
                      sensor={**SENSOR, **more}, film={"range": 75.0})
    return mitsonar.soundings(scene, column=True)


def test_a_recorded_column_stands_beside_the_levels():
    plain, line = sounded(**BLEED), sounded(**BLEED, recorded_column=True)
    assert "column_recorded_db" not in plain
    for name in plain.variables:
        np.testing.assert_array_equal(line[name].values, plain[name].values)
    assert line["column_recorded_db"].dims == line["column_level_db"].dims


def test_transmit_bleed_rings_down_and_echoes_keep_their_levels():
    """-40 dB of full scale for 1 ms, then 60 dB in 6 ms; levels are steps of half a decibel."""
    line = sounded(**BLEED, recorded_column=True)
    written, level = (line[name].values[0].astype(float) for name in ("column_recorded_db", "column_level_db"))
    time = line["column_start"].values[0, 0] + np.arange(level.shape[1]) / line["column_rate"].values[0, 0]
    np.testing.assert_allclose(written[:, time < 0.95e-3], 140.0, atol=0.51)
    after = (time > 1.1e-3) & (time < 4e-3)
    np.testing.assert_allclose(written[:, after], np.broadcast_to(140 - 10 * (time[after] - 1e-3) / 1e-3,
                                                                  written[:, after].shape), atol=0.51)
    bed_echo = (time > 2 * H / 1500) & (level > 80)
    np.testing.assert_allclose(written[bed_echo], level[bed_echo], atol=0.3)


def test_a_recorded_column_needs_a_recorder():
    with pytest.raises(Exception, match="no recorder"):
        multibeam({"seabed": bed(SONAR + H)}, sensor={**SENSOR, "recorder": "none", "recorded_column": True})


def test_receivers_flaws_set_the_floor_of_the_ring():
    """The mean power of beams far from a point, over that of the beam on it, is 2σ²/N of the receiving line (Steinberg
    1976): some 60 independent beams, 0.6 dB, and 1.5 dB are allowed as for other fans.
    """
    def beams(flaws):
        scene = multibeam({"seabed": bed(200.0), "point": point_target([0.0, 0.0, -22.0])}, depth=SONAR,
                          sensor={**SENSOR, "beams": 128, "pings": 1, "receive_flaws": flaws}, film={"range": 30.0})
        level = mitsonar.render(scene, 1)["level"].values[0].astype(float)
        beam, sample = np.unravel_index(level.argmax(), level.shape)
        far = np.abs(np.arange(128) - beam) > 20
        return 10 * np.log10(np.mean(10 ** (0.1 * (level[far, sample] - level.max())))), scene.sensors()[0].receive

    floor, receive = beams(0.3)
    assert floor == pytest.approx(10 * np.log10(diffuse_level(receive.weight, 0.3)), abs=1.5)
    assert beams(0.0)[0] < floor - 6
