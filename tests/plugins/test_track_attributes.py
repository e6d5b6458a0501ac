"""Where sensors go by their attributes: way points, degrees, XTF, motion, the lever arm, and what contradicts itself.

The seabed is a rectangle 30 m down, 400 m wide, about the origin; positions are exact but for float32 geometry, 1e-4 m.
"""
import numpy as np
import pytest

KNOT = 1852 / 3600
HEADER = "time,x,y,z,roll,pitch,heading\n"
UTM = (554000.0, 4178000.0), "EPSG:32610"
BAY = "time,lat,lon,depth,heading\n0,37.75,-122.38,9,90\n20,37.75,-122.3796,9,90\n"


@pytest.fixture
def sensor(make):
    """Make a sidescan, or another kind, of attributes."""
    def run(kind="sidescan", **attributes):
        return make(kind, medium={"type": "seawater"}, film={"type": "sonar_film", "range": 50.0}, **attributes)
    return run


@pytest.fixture
def refused(refusal):
    """Return the sentence about attributes that must be refused."""
    return lambda **attributes: refusal("sidescan", medium={"type": "seawater"}, film={"type": "sonar_film"},
                                        **attributes)


@pytest.fixture
def file(tmp_path):
    """Write a track, give its name."""
    def run(text, name="track.csv"):
        (tmp_path / name).write_text(text)
        return str(tmp_path / name)
    return run


def geometry(depth=30.0, half=200.0, slope=0.0):
    import mitsuba as mi

    from mitsonar.scene.geometry import Geometry

    T = mi.ScalarTransform4f
    bed = {"type": "rectangle", "to_world": T().translate([0, 0, -depth]).rotate([1, 0, 0], slope).scale(half)}
    return Geometry(mi.load_dict({"type": "scene", "bed": bed}))


def passage(sensor, where=(None, ""), **bed):
    """Lay a sensor's route over the seabed, whose origin lies somewhere: a `Passage`."""
    floor = geometry(**bed)
    floor.local_origin, floor.crs = None if where[0] is None else np.array([*where[0], 0.0]), where[1]
    return sensor.route.lay(floor, 0.05)


def voyage(sensor, where=(None, ""), **bed):
    """Lay a sensor's route over the seabed: a `Voyage`."""
    return passage(sensor, where, **bed).voyage


# ---- way points

def test_way_points_are_sailed_to_their_end(sensor):
    laid = voyage(sensor(waypoints="0 -50, 0 50, 80 50", depth=12.0, ping_rate_hz=2.0, turn_radius=20.0))
    track, step = laid.track, 2 * KNOT
    length = 180 - 40 + 10 * np.pi
    assert track.pings == int(length / step) + 1 and np.diff(track.time) == pytest.approx(0.5)
    assert track.position[0].tolist() == [0, -50, -12] and track.length == pytest.approx(length, abs=step)
    assert np.ptp(track.position[:, 2]) == 0
    # rounded over a second: a ten-thousandth of the speed, and a rate of turn that grows and fades
    np.testing.assert_allclose(np.linalg.norm(laid.velocity, axis=1), 4 * KNOT, rtol=2e-4)
    np.testing.assert_allclose(laid.velocity[:, 0], 4 * KNOT * np.sin(track.heading), atol=1e-3)
    rate, whole = laid.turn_rate[:, 2], -4 * KNOT / 20                               # to starboard: about down
    turning = rate < 0.999 * whole
    np.testing.assert_allclose(rate[turning], whole, rtol=1e-4)
    assert turning.sum() * step == pytest.approx(10 * np.pi, abs=3 * step)
    assert rate.sum() * 0.5 == pytest.approx(-np.pi / 2, abs=0.01)
    assert np.rad2deg(track.heading[[0, -1]]) == pytest.approx([0, 90])


def test_way_points_are_cut_after_the_pings_only_if_written(sensor):
    course = {"waypoints": "0 0, 0 50", "depth": 5.0, "ping_rate_hz": 1.0}
    assert voyage(sensor(**course)).track.pings == 25 and voyage(sensor(**course, pings=7)).track.pings == 7


