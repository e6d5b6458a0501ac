"""Track files: what the columns mean, how they may be written, and which lines are refused by number."""
import datetime
import warnings

import numpy as np
import pytest

from mitsonar.io.tracks import tracks

PLAIN = "time,x,y,z,roll,pitch,heading\n0,1,2,-3,10,-20,350\n0.5,2,4,-3.5,0,0,370\n"


def written(folder, text, encoding="utf-8"):
    path = folder / "track.csv"
    path.write_bytes(text.encode(encoding))
    return path


@pytest.mark.parametrize("text", [
    PLAIN,
    PLAIN.replace("\n", "\r\n").rstrip(),
    "\ufeff" + PLAIN,
    PLAIN.replace(",", ";"),
    PLAIN.replace(",", "\t"),
    PLAIN.replace(",", " , "),
    "# towed by hand\n" + PLAIN.replace("\n", "\n\n") + "# end\n",
    PLAIN.replace("roll,pitch,heading", "Roll_deg,PITCH_DEG,heading_deg"),
    PLAIN.replace("z,", "depth,").replace("-3", "3"),
    PLAIN.replace("x,y", "Easting,NORTHING"),
    PLAIN.replace("x,y", "east,north"),
    "note,heading,pitch,roll,z,y,x,time\na,350,-20,10,-3,2,1,0\n\"b,c\",370,0,0,-3.5,4,2,0.5\n",
], ids=["plain", "crlf", "bom", "semicolon", "tab", "blanks", "comments", "suffixes", "depth", "easting", "east",
        "shuffled"])
def test_spellings_of_one_track(text, tmp_path):
    track = tracks.read(written(tmp_path, text))
    np.testing.assert_array_equal(track.time, [0, 0.5])
    np.testing.assert_array_equal(track.position, [[1, 2, -3], [2, 4, -3.5]])
    np.testing.assert_allclose(np.rad2deg([track.roll, track.pitch, track.heading]), [[10, 0], [-20, 0], [350, 370]])


def test_attitude_is_optional(tmp_path):
    track = tracks.read(written(tmp_path, "x,y,depth,time\n431000.25,5200000.5,7,3\n"))
    assert track.pings == 1 and not track.roll.any() and not track.pitch.any() and not track.heading.any()
    np.testing.assert_array_equal(track.position, [[431000.25, 5200000.5, -7]])


@pytest.mark.parametrize("columns", ["lat,lon", "LAT,Long", "latitude,longitude_deg"])
def test_degrees_by_any_name_go_before_eastings(columns, tmp_path):
    record = tracks.load(written(tmp_path, f"time,{columns},easting,northing,z\n0,54,8,431000,5200000,-1\n"))
    assert record.geographic and (record.y[0], record.x[0]) == (54, 8)


@pytest.mark.parametrize(("first", "second", "step"), [
    ("2012-08-21T10:11:12Z", "2012-08-21T10:11:12.125Z", 0.125),
    ("2012-08-21 10:11:12", "2012-08-21 10:11:13,5", 1.5),
    ("2012-08-21T10:11:12+00:00", "2012-08-21T12:11:12.25+0200", 0.25),
    ("2012-12-31T23:59:59Z", "2013-01-01T00:00:00Z", 1.0),
])
def test_iso_times_become_seconds_since_1970(first, second, step, tmp_path):
    track = tracks.read(written(tmp_path, f"time;x;y;z\n{first};0;0;-1\n{second};1;0;-1\n"))
    year = int(first[:4])
    assert datetime.datetime.fromtimestamp(track.time[0], datetime.timezone.utc).year == year
    assert track.time[1] - track.time[0] == step


@pytest.mark.parametrize(("text", "words"), [
    ("", "no header and no records"),
    ("time,x,y,z\n", "a header but no records"),
    ("time,x,z\n0,1,2\n", "the column y is missing; the header has time, x, z"),
    ("time,x,y,height\n0,1,2,3\n", "the column z is missing"),
    ("0,1,2,-3\n1,2,3,-3\n", "line 1: numbers where the names of columns belong"),
    ("time,x,x,y,z\n0,1,1,2,-3\n", "the column x is given twice"),
    ("time,x,y,z,roll,roll_deg\n0,1,2,-3,0,0\n", "the column roll is given twice"),
    ("time,x,y,z,depth\n0,1,2,-3,3\n", "both z and depth"),
    ("time,x,y,z\n0,1,2,-3\n\n1,nan,2,-3\n", "line 4: x is 'nan', which is not a finite number"),
    ("time,x,y,z\n0,1,2,-3\n1,,2,-3\n", "line 3: x is 'empty'"),
    ("time,x,y,z\n0,1,2,-3\n1,2,deep,-3\n", "line 3: y is 'deep'"),
    ("time,x,y,z\n0,1,2,-3\n1,2\n", "line 3: 2 fields, but the header names 4"),
    ("time,x,y,z\n0,1,2,-3\n2,1,2,-3\n1,1,2,-3\n", "line 4: time 1 is not later than 2 before it"),
    ("time,x,y,z\n0,1,2,-3\n0,1,2,-3\n", "line 3: time 0 is not later"),
    ("time,x,y,z\n0,1,2,3\n", "line 2: z = 3 m is above the sea surface"),
    ("time,x,y,depth\n0,1,2,-3\n", "line 2: depth = -3 m is above the sea surface"),
    ("time,x,y,z\n2012-08-21T10:00:00Z,1,2,-3\n5,1,2,-3\n", "line 3: time is '5', but the first record has an ISO"),
    ("time,x,y,z\n2012-13-21T10:00:00Z,1,2,-3\n", "line 2: time is '2012-13-21T10:00:00Z'"),
    ("time,x,y,z,pitch\n0,1,2,-3,120\n", "line 2: pitch is 120 degrees, beyond +-90"),
    ("time,x,y,z\n0,1,2,-3\n1,\"2,3,-3\n2,3,4,-3\n", "close the quotation marks"),
    ("time,x,y,z\n0,1,2,-3\n1,\"2\n3\",4,-3\n", "a field runs over several lines; close the quotation marks"),
    ("time,x,y,z\n0,1,2,-3\n1,\"2,3,-3\n2,\"3,4,-3\n", "close the quotation marks"),
])
def test_bad_files_are_refused_in_one_sentence(text, words, tmp_path):
    with pytest.raises(ValueError, match="track.csv") as caught:
        tracks.read(written(tmp_path, text))
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_what_is_no_text_file_is_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="no such file"):
        tracks.read(tmp_path / "missing.csv")
    with pytest.raises(ValueError, match="not a text file"):
        tracks.read(written(tmp_path, PLAIN, "utf-16"))
    with pytest.raises(ValueError, match="it is a folder; give the path of a CSV, XTF, SBET or POS MV file"):
        tracks.read(tmp_path)


