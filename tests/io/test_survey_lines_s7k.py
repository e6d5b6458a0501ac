"""s7k files: fields by the format's document, places by our reduction over a level bed, and versions of records.

Water of one speed and a level bed: depth = 40 m, across = 1 m + 38 m tan(angle), as the arrays are 1 m to starboard and
2 m deep. The travel time of the file is that of one point, and the arrays stand 1 m apart along the ship: the depth is
then too large by less than (1 m)² / (8 · 38 m) · (1 + tan²) = 13 mm at 60 degrees.
"""
import struct
import tracemalloc

import numpy as np
import pytest

import mitsonar
from mitsonar.hydrography.reduction.resounding import resounded
from mitsonar.io.survey_lines import reading, write
from tests.inputs.s7k_file import BEAMS, DEVICE, SPEED, fields, record, records_of, s7k_file
from tests.inputs.soundings_line import soundings_line

ANGLE = np.radians(np.linspace(-60, 60, BEAMS))


def line_of(tmp_path, content):
    """Return the line of a file's bytes."""
    (tmp_path / "a.s7k").write_bytes(content)
    return mitsonar.read(tmp_path / "a.s7k")


@pytest.mark.parametrize("options", [{}, {"old": True}, {"old": True, "stabilised": True, "roll": 0.03},
                                     {"size": 22}, {"size": 50}, {"heads": 2}])
def test_soundings_of_a_level_bed_lie_on_it(tmp_path, options):
    line = line_of(tmp_path, s7k_file(**options))
    pings = 3 * options.get("heads", 1)
    assert line["valid"].values.sum() == pings * BEAMS and line.sizes["ping"] == pings
    # the angles of the old record are from the vertical where beams are stabilised, and the array is rolled
    angle = line["angle"].values[0] - options.get("roll", 0.0)
    assert np.allclose(angle, ANGLE - options.get("roll", 0.0), atol=1e-6)
    if not options.get("roll"):
        assert np.allclose(line["depth"], 40.0, atol=0.014)
        assert np.allclose(line["across_track"][0], 1 + 38 * np.tan(ANGLE), atol=0.02)
        assert np.allclose(line["along_track"], 10.0, atol=0.02)
    assert np.isfinite(line["quality"].values).all() == (not options.get("old", False))
    assert np.isfinite(line["backscatter_db"].values).all() == (options.get("size") != 22)
    assert "places by mitsonar" in line.attrs["reduction"]


def test_a_rolled_array_turns_the_swath(tmp_path):
    """Beams of detections 7027 are relative to the array: a roll of 0.1 rad takes the port beam up, starboard down."""
    line = line_of(tmp_path, s7k_file(roll=0.1, arms=False))
    assert np.allclose(line["across_track"][0], 40 * np.sin(ANGLE - 0.1) / np.cos(ANGLE) * 38 / 40, atol=0.02)


def test_fields_are_those_of_the_document(tmp_path):
    line = line_of(tmp_path, s7k_file())
    assert line.attrs["sonar"] == "SeaBat 7125" and line.attrs["start"] == "2026-05-01T10:00:10Z"
    assert np.allclose(line["receive_offset"], [9, 1, 3]) and np.allclose(line["transmit_offset"], [10, 1, 3])
    assert np.allclose(line["motion_depth"], -1.0) and np.allclose(line["head_sound_speed"], SPEED)
    one = {name: float(line[f"sector_{name}"][0, 0]) for name in (
        "frequency", "pulse_length", "bandwidth", "source_level_db", "absorption_db")}
    assert one == pytest.approx({"frequency": 4e5, "pulse_length": 1e-4, "bandwidth": 2e4, "source_level_db": 220,
                                 "absorption_db": 0.09})
    assert np.allclose(line["quality"], 2.0) and np.allclose(line["backscatter_db"], 60.0)
    assert np.all(line["detection"] == 1) and np.allclose(line["ping_time"], [0, 0.5, 1])
    assert line.attrs["profile"] == "the cast of the file" and np.allclose(line["cast_sound_speed"], SPEED)
    cast, = reading.line_casts(tmp_path / "a.s7k")
    assert cast.place == pytest.approx((54.0, 7.5))


