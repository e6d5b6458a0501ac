"""Recorded sidescans through one door: what a file holds comes back as recorded, a choice is told, damage is said.

Two real lines, read by pyxtf packet by packet, are the independent reading; small ones are those that mitsonar writes.
"""
import struct
import warnings
from pathlib import Path

import numpy as np
import pytest
from flipped_bits import COPIES, refusals
from synthetic_sidescan import sidescan

import mitsonar
from mitsonar.io import sidescan_lines
from mitsonar.io.xtf import xtf

MEASURED = Path(__file__).resolve().parents[2] / "../shared/data/measured/sidescan"


@pytest.fixture
def line(tmp_path):
    """The path of a written line of 20 pings, and its record."""
    record = sidescan(pings=20, bins=50)
    xtf.write(record, tmp_path / "line.xtf", start=1e9)
    return tmp_path / "line.xtf", record


def test_a_written_line_comes_back_as_its_navigation_and_counts(line):
    path, record = line
    got = mitsonar.read(path)
    assert got["amplitude"].dims == ("ping", "side", "sample") and got["amplitude"].dtype == np.uint16
    assert got.attrs["bits"] == 16 and got.attrs["frequency"] == 100e3 and not got.attrs["geographic"]
    np.testing.assert_allclose(got["ping_time"], 1e9 + record["ping_time"], atol=5.1e-3)        # hundredths of a second
    for name, slack in (("heading", 1e-6), ("pitch", 1e-8), ("roll", 1e-8), ("altitude", 1e-5)):
        np.testing.assert_allclose(got[name], record[name] % (2 * np.pi) if name == "heading" else record[name],
                                   atol=slack)
    np.testing.assert_allclose(got["x"], record["x"] + record.attrs["local_origin"][0], atol=1e-6)
    np.testing.assert_allclose(got["sensor_depth"], -record["z"], atol=1e-5)
    np.testing.assert_allclose(got["range"], record["range"], atol=1e-4)
    np.testing.assert_allclose(got["sample_interval"], 2 * 75 / 1492.3 / 50, rtol=1e-6)
    np.testing.assert_allclose(got["sound_speed"], 1492.3, rtol=1e-6)


def test_one_of_several_pairs_is_chosen_by_frequency_or_number_and_the_others_are_told(tmp_path):
    low, high = sidescan(pings=8, bins=40), sidescan(pings=8, bins=60, seed=5).assign_attrs(frequency=400e3)
    xtf.write([low, high], tmp_path / "dual.xtf")
    with pytest.warns(UserWarning, match="channels 2 .port, 400 kHz., 3 .starboard, 400 kHz."):
        first = sidescan_lines.read(tmp_path / "dual.xtf")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        second = sidescan_lines.read(tmp_path / "dual.xtf", frequency=420e3)
        mixed = sidescan_lines.read(tmp_path / "dual.xtf", channels=(3, 0))
    assert first.sizes["sample"] == 40 and second.sizes["sample"] == 60
    assert second.attrs["frequency"] == 400e3 and second.attrs["channel_numbers"] == [2, 3]
    assert mixed.attrs["channel_numbers"] == [0, 3] and list(mixed["samples"].values[0]) == [40, 60]
    assert not mixed["amplitude"].values[:, 0, 40:].any()
    for choice, words in (({"frequency": 50e3}, "50 kHz was asked for, and it has 0 .port, 100 kHz."),
                          ({"channels": (0, 2)}, "at most one of each side"), ({"channels": (9,)}, "channels 9 were"),
                          ({"channels": (0,), "frequency": 1e5}, "give one of them")):
        with pytest.raises(ValueError, match=words):
            sidescan_lines.read(tmp_path / "dual.xtf", **choice)


def test_a_range_of_pings_is_read_alone(line):
    path, _ = line
    whole, some = sidescan_lines.read(path), sidescan_lines.read(path, pings=slice(5, 9))
    np.testing.assert_array_equal(some["amplitude"], whole["amplitude"][5:9])
    np.testing.assert_array_equal(some["ping_time"], whole["ping_time"][5:9])
    for pings, words in ((slice(30, 40), "20 sidescan pings, and none"), (slice(3, 3), "give a slice"),
                         (slice(-4, None), "give a slice")):
        with pytest.raises(ValueError, match=words):
            sidescan_lines.read(path, pings=pings)


def test_missing_ping_numbers_are_counted_as_lost(line):
    path, _ = line
    raw = bytearray(path.read_bytes())
    at = raw.index(struct.pack("<HB", 0xFACE, 0), 1024)
    pings = [place for place in range(at, len(raw), 64) if raw[place:place + 3] == raw[at:at + 3]]
    assert len(pings) == 20
    for number, place in enumerate(pings):
        raw[place + 28:place + 32] = struct.pack("<I", 100 + number + 3 * (number >= 12))
    path.write_bytes(raw)
    got = sidescan_lines.read(path)
    assert got.attrs["lost_pings"] == 3 and got["lost"].values.nonzero()[0].tolist() == [12]


