"""JSF in and out: files made byte by byte are read, and written ones hold their bytes where the description says.

The writer and the reader were also compared with three readers of others (sidescantools, pyjsf, PINGVerter).
"""
import struct

import numpy as np
import pytest
import sidescan_by_bytes as by_bytes
from flipped_bits import COPIES, refusals
from synthetic_sidescan import sidescan

import mitsonar
from mitsonar.cli.main import main
from mitsonar.io import sidescan_lines
from mitsonar.io.sidescan_lines import jsf_file

RNG = np.random.default_rng(5)
ROWS = RNG.integers(0, 65536, (4, 2, 30))


@pytest.fixture
def line(tmp_path):
    """The path of a file of four pings with a low and a high frequency, a sub-bottom profiler, and a status message."""
    parts = [by_bytes.message(182, bytes(24), 0)]
    for ping, sides in enumerate(ROWS):
        parts.append(by_bytes.sonar(7 + ping, RNG.integers(0, 99, 50), subsystem=0))
        for channel, row in enumerate(sides):
            parts.append(by_bytes.sonar(7 + ping, row, channel=channel, seconds=1_700_000_000 + ping,
                                        weight=3 * channel))
            parts.append(by_bytes.sonar(7 + ping, row[:20], channel=channel, subsystem=21, band=(40_000, 41_000)))
    (tmp_path / "line.jsf").write_bytes(b"".join(parts))
    return tmp_path / "line.jsf"


def test_sonar_messages_come_back_with_scale_navigation_and_pulse(line):
    got = sidescan_lines.read(line, frequency=125e3)
    assert mitsonar.io.sidescan_lines.recognised(line) == "jsf" and got.attrs["channel_numbers"] == [200, 201]
    np.testing.assert_array_equal(got["amplitude"], ROWS)
    np.testing.assert_array_equal(got["weight"], [[0, 3]] * 4)
    for name, value in (("altitude", 12.345), ("sensor_depth", 7.5), ("heading", np.radians(271.5)),
                        ("pitch", np.radians(-910 * 180 / 32768)), ("roll", np.radians(1820 * 180 / 32768)),
                        ("longitude", 8.0), ("latitude", -47.0), ("speed", 4.57 * 1852 / 3600),
                        ("sound_speed", 1490.0)):
        np.testing.assert_allclose(got[name], value, rtol=1e-7)
    assert np.isnan(got["heave"]).all()                  # its bit of validity is not set
    np.testing.assert_allclose(got["ping_time"], 1_700_000_000.25 + np.arange(4), rtol=0, atol=1e-6)
    np.testing.assert_allclose(got["sample_interval"], 20_000.5e-9, rtol=1e-12)
    np.testing.assert_allclose(got["pulse_length"], 2.5e-3)
    np.testing.assert_allclose(got["slant_range"], 0.5 * 1490 * 30 * 20_000.5e-9)
    assert got.attrs["left_out"][0].startswith("channels 210 (port, 405 kHz), 211")
    assert "4 messages of type 80 (sonar data that is no sidescan)" in got.attrs["left_out"]


def test_long_pings_analytic_samples_and_several_packets(tmp_path):
    complex_row = np.array([300, -400, 0, 5, -32768, 0])
    long_row = RNG.integers(0, 1000, 70_000)
    (tmp_path / "a.jsf").write_bytes(
        by_bytes.sonar(1, complex_row, kind=1, weight=2)
        + by_bytes.sonar(2, complex_row[:4], kind=1) + by_bytes.sonar(2, complex_row[2:], kind=1, packet=2))
    got = sidescan_lines.read(tmp_path / "a.jsf")
    np.testing.assert_allclose(got["amplitude"][0, 0, :3], [500, 5, 32768])
    np.testing.assert_allclose(got["amplitude"][1, 0], [500, 5, 5, 32768])
    assert list(got["side"].values) == ["port"] and got["samples"].values.ravel().tolist() == [3, 4]
    (tmp_path / "b.jsf").write_bytes(by_bytes.sonar(1, long_row, high=1 << 8 | 1 | 1 << 4))
    got = sidescan_lines.read(tmp_path / "b.jsf")
    np.testing.assert_array_equal(got["amplitude"][0, 0], long_row)
    assert got.attrs["frequency"] == 10 * (65536 + 12_500)
    (tmp_path / "c.jsf").write_bytes(by_bytes.sonar(1, complex_row, kind=2))
    with pytest.raises(ValueError, match="samples of kind 2"):
        sidescan_lines.read(tmp_path / "c.jsf")


