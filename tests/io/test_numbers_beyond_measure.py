"""Numbers that no sea, ship or memory holds: refused in a sentence of bearable length."""
import numpy as np
import pytest

from mitsonar.device.sentences import sentence, shortened
from mitsonar.io.tracks import tracks
from mitsonar.sonar.motion.track import Track
from mitsonar.water.profile import SoundSpeedProfile


def test_words_of_bearable_length_stay():
    text = f"cannot read {'/folder' * 40}/file.xml: it is a folder"
    assert shortened(text) == text


@pytest.mark.parametrize("text", ["9" * 10_000, "x = " + "7" * 400 + " m", "a " * 200 + "b" * 5000 + " c"])
def test_the_middle_of_long_words_is_left_out(text):
    said = sentence(ValueError(text))
    assert len(said) < 520 and said.startswith(text[:60]) and said.endswith(text[-5:]) and "..." in said


def test_a_sentence_cannot_move_the_cursor_of_a_terminal():
    assert sentence(ValueError("balance.\x1b[31m\n\u202eb is unknown")) == "balance.?[31m ?b is unknown"


def test_the_middle_of_a_long_sentence_is_left_out():
    said = sentence(ValueError(f"the attribute frequency is {list(range(1_000_000))}, not a number; mend it"))
    assert len(said) < 3000 and said.startswith("the attribute frequency is [0, 1, 2") and said.endswith("; mend it")


@pytest.mark.parametrize("depth", [1e7, 1e30, 1e300, np.inf])
def test_depths_of_a_profile(depth):
    with pytest.raises(ValueError, match=r"depth\[1\] "):
        SoundSpeedProfile([0, depth], [1500, 1490])


@pytest.mark.parametrize("name, value, words", [
    ("time", 1e300, "line 3: time is 1e\\+300 s, and no time lies beyond"),
    ("x", 1e30, "line 3: x is 1e\\+30 m, farther than any place on Earth"),
    ("z", -1e300, "line 3: z is -1e\\+300 m, farther than any place on Earth"),
])
def test_times_and_places_of_a_track_file(tmp_path, name, value, words):
    record = {"time": 9, "x": 0, "y": 0, "z": -9} | {name: value}
    (tmp_path / "t.csv").write_text("time,x,y,z\n0,0,0,-9\n" + ",".join(map(str, record.values())) + "\n")
    with pytest.raises(ValueError, match=words):
        tracks.read(tmp_path / "t.csv")


@pytest.mark.parametrize("name, value, words", [("time", [0, 1e300], "no time lies beyond"),
                                                ("position", [[0, 0, -9], [0, 1e30, -9]], "no place on Earth")])
def test_times_and_places_of_a_track(name, value, words):
    fields = {"time": [0.0, 1], "position": [[0.0, 0, -9], [1, 0, -9]], "roll": np.zeros(2), "pitch": np.zeros(2),
              "heading": np.zeros(2)}
    Track(**fields)
    with pytest.raises(ValueError, match=words):
        Track(**{**fields, name: value})