@pytest.mark.parametrize("name", ["scotsman_600khz.xtf", "wreck_000_1236.xtf"])
def test_real_lines_agree_with_pyxtf_packet_by_packet(name):
    import pyxtf

    if not (MEASURED / name).exists():
        pytest.skip(f"{name} is not here")
    header, packets = pyxtf.xtf_read(str(MEASURED / name))
    pings = packets[pyxtf.XTFHeaderType.sonar]
    got = sidescan_lines.read(MEASURED / name)
    assert got.attrs["note"] == header.NoteString.decode().strip() and got.sizes["ping"] == len(pings)
    for number, ping in enumerate(pings):
        np.testing.assert_array_equal(got["amplitude"][number, 0], ping.data[0][::-1])
        np.testing.assert_array_equal(got["amplitude"][number, 1], ping.data[1])
    for variable, field, scale in (("longitude", "SensorXcoordinate", 1), ("latitude", "SensorYcoordinate", 1),
                                   ("heading", "SensorHeading", np.pi / 180), ("roll", "SensorRoll", np.pi / 180),
                                   ("speed", "SensorSpeed", 1852 / 3600), ("altitude", "SensorPrimaryAltitude", 1)):
        stored = np.array([getattr(ping, field) for ping in pings]) * scale
        known = np.isfinite(got[variable].values)
        np.testing.assert_allclose(got[variable].values[known], stored[known], rtol=1e-12)
        assert not stored[~known].any()


def test_a_recorded_line_is_drawn_in_steps_of_its_recorder(line, tmp_path):
    path, _ = line
    axes = mitsonar.plots.plot(mitsonar.read(path), path=tmp_path / "line.png")
    bars = [ax.get_ylabel() for ax in axes.figure.axes]
    assert any("dB re 1 step" in label for label in bars) and (tmp_path / "line.png").stat().st_size > 10_000


def test_pings_of_another_range_are_drawn_at_their_own_ranges(line):
    record = sidescan_lines.read(line[0])
    record["slant_range"][3] /= 3
    image = sidescan_lines.as_image(record)
    level = 20 * np.log10(np.maximum(record["amplitude"].values[3, 0], 0.5))
    np.testing.assert_allclose(image["level"][3, 0, :17], level[1::3], rtol=1e-5)
    assert np.isnan(image["level"][3, 0, 17:]).all() and np.isfinite(image["level"][4]).all()


def test_navigation_that_no_ping_header_has_comes_from_packets(tmp_path):
    record = sidescan(pings=20, bins=50).assign_attrs(crs="EPSG:32632")
    xtf.write(record, tmp_path / "line.xtf", start=1e9)
    whole = sidescan_lines.read(tmp_path / "line.xtf")
    raw = bytearray((tmp_path / "line.xtf").read_bytes())
    for at in range(1024, len(raw), 64):
        if raw[at:at + 3] == b"\xce\xfa\0":              # ping headers: places, pitch, roll, headings
            for first, last in ((124, 144), (160, 176), (204, 216)):
                raw[at + first:at + last] = bytes(last - first)
    (tmp_path / "line.xtf").write_bytes(raw)
    got = sidescan_lines.read(tmp_path / "line.xtf")
    assert got.attrs["navigation_from"] == "ping headers; longitude,latitude,heading,pitch,roll from packets"
    inside = slice(0, -1)                                # hundredths of a second may lie after the last packet
    for name, slack in (("longitude", 2e-7), ("latitude", 2e-7), ("heading", 1e-3), ("pitch", 1e-3), ("roll", 1e-3)):
        assert np.isfinite(got[name][inside]).all()
        np.testing.assert_allclose(got[name][inside], whole[name][inside], atol=slack)


def test_a_record_is_stored_as_netcdf_and_no_image(line, tmp_path):
    got = mitsonar.read(line[0])
    mitsonar.write(got, tmp_path / "line.nc")
    back = mitsonar.read(tmp_path / "line.nc")
    np.testing.assert_array_equal(back["amplitude"], got["amplitude"])
    assert back["amplitude"].dtype == np.uint16 and back.attrs["channels"] == got.attrs["channels"]
    with pytest.raises(ValueError, match="recorded sidescan is no image"):
        mitsonar.write(got, tmp_path / "line.exr")


def test_padding_beyond_the_memory_allowed_is_refused(line, monkeypatch):
    monkeypatch.setattr("mitsonar.io.sidescan_lines.record.MOST_BYTES", 1000)
    with pytest.raises(ValueError, match="samples take 4e-06 GB.*pings=slice"):
        sidescan_lines.read(line[0])


@pytest.mark.parametrize(("change", "words"), [
    (lambda raw: raw[:-70], "cut off"),
    (lambda raw: raw[:900], "header of 1024 bytes"),
    (lambda raw: raw[:1024], "no XTF file with sonar packets"),
    (lambda raw: raw[:1024] + b"\0" * 300, "no packet starts"),
])
def test_cut_and_broken_files_are_refused_in_one_sentence(line, change, words, tmp_path):
    bad = tmp_path / "bad.xtf"
    bad.write_bytes(change(line[0].read_bytes()))
    with pytest.raises(ValueError, match=words) as caught:
        sidescan_lines.read(bad)
    assert "\n" not in str(caught.value)


def test_flipped_bits_end_in_a_record_or_a_sentence(line):
    rng = np.random.default_rng(3)
    # most of a file is samples; its headers are in the first 1700 bytes
    refused = refusals(line[0], lambda bad: sidescan_lines.as_image(sidescan_lines.read(bad)),
                       "cannot read the sidescan record",
                       lambda size: [*rng.integers(0, size, 40), *rng.integers(0, 1700, 4)], rng)
    assert 10 < refused < COPIES