def test_a_course_cut_by_pings_says_how_far_it_goes(sensor):
    course = sensor(waypoints="0 0, 0 50", depth=5.0, ping_rate_hz=1.0, pings=7)
    with pytest.warns(UserWarning, match="the course is cut by pings, 7: 12 of 50 m are sailed; 25 pings are all"):
        laid = passage(course)
    assert (laid.sailed, laid.planned) == pytest.approx((6 * 4 * KNOT, 50.0))


def test_a_track_cut_by_pings_says_how_far_it_goes(sensor, file):
    path = file("time,x,y,z\n0,0,0,-5\n10,0,30,-5\n20,40,30,-5\n")
    with pytest.warns(UserWarning, match="the track is cut by pings, 16: 50 of 70 m are sailed; 21 pings are all"):
        voyage(sensor(track=path, ping_rate_hz=1.0, pings=16))


@pytest.mark.parametrize("pings", [{}, {"pings": 25}, {"pings": 90}])
def test_a_course_sailed_to_its_end_is_no_matter(sensor, recwarn, pings):
    course = sensor(waypoints="0 0, 0 50", depth=5.0, ping_rate_hz=1.0, **pings)
    laid = passage(course)
    assert not recwarn.list and (laid.sailed, laid.planned) == pytest.approx((49.4, 50.0), abs=0.1)


def test_corners_jump_and_do_not_spin(sensor):
    laid = voyage(sensor(waypoints="0 0, 0 40, 40 40", depth=5.0, turn_radius=0.0, ping_rate_hz=2.0))
    assert not laid.turn_rate.any() and np.unique(np.round(np.rad2deg(laid.track.heading), 9)).tolist() == [0, 90]


def test_depths_of_way_points(sensor):
    laid = voyage(sensor(waypoints="0 0 -5, 0 40 -15", ping_rate_hz=2.0))
    y, z = laid.track.position[:, 1:].T
    np.testing.assert_allclose(z, -5 - y / 4, atol=1e-9)
    np.testing.assert_allclose(laid.velocity[:, 2], -KNOT, rtol=1e-6)


def test_altitude_along_way_points(sensor):
    laid = voyage(sensor(waypoints="0 -50, 0 50", altitude=10.0, ping_rate_hz=2.0), slope=5.0)
    _, y, z = laid.track.position.T
    np.testing.assert_allclose(z, -20 + y * np.tan(np.deg2rad(5)), atol=1e-3)
    np.testing.assert_allclose(laid.velocity[:, 2], 4 * KNOT * np.tan(np.deg2rad(5)), rtol=1e-3)


def test_a_file_of_way_points(sensor, file):
    track = voyage(sensor(track=file("x,y,depth\n0,0,7\n30,0,7\n"), speed_knots=2.0)).track
    assert np.rad2deg(track.heading) == pytest.approx(90) and track.speed == pytest.approx(2 * KNOT)


def test_georeferenced_way_points(sensor):
    track = voyage(sensor(waypoints="554000 4178000, 554040 4178000", depth=5.0, georeferenced=True), UTM).track
    assert track.position[0].tolist() == [0, 0, -5]


# ---- degrees

def test_degrees_are_laid_over_the_bathymetry(sensor, file):
    import pyproj

    track = voyage(sensor(track=file(BAY), ping_rate_hz=1.0), UTM, half=2000.0).track
    east, north = pyproj.Transformer.from_crs(4326, 32610, always_xy=True).transform(-122.38, 37.75)
    np.testing.assert_allclose(track.position[0], [east - UTM[0][0], north - UTM[0][1], -9], atol=1e-6)
    # 0.62 degrees east of the zone's meridian: true east lies 0.38 degrees to the left of the x axis' right angle
    assert np.rad2deg(track.heading) == pytest.approx(90 - 0.62 * np.sin(np.deg2rad(37.75)), abs=1e-3)


def test_degrees_over_a_seabed_of_nowhere(sensor, file):
    laid = passage(sensor(track=file(BAY)))
    track = laid.voyage.track
    assert abs(track.position[:, 0].mean()) < 0.1 and track.length == pytest.approx(35.25, abs=0.1)
    assert "lat_0=37.75" in laid.frame.crs
    track = voyage(sensor(track=file(BAY), origin="37.7495, -122.38")).track
    np.testing.assert_allclose(track.position[0], [0, 55.5, -9], atol=0.1)


