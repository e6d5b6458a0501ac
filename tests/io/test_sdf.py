"""SDF pages made byte by byte, by the layout that two public readers agree on; no recorded file was at hand.

One of them (octave-sss) read such files alike: samples, times, numbers, speed and frequency exactly.
"""
import struct

import numpy as np
import pytest
import sidescan_by_bytes as by_bytes
from flipped_bits import COPIES, refusals

from mitsonar.io import sidescan_lines

RNG = np.random.default_rng(6)
ROWS = RNG.integers(0, 1 << 20, (5, 2, 40))


@pytest.fixture
def line(tmp_path):
    """The path of a file of five pings of both frequencies, and a page of bathymetry."""
    pages = [by_bytes.page(1, [], [], version=3503)]
    for number, (port, starboard) in enumerate(ROWS):
        pages += [by_bytes.page(30 + number, port[:10], starboard[:10], version=3501, khz=450),
                  by_bytes.page(30 + number, port, starboard, second=5 + number)]
    (tmp_path / "line.sdf").write_bytes(b"".join(pages))
    return tmp_path / "line.sdf"


def test_pages_come_back_by_frequency_with_their_navigation(line):
    got = sidescan_lines.read(line, frequency=900e3)
    np.testing.assert_array_equal(got["amplitude"], ROWS)
    assert got.attrs["format"] == "sdf" and got.attrs["channel_numbers"] == [2, 3] and got.attrs["bits"] == 32
    assert got.attrs["left_out"] == ["channels 0 (port, 450 kHz), 1 (starboard, 450 kHz)", "1 pages of version 3503"]
    for name, value in (("longitude", -8), ("latitude", 47), ("altitude", 6.5), ("heading", np.radians(359.5)),
                        ("pitch", np.radians(-2)), ("roll", np.radians(3)), ("speed", 2.5), ("sound_speed", 1480),
                        ("sensor_depth", 21), ("slant_range", 50), ("sample_interval", 1 / 40_000)):
        np.testing.assert_allclose(got[name], value, rtol=1e-6)
    start = np.datetime64("2024-02-29T23:59:05.25").astype("datetime64[ms]").astype(float) / 1e3
    np.testing.assert_allclose(got["ping_time"], start + np.arange(5), rtol=0, atol=1e-6)
    assert got["ping_number"].values.tolist() == [30, 31, 32, 33, 34]


@pytest.mark.parametrize(("change", "words"), [
    (lambda raw: by_bytes.page(1, [1, 2], [3, 4], version=5001), "of the versions 5001, and those of the UUV-3500"),
    (lambda raw: raw[:-3], "cut off"),
    (lambda raw: raw[:4] + struct.pack("<I", 2**32 - 1) + raw[8:], "damaged"),
    (lambda raw: raw + b"\0" * 600, "no page starts"),
    (lambda raw: raw.replace(struct.pack("<I", 40) + ROWS[2, 0].astype("<u4").tobytes(), struct.pack("<I", 2**31)
                             + ROWS[2, 0].astype("<u4").tobytes()), "2147483648 samples to port"),
])
def test_cut_and_broken_pages_are_refused_in_one_sentence(line, change, words):
    line.write_bytes(change(line.read_bytes()))
    with pytest.raises(ValueError, match=words) as caught:
        sidescan_lines.read(line, channels=(2, 3))
    assert "\n" not in str(caught.value)


def test_flipped_bits_of_pages_end_in_a_record_or_a_sentence(line):
    rng = np.random.default_rng(7)
    refused = refusals(line, lambda bad: sidescan_lines.as_image(sidescan_lines.read(bad)),
                       "cannot read the sidescan record",
                       lambda size: rng.integers(0, size, 12), rng)
    assert 5 < refused < COPIES
