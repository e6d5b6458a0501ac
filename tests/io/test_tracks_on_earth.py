"""Tracks in latitude and longitude, way points, heave: what is read, and where on Earth and in a scene it lies.

Places: PROJ's transverse Mercator against its own geodesics, an independent computation: distances within the scale
error of UTM (4e-4 on the central meridian) or of a frame about the track (1e-8 within a kilometre). Convergence of UTM:
tan γ = tan(λ - λ0) sin φ on the sphere, within 1e-5 rad of it on the ellipsoid this close to the meridian.
"""
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from mitsonar.io.tracks import tracks
from mitsonar.io.tracks.navigation import Frame, Waypoints, course

BAY = "time,latitude,longitude,depth,heading\n0,37.75,-122.38,4,90\n1,37.75,-122.37998,4,90\n"
UTM = Frame(crs="EPSG:32610", origin=(554000.0, 4178000.0))


def written(folder, text, encoding="utf-8"):
    path = folder / "track.csv"
    path.write_bytes(text.encode(encoding))
    return path


def test_degrees_are_projected_to_the_bathymetry(tmp_path):
    track = tracks.read(written(tmp_path, BAY), frame=UTM)
    north, east = 37.75, np.deg2rad(-122.38 + 123)
    # on the sphere of the mean radius, for a place that is right within 0.5 % of its distance from the meridian
    assert track.position[0, 0] + 554000 == pytest.approx(500000 + 6.371e6 * east * np.cos(np.deg2rad(north)), abs=300)
    assert track.position[0, 2] == -4
    assert track.position[1, 0] - track.position[0, 0] == pytest.approx(1.762, abs=0.002)
    convergence = np.arctan(np.tan(east) * np.sin(np.deg2rad(north)))
    np.testing.assert_allclose(track.heading, np.pi / 2 - convergence, atol=1e-5)
    # a heading to the east of true north, seen from the grid, is that of the way itself
    np.testing.assert_allclose(course(track.time, track.position[:, :2]), track.heading, atol=1e-5)


@pytest.mark.parametrize("place", [(37.75, -122.38), (-54.8, -68.3), (78.2, 15.6), (0.01, 179.999)])
def test_frames_about_a_place_are_true_to_scale_and_north(place):
    import pyproj

    latitude, longitude = place[0] + np.array([0, 0.002, 0]), place[1] + np.array([0, 0, 0.004])
    position, convergence = Frame.about(*place).project(latitude, longitude)
    bearing, _, length = pyproj.Geod(ellps="WGS84").inv([place[1]] * 3, [place[0]] * 3, longitude, latitude)
    np.testing.assert_allclose(np.hypot(*position.T), length, rtol=1e-7, atol=1e-6)
    np.testing.assert_allclose(position[1], [0, length[1]], atol=1e-5)
    assert abs(convergence[0]) < 1e-9 and np.arctan2(*position[2]) == pytest.approx(np.deg2rad(bearing[2]), abs=1e-6)


def test_without_a_frame_degrees_lie_about_the_middle(tmp_path):
    track = tracks.read(written(tmp_path, BAY))
    np.testing.assert_allclose(track.position[:, :2].mean(0), 0, atol=1e-6)
    np.testing.assert_allclose(track.heading, np.pi / 2, atol=1e-6)


def test_a_track_across_the_date_line_is_whole(tmp_path):
    track = tracks.read(written(tmp_path, "time,lat,lon,z\n0,10,179.9999,-3\n5,10,-179.9999,-3\n"))
    assert track.length == pytest.approx(21.93, abs=0.02)
    np.testing.assert_allclose(track.heading, np.pi / 2, atol=1e-6)


@pytest.mark.parametrize(("text", "geographic"), [
    ("time,lat,lon,depth\n0,45,9,2\n", True), ("time,Latitude_deg,LONGITUDE_DEG,depth\n0,45,9,2\n", True),
    ("time,latitude,longitude,depth,y,x\n0,45,9,2,8,7\n", False),
])
def test_metres_go_before_degrees(text, geographic, tmp_path):
    record = tracks.load(written(tmp_path, text))
    assert record.geographic == geographic
    assert (record.x[0], record.y[0]) == ((9, 45) if geographic else (7, 8))


def test_heave_goes_up(tmp_path):
    track = tracks.read(written(tmp_path, "time,x,y,z,heave\n0,0,0,-5,0.25\n1,1,0,-5,-0.5\n"))
    np.testing.assert_allclose(track.position[:, 2], [-4.75, -5.5])


def test_a_heading_that_nobody_wrote_is_the_course(tmp_path):
    lines = [f"{t},{10 + 2 * min(t, 10)},{2 * max(t - 10, 0)},-5" for t in range(21)]
    track = tracks.read(written(tmp_path, "time,x,y,z\n" + "\n".join(lines)))
    np.testing.assert_allclose(np.rad2deg(track.heading[[0, 5, 15, 20]]), [90, 90, 0, 0], atol=1e-9)
    # where it stands still, the last course counts, and north if there was none
    assert course([0, 9, 18, 27], [[0, 0], [9, 0], [9, 0], [9, 0.1]])[-1] == pytest.approx(np.pi / 2)
    assert not course([0.0, 1.0], np.zeros((2, 2))).any() and not course([0.0], np.zeros((1, 2))).any()


