"""Strengths as instruments write them, against closed forms and against an instrument that writes both curves.

Lambert's bed, S = S_0 + 20 log cos θ, is flat after the correction: exactly. A model bed (1) is flat after "both":
exactly, too. The sums of errors are those of the sonar equation, term by term.
"""
import struct
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from soundings_line import blocks_of, soundings_line

import mitsonar
from mitsonar.hydrography.detection.written_strength import (
    ANGLE_LAWS,
    BeamPattern,
    StrengthWriting,
    angle_correction_db,
    found_response,
)
from mitsonar.hydrography.record import variable
from mitsonar.io import survey_lines
from mitsonar.io.scene_files import beam_pattern

ANGLE = np.deg2rad(np.linspace(-70, 70, 141))
LAMBERT = -22.0 + 20 * np.log10(np.cos(ANGLE))
CROSSOVER = np.deg2rad(25.0)
RESPONSE = {"normal_db": -10.0, "oblique_db": -22.0, "crossover": CROSSOVER}
MODEL = np.where(np.abs(ANGLE) < CROSSOVER, -10.0 + (12 * -1 + 20 * np.log10(np.cos(CROSSOVER)))
                 * np.abs(ANGLE) / CROSSOVER, LAMBERT)
MEASURED = Path(__file__).resolve().parents[3] / "shared" / "data" / "measured" / "multibeam"
EXACT = {"rtol": 0, "atol": 1e-9}


def test_lamberts_bed_is_flat_after_the_correction():
    np.testing.assert_allclose(LAMBERT + angle_correction_db(ANGLE, "lambert", **RESPONSE), -22.0, **EXACT)


def test_a_bed_that_rises_about_normal_incidence_is_flat_after_both():
    assert found_response(MODEL, ANGLE, CROSSOVER) == pytest.approx((-10.0, -22.0), abs=1e-9)
    np.testing.assert_allclose(MODEL + angle_correction_db(ANGLE, "both", **RESPONSE), -22.0, **EXACT)


def test_the_normal_law_leaves_what_lies_beyond_the_crossover():
    written = MODEL + angle_correction_db(ANGLE, "normal", **RESPONSE)
    beyond = np.abs(ANGLE) >= CROSSOVER
    np.testing.assert_allclose(written[beyond], MODEL[beyond], **EXACT)
    assert written[70] == pytest.approx(-22.0, abs=1e-9) and not angle_correction_db(ANGLE, "none", **RESPONSE).any()


def test_an_unknown_law_names_the_known_ones():
    with pytest.raises(ValueError, match=", ".join(ANGLE_LAWS)):
        angle_correction_db(ANGLE, "cosine", **RESPONSE)


def test_no_strength_has_no_response():
    assert np.isnan(found_response(np.full(3, np.nan), np.zeros(3), CROSSOVER)).all()
    assert found_response(np.array([-30.0]), np.array([0.0]), CROSSOVER) == pytest.approx((-30.0, -30.0))


def test_errors_are_those_of_the_sonar_equation():
    """2 (α' - α) R - (SL' - SL) + 10 log A/A' + P - P' + G, term by term."""
    step = BeamPattern(sector=np.array([0, 1, 1]), angle=np.deg2rad([0.0, 40.0, 20.0]), level_db=np.array([1.5, 2, -4]))
    writing = StrengthWriting(absorption_db=(0.1,), source_level_error_db=(0.5, -0.25), level_bed=True, pattern=step,
                              gain_steps=((2, 3.0), (5, -1.0)))
    arguments = {"angle": np.deg2rad([-10.0, 30.0]), "distance": np.array([10.0, 40.0]),
                 "absorption_db": np.array([0.07, 0.08]), "area_error_db": np.array([0.0, 0.7])}
    assert [writing.gain_db(ping) for ping in (0, 2, 4, 5, 9)] == [0, 3, 3, -1, -1]
    np.testing.assert_allclose(writing.errors_db(3, 1, **arguments), [
        2 * 0.03 * 10 + 0.25 + 0 - 4 + 3, 2 * 0.02 * 40 + 0.25 + 0.7 - 1 + 3], **EXACT)
    corrected = StrengthWriting(pattern=step, pattern_correction=step)
    assert not corrected.errors_db(0, 1, **arguments).any()


def test_a_pattern_is_read_from_its_table(tmp_path):
    file = tmp_path / "pattern.csv"
    file.write_text("sector, angle, level\n1, 40, 2\n0, 0, 1.5\n1, 20, -4\n")
    found = beam_pattern.read(file).at(np.array([0, 1, 1, 2]), np.deg2rad([70.0, 30.0, -5.0, 0.0]))
    np.testing.assert_allclose(found, [1.5, -1.0, -4.0, 0.0], **EXACT)


@pytest.mark.parametrize("text, words", [
    ("sector, angle\n0, 1\n", "3 columns|2 columns"), ("sector, angle, level\n0.5, 1, 1\n", "line 2.*whole sectors"),
    ("sector, angle, level\n0, 1, 200\n", "line 2.*levels within")])