def test_an_image_tells_where_its_track_was(sensor, file, make):
    import mitsuba as mi

    import mitsonar
    scene = mi.load_dict({"type": "scene", "sensor": sensor(track=file(BAY), pings=2), "bed": {
        "type": "seabed", "depth": 30.0}, "integrator": {"type": "sonar_path", "rays": 1000}})
    image = mitsonar.render(scene)
    assert "+proj=tmerc +lat_0=37.75" in image.attrs["crs"] and image.attrs["local_origin"] == [0, 0]


@pytest.mark.parametrize(("text", "where", "words"), [
    (BAY, ((554000.0, 4178000.0), "EPSG:32632"), "km away from the seabed"),
    (BAY, ((554000.0, 5178000.0), "EPSG:32610"), "the track lies 10.. km away .* in EPSG:32610; check zone and"),
    (BAY, (UTM[0], ""), "names no coordinate system"),
    ("time,lat,lon,depth\n0,-12,37.75,9\n9,-12,37.751,9\n", UTM, "km away|outside what"),
])
def test_tracks_of_another_place(sensor, file, text, where, words):
    with pytest.raises(ValueError, match=words):
        voyage(sensor(track=file(text)), where)


@pytest.mark.parametrize("columns", ["time,easting,northing,depth", "time,x,y,depth"])
def test_eastings_and_northings(sensor, file, columns):
    path = file(f"{columns}\n0,554010,4178020,9\n20,554030,4178020,9\n")
    assert voyage(sensor(track=path, georeferenced=True), UTM).track.position[0].tolist() == [10, 20, -9]
    with pytest.raises(ValueError, match="km away from the seabed, at x = 554010 m, .* are eastings and northings of "
                                         "the bathymetry: write georeferenced true"):
        voyage(sensor(track=path), UTM)
    with pytest.raises(ValueError, match="if they are eastings and northings, write georeferenced true, over a bathym"):
        voyage(sensor(track=path))
    with pytest.raises(ValueError, match="write georeferenced true"):
        voyage(sensor(waypoints="554000 4178000, 554040 4178000", depth=5.0), UTM)


# ---- XTF

def test_a_track_of_an_xtf_file(sensor, tmp_path):
    import pyxtf

    packets = [pyxtf.XTFFileHeader()]
    packets[0].NavUnits = 3
    for step in range(100):
        packet = pyxtf.XTFPosRawNavigation()
        packet.Year, packet.Month, packet.Day, packet.Second, packet.NumBytesThisRecord = 2020, 1, 1, step // 10, 64
        packet.Microsecond, packet.RawYcoordinate, packet.RawXcoordinate = step % 10 * 1000, 54 + step * 2e-6, 8.0
        packet.Heave, packet.Heading, packet.Roll = 0.5 * np.sin(step / 10), 10.0, 5.0
        packets.append(packet)
    (tmp_path / "line.xtf").write_bytes(b"".join(map(bytes, packets)))
    track = voyage(sensor(track=str(tmp_path / "line.xtf"), depth=3.0, ping_rate_hz=1.0)).track
    np.testing.assert_allclose(track.position[:, 2], -3 + 0.5 * np.sin(np.arange(10)), atol=1e-3)
    assert np.rad2deg(track.heading) == pytest.approx(10) and np.rad2deg(track.roll) == pytest.approx(5)
    laid = voyage(sensor(track=str(tmp_path / "line.xtf"), altitude=10.0, ping_rate_hz=1.0))
    np.testing.assert_allclose(laid.track.position[:, 2], -20 + 0.5 * np.sin(np.arange(10)), atol=1e-3)


# ---- motion and lever arm