@pytest.mark.parametrize("text", ["0 0, 50 0, 50 30", "0 0;50 0;50 30;", "0 0 , 50.0 0e0,\n50 +30"])
def test_way_points_in_metres(text):
    points = tracks.waypoints(text)
    assert not points.geographic and points.z is None
    assert points.placed().tolist() == [[0, 0], [50, 0], [50, 30]]


def test_way_points_in_degrees_with_depths():
    points = tracks.waypoints("37.75N 122.38W -3, 37.751n 122.38 w -4")
    assert points.geographic and points.z.tolist() == [-3, -4]
    assert points.x.tolist() == [-122.38, -122.38] and points.y.tolist() == [37.75, 37.751]
    assert np.diff(points.placed(UTM)[:, 1]) == pytest.approx(111, abs=0.2)


def test_way_points_from_a_file(tmp_path):
    points = tracks.load(written(tmp_path, "name,x,y,depth\nA,0,0,3\nB,9,0,4\n"))
    assert isinstance(points, Waypoints) and points.z.tolist() == [-3, -4]
    assert tracks.load(written(tmp_path, "lat,lon\n1,2\n3,4\n")).geographic
    with pytest.raises(ValueError, match="column time is missing, so it holds way points; add the times, or sail"):
        tracks.read(tmp_path / "track.csv")


@pytest.mark.parametrize("text", ["", "0", "0 0 0 0", "a b", "0 0, 1", "91N 0E", "0N 361E", "0 0 1", "0 nan", "1N 2",
                                  "0 0,,1 1", "1..2N 3E", "0 0, inf 1", "37.75 N 122.38"])
def test_way_points_that_are_none(text):
    with pytest.raises(ValueError, match=r"way point \d is .*write each as x and y"):
        tracks.waypoints(text)


@pytest.mark.parametrize("text", ["0 0, 1N 1E", "0 0 -1, 1 1"])
def test_way_points_that_are_not_alike(text):
    with pytest.raises(ValueError, match="not written alike"):
        tracks.waypoints(text)


@pytest.mark.parametrize(("text", "words"), [
    ("time,lat,lon,z\n0,91,0,-1\n", "line 2: latitude is 91 degrees, beyond +-90"),
    ("time,lat,lon,z\n0,-122.38,37.75,-1\n", "line 2: latitude is -122.38 degrees"),
    ("time,lat,lon,z\n0,5,361,-1\n", "line 2: longitude is 361 degrees, beyond +-360"),
    ("time,lat,z\n0,5,-1\n", "the column longitude is missing"),
    ("time,lat,latitude,lon,z\n0,5,5,5,-1\n", "the column latitude is given twice"),
    ("lat,lon,heading\n5,5,9\n", "the column time is missing"),
    ("x,y,z\n0,0,-1\n1,1,1\n", "line 3: z = 1 m is above the sea surface"),
    ("time,x,y,z,heave\n0,0,0,-1,high\n", "line 2: heave is 'high'"),
    ("time,lat,lon\n0,1,2\n", "the column z is missing"),
])
def test_bad_files_are_refused_in_one_sentence(text, words, tmp_path):
    with pytest.raises(ValueError, match="track.csv") as caught:
        tracks.load(written(tmp_path, text))
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_files_that_would_not_fit_into_memory(tmp_path, monkeypatch):
    monkeypatch.setattr(tracks, "LARGEST_FILE", 20)
    with pytest.raises(ValueError, match="MB, more than .*; thin it out or split it"):
        tracks.load(written(tmp_path, BAY))


@pytest.mark.parametrize(("frame", "words"), [
    (Frame(crs=""), "names no coordinate system"), (Frame(crs="EPSG:4326"), "is not one in metres"),
])
def test_frames_that_hold_no_degrees(frame, words, tmp_path):
    with pytest.raises(ValueError, match=words):
        tracks.read(written(tmp_path, BAY), frame=frame)


CELL = st.one_of(st.integers(-100, 3).map(str), st.floats().map(repr),
                 st.sampled_from(["", "1e400", "0x1", "\u0661", "2012-08-21T10:00:00Z", '"', "-", "37N"]))
HEADERS = [names.split() for names in ("time x y z", "time lat lon depth heading", "x y", "lat lon z",
                                       "time x y z heave", "time x y z roll_deg pitch", "time x x z", "note lat")]


@settings(derandomize=True, max_examples=150, deadline=None)
@given(st.sampled_from(HEADERS), st.lists(st.lists(CELL, min_size=4, max_size=6), max_size=4),
       st.sampled_from([",", ";", "\t"]))
def test_whatever_a_table_holds(tmp_path_factory, names, rows, divider):
    path = tmp_path_factory.getbasetemp() / "fuzz.csv"
    path.write_text("\n".join(divider.join(row) for row in [names, *rows]), encoding="utf-8")
    try:
        tracks.load(path).placed()
    except ValueError as error:
        assert "\n" not in str(error)


@settings(derandomize=True, max_examples=150, deadline=None)
@given(st.text(alphabet="0123456789.,; -+eNSEWnan\n\u0661", max_size=40))
def test_whatever_way_points_are_written(text):
    try:
        assert len(tracks.waypoints(text).x) >= 1
    except ValueError as error:
        assert str(error).startswith(("way point", "the way points"))
