"""Navigation from XTF: small files written by pyxtf's own packets, a real survey line, and damaged files.

The small file: 5 s, positions at 10 Hz and attitude at 20 Hz, due east at 2 m/s along 37.75 N from 122.38 W; roll and
heave are sines of 4 s. Degrees of longitude there are 88.1 km; stamps of 0.1 ms are 0.2 mm.
"""
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from mitsonar.io.tracks import tracks
from mitsonar.io.tracks.navigation import course
from mitsonar.io.xtf import navigation as navigation_xtf

SURVEY = Path(__file__).resolve().parents[2] / "../shared/data/tracks/r2sonic_20150708.xtf"
SCOTSMAN = Path(__file__).resolve().parents[2] / "../shared/data/measured/sidescan/scotsman_600khz.xtf"
START = 1436399535                 # 2015-07-08T23:52:15Z
PER_DEGREE = 88_129.79             # [m] of longitude at 37.75 N on WGS 84, a cos φ / √(1 - e² sin² φ) · π/180
TIMES = np.round(np.arange(0, 5.05, 0.1), 3)


def stamp(packet, seconds, fraction, unit):
    """Date a packet `seconds` after the start."""
    packet.Year, packet.Month, packet.Day, packet.Hour = 2015, 7, 8, 23
    whole = 52 * 60 + 15 + seconds + 1e-7
    packet.Minute, packet.Second = divmod(int(whole), 60)
    setattr(packet, fraction, int((whole % 1) / unit))
    packet.NumBytesThisRecord = 64
    return packet


def position(seconds, longitude=None, latitude=37.75, **more):
    import pyxtf

    packet = stamp(pyxtf.XTFPosRawNavigation(), seconds, "Microsecond", 1e-4)
    packet.RawXcoordinate = -122.38 + 2 * seconds / PER_DEGREE if longitude is None else longitude
    packet.RawYcoordinate = latitude
    for name, value in more.items():
        setattr(packet, name, value)
    return packet


def attitude(seconds, **more):
    import pyxtf

    packet = stamp(pyxtf.XTFAttitudeData(), seconds, "Millisecond", 1e-3)
    wave = np.sin(2 * np.pi * seconds / 4)
    packet.Roll, packet.Pitch, packet.Heave, packet.Heading = 3 * wave, 1.0, 0.2 * wave, 90.0
    for name, value in more.items():
        setattr(packet, name, value)
    return packet


def ping(seconds, **more):
    import pyxtf

    packet = stamp(pyxtf.XTFPingHeader(), seconds, "HSeconds", 1e-2)
    packet.NumBytesThisRecord = 256
    for name, value in more.items():
        setattr(packet, name, value)
    return packet


