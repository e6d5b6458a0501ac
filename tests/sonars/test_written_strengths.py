"""Soundings of a multibeam that writes strengths in its own way: the bed's strengths stay, and beside them stands what
goes into its file.

Over a level bed of Lambert's law, a written curve without Lambert's law is flat by angle. Strengths are means of
speckle with 2 dB of chance each; sectors of 20 degrees have a hundred: 0.2 dB, and 0.8 dB are allowed.
"""
import functools

import numpy as np
import pytest
from sonar_scenes import bed, multibeam

import mitsonar

H, SONAR = 30.0, 2.0
SENSOR = {"preset": "shallow_300khz_three_sectors", "pulse_ms": "0.2, 0.15, 0.2", "beams": 96, "swath_deg": 110.0,
          "receive_beam_width_deg": 2.0, "transmit_beam_width_deg": 2.0, "noise": True, "motion": "none",
          "speed_knots": 6.0, "pings": 4, "ping_rate_hz": 4.0}
GAINS = {"written_gain_pings": "1, 3", "written_gain_db": "3, -1.5"}
EXACT = {"rtol": 0, "atol": 2e-5}          # of numbers of 32 bits
PATTERN = "sector, angle, level\n0, -60, -1\n0, -36, 2\n1, 0, 0.5\n2, 36, -1\n"
WRONG = "sector, angle, level\n0, -36, 0.5\n"


@functools.cache
def sounded(tilt=0.0, **more):
    scene = multibeam({"seabed": bed(SONAR + H, {"type": "lambert", "mu_db": -20.0}, tilt=tilt)}, depth=SONAR,
                      sensor={**SENSOR, **more}, film={"range": 70.0})
    return mitsonar.soundings(scene, snippets=8)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("patterns")
    for name, text in (("real.csv", PATTERN), ("wrong.csv", WRONG)):
        (folder / name).write_text(text)
    return {"written_pattern": str(folder / "real.csv"), "written_pattern_correction": str(folder / "wrong.csv")}


@pytest.fixture
def written(files):
    """A line with a pattern that the instrument corrects wrongly, its own absorption and level, and gain steps."""
    return sounded(**GAINS, **files, written_beam_law="lambert",
                   written_image_law="both", written_absorption_db=0.09,
                   written_source_level_error_db="0.5, 0, -1")


def test_without_its_attributes_nothing_is_written_apart():
    assert not any(str(name).startswith("written") for name in sounded().variables)


def test_the_beds_strengths_stay(written):
    for name in sounded().variables:
        np.testing.assert_array_equal(written[name].values, sounded()[name].values)


def test_lamberts_law_is_removed_from_what_is_written(written):
    valid, incidence = written["valid"].values, np.pi / 2 - written["grazing"].values
    law = written["written_backscatter_db"].values - written["written_error_db"].values
    cosine = 20 * np.log10(np.cos(incidence))
    np.testing.assert_allclose((law - written["backscatter_db"].values)[valid], -cosine[valid], **EXACT)
    part = np.rad2deg(incidence) // 20
    means = [10 * np.log10(np.mean(10 ** (0.1 * law[valid & (part == one)]))) for one in (0, 1, 2)]
    np.testing.assert_allclose(means, -20.0, rtol=0, atol=0.8)
    far = valid & (incidence > written["crossover_angle"].values[:, None])
    added = np.nanmean((written["written_snippet_db"] - written["snippet_db"]).values, -1)
    np.testing.assert_allclose((added - written["written_error_db"].values)[far], -cosine[far], **EXACT)


def test_errors_are_those_of_the_sonar_equation_and_steps_are_told(written):
    """2 (α' - α) R + G - (SL' - SL) + P - P': a step between sectors is the difference of their patterns.

    The record's absorption is the mean down to the lowest bed; to a sounding it differs by 1e-4 dB/m, 0.02 dB.
    """
    sector, valid, angle = (written[name].values for name in ("sector", "valid", "angle"))
    assert written["written_gain_db"].values.tolist() == [0, 3, 3, -1.5]
    true = np.take_along_axis(written["sector_absorption_db"].values, sector, 1)
    path = (written["depth"] - SONAR).values / np.sin(written["grazing"].values)
    pattern = np.where(sector == 0, np.interp(np.rad2deg(angle), [-60, -36], [-1, 2]) - 0.5,
                       np.array([0.0, 0.5, -1.0])[sector])
    wanted = written["written_gain_db"].values[:, None] - np.array([0.5, 0.0, -1.0])[sector] + pattern + 2 * (
        0.09 - true) * path
    np.testing.assert_allclose(written["written_error_db"].values[valid], wanted[valid], rtol=0, atol=0.02)


def test_a_level_bed_is_assumed_on_a_slope():
    """On a slope δ down to starboard the pulse-limited area goes as 1 / sin(θ + δ) to starboard and 1 / sin(θ - δ) to
    port; assumed is 1 / sin θ. The slope found from neighbouring beams and the beam's own limit are a quarter decibel.
    """
    slope = np.deg2rad(8.0)
    line = sounded(slope, written_level_bed=True, beams=48, pings=1)
    angle, error = line["angle"].values, line["written_error_db"].values
    for side in (-1, 1):
        some = line["valid"].values & (np.rad2deg(angle) * side > 35) & (np.rad2deg(angle) * side < 50)
        theory = 10 * np.log10(np.sin(np.abs(angle)) / np.sin(np.abs(angle + slope)))
        wanted, found = np.median(theory[some]), np.median(error[some])
        assert abs(wanted) > 0.5 and found == pytest.approx(wanted, abs=0.25), side


def test_a_short_window_leaves_the_speckle_and_the_mean_strength():
    """One sample of an echo has an exponential intensity, whose decibels spread by 10 π / (√6 ln 10) = 5.57 (Lurton
    2010): of some 170 beams beyond 20 degrees that is known to 8 %, and their mean intensity to 0.4 dB.
    """
    line = sounded(written_window_ms=0.02)
    valid, law = line["valid"].values, line["true_backscatter_db"].values
    outer = valid & (np.pi / 2 - line["grazing"].values > np.deg2rad(20))
    off = (line["written_backscatter_db"].values - law)[outer]
    assert np.std(off) == pytest.approx(10 * np.pi / (np.sqrt(6) * np.log(10)), rel=0.25)
    assert 10 * np.log10(np.mean(10 ** (0.1 * off))) == pytest.approx(0.0, abs=1.2)
    assert np.std((line["backscatter_db"].values - law)[outer]) < 3.5
    assert np.nanmax(np.abs(line["written_snippet_db"] - line["snippet_db"])) < 2e-5


@pytest.mark.parametrize("more, words", [
    ({"written_gain_pings": "2, 1", "written_gain_db": "1, 2"}, "rise from 0"),
    ({"written_source_level_error_db": "1, 2"}, "each of the 3 sectors"),
    ({"written_absorption_db": "-1"}, "numbers from 0 to 10"),
    ({"written_beam_law": "cosine"}, "both")])
def test_what_does_not_fit_is_refused(more, words):
    with pytest.raises(Exception, match=words):
        multibeam({"seabed": bed(SONAR + H)}, sensor={**SENSOR, **more})
