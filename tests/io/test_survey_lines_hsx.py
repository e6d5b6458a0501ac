"""HSX files of HYPACK over a level bed: fans, roll angles and directions, units, time that passes midnight.

Water of one speed, a level bed and one point that sends and receives: depth = 40 m, across = 0.5 m + 38 m tan(angle).
Numbers of the file have four decimals, so that places agree to a few millimetres at 60 degrees.
"""
import numpy as np
import pytest

import mitsonar
from mitsonar.io.survey_lines import reading
from tests.inputs.hsx_file import BEAMS, FIRST, SPEED, STEP, hsx_file

ANGLE = np.radians(np.linspace(-60, 60, BEAMS))


def line_of(tmp_path, content):
    """Return the line of a file's bytes."""
    (tmp_path / "a.hsx").write_bytes(content)
    return mitsonar.read(tmp_path / "a.hsx")


@pytest.mark.parametrize("options", [{}, {"unit": 2}, {"shape": "3"}, {"roll": 3.0}, {"roll": 3.0, "flags": 1},
                                     {"shape": "3", "flags": 3, "roll": -2.0}, {"seconds": 86_399.9}])
def test_soundings_of_a_level_bed_lie_on_it(tmp_path, options):
    """Roll angles are relative to the array, or stabilised (flag 1): the bed is level either way.

    A ship that rolls by 3 degrees carries an array that is 2 m down and 0.5 m to starboard 26 mm deeper.
    """
    line = line_of(tmp_path, hsx_file(**options))
    valid = line["valid"].values
    turned = np.radians(options.get("roll", 0.0))
    deeper, aside = (0.5 * np.sin(turned) + 2 * np.cos(turned) - 2, 0.5 * np.cos(turned) - 2 * np.sin(turned))
    assert np.array_equal(valid, np.tile(np.arange(BEAMS) != 2, (3, 1))) and line.sizes["ping"] == 3
    seen = np.broadcast_to(aside + 38 * np.tan(ANGLE), valid.shape)
    assert np.allclose(line["depth"].values[valid], 40.0 + deeper, atol=0.01)
    assert np.allclose(line["across_track"].values[valid], seen[valid], atol=0.02)
    assert np.allclose(line["along_track"].values[valid], 5.0, atol=0.01)
    assert np.allclose(np.diff(line["ping_time"]), 0.5) and np.allclose(np.diff(line["ping_y"]), 1.0, atol=1e-3)
    assert options.get("roll") or np.allclose(line["ping_x"], -1.0, atol=0.01)
    assert np.allclose(line["head_sound_speed"], SPEED)
    assert "places by mitsonar" in line.attrs["reduction"]
    assert "easting 500001 m, northing" in line.attrs["left_out"] and "HVF are not read" in line.attrs["left_out"]


def test_a_fixed_fan_has_the_headers_angles(tmp_path):
    line = line_of(tmp_path, hsx_file(shape="1"))
    valid = line["valid"][0].values
    assert np.allclose(np.degrees(line["angle"][0])[valid], -(FIRST + STEP * np.arange(BEAMS))[valid])


def test_settings_steering_and_heave(tmp_path):
    line = line_of(tmp_path, hsx_file(steering=2.0, heave=0.4, system="<UTM32N>"))
    one = {name: float(line[f"sector_{name}"][0, 0]) for name in ("frequency", "pulse_length", "source_level_db")}
    assert one == pytest.approx({"frequency": 4e5, "pulse_length": 33e-6, "source_level_db": 220.0})
    assert np.allclose(np.degrees(line["transmit_angle"].values[line["valid"].values]), 2.0)
    assert np.allclose(line["motion_depth"], -0.4)
    assert line.attrs["crs"] == "EPSG:32632" and line.attrs["origin"] == (500_001.0, 5_900_001.0 - 0.0)
    assert line.attrs["sonar"] == "Reson Seabat 7125" and line.attrs["start"].startswith("2026-05-01T10:00:10")
    assert np.allclose(line["backscatter_db"].values[line["valid"].values], 40.0)


def test_two_heads_are_pings_of_their_own(tmp_path):
    content = hsx_file(flags=4).replace(f"881 {BEAMS} 0".encode(), f"881 {BEAMS // 2} {BEAMS // 2}".encode())
    content = content.replace(b"\r\nMBI", b"\r\nOF2 2 4 -0.5 5 2 0 0 0 0\r\nMBI")
    line = line_of(tmp_path, content)
    assert line.sizes["receive_head"] == 2 and np.array_equal(line["head"], [0, 1] * 3)
    assert np.allclose(line["head_receive_offset"], [[5, 0.5, 2], [5, -0.5, 2]])
    assert float(line["across_track"][0].max()) < 0.51 < float(line["across_track"][1].max())


@pytest.mark.parametrize("content, sentence", [
    (hsx_file(0), "it has no soundings of a multibeam sonar"),
    (hsx_file().replace(b"TND", b"TNX"), "it states no date"),
    (hsx_file().replace(b"05/01/2026", b"15/01/2026"), "has the date '15/01/2026'"),
    (hsx_file().replace(b"POS 1", b"PXS 1"), "it has no position"),
    (hsx_file().replace(b" 220 30 400", b" 220 thirty 400"), "where numbers belong"),
    (hsx_file().replace(f" {BEAMS} 1485".encode(), b" 12 1485"), "has 16 values of range for 12 beams"),
    (hsx_file().replace(f" {BEAMS} 1485".encode(), b" 9000 1485"), "has 9000 beams"),
    (hsx_file()[:-60], "has 14 values of intensity for 16 beams"),
    (hsx_file() + b"A" * (1 << 20), "more than 1048575 characters"),
])
def test_a_damaged_file_is_refused_in_a_sentence(tmp_path, content, sentence):
    (tmp_path / "a.hsx").write_bytes(content)
    with pytest.raises(ValueError, match=sentence) as caught:
        reading.read(tmp_path / "a.hsx")
    assert "\n" not in str(caught.value) and str(caught.value).startswith("cannot read")