def data(packets, units=3, channels=0):
    """The bytes of a file."""
    import pyxtf

    header = pyxtf.XTFFileHeader()
    header.NavUnits, header.NumberOfSonarChannels = units, channels
    return (header.to_bytes().ljust(1024 * (1 + max(0, -(-(channels - 6) // 8))), b"\0")
            + b"".join(bytes(packet) for packet in packets))


def small():
    return [*map(position, TIMES), *map(attitude, np.round(np.arange(0, 5.02, 0.05), 3))]


@pytest.fixture
def load(tmp_path):
    def run(packets, name="line.xtf", **header):
        path = tmp_path / name
        path.write_bytes(packets if isinstance(packets, bytes) else data(packets, **header))
        return tracks.load(path)
    return run


def test_positions_attitude_and_heave_on_the_finer_clock(load):
    record = load(small())
    assert record.geographic and record.z is None and record.time.size == 101
    np.testing.assert_allclose(record.time - START, np.arange(101) * 0.05, atol=1e-6)
    wave = np.sin(2 * np.pi * (record.time - START) / 4)
    np.testing.assert_allclose(np.rad2deg(record.roll), 3 * wave, atol=1e-3)
    np.testing.assert_allclose(record.heave, 0.2 * wave, atol=1e-4)
    track = record.placed(depth=2.0)
    np.testing.assert_allclose(track.position[:, 0], 2 * (record.time - START) - 5, atol=5e-4)
    np.testing.assert_allclose(track.position[:, 2], -2 + 0.2 * wave, atol=1e-4)
    assert np.rad2deg(track.heading) == pytest.approx(90, abs=1e-3) and np.rad2deg(track.pitch) == pytest.approx(1)


def test_it_is_known_by_its_content(load):
    assert load(small(), name="line.dat").time.size == 101


def test_metres_stay_metres(load):
    packets = [position(t, 500000 + 2 * t, 6e6) for t in TIMES]
    record = load(packets, units=0)
    assert not record.geographic and record.x[-1] == pytest.approx(500010) and record.y[0] == 6e6
    assert course(record.time, record.placed().position[:, :2]) == pytest.approx(np.pi / 2)


def test_packets_out_of_order_and_packets_between(load):
    import pyxtf

    note = pyxtf.XTFNotesHeader()
    note.NumBytesThisRecord = 256
    wanted, got = load(small()), load([note, *reversed(small()), note])
    assert np.array_equal(wanted.time, got.time) and np.array_equal(wanted.x, got.x)


def test_what_cannot_be_true_is_left_out_and_counted(load, caplog):
    packets = small()
    packets += [position(2.0), position(2.0), position(2.02, 0.0, 0.0), position(2.03, -122.38, 91.0),
                position(2.04, -122.3), position(4.99, -121.0), position(2.05, float("nan")), attitude(1.025, Roll=1e9)]
    bad = position(1.0)
    bad.Month = 13
    late = position(1.5)
    late.Year = 2035
    with caplog.at_level("INFO"):
        record = load([*packets, bad, late, position(-0.5, -120.0)])
    assert np.array_equal(record.x, load(small()).x)
    said = caplog.messages[0]
    for count in ("2 positions without a sound date", "2 repeated positions", "3 impossible places", "3 jumps",
                  "1 impossible attitudes"):
        assert count in said, said


def test_only_a_sonars_headers(load):
    pings = [ping(t, SensorXcoordinate=-122.38 + 2 * t / PER_DEGREE, SensorYcoordinate=37.75, SensorDepth=12 + t,
                  SensorRoll=2.0, SensorPitch=-1.0, SensorHeading=359 + 0.5 * t) for t in TIMES]
    record = load(pings, channels=2)
    np.testing.assert_allclose(record.z, -12 - (record.time - START), atol=1e-5)
    assert np.rad2deg(record.roll) == pytest.approx(2) and np.rad2deg(record.pitch) == pytest.approx(-1)
    np.testing.assert_allclose(np.rad2deg(record.heading), 359 + 0.5 * (record.time - START), atol=1e-3)


def test_a_ships_position_where_the_sensor_has_none(load):
    pings = [ping(t, ShipXcoordinate=-122.38 + 2 * t / PER_DEGREE, ShipYcoordinate=37.75, ShipGyro=91.0) for t in TIMES]
    record = load(pings)
    assert record.z is None and np.rad2deg(record.heading) == pytest.approx(91)


def test_positions_alone_head_along_the_course(load):
    track = load(list(map(position, TIMES))).placed()
    assert np.rad2deg(track.heading) == pytest.approx(90, abs=0.01) and not track.roll.any()


def test_gyro_packets_and_navigation_packets(load):
    import pyxtf

    packets = []
    for t in TIMES:
        place = stamp(pyxtf.XTFHeaderNavigation(), t, "Microsecond", 1e-6)
        place.RawXcoordinate, place.RawYcoordinate = -122.38 + 2 * t / PER_DEGREE, 37.75
        gyro = stamp(pyxtf.XTFHeaderGyro(), t, "Microsecond", 1e-6)
        gyro.Gyro = 88.0
        packets += [place, gyro]
    record = load(packets)
    assert np.rad2deg(record.heading) == pytest.approx(88) and record.time[-1] - START == pytest.approx(5, abs=1e-5)


def test_many_channels_make_a_longer_header(load):
    assert load(small(), channels=7).time.size == load(small(), channels=15).time.size == 101


@pytest.mark.parametrize(("contents", "words"), [
    (lambda: b"", "it is not an XTF file"),
    (lambda: "time,x,y,z\n0,0,0,-1\n".encode("utf-16").ljust(2000), "it is not an XTF file"),
    (lambda: data([]), "it holds no navigation"),
    (lambda: data([attitude(t) for t in TIMES]), "it holds no navigation"),
    (lambda: data([position(t, 0.0, 0.0) for t in TIMES]), "it holds no navigation"),
    (lambda: data([position(1.0)]), "fewer than two of its positions"),
    (lambda: data([position(t, 37.75, -122.38) for t in TIMES]), "are plausible (left out: 51 impossible places)"),
    (lambda: data([position(t, t % 2) for t in TIMES]), "positions jump faster than 25 m/s"),
    (lambda: data([*map(position, TIMES), *(attitude(60 + t) for t in TIMES)]), "but never together"),
    (lambda: data([*map(position, TIMES), *(attitude(t, Pitch=99.0) for t in TIMES)]), "fewer than two of its attitud"),
    (lambda: data(small())[:-20], "ends within a packet that starts at byte"),
    (lambda: data(small()) + b"\xce\xfa", "ends within a packet"),
    (lambda: data(small()) + bytes(64), "no packet starts at byte"),
    (lambda: data([position(1.0, NumBytesThisRecord=0), *small()]), "no packet starts at byte 1024"),
    (lambda: data([position(1.0, NumBytesThisRecord=2 ** 32 - 1), *small()]), "ends within a packet"),
    (lambda: data(small(), units=7), "units of type 7; 0 (metres) and 3 (degrees) are known"),
])
def test_bad_files_are_refused_in_one_sentence(contents, words, tmp_path):
    path = tmp_path / "line.xtf"
    path.write_bytes(contents())
    with pytest.raises(ValueError, match="cannot read the track .*line.xtf") as caught:
        tracks.load(path)
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_more_navigation_than_memory_should_hold(load, monkeypatch):
    monkeypatch.setattr(navigation_xtf, "_MOST_BYTES", 6400)
    with pytest.raises(ValueError, match="holds more than .* of navigation; split it"):
        load(small())


@settings(derandomize=True, max_examples=250, deadline=None)
@given(st.data())
def test_whatever_bytes_are_changed(tmp_path_factory, draw):
    contents = bytearray(data(small()[::5]))
    for _ in range(draw.draw(st.integers(1, 8))):
        contents[draw.draw(st.integers(0, len(contents) - 1))] = draw.draw(st.integers(0, 255))
    path = tmp_path_factory.getbasetemp() / "fuzz.xtf"
    path.write_bytes(contents[:draw.draw(st.integers(len(contents) // 2, len(contents)))])
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            tracks.read(path)
    except ValueError as error:
        assert "\n" not in str(error)


@pytest.mark.skipif(not SURVEY.is_file(), reason="the shared survey line is not here")
def test_a_real_line(caplog):
    """QINSy, 48 s of multibeam: counts, clocks, speed and heading as a launch in calm water has them."""
    with caplog.at_level("INFO"):
        record = tracks.load(SURVEY)
    assert "1204 positions and 1203 attitudes over 48.1 s; left out: none" in caplog.messages[0]
    assert record.time[0] == pytest.approx(START + 0.908, abs=1e-4) and record.time.size == 1203
    assert np.diff(record.time) == pytest.approx(0.04, abs=1e-4)
    track = record.placed(depth=0.5)
    speed = np.linalg.norm(np.diff(track.position[:, :2], axis=0), axis=1) / np.diff(track.time)
    assert 0.4 < speed.min() and speed.max() < 1
    off = np.angle(np.exp(1j * (course(track.time, track.position[:, :2]) - track.heading)))
    assert abs(np.rad2deg(off.mean())) < 5
    assert np.abs(np.rad2deg(track.roll)).max() == pytest.approx(4.19, abs=0.01)
    assert np.ptp(record.heave) == pytest.approx(0.135, abs=0.001)


def test_fixes_that_pings_repeat_are_used_once_each(load):
    """Ten pings a second, one fix a second: 1 m/s to the east, whatever ping one looks at."""
    metre = 1 / (111_195 * np.cos(np.deg2rad(37.75)))
    packets = [ping(0.1 * number, SensorXcoordinate=-122.5 + metre * (number // 10), SensorYcoordinate=37.75)
               for number in range(100)]
    with pytest.warns(UserWarning, match="repeats positions: 10 fixes, one in 1 s, stand in 100 records"):
        track = load(packets).placed(depth=1.0)
    assert np.diff(track.position[:, 0]) / np.diff(track.time) == pytest.approx(1.0, rel=0.01)


@pytest.mark.skipif(not SCOTSMAN.is_file(), reason="the shared sidescan line is not here")
def test_a_real_line_of_repeated_fixes_moves_on():
    """460 pings in 52 s with 219 fixes: bare, every second ping stands still."""
    with pytest.warns(UserWarning, match="repeats positions: 2.. fixes"):
        track = tracks.load(SCOTSMAN).placed(depth=1.0)
    step = np.hypot(*np.diff(track.position[:, :2], axis=0).T)
    assert step.min() > 0.02 and step.max() < 4 * np.median(step)