def test_sensors_take_the_place_of_what_sonar_messages_repeat(tmp_path):
    seconds, parts = 1_700_000_000, []
    for half in range(9):                                # at 2 Hz; degrees of latitude grow by 0.001 a second
        whole, rest = divmod(half, 2)
        parts.append(by_bytes.motion(seconds + whole, 500 * rest, 100 * half))
        parts.append(by_bytes.nmea(seconds + whole, 500 * rest,
                                   f"$GPGGA,1,47{0.03 * half:010.7f},S,00803.0,W,1,,,,M,,M,,*00"))
    pings = [by_bytes.sonar(ping, [1, 2], seconds=seconds + ping) for ping in range(4)]
    (tmp_path / "a.jsf").write_bytes(b"".join([*parts, *pings]))
    got = sidescan_lines.read(tmp_path / "a.jsf")
    at = np.arange(4) + 0.25
    np.testing.assert_allclose(got["roll"], np.radians(200 * at * 180 / 32768), rtol=1e-9)
    np.testing.assert_allclose(got["latitude"], -47 - 0.001 * at, rtol=1e-10)
    np.testing.assert_allclose(got["longitude"], -8.05)
    assert got.attrs["navigation_from"].endswith("roll,latitude,longitude from messages of sensors")
    interpolated = [by_bytes.sonar(ping, [1, 2], seconds=seconds + ping, valid=0x2001) for ping in range(4)]
    (tmp_path / "b.jsf").write_bytes(b"".join([*parts, *interpolated]))
    np.testing.assert_allclose(sidescan_lines.read(tmp_path / "b.jsf")["latitude"], -47.0)


def test_a_lost_side_is_empty_and_lost_pings_are_counted(tmp_path):
    parts = [by_bytes.sonar(number, [number, 5], channel=channel) for number in (4, 5, 9) for channel in (0, 1)
             if (number, channel) != (5, 1)]
    (tmp_path / "a.jsf").write_bytes(b"".join(parts))
    got = sidescan_lines.read(tmp_path / "a.jsf")
    assert got["samples"].values.tolist() == [[2, 2], [2, 0], [2, 2]]
    assert got.attrs["lost_pings"] == 3 and got["ping_number"].values.tolist() == [4, 5, 9]


@pytest.mark.parametrize(("crs", "slack"), [("EPSG:32632", 1e-9), (None, 0.051)])
def test_a_written_record_comes_back_at_its_levels_and_places(tmp_path, crs, slack):
    record = sidescan(pings=25).assign_attrs(crs=crs, pulse_length=123e-6)
    written = jsf_file.write(record, tmp_path / "line.jsf", start=1.7e9)
    got = mitsonar.read(tmp_path / "line.jsf")
    scale, = written.scales
    amplitude = got["amplitude"].values * 2.0 ** -got["weight"].values[..., None]
    level = scale.levels(amplitude, record["range"].values)
    loud = (amplitude > 100) & (amplitude < 30_000)
    assert loud.mean() > 0.5 and np.abs(level - record["level"].values)[loud].max() < 0.05
    assert got["amplitude"].values.max() <= 32767 and (got["weight"].values >= 0).all()
    east, north = record.attrs["local_origin"]
    if crs is None:
        np.testing.assert_allclose(got["y"], north + record["y"], atol=slack)
    else:
        import pyproj

        x, y = pyproj.Transformer.from_crs(4326, crs, always_xy=True).transform(got["longitude"], got["latitude"])
        np.testing.assert_allclose(x, east + record["x"], atol=1e-3)
        np.testing.assert_allclose(y, north + record["y"], atol=1e-3)
    np.testing.assert_allclose(got["range"], record["range"], atol=1e-4)
    np.testing.assert_allclose(got["altitude"], record["altitude"], atol=1e-3)
    np.testing.assert_allclose(got["roll"], record["roll"], atol=5e-5)
    np.testing.assert_allclose(got["ping_time"], 1.7e9 + record["ping_time"], atol=1e-3)
    np.testing.assert_allclose(got["pulse_length"], 123e-6)