def test_arrays_without_an_installation_record_stand_where_the_settings_put_them(tmp_path):
    settings = fields(7503, number=100, transmit=(0.1, 0.3, -0.2), tilt=(np.radians(10), 0, 0))
    line = line_of(tmp_path, record(7503, 1.0, settings) + s7k_file(arms=False))
    assert np.allclose(line["transmit_offset"], [0, 0.1, 0.2]) and np.allclose(line["receive_offset"], [-0.3, 0, 0])
    # a positive tilt turns beams to starboard: the starboard side is up
    assert np.allclose(line["receive_mounting"], [-np.radians(10), 0, 0])
    assert float(line["across_track"].mean()) > 5


def test_installation_of_another_device_and_settings_of_an_older_version(tmp_path):
    """Other programs write the installation under a device of their own; older 7503 end before the tilts."""
    settings = fields(7503, number=100, transmit=(0.1, 0.3, -0.2))[:-12]
    line = line_of(tmp_path, record(7503, 1.0, settings) + s7k_file(arms=False))
    assert np.allclose(line["transmit_offset"], [0, 0.1, 0.2]) and np.allclose(line["receive_mounting"], 0)
    other = record(7030, 1.0, fields(7030, receive=(0.5, 2.0, -1.0, 0, 0, 0)), source=(7000, 0))
    assert np.allclose(line_of(tmp_path, other + s7k_file(arms=False))["receive_offset"], [2, 0.5, 1])


def test_checksums_count_in_files_that_keep_them(tmp_path):
    content = s7k_file(1)
    parts = [part[:-4] + b"\x01\x02\x03\x04" for _, part in records_of(content)]
    assert line_of(tmp_path, b"".join(parts)).sizes["ping"] == 1
    (tmp_path / "a.s7k").write_bytes(content[:-500] + bytes([content[-500] ^ 1]) + content[-499:])
    with pytest.raises(ValueError, match="its record 7027 at byte .* is damaged: its checksum is wrong"):
        reading.read(tmp_path / "a.s7k")


def test_a_file_without_a_cast_takes_the_heads_speed_and_says_so(tmp_path):
    line = line_of(tmp_path, s7k_file(cast=False) + record(7051, 1.0, bytes(8)))
    assert line.attrs["profile"] == "the head's sound speed at all depths"
    assert not reading.line_casts(tmp_path / "a.s7k")
    assert np.allclose(line["depth"], 40.0, atol=0.014)
    assert line.attrs["left_out"] == "records of the kinds 7051 are not read"


def test_motion_of_separate_records_is_joined(tmp_path):
    """Roll, pitch and heave (1012) with the headings of 1013, which turn past north."""
    other = b"".join(part for kind, part in records_of(s7k_file()) if kind != 1016)
    for number in range(5):
        second = 9.0 + number
        other += record(1012, second, fields(1012, roll=0.02, pitch=-0.01, heave=0.5))
        other += record(1013, second + 0.5, fields(1013, heading=np.remainder(-0.1 + 0.05 * number, 2 * np.pi)))
    line = line_of(tmp_path, other)
    assert np.allclose(line["motion_depth"], -1.5) and np.allclose(line["motion_roll"], 0.02)
    assert np.allclose(line["motion_pitch"], -0.01)
    assert np.allclose(np.diff(line["motion_heading"])[1:], 0.05, atol=1e-6)