@pytest.mark.parametrize("kind", ["sidescan", "array_sonar", "forward_looking"])
def test_random_motion(sensor, kind):
    line = {"start": [0.0, -100.0, -10.0], "pings": 4000, "speed_knots": 0.1}
    track = voyage(sensor(kind, **line, roll_deg=3.0, pitch_deg=1.0, yaw_deg=2.0, heave=0.25)).track
    assert np.rad2deg([track.roll.std(), track.pitch.std(), track.heading.std()]) == pytest.approx([3, 1, 2], rel=0.3)
    assert track.position[:, 2].std() == pytest.approx(0.25, rel=0.3)
    crossings = np.count_nonzero(np.diff(np.sign(track.roll)))
    assert crossings == pytest.approx(2 * 200 / 8, rel=0.15)                        # 200 s of a period of 8 s
    other = voyage(sensor(kind, **line, roll_deg=3.0, motion_seed=1, motion_period=4.0)).track
    assert np.count_nonzero(np.diff(np.sign(other.roll))) == pytest.approx(2 * 200 / 4, rel=0.15)


def test_a_named_motion_and_what_is_written_in_its_place(sensor):
    from mitsonar.sonar.preset_tables import motions

    line = {"start": [0.0, -100.0, -10.0], "pings": 8000, "speed_knots": 0.1}
    tow = motions()["tow"]
    track = voyage(sensor(**line, motion="tow")).track
    for name, values in (("roll", track.roll), ("pitch", track.pitch), ("yaw", track.heading)):
        assert np.rad2deg(values.std()) == pytest.approx(tow[f"{name}_deg"], rel=0.2)
        crossings = np.count_nonzero(np.diff(np.sign(values)))
        assert crossings == pytest.approx(2 * track.time[-1] / tow[f"{name}_period"], rel=0.15)
    assert track.position[:, 2].std() == pytest.approx(tow["heave"], rel=0.2)
    other = voyage(sensor(**line, motion="tow", roll_deg=4.0, yaw_period=8.0)).track
    assert np.rad2deg(other.roll.std()) == pytest.approx(4, rel=0.2) and np.array_equal(other.pitch, track.pitch)
    assert np.count_nonzero(np.diff(np.sign(other.heading))) == pytest.approx(2 * track.time[-1] / 8, rel=0.15)
    assert not voyage(sensor(**line)).track.roll.any()


def test_a_recorded_track_has_its_own_motion_and_may_strum(sensor, file):
    path = file(HEADER + "0,0,0,-10,0,0,90\n60,30,0,-10,0,0,90\n")
    plain, named = (voyage(sensor(track=path, **more)).track for more in ({}, {"motion": "tow"}))
    assert plain == named
    shaken = voyage(sensor(track=path, strum_heave=0.002, strum_hz=9.0)).track
    assert (shaken.position - plain.position)[:, 2].std() == pytest.approx(0.002, rel=0.2)


def test_the_frequency_of_a_strum_follows_from_speed_and_cable(sensor):
    def frequency(**attributes):
        return sensor(strum_pitch_deg=0.1, **attributes).route.random_motion.strum_frequency

    assert frequency(speed_knots=3.0) == pytest.approx(0.2 * 3 * KNOT / 0.02)
    assert frequency(speed_knots=3.0, cable_diameter=0.01) == pytest.approx(0.2 * 3 * KNOT / 0.01)
    assert frequency(strum_hz=7.0) == 7.0


def test_the_offset_turns_with_the_platform(sensor, file):
    path = file(HEADER + "0,0,0,-10,0,0,90\n10,0,0,-10,90,0,90\n")
    still, laid = (voyage(sensor(track=path, ping_rate_hz=0.1, **more)) for more in ({}, {"offset": "2, 1, 3"}))
    np.testing.assert_allclose(laid.track.position[0], [2, -1, -13], atol=1e-9)
    np.testing.assert_allclose(laid.track.position[1], [2, 3, -11], atol=1e-9)
    arm = laid.track.position - still.track.position
    np.testing.assert_allclose(laid.velocity, np.cross(laid.turn_rate, arm), atol=1e-9)


def test_depth_of_the_line_over_the_middle(sensor):
    track = voyage(sensor(pings=5, depth=4.0)).track
    assert track.position[:, 2].tolist() == [-4] * 5


# ---- refusals

COURSE = "0 0, 0 50"