def test_a_long_track_is_read_at_once(tmp_path):
    """A day at 1 Hz: the columns are turned to numbers whole, only ISO times one by one."""
    start = datetime.datetime(2020, 1, 1)
    lines = [f"{(start + datetime.timedelta(seconds=k)).isoformat()}Z,{k},0,-5" for k in range(20000)]
    track = tracks.read(written(tmp_path, "time,x,y,z\n" + "\n".join(lines)))
    assert track.pings == 20000 and track.speed == pytest.approx(1)


def towed(fix=1.0, stop=0.0, pings=200, begin=0.35):
    """Times [s] at 10 Hz, and places (P, 2) [m] as they are and as they are recorded, one fix in so many seconds."""
    time = 0.1 * np.arange(pings)

    def true(when):
        sailed = 2.0 * np.maximum(when - stop, 0.0)
        return np.stack([sailed, 10 * np.sin(sailed / 40)], -1)

    return time, true(time), true(np.floor((time + begin) / fix + 1e-9) * fix - begin)


@pytest.mark.parametrize("fix", [0.25, 1.0, 3.0])
@pytest.mark.parametrize("suffix", ["time", "latitude"])
def test_repeated_fixes_are_used_once_each_and_said(tmp_path, fix, suffix):
    # A fix is taken for new when a record first has it: up to a record late, 0.1 s x 2 m/s. The speed of the bare
    # record is 0 nine times and then ten times as fast.
    time, true, recorded = towed(fix)
    path = tmp_path / "track.csv"
    if suffix == "latitude":
        rows = np.column_stack([time, 50 + recorded[:, 1] / 111_200, 0.01 + recorded[:, 0] / 71_700, 0 * time - 5])
        head = "time,latitude,longitude,z"
    else:
        rows, head = np.column_stack([time, recorded, 0 * time - 5]), "time,x,y,z"
    np.savetxt(path, rows, delimiter=",", header=head, comments="", fmt="%.12g")
    with pytest.warns(UserWarning, match="repeats positions: .* fixes, one in .* s, stand in 200 records"):
        track = tracks.read(path)
    speed = np.hypot(*np.diff(track.position[:, :2], axis=0).T) / 0.1
    assert (0.5 if fix < 1 else 1.5) < speed.min() and speed.max() < (4.0 if fix < 1 else 2.6)
    if suffix == "time":
        assert np.hypot(*(track.position[:, :2] - true).T).max() < 0.35


def test_a_platform_that_stands_and_a_track_of_new_places_are_as_recorded(tmp_path):
    time, true, _ = towed(stop=8.0)
    still = np.column_stack([time, 0 * true, 0 * time - 5])
    for name, rows in (("goes", np.column_stack([time, true, 0 * time - 5])), ("still", still)):
        np.savetxt(tmp_path / f"{name}.csv", rows, delimiter=",", header="time,x,y,z", comments="", fmt="%.12g")
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            track = tracks.read(tmp_path / f"{name}.csv")
        assert np.allclose(track.position[:, :2], rows[:, 1:3], rtol=0, atol=1e-9, equal_nan=False)
    time, true, recorded = towed(stop=8.0)
    rows = np.column_stack([time, recorded, 0 * time - 5])
    np.savetxt(tmp_path / "starts.csv", rows, delimiter=",", header="time,x,y,z", comments="", fmt="%.12g")
    with pytest.warns(UserWarning, match="repeats positions"):
        track = tracks.read(tmp_path / "starts.csv")
    assert np.hypot(*(track.position[:, :2] - true).T).max() < 0.6 and abs(track.position[:70, 0]).max() < 0.05


def test_one_line_of_a_file_of_lines_is_read_without_its_run_in(tmp_path):
    path = written(tmp_path, "line,point,x,y\n1,start,0,0\n1,end,9,0\n2,run-in,10,2\n2,start,9,2\n2,end,0,2\n")
    assert tracks.load(path, 2).x.tolist() == [9, 0] and tracks.load(path).x.size == 5
    with pytest.raises(ValueError, match="cannot read line 3 of the track .*: its lines are 1, 2"):
        tracks.load(path, 3)
    with pytest.raises(ValueError, match="no column line"):
        tracks.load(written(tmp_path, "x,y\n0,0\n1,1\n"), 1)