def test_detections_that_did_not_pass_are_not_valid(tmp_path):
    flags = np.full(BEAMS, 2 + (1 << 2))
    flags[2], flags[3] = 1 << 2, 1 + (1 << 2) + (1 << 9)        # neither kind of detection; a second one of its beam
    quality = np.full(BEAMS, 3)
    quality[4] = 1                                              # bright, not colinear
    line = line_of(tmp_path, s7k_file(flags=flags, quality=quality))
    assert np.array_equal(np.flatnonzero(~line["valid"][0].values), [2, 3, 4])
    assert np.all(line["detection"].values[0][line["valid"][0].values] == 2)


@pytest.mark.parametrize("content, sentence", [
    (s7k_file(1)[:-10], "it is cut: its last record"), (s7k_file(1)[:-60], "damaged or cut at byte"),
    (record(7200, 0.0, bytes(100)), "it has no soundings"),
    (s7k_file(1, beams=5000), "its ping 100 has 5000 beams"),
    (s7k_file(1) + record(1009, 0.0, fields(1009, entries=90)), "too short for its 90 entries"),
    (s7k_file(1, size=12), "has detections of 12 bytes"),
    (b"".join(part for kind, part in records_of(s7k_file(1)) if kind != 1003), "it has no position of the vessel"),
    (s7k_file(1).replace(struct.pack("<f", SPEED), struct.pack("<f", 15.0)), "checksum is wrong"),
])
def test_a_damaged_file_is_refused_in_a_sentence(tmp_path, content, sentence):
    (tmp_path / "a.s7k").write_bytes(content)
    with pytest.raises(ValueError, match=sentence) as caught:
        reading.read(tmp_path / "a.s7k")
    assert "\n" not in str(caught.value) and str(caught.value).startswith("cannot read")


def test_two_heads_have_their_own_arrays(tmp_path):
    line = line_of(tmp_path, s7k_file(heads=2) + record(7030, 1.0, fields(7030, receive=(0, 1, 0, 0, 0, 0)),
                                                         source=(DEVICE, 5)))
    assert line.sizes["receive_head"] == 2 and np.array_equal(line["head"], [0, 1] * 3)
    assert np.allclose(reading.of_head(line, 1)["receive_offset"], [9, 1, 3])


def test_the_command_states_whose_places_they_are_and_reduces_them_anew(tmp_path, capsys):
    """With 1500 m/s for a line of 1485 m/s, depths below the arrays grow by 1 %.

    The head's speed stays the node at the arrays, which changes 0.1 m of 38 m.
    """
    from mitsonar.cli.main import main

    (tmp_path / "a.s7k").write_bytes(s7k_file())
    (tmp_path / "cast.csv").write_text("depth,sound_speed\n0,1500\n2.1,1500\n100,1500\n")
    for name, more in (("as.nc", []), ("anew.nc", ["--profile", str(tmp_path / "cast.csv")])):
        assert main(["soundings", str(tmp_path / "a.s7k"), "-o", str(tmp_path / name), *more]) in (0, None)
        said = capsys.readouterr().err
        assert "places by mitsonar" in said and "the file's soundings were made" not in said
    before, after = (mitsonar.read(tmp_path / name) for name in ("as.nc", "anew.nc"))
    assert np.allclose(after["depth"][:, 7] - 2, (before["depth"][:, 7] - 2) * 1500 / SPEED, rtol=1e-4)


def with_one_steering(line):
    """Return a line whose soundings have the transmit angle of their sector, with places that belong to it."""
    steering = np.take_along_axis(line["sector_angle"].values, line["sector"].values, axis=1)
    return resounded(line.assign(transmit_angle=line["transmit_angle"] * 0 + steering))


