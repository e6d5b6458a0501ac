"""Damaged survey lines: cut, empty, changed, or lying about lengths; one sentence, and no more memory than the file."""
import resource
from pathlib import Path

import numpy as np
import pytest

import mitsonar
from mitsonar.io.survey_lines import reading
from tests.inputs.all_file import all_file, wcd_file
from tests.inputs.hsx_file import hsx_file
from tests.inputs.s7k_file import s7k_file, unsummed
from tests.inputs.soundings_line import soundings_line
from tests.inputs.xtf_lines import xtf_file

MEASURED = Path(__file__).resolve().parents[2] / "../shared/data/measured/multibeam"
REAL = ("em2042_os01.kmall", "em2042_os01.kmwcd", "gsf_3_08.gsf")
VARIANTS, OF_REAL = 200, 60


def damaged(raw, chance):
    """Return the bytes of a file after one of five accidents."""
    raw, kind = raw.copy(), int(chance.integers(5))
    if kind == 0:
        return raw[:chance.integers(raw.size)]
    if kind == 1:                                   # some bytes of one value
        raw[chance.integers(0, raw.size, chance.integers(1, 200))] = chance.integers(256)
    elif kind == 2:                                 # a largest length, or a NaN
        start = chance.integers(0, min(raw.size, 20_000))
        raw[start:start + 4] = 255
    elif kind == 3:                                 # words of their own
        for start in chance.integers(0, raw.size - 1, 20):
            raw[start:start + 2] = chance.integers(0, 256, 2)
    else:                                           # bits of the heads
        raw[chance.integers(0, min(raw.size, 3000), 3)] ^= np.uint8(1 << chance.integers(8))
    return raw


def sources(name):
    """Return the bytes of a file, and of the one that must stand beside it."""
    if name == "line.all":
        return np.frombuffer(all_file(3), np.uint8), {}
    if name.endswith(".s7k"):
        return np.frombuffer(s7k_file(3) if name == "line.s7k" else unsummed(s7k_file(3)), np.uint8), {}
    if name.endswith(".hsx"):
        return np.frombuffer(hsx_file(3, shape=name[0]), np.uint8), {}
    if name.endswith(".xtf"):
        return np.frombuffer(xtf_file(3, kind=name[:-4]), np.uint8), {}
    if name == "line.wcd":
        return np.frombuffer(wcd_file(3), np.uint8), {"line.all": all_file(3)}
    if not (MEASURED / name).is_file():
        pytest.skip("the shared survey lines are not here")
    beside = {name.replace("wcd", "all"): (MEASURED / name.replace("wcd", "all")).read_bytes()} if "wcd" in name else {}
    return np.fromfile(MEASURED / name, np.uint8), beside


@pytest.mark.parametrize("name", ["line.all", "line.wcd", "line.s7k", "unsummed.s7k", "65.xtf",
                                  "7027.xtf", "7006.xtf", "2.hsx", "3.hsx", *REAL])
def test_a_damaged_line_is_read_or_refused_in_one_sentence(tmp_path, name):
    raw, beside = sources(name)
    for other, content in beside.items():
        (tmp_path / other).write_bytes(content)
    chance, refused = np.random.default_rng(1), 0
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    variants = OF_REAL if name in REAL else VARIANTS
    for _ in range(variants):
        damaged(raw, chance).tofile(tmp_path / name)
        try:
            reading.read(tmp_path / name)
        except ValueError as error:
            refused += 1
            assert str(error).startswith(f"cannot read {tmp_path / name}: ") and "\n" not in str(error)
    assert variants / 6 < refused < variants
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200_000         # kB


@pytest.mark.parametrize("name, content, sentence", [
    ("a.all", b"", "it is empty"),
    ("a.kmall", b"#IIP", "it is another file, not a line of soundings; give an .all, .kmall, .gsf, .s7k, .xtf or .hsx"),
    ("a.exr", b"\x76\x2f\x31\x01\2\0\0\0", "it is an OpenEXR image, not a line of soundings"),
    ("a.gsf", b"\0\0\0\x0c\0\0\0\1GSF-v03.09\0\0", "it has no pings of soundings"),
    ("a.gsf", b"\0\0\0\x0c\0\0\0\1GSF-v03.09\0\0" + b"\0\0\0\x40\0\0\0\2", "it is cut: its last record, at byte 20"),
    ("a.gsf", b"\0\0\0\x0c\0\0\0\1GSF-v03.09\0\0" + bytes(4000), "it is damaged at byte 20: there is no record"),
    ("a.all", b"\x40\0\0\0\2N" + bytes(20), "it is cut: its last datagram, at byte 0, has 26 of 68 bytes"),
    ("a.all", all_file(1)[:-40], "copy the file again"),
    ("a.all", all_file(1).replace(b"\0\0\0\2U", b"\0\0\0\2V"), "it has no cast of sound speed"),
    ("a.all", all_file(1).replace(b"\0\0\0\2P", b"\0\0\0\2Q"), "it has no position of the vessel"),
    ("a.all", all_file(1).replace(b"\0\0\0\2X", b"\0\0\0\2D"), "of an older kind"),
    ("a.all", all_file(1, beams=5000), "its ping 7 has 5000 beams"),
    ("a.kmall", b"\x18\0\0\0#SPO" + bytes(12) + b"\x18\0\0\0", "it has no soundings"),
])
def test_what_is_no_line_is_said(tmp_path, name, content, sentence):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=sentence):
        reading.read(tmp_path / name)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_soundings_whose_time_is_no_number_are_not_valid(tmp_path, value):
    good = all_file(1)
    (tmp_path / "a.all").write_bytes(good)
    line = reading.read(tmp_path / "a.all")
    time = np.float32(line["travel_time"].values[0, 2])
    (tmp_path / "a.all").write_bytes(good.replace(time.tobytes(), np.float32(value).tobytes(), 1))
    spoilt = reading.read(tmp_path / "a.all")
    assert line["valid"].values[0, 2] and spoilt["valid"].values.sum() == line["valid"].values.sum() - 1
    assert np.isfinite(spoilt["travel_time"].values[spoilt["valid"].values]).all()


def test_a_huge_hole_is_refused_at_once(tmp_path):
    for name, head in (("a.all", all_file(1)), ("a.gsf", b"\0\0\0\x0c\0\0\0\1GSF-v03.09\0\0")):
        with open(tmp_path / name, "wb") as stream:
            stream.write(head)
            stream.truncate(1 << 40)
        with pytest.raises(ValueError, match="damaged"):
            reading.read(tmp_path / name)


def test_a_cast_that_claims_more_points_than_it_has(tmp_path):
    """The words of the library's reader, such as "buffer is smaller than requested size", do not reach the user."""
    mitsonar.write(soundings_line(2, 6, column=False), tmp_path / "a.gsf")
    raw, place = bytearray((tmp_path / "a.gsf").read_bytes()), 0
    while raw[place + 4:place + 8] != b"\0\0\0\3":      # by sizes, to the cast
        place += 8 + int.from_bytes(raw[place:place + 4], "big")
    raw[place + 32:place + 36] = (1000).to_bytes(4, "big")
    (tmp_path / "a.gsf").write_bytes(raw)
    with pytest.raises(ValueError, match="a.gsf: a record of type 3 is damaged or cut short; export the line again"):
        reading.read(tmp_path / "a.gsf")