def test_a_bad_pattern_names_its_line(tmp_path, text, words):
    file = tmp_path / "pattern.csv"
    file.write_text(text)
    with pytest.raises(ValueError, match=words):
        beam_pattern.read(file)


@pytest.mark.parametrize("suffix, reads", [(".kmall", "reflectivity"), (".gsf", "amplitude"), (".nc", "both")])
def test_files_of_instruments_hold_the_written_strengths(tmp_path, suffix, reads):
    """A .nc has both curves; in others ``backscatter_db`` is what was written, within the format's steps."""
    line = soundings_line(pings=2)
    written = line["backscatter_db"].values + 5.0
    line = line.assign({"written_backscatter_db": variable("written_backscatter_db", written),
                        "normal_incidence_db": variable("normal_incidence_db", np.array([-12.5, -13.5])),
                        "oblique_incidence_db": variable("oblique_incidence_db", np.array([-25.0, -26.0]))})
    recorded = line["column_level_db"].values + 3.0
    line = line.assign(column_recorded_db=variable("column_recorded_db", recorded))
    path = tmp_path / f"line{suffix}"
    words = mitsonar.write(line, path) if suffix == ".nc" else survey_lines.write(blocks_of(line), path).words
    back, valid = mitsonar.read(path), line["valid"].values
    if reads == "both":
        xr.testing.assert_identical(back["backscatter_db"], line["backscatter_db"])
        np.testing.assert_array_equal(back["written_backscatter_db"], line["written_backscatter_db"])
        return
    if suffix == ".kmall":
        survey_lines.write(blocks_of(line.drop_vars("column_recorded_db")), path)
        added = (back["column_level_db"] - mitsonar.read(path)["column_level_db"]).values
        assert np.nanmedian(added) == pytest.approx(3.0, abs=0.26)
    found = back["backscatter_db"].values[back["valid"].values]
    np.testing.assert_allclose(np.sort(found), np.sort(written[valid]), atol=0.006)
    assert any("instrument writes" in text for text in words)
    assert not any("normal_incidence_db" in text for text in words)


def _images(path):
    """Yield BSn, BSo [dB], the crossover [rad] and, of every beam, incidence [rad], strength and image [dB]."""
    content, at, beams = path.read_bytes(), 0, {}
    while at + 18 < len(content):
        length, kind, ping = struct.unpack_from("<I", content, at)[0], content[at + 5], content[at + 16:at + 20]
        if kind == 88:
            table = np.frombuffer(content, [("xyz", "<f4", 3), ("skip", "u1", 6), ("strength", "<i2")],
                                  struct.unpack_from("<H", content, at + 28)[0], at + 40)
            beams[ping] = np.arctan2(table["xyz"][:, 1], table["xyz"][:, 0]), 0.1 * table["strength"]
        elif kind == 89 and ping in beams:
            normal, oblique, _, crossover, count = struct.unpack_from("<hhHHH", content, at + 26)
            table = np.frombuffer(content, [("skip", "u1", 2), ("samples", "<u2"), ("centre", "<u2")], count, at + 36)
            samples = 0.1 * np.frombuffer(content, "<i2", int(table["samples"].sum()), at + 36 + table.nbytes)
            count, own = table["samples"].astype(int), np.maximum(table["centre"], 1).astype(int) - 1
            centre = np.cumsum(count) - count + own
            near = 10 * np.log10(np.mean([10 ** (0.1 * samples[np.clip(centre + k, 0, samples.size - 1)])
                                          for k in range(-2, 3)], axis=0))
            yield 0.1 * normal, 0.1 * oblique, np.deg2rad(0.1 * crossover), *beams[ping], near
        at += 4 + length


@pytest.mark.skipif(not (MEASURED / "em710_122m.all").exists(), reason="the recorded line is not here")
def test_an_instruments_image_is_its_beams_strength_after_the_correction():
    """An EM 710 writes beams without a correction of the angle and an image with "both": their difference by angle is
    C of its own BSn, BSo and crossover within 1 dB, where C itself goes from -10 to 8 dB. BSo found from the beams is
    the file's within 1 dB, and BSn within 4 dB: the instrument's own wander by 3 dB from ping to ping.
    """
    rows = list(_images(MEASURED / "em710_122m.all"))
    assert len(rows) == 10
    error, angle = [], []
    for normal, oblique, crossover, incidence, strength, image in rows:
        wanted = angle_correction_db(incidence, "both", normal_db=normal, oblique_db=oblique, crossover=crossover)
        error.append(image - strength - wanted)
        angle.append(np.abs(np.rad2deg(incidence)))
        found = found_response(strength, incidence, crossover)
        assert found[0] == pytest.approx(normal, abs=4.0) and found[1] == pytest.approx(oblique, abs=1.0)
    error, angle = np.concatenate(error), np.concatenate(angle)
    for low in range(0, 64, 4):
        assert abs(np.median(error[(angle >= low) & (angle < low + 4)])) < 1.0, low
