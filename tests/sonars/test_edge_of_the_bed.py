"""Beams that look past the bed's edge have no sounding: what side lobes bring them is not flagged valid.

A bed 70 m wide, 25 m below: its edges are at 54.5 degrees. Beams of 60 to 68 degrees receive the bed by side lobes
alone, some 30 dB below what other beams receive at that time. Before, 97 % and more of them were valid, metres off and
with an uncertainty of centimetres.
"""
import functools

import numpy as np
from sonar_scenes import bed, multibeam, sediment

import mitsonar

SONAR, H, EDGE = 2.0, 25.0, np.arctan(35.0 / 25.0)


@functools.cache
def line():
    return mitsonar.soundings(multibeam(
        {"seabed": bed(SONAR + H, sediment("medium sand"), size=70.0)}, depth=SONAR, film={"range": 70.0},
        sensor={"preset": "shallow_300khz_three_sectors", "noise": True, "pings": 3, "ping_rate_hz": 4.0, "beams": 96,
                "speed_knots": 5.0, "swath_deg": 136.0, "receive_beam_width_deg": 1.5,
                "transmit_beam_width_deg": 1.5}), seed=1)


def test_beams_beyond_the_edge_are_not_valid():
    """More than a beam and a half beyond."""
    off = np.abs(line()["angle"].values) > EDGE + np.deg2rad(2.2)
    assert off.sum() > 60
    assert line()["valid"].values[off].mean() < 0.03


def test_beams_on_the_bed_stay_valid_and_right_up_to_its_edge():
    """They took their slope from beams beyond the edge before, and were 0.1 to 0.4 m off, with 0.06 stated."""
    on = np.abs(line()["angle"].values) < EDGE - np.deg2rad(0.75)
    valid, error = line()["valid"].values, line()["error"].values
    assert valid[on].mean() > 0.97
    assert np.abs(error[on & valid]).max() < 0.02 * H
    last = on & valid & (np.abs(line()["angle"].values) > EDGE - np.deg2rad(6.0))
    assert np.sqrt(np.mean((error[last] / line()["uncertainty"].values[last]) ** 2)) < 1.8


def test_what_is_valid_on_the_skirt_of_a_beam_says_how_little_it_knows():
    """Off the plane of the bed by some of the stated uncertainty: half a metre and more it was, with 0.07 stated."""
    angle = np.abs(line()["angle"].values)
    skirt = line()["valid"].values & (angle > EDGE - np.deg2rad(0.75))
    off = np.abs(line()["depth"].values - (SONAR + H))[skirt]
    assert (off < np.maximum(5 * line()["uncertainty"].values[skirt], 0.004 * H)).all()
