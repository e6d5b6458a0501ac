"""The command `bag`: bags of records, and one sentence about what is wrong."""
import sys

import numpy as np
import pytest
from read_bag import one, picture, read
from soundings_line import soundings_line
from synthetic_sidescan import sidescan

import mitsonar
from mitsonar.cli import main as cli
from mitsonar.io.bags import bag

pytest.importorskip("rosbags", reason="rosbags is not installed")


@pytest.fixture
def records(folder):
    """A sidescan's image and a line of soundings in the current folder."""
    image, line = sidescan(pings=4, bins=20), soundings_line(pings=2)
    mitsonar.io.write(image, "side.exr")
    mitsonar.io.write(line, "line.nc")
    return image, line


def test_a_record_becomes_a_bag_and_what_is_in_it_is_said(records, capfd):
    assert cli.main(["bag", "side.exr", "-o", "a.mcap", "--start", "2026-05-01T10:00:00Z"]) == 0
    out, err = capfd.readouterr()
    assert out == "a.mcap\n" and err.count("\n") == 1 and "4 of /sonar/image" in err
    stamp, message = read("a.mcap")["/sonar/image"][1]
    assert stamp == round((bag.seconds_of("2026-05-01T10:00:00Z") + 0.1) * 1e9)
    np.testing.assert_array_equal(picture(message.image), records[0]["level"].values[1].T)


def test_topics_of_several_records_have_their_names(records, capfd):
    assert cli.main(["bag", "side.exr", "line.nc", "-o", "a.mcap"]) == 0
    messages = read("a.mcap")
    assert {"/side/image", "/line/detections", "/line/odometry", "/side/odometry", "/tf"} <= set(messages)
    assert one(messages, "/side/image").header.frame_id == "side/sonar"
    assert one(messages, "/line/odometry").child_frame_id == "line/base_link"


def test_what_is_wrong_is_said_in_one_sentence_and_leaves_no_file(records, refusal, folder):
    (folder / "notes.txt").write_text("notes")
    (folder / "cut.exr").write_bytes((folder / "side.exr").read_bytes()[:2000])
    (folder / "empty.nc").write_bytes(b"")
    for words, *arguments in (("must end in .mcap", "side.exr", "-o", "a.bag"),
                              ("there is no such file", "none.nc", "-o", "a.mcap"),
                              ("notes.txt", "notes.txt", "-o", "a.mcap"),
                              ("cut.exr", "cut.exr", "-o", "a.mcap"),
                              ("empty.nc", "empty.nc", "-o", "a.mcap"),
                              ("cut.exr", "side.exr", "cut.exr", "-o", "a.mcap"),
                              ("/side/", "side.exr", "side.exr", "-o", "a.mcap"),
                              ("--cell draws fans", "side.exr", "-o", "a.mcap", "--cell", "1"),
                              ("--start", "side.exr", "-o", "a.mcap", "--start", "1800-01-01"),
                              ("does not exist", "side.exr", "-o", "none/a.mcap")):
        assert words in refusal("bag", *arguments)


def test_signals_have_no_message(folder, refusal):
    import xarray as xr

    signals = xr.DataArray(np.ones((1, 1, 2, 4), np.complex64), dims=("ping", "tx", "rx", "sample"), name="signals")
    mitsonar.io.write(signals, "signals.nc")
    assert "signals of elements have no message" in refusal("bag", "signals.nc", "-o", "a.mcap")


def test_without_rosbags_the_command_says_what_to_install(records, refusal, monkeypatch):
    bag.typestore.cache_clear()
    monkeypatch.setitem(sys.modules, "rosbags", None)
    assert 'pip install "mitsonar[ros]"' in refusal("bag", "side.exr", "-o", "a.mcap")


def test_a_bag_that_fails_midway_leaves_the_older_file(records, folder, monkeypatch):
    (folder / "a.mcap").write_bytes(b"older")

    def fails(*_, **__):
        yield from bag.messages(records[0])
        raise ValueError("no more pings")
    monkeypatch.setattr(bag, "of_parts", fails)
    assert cli.main(["bag", "side.exr", "-o", "a.mcap"]) == 2
    assert (folder / "a.mcap").read_bytes() == b"older"
    assert {path.name for path in folder.iterdir()} == {"scene.xml", "side.exr", "line.nc", "a.mcap"}