@pytest.mark.parametrize("sectors", [1, 3])
def test_a_line_that_was_written_comes_back(tmp_path, sectors):
    """Singles of the format: times to 4 microseconds, which a roll of 0.1 rad/s turns to 0.05 mm at 100 m."""
    line = with_one_steering(soundings_line(sectors=sectors, column=False, snippets=False))
    written = write(line, tmp_path / "a.s7k")
    again = reading.read(tmp_path / "a.s7k")
    assert (written.pings, again.sizes["ping"]) == (4, 4 * sectors)
    assert written.soundings == int(line["valid"].sum()) == int(again["valid"].sum())
    assert any(f"{sectors} sectors are written as" in word for word in written.words) == (sectors > 1)
    assert not any("one transmit angle" in word for word in written.words)
    sent = line["ping_time"].values[:, None] + line["sector_delay"].values
    assert np.allclose(again["ping_time"], (sent - sent[0, 0]).ravel(), atol=1e-5)
    moved = np.array(again.attrs["origin"]) - np.array(line.attrs["origin"])
    for name, shift in (("depth", 0), ("x", moved[0]), ("y", moved[1]), ("travel_time", 0), ("angle", 0),
                        ("backscatter_db", 0), ("quality", 0), ("detection", 0)):
        # soundings in the order of pings, and of sectors within a ping, as the file has them
        before = np.concatenate([line[name].values[ping][line["valid"].values[ping]] for ping in range(4)])
        after = np.concatenate([again[name].values[ping][again["valid"].values[ping]]
                                for ping in range(4 * sectors)])
        assert np.allclose(after + shift, before, atol=1e-3, rtol=1e-5), name
    for name in ("transmit_offset", "receive_offset", "transmit_mounting", "receive_mounting", "cast_sound_speed"):
        assert np.allclose(again[name], line[name], atol=1e-6), name
    assert np.allclose(again["motion_depth"], line["motion_depth"], atol=1e-5)


def test_a_transmit_angle_of_its_own_is_said_to_be_lost(tmp_path):
    line = soundings_line(sectors=1, column=False, snippets=False)
    assert any("one transmit angle a ping; those of soundings differ from it by up to" in word
               for word in write(line, tmp_path / "a.s7k").words)


def test_another_reader_reads_what_was_written(tmp_path):
    """The frames and fields of every record, by the sizes and numbers of the document alone."""
    line = with_one_steering(soundings_line(sectors=1, column=False, snippets=False))
    write(line.assign_attrs(sonar="SeaBat 7125"), tmp_path / "a.s7k")
    found = records_of((tmp_path / "a.s7k").read_bytes())
    assert [kind for kind, _ in found[:3]] == [7200, 7030, 1009]
    assert all(sum(part[:-4]) == int.from_bytes(part[-4:], "little") for _, part in found)
    part = next(part for kind, part in found if kind == 7027)
    assert struct.unpack_from("<I", part, 36) == (7125,)
    number, sequence, beams, size = struct.unpack_from("<IHII", part, 64 + 8)
    rate, steering = struct.unpack_from("<2f", part, 64 + 27)
    assert (number, sequence, beams, size) == (1, 0, 24, 34) and len(part) == 64 + 99 + 24 * 34 + 4
    beam, sample, angle, flags, quality = struct.unpack_from("<H2f2I", part, 64 + 99 + 5 * 34)
    assert (beam, flags & 3, quality & 3) == (5, 2, 3) and np.isclose(sample / rate, line["travel_time"][0, 5])
    assert np.isclose(angle, line["angle"][0, 5]) and np.isclose(steering, line["sector_angle"][0, 0])
    latitude, longitude = struct.unpack_from("<2d", next(part for kind, part in found if kind == 1015), 64 + 1)
    assert np.allclose(np.degrees([latitude, longitude]), [53.7, 8.2], atol=0.1)


def test_a_longer_file_takes_no_more_memory(tmp_path):
    """120 pings more, of 64 beams and 20 variables, would take 1.2 MB; their places in the file take 0.2 MB."""
    def most(pings):
        (tmp_path / "a.s7k").write_bytes(s7k_file(pings, beams=64))
        tracemalloc.start()
        held = sum(block.sizes["ping"] for block in reading.blocks(tmp_path / "a.s7k", size=8))
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return held, peak

    most(8)
    (few, little), (many, much) = most(40), most(160)
    assert (few, many) == (40, 160) and much < little + 600_000
