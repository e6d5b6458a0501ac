"""XTF files of multibeam sonars: R2Sonic and Reson inside, over a level bed, and a real line of an R2Sonic 2026.

Water of one speed, a level bed and one point that sends and receives: depth = 40 m, across = 1 m + 38 m tan(angle), as
the array is 1 m to starboard and 2 m deep. Numbers of the datagram are in steps of 4 µs and 0.1 mrad: at 60 degrees the
half steps are 0.0008 m · cos and 38 m · 0.05 mrad · (tan + tan³) = 14 mm of depth.
"""
from pathlib import Path

import numpy as np
import pytest

import mitsonar
from mitsonar.io.survey_lines import reading
from tests.inputs.s7k_file import BEAMS, SPEED
from tests.inputs.xtf_lines import xtf_file

ANGLE = np.radians(np.linspace(-60, 60, BEAMS))
REAL = Path(__file__).resolve().parents[2] / "../shared/data/tracks/r2sonic_20150708.xtf"


def line_of(tmp_path, content):
    """Return the line of a file's bytes."""
    (tmp_path / "a.xtf").write_bytes(content)
    return mitsonar.read(tmp_path / "a.xtf")


@pytest.mark.parametrize("options", [{}, {"even": True}, {"kind": "68"}, {"kind": "7027"}, {"kind": "7006"}])
def test_soundings_of_a_level_bed_lie_on_it(tmp_path, options):
    line = line_of(tmp_path, xtf_file(**options))
    assert line["valid"].values.sum() == 3 * BEAMS and line.sizes["ping"] == 3
    assert np.allclose(line["angle"], ANGLE, atol=6e-5) and np.allclose(line["depth"], 40.0, atol=0.02)
    assert np.allclose(line["across_track"][0], 1 + 38 * np.tan(ANGLE), atol=0.02)
    assert np.allclose(line["along_track"], 5.0, atol=0.02) and np.allclose(line["backscatter_db"], 60.0)
    assert np.allclose(line["head_sound_speed"], SPEED) and "places by mitsonar" in line.attrs["reduction"]
    assert line.attrs["start"].startswith("2026-05-01T10:00:10.5") and np.allclose(np.diff(line["ping_time"]), 0.5)
    reson = options.get("kind", "").startswith("7")
    assert float(line["sector_frequency"][0, 0]) == (2e5 if reson else 4e5)
    assert np.all(line["detection"] == (1 if options.get("kind") == "7027" else 2))
    assert line.attrs["sonar"] == ("SeaBat 7125" if reson else "R2Sonic 2026")
    assert not reading.line_casts(tmp_path / "a.xtf")


@pytest.mark.parametrize("flags, method", [(0x8, 2), (0x4, 1), (0x3, 0)])
def test_a_beam_without_a_detection_is_not_valid(tmp_path, flags, method):
    """Bits 8 and 4 of a beam's flags state a detection by phase and by magnitude."""
    line = line_of(tmp_path, xtf_file(flags=flags))
    assert np.all(line["detection"] == method) and np.all(line["valid"] == (method > 0))


def test_blocks_hold_what_the_line_holds(tmp_path):
    whole = line_of(tmp_path, xtf_file(5))
    parts = list(reading.blocks(tmp_path / "a.xtf", size=2))
    assert [one.sizes["ping"] for one in parts] == [2, 2, 1]
    assert np.array_equal(np.concatenate([one["depth"] for one in parts]), whole["depth"])


@pytest.mark.parametrize("content, sentence", [
    (xtf_file(1)[:-9], "cut off"), (xtf_file(0), "it has no soundings of a multibeam sonar"),
    (xtf_file(1, points=300), "section R0 of 36 bytes, too few for 300 points"),
    (xtf_file(1, points=9000), "its ping 100 has 9000 beams"),
    (xtf_file(1).replace(b"Q0", b"Q1"), "lacks flags of quality"),
    (xtf_file(1).replace(b"A2\0", b"A2\xff"), "has a section of"),
])
def test_a_damaged_file_is_refused_in_a_sentence(tmp_path, content, sentence):
    (tmp_path / "a.xtf").write_bytes(content)
    with pytest.raises(ValueError, match=sentence) as caught:
        reading.read(tmp_path / "a.xtf")
    assert "\n" not in str(caught.value) and str(caught.value).startswith("cannot read")


@pytest.mark.skipif(not REAL.is_file(), reason="the shared survey lines are not here")
def test_a_real_lines_bed_is_level_by_its_own_mountings():
    """A harbour's bed at 14 m: mountings of the header (1.8 degrees of roll) level it to a tenth of a degree.

    With the roll of the mounting left out the bed slopes by 1.7 degrees; with the roll of the ship turned round, beams
    scatter by 0.5 m and more instead of 0.17 m.
    """
    line = reading.read(REAL, pings=slice(0, 200))
    valid = line["valid"].values
    slope = np.polyfit(line["across_track"].values[valid], line["depth"].values[valid], 2)[1]
    assert valid.all() and abs(np.degrees(np.arctan(slope))) < 0.3
    assert np.nanstd(line["depth"].values, axis=0).max() < 0.25
    assert line.attrs["sonar"] == "R2Sonic 2026" and "left_out" not in line.attrs
