"""Kongsberg's .all and .wcd files as lines of soundings: units, signs and lever arms of a file made field by field."""
import numpy as np
import pytest
from pyproj import Transformer

import mitsonar
from mitsonar.hydrography.record import BY_AMPLITUDE, BY_PHASE, NOT_DETECTED, check, joined
from mitsonar.io.survey_lines import reading
from tests.inputs.all_file import BEAMS, SAMPLES, all_file, wcd_file


@pytest.fixture
def line(tmp_path):
    (tmp_path / "line.all").write_bytes(all_file())
    return tmp_path / "line.all"


def test_angles_are_positive_to_starboard_and_the_ship_is_where_its_antenna_says(line):
    soundings = mitsonar.read(line)
    check(soundings)
    assert soundings.attrs["start"] == "2026-05-01T10:00:00Z" and soundings.attrs["sonar"] == "EM 710"
    assert np.allclose(soundings["angle"][0, 2:], np.deg2rad(np.linspace(-40, 40, BEAMS)[2:]), atol=1e-4)
    assert soundings["across_track"][0, -1] > 0 > soundings["across_track"][0, 0]
    # Across and along track in the file are about the antenna, 2 m forward and 3 m to starboard of the reference point.
    assert soundings["along_track"][0, 0] == pytest.approx(3.5, abs=1e-6)
    assert soundings["across_track"][0, -1] == pytest.approx(60 * np.tan(np.deg2rad(40)) + 3, abs=1e-4)
    assert np.diff(soundings["ping_y"].values) == pytest.approx(2.0, abs=0.02)
    # The heading is from the grid's north, 1.2 degrees off the pole's here (54 north, 1.5 west of 9 east).
    assert np.rad2deg(soundings["ping_heading"][0]) == pytest.approx(1.5 * np.sin(np.deg2rad(54)), abs=0.01)
    antenna = soundings[["ping_x", "ping_y"]].isel(ping=0).to_array().values
    along = np.array([np.sin(soundings["ping_heading"][0]), np.cos(soundings["ping_heading"][0])])
    antenna = antenna + 2 * along + 3 * np.array([along[1], -along[0]])
    assert soundings.attrs["crs"] == "EPSG:32632"
    there = Transformer.from_crs("EPSG:4326", "EPSG:32632", always_xy=True).transform(7.5, 54.0)
    assert np.allclose(antenna + soundings.attrs["origin"], there, atol=0.01)


def test_depths_are_from_the_surface_and_the_reference_point_hangs_from_the_transmitter(line):
    soundings = mitsonar.read(line)
    assert np.allclose(soundings["depth"][0, 2:], 63.7)
    assert np.allclose(soundings["ping_depth"], 3.7 - 5.0)
    assert np.allclose(soundings["motion_depth"], 0.2 - 1.5)                  # heave positive down, waterline
    assert soundings["head_sound_speed"].values == pytest.approx(1505.0)
    assert np.allclose(soundings["cast_depth"], (0, 20, 200)) and soundings["cast_sound_speed"][1] == 1510.0


@pytest.mark.parametrize("rises", [True, False])
def test_the_motion_puts_the_array_where_the_soundings_were_made_from(tmp_path, rises):
    # 3 degrees of pitch and 10 m of lever: half a metre between the two kinds of file; angles are in steps of 0.01
    # degrees, 2 mm of the array's depth.
    def pitch(time):
        return 3 * np.sin(2 * np.pi * time / 5.3)

    (tmp_path / "line.all").write_bytes(all_file(8, pitch=pitch, rises=rises))
    line = mitsonar.read(tmp_path / "line.all")
    there = np.interp(line["ping_time"], line["motion_time"], line["motion_depth"])
    assert np.abs(line["ping_depth"].values - there).max() < 0.003
    angle = line["motion_pitch"].values
    array = line["motion_depth"].values - 10 * np.sin(angle) + 5 * np.cos(angle)
    wanted = 0.2 - 1.5 + (5 * np.cos(angle) - 10 * np.sin(angle) if rises else 5.0)
    assert np.abs(array - wanted).max() < 0.003