@pytest.mark.parametrize(("attributes", "words"), [
    ({"waypoints": "0 0"}, "say how deep the sonar is"),
    ({"waypoints": COURSE}, "the way points do not say how deep the sonar is; give depth"),
    ({"waypoints": "0 0, here", "depth": 5.0}, 'way point 2 is "here"; write each as x and y'),
    ({"waypoints": 3, "depth": 5.0}, "waypoints is the integer 3; expected a string"),
    ({"waypoints": COURSE, "depth": 5.0, "heading_deg": 3.0}, "heading_deg and a course are both given"),
    ({"waypoints": COURSE, "depth": 5.0, "speed_knots": 0.0}, "speed_knots is 0, but there are way points"),
    ({"waypoints": COURSE, "depth": 5.0, "altitude": 5.0}, "depth is given, but altitude"),
    ({"waypoints": "0 0 -4, 0 50 -4", "depth": 5.0}, "depth is given, but altitude, start or the track"),
    ({"waypoints": COURSE, "depth": 5.0, "origin": "1, 2"}, "origin is given, but only a track in latitude"),
    ({"waypoints": "1N 2E, 2N 2E", "depth": 5.0, "origin": "100, 2"}, "origin is 100, 2; give latitude"),
    ({"waypoints": "1N 2E, 2N 2E", "depth": 5.0, "georeferenced": True}, "georeferenced is true, but the track is in"),
    ({"turn_radius": 5.0}, "turn_radius is given, but only a course through way points has turns"),
    ({"start": [0, 0, -3], "depth": 5.0}, "depth is given, but altitude, start"),
    ({"roll_deg": -1.0}, "at least 0 and at most 30"),
    ({"motion_period": 0.0}, "expected a number [s] above 0"),
    ({"offset": "1, 2"}, "expected 3 numbers [m]"),
    ({"motion": "towed"}, 'motion is the string "towed"'),
    ({"strum_hz": 9.0}, "strum_hz is given without strum_heave or strum_pitch_deg"),
    ({"strum_heave": 0.001, "strum_hz": 9.0, "cable_diameter": 0.01}, "strum_hz and cable_diameter are given"),
    ({"strum_heave": 0.001, "speed_knots": 0.0}, "follows from speed_knots, which is 0; give strum_hz"),
])
def test_refusals(refused, attributes, words):
    assert words in refused(**attributes)


def test_refusals_of_recorded_tracks(refused, file):
    path = file(HEADER + "0,0,0,-10,0,0,90\n10,0,5,-10,0,0,90\n")
    assert "track and waypoints are both given" in refused(track=path, waypoints=COURSE)
    assert "roll_deg, motion_seed and a recorded track are both given" in refused(track=path, roll_deg=1.0,
                                                                                  motion_seed=2)
    assert "latitude is 91 degrees" in refused(track=file("time,lat,lon,z\n0,91,0,-1\n"))
    assert "it is not an XTF file" in refused(track=file("nothing", "line.xtf"))


@pytest.mark.parametrize(("attributes", "words"), [
    ({"waypoints": "0 0, 0 50, 9 50", "turn_radius": 20.0}, "turns of 20 m radius need 20.0 m of the 9.0 m"),
    ({"waypoints": "0 0, 0 0"}, "way points 1 and 2 are the same place"),
    ({"waypoints": "0 0"}, "got 1; give from two"),
    ({"waypoints": "0 0, 0 50, 0 0"}, "turns back on itself at way point 2"),
    ({"waypoints": "0 0, 1e9 50"}, "the way points take 4.86e+08 s, which is more than 1000000 pings"),
    ({"waypoints": "0 0, 1e3 50"}, "track outside the bathymetry"),
])
def test_courses_that_cannot_be_sailed(sensor, attributes, words):
    with pytest.raises(ValueError) as caught:
        voyage(sensor(depth=5.0, **attributes))
    assert words in str(caught.value)


def test_a_recording_of_centuries_is_refused_before_it_is_resampled(sensor, file):
    path = file("time,x,y,z\n0,0,0,-5\n1e10,1,0,-5\n")
    with pytest.raises(ValueError, match="the track lasts 1e.10 s, which is more than 1000000 pings"):
        voyage(sensor(track=path))
    assert voyage(sensor(track=path, pings=3)).track.pings == 3