def test_counts_are_written_as_they_are_unless_they_need_the_last_bit(tmp_path):
    record = sidescan(pings=3, bins=20)
    counts = RNG.integers(0, 20_000, (3, 2, 20)).astype(np.uint16)
    counts[1, 1, 4] = 65_535
    record = record.assign(recorded=(record["level"].dims, counts)).assign_attrs(recorder={
        "bits": 16, "full_scale_db": 171.0, "dither": False, "spreading": 30.0, "absorption_db": 0.03, "start": 1.0,
        "end": None, "step_db": 0.0, "sectors_db": [0.0], "law": "linear", "range_db": 60.0})
    jsf_file.write(record, tmp_path / "line.jsf", tvg="counts")
    got = sidescan_lines.read(tmp_path / "line.jsf")
    assert got["weight"].values.tolist() == [[0, 0], [0, -1], [0, 0]]
    np.testing.assert_array_equal(got["amplitude"][0], counts[0])
    assert np.abs(2 * got["amplitude"].values[1, 1].astype(int) - counts[1, 1]).max() <= 1


def test_the_command_writes_two_frequencies_as_two_subsystems(tmp_path, capsys):
    for name, frequency, bins in (("low", 100e3, 40), ("high", 400e3, 60)):
        mitsonar.write(sidescan(pings=6, bins=bins).assign_attrs(frequency=frequency), tmp_path / f"{name}.nc")
    assert main(["convert", str(tmp_path / "high.nc"), str(tmp_path / "low.nc"), str(tmp_path / "dual.jsf")]) == 0
    assert "2^-weight" in capsys.readouterr().err
    kinds = []
    raw, at = (tmp_path / "dual.jsf").read_bytes(), 0
    while at < len(raw):
        sync, kind, subsystem, channel, size = struct.unpack_from("<HxxHxBBxxxi", raw, at)
        assert sync == 0x1601
        kinds.append((kind, subsystem, channel))
        at += 16 + size
    assert at == len(raw)
    assert kinds[:6] == [(182, 0, 0), (2020, 101, 0), (80, 20, 0), (80, 20, 1), (80, 21, 0), (80, 21, 1)]
    with pytest.warns(UserWarning, match="400 kHz"):
        assert mitsonar.read(tmp_path / "dual.jsf").sizes["sample"] == 40


@pytest.mark.parametrize(("change", "words"), [
    (lambda raw: raw[:-10], "cut off"),
    (lambda raw: raw[:40] + b"\7" + raw[41:], "no message starts"),
    (lambda raw: raw[:12] + struct.pack("<i", -5) + raw[16:], "has -5 bytes"),
    (lambda raw: raw[:12] + struct.pack("<i", 2**31 - 1) + raw[16:], "cut off"),
    (lambda raw: raw[:40], "no channel to port or starboard"),
])
def test_cut_and_broken_messages_are_refused_in_one_sentence(line, change, words):
    line.write_bytes(change(line.read_bytes()))
    with pytest.raises(ValueError, match=words) as caught:
        sidescan_lines.read(line)
    assert "\n" not in str(caught.value)


def test_flipped_bits_of_messages_end_in_a_record_or_a_sentence(line):
    rng = np.random.default_rng(4)
    refused = refusals(line, lambda bad: sidescan_lines.as_image(sidescan_lines.read(bad)),
                       "cannot read the sidescan record",
                       lambda size: rng.integers(0, size, int(rng.integers(1, 12))), rng)
    assert 10 < refused < COPIES


@pytest.mark.parametrize("length", [0, 1, 2, 3, 15])
def test_the_beginning_of_a_message_is_no_record(line, length):
    line.write_bytes(line.read_bytes()[:length])
    assert sidescan_lines.recognised(line) is None