def test_an_array_turned_about_is_the_same_array(line):
    soundings = mitsonar.read(line)
    assert np.allclose(np.rad2deg(soundings["transmit_mounting"]), (0.3, 0.2, 0.1))
    assert np.allclose(np.rad2deg(soundings["receive_mounting"]), (0.3, 0.2, 0.0))
    assert np.allclose(soundings["receive_offset"], (9, 1, 5.5))


def test_sectors_detections_and_what_is_not_valid(line):
    soundings = mitsonar.read(line)
    assert np.allclose(np.rad2deg(soundings["sector_angle"][0]), (-1.0, 1.5))
    assert np.allclose(soundings["transmit_angle"][0, [0, -1]], soundings["sector_angle"][0])
    assert np.allclose(soundings["sector_absorption_db"], (0.020, 0.025))
    assert not soundings["valid"][0, 1] and np.isnan(soundings["depth"][0, 1])
    assert list(soundings["detection"][0].values) == [BY_PHASE, NOT_DETECTED, *[BY_AMPLITUDE] * 4,
                                                      BY_PHASE, BY_PHASE]
    assert soundings["quality"][0, 0] == pytest.approx(-np.log10(5 / 250), abs=1e-5)
    assert soundings["backscatter_db"][0, 0] == pytest.approx(-25.0)


def test_the_water_column_is_taken_from_the_file_beside_it_without_its_gain(line):
    line.with_suffix(".wcd").write_bytes(wcd_file())
    soundings = reading.read(line)
    assert reading.read(line.with_suffix(".wcd")).identical(soundings)
    assert soundings["column_level_db"].shape == (2, 4, SAMPLES)
    assert list(np.isfinite(soundings["column_level_db"][0]).sum("column_sample").values) == [30, 20, 30, 20]
    reach = (4 + 0.5) * 1505.0 / (2 * 2000.0)
    assert soundings["column_level_db"][0, 2, 0] == pytest.approx(-20 - 20 - 30 * np.log10(reach) - 2 * 0.025 * reach,
                                                                 abs=1e-4)
    assert soundings["column_start"][0, 0] == 4 / 2000.0
    assert np.allclose(np.rad2deg(soundings["column_angle"][0]), np.array([-30, -10, 10, 30]) + 0.3)
    assert "column_level_db" not in reading.read(line, water_column=False)
    line.unlink()
    with pytest.raises(ValueError, match="a water column alone; put line.all"):
        reading.read(line.with_suffix(".wcd"))


def test_blocks_are_the_line_and_either_order_of_bytes_is_read(line, tmp_path):
    whole = mitsonar.read(line)
    assert joined(reading.blocks(line, size=1)).identical(whole)
    assert reading.read(line, pings=slice(1, 2))["ping_time"].values == pytest.approx(1.0)
    with pytest.raises(ValueError, match="it has the pings 0 to 1"):
        reading.read(line, pings=slice(5, 9))
    (tmp_path / "line2.all").write_bytes(all_file(order=">"))
    assert mitsonar.read(tmp_path / "line2.all").equals(whole)


def test_datagrams_that_are_not_read_are_named(line):
    assert "left_out" not in mitsonar.read(line).attrs
    known = line.read_bytes()
    other = bytearray(known[:4 + int.from_bytes(known[:4], "little")])         # the first datagram, as one of kind Y
    other[5:6] = b"Y"
    line.write_bytes(known + other)
    assert mitsonar.read(line).attrs["left_out"] == "datagrams of the kinds Y are not read"


def test_a_line_of_one_head_has_no_second(line):
    assert reading.read(line, head=0).identical(reading.read(line))
    with pytest.raises(ValueError, match="one receiving head, 0; head 1 was asked for"):
        reading.read(line, head=1)
