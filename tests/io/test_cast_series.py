"""Several casts: of a folder, of a file with several, of recorded lines, with their times and places."""
import datetime

import numpy as np
import pytest

from mitsonar.io import casts
from mitsonar.io.casts.series import read_series
from mitsonar.io.survey_lines import write
from tests.inputs.soundings_line import soundings_line

SECTIONS = """[SVP_VERSION_2]
two.svp
Section 2012-234 10:11:12 44:06:00 -68:30:00
0 1500
20 1490
Section 2012-234 12:11:12 44:07:30 -68:30:00
0 1502
20 1480
"""


def test_sections_of_a_file_have_their_times_and_places(tmp_path):
    (tmp_path / "two.svp").write_text(SECTIONS)
    for path in (tmp_path / "two.svp", tmp_path):
        first, second = read_series(path, casts.read)
        assert second.time - first.time == 7200 and second.place == (44.125, -68.5) and second.geographic
        assert (first.name, second.name) == ("two.svp:0", "two.svp:1")
        assert second.cast.profile.sound_speed.tolist() == [1502, 1480]
    assert first.time == datetime.datetime(2012, 8, 21, 10, 11, 12, tzinfo=datetime.timezone.utc).timestamp()


@pytest.mark.parametrize("suffix", ["kmall", "gsf"])
def test_a_recorded_line_gives_its_casts(tmp_path, suffix):
    line = soundings_line()
    write(line, tmp_path / f"line.{suffix}")
    one, = read_series(tmp_path / f"line.{suffix}", casts.read)
    assert np.allclose(one.cast.profile.sound_speed, line["cast_sound_speed"].values, atol=0.1)
    assert one.geographic and abs(one.place[0]) <= 90 and one.time > 1e8


@pytest.mark.parametrize("suffix", ["kmall"])
def test_all_casts_of_a_line_count(tmp_path, suffix):
    """A line of two files, one after the other, has both casts."""
    path, line = tmp_path / "line.kmall", soundings_line()
    write(line, path)
    first = path.read_bytes()
    write(line.assign(cast_sound_speed=line["cast_sound_speed"] + 5.0), path)
    path.write_bytes(first + path.read_bytes())
    one, other = read_series(path, casts.read)
    np.testing.assert_allclose(other.cast.profile.sound_speed - one.cast.profile.sound_speed, 5.0, atol=1e-3)


def test_a_list_gives_times_and_places_to_plain_tables(tmp_path):
    for name in "ab":
        (tmp_path / f"{name}.csv").write_text("depth,speed\n0,1500\n9,1490\n")
    (tmp_path / "list.csv").write_text("# of a day\nfile;time;x;y\na.csv;2012-08-21T10:00:00Z;1;2\n"
                                       "b.csv;2012-08-21T11:00:00Z;3;4\n")
    one, other = read_series(tmp_path / "list.csv", casts.read)
    assert other.time - one.time == 3600 and other.place == (3.0, 4.0) and not other.geographic


@pytest.mark.parametrize("name, content, message", [
    ("bad.csv", b"\x00\x01\x02", "it is binary"), ("one.kmall", b"\x10\x00\x00\x00#IIP", "cannot read .*one.kmall")])
def test_what_is_no_cast_is_named(tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=message):
        read_series(tmp_path, casts.read)
