"""The sensor `sidescan`: the sonar its attributes make, the track it lays over a scene, what it refuses.

The seabed of most tests is a rectangle 30 m down, 60 m east to west and 100 m south to north about the origin.
Positions are exact but for float32 geometry: 1e-4 m.
"""
import numpy as np
import pytest

from mitsonar.sonar import presets
from mitsonar.survey.sensor import slowest_speed
from mitsonar.survey.sidescan.kind import sonar_at

DEPTH, WIDTH, LENGTH = 30.0, 60.0, 100.0
KNOT = 1852 / 3600
METRE = 1e-4
HEADER = "time,x,y,z,roll,pitch,heading\n"
TRACK = HEADER + "10,-10,-20,-12,1,2,350\n20,-10,-10,-14,3,4,10\n30,-10,0,-16,5,6,30\n"


@pytest.fixture
def sidescan(make):
    """Make a sensor of attributes, and of a range and a profile."""
    def run(range=50.0, profile="0:1500, 10:1500, 30:1480", **attributes):
        return make("sidescan", medium={"type": "seawater", "profile": profile},
                    film={"type": "sonar_film", "range": range}, **attributes)
    return run


@pytest.fixture
def refused(refusal):
    """Return the sentence about attributes that must be refused."""
    def run(**attributes):
        return refusal("sidescan", **{"medium": {"type": "seawater"}, "film": {"type": "sonar_film"}, **attributes})
    return run


def bed(depth=DEPTH, width=WIDTH, length=LENGTH, x=0.0, y=0.0):
    """A level rectangle of seabed about (x, y)."""
    import mitsuba as mi

    T = mi.ScalarTransform4f
    return {"type": "rectangle", "to_world": T().translate([x, y, -depth]).scale([width / 2, length / 2, 1])}


def plan(sensor, origin=None, **shapes):
    """Lay a sensor's track over the seabed, or over other shapes: track, sonar, depth below."""
    import mitsuba as mi

    from mitsonar.scene.geometry import Geometry

    floor = Geometry(mi.load_dict({"type": "scene", **(shapes or {"bed": bed()})}))
    floor.local_origin, floor.crs = None if origin is None else np.array([*origin, 0.0]), None
    passage = sensor.route.lay(floor, sensor.film().window(slowest_speed(sensor))[0][1])
    track = passage.voyage.track
    return track, sonar_at(sensor, float(-track.position[:, 2].mean())), passage.depth_below


# ---- the sonar

@pytest.mark.parametrize("name", presets())
def test_presets(sidescan, name):
    wanted = presets()[name]
    sonar = sonar_at(sidescan(preset=name), 5.0)
    assert sonar.frequency == pytest.approx(1e3 * wanted["frequency_khz"], rel=1e-15)
    assert sonar.source_level_db == wanted["source_level_db"]
    assert sonar.pulse_length == pytest.approx(1e-3 * wanted["pulse_ms"], rel=1e-15)
    assert np.rad2deg(sonar.depression_angle) == pytest.approx(wanted["depression_deg"], rel=1e-15)
    widths = wanted["beam_width_deg"], wanted["vertical_beam_width_deg"]
    assert np.rad2deg(sonar.transmit.beam_widths(sonar.wavelength)) == pytest.approx(widths, rel=1e-12)
    assert sonar.receive == sonar.transmit


def test_what_is_written_goes_before_the_preset(sidescan):
    sonar = sonar_at(sidescan(preset="towed_100khz", frequency_khz=200, pulse_ms=0.5), 5.0)
    assert (sonar.frequency, sonar.pulse_length) == (200e3, 0.5e-3)
    assert sonar.source_level_db == presets()["towed_100khz"]["source_level_db"]


def test_receiving_face_is_like_the_transmitting_one_unless_written(sidescan):
    sonar = sonar_at(sidescan(beam_width_deg=3.0, vertical_beam_width_deg=180.0, receive_beam_width_deg=6.0), 5.0)
    assert sonar.transmit.beam_widths(sonar.wavelength) == pytest.approx((np.deg2rad(3), np.pi), rel=1e-12)
    assert sonar.receive.beam_widths(sonar.wavelength) == pytest.approx((np.deg2rad(6), np.pi), rel=1e-12)


def test_sound_speed_at_the_head(sidescan):
    assert sonar_at(sidescan(), 20.0).sound_speed == 1490
    assert sonar_at(sidescan(sound_speed=1470.0), 20.0).sound_speed == 1470
    # the track's mean depth is the head's
    assert plan(sidescan(altitude=10.0))[1].sound_speed == pytest.approx(1490, abs=1e-3)


def test_noise_level(sidescan):
    sensor = sidescan()
    assert sensor.noise_level_db() == sensor.water.noise_level_db(sensor.frequency)
    assert sidescan(noise_level_db=33.0).noise_level_db() == 33


# ---- the straight track

def test_straight_from_a_start(sidescan):
    sensor = sidescan(start=[1.0, -20.0, -12.0], heading_deg=90.0, speed_knots=6.0, pings=5, ping_rate_hz=2.0)
    track, _, below = plan(sensor)
    assert track.time == pytest.approx(np.arange(5) / 2)
    steps = 3 * KNOT * np.arange(5)
    assert track.position == pytest.approx(np.array([1, -20, -12]) + steps[:, None] * [1, 0, 0], abs=1e-9)
    assert track.heading == pytest.approx(np.full(5, np.pi / 2)) and not track.roll.any() and not track.pitch.any()
    assert below == pytest.approx(np.full(5, DEPTH - 12), abs=METRE)


def test_pings_follow_as_fast_as_the_range_allows(sidescan):
    # the slowest water of the profile makes the longest wait
    track, _, _ = plan(sidescan(range=37.0, start=[0.0, 0.0, -12.0], pings=3))
    assert np.diff(track.time) == pytest.approx(2 * 37 / 1480, rel=1e-12)
    track, _, _ = plan(sidescan(range=37.0, start=[0.0, 0.0, -12.0], pings=3, sound_speed=1000.0))
    assert np.diff(track.time) == pytest.approx(2 * 37 / 1000, rel=1e-12)


def test_ping_rate_too_high_for_the_range(sidescan):
    limit = 1480 / (2 * 37)
    plan(sidescan(range=37.0, pings=3, ping_rate_hz=limit * 0.999))
    with pytest.raises(ValueError, match="ping_rate_hz is 20.2, but echoes .* take 0.0500 s; use at most 20.000 Hz"):
        plan(sidescan(range=37.0, pings=3, ping_rate_hz=20.2))


# ---- the line over the surveyed area

def test_line_over_the_middle_along_the_longer_axis(sidescan):
    track, _, below = plan(sidescan(pings=11, speed_knots=20.0), bed=bed(width=80, length=50, x=300, y=-200))
    assert track.position.mean(0) == pytest.approx([300, -200, 20 - DEPTH], abs=0.1)
    assert np.sin(track.heading) == pytest.approx(np.ones(11), abs=1e-6)
    assert below == pytest.approx(np.full(11, 20.0), abs=1e-3)


def test_line_of_given_heading_and_altitude(sidescan):
    track, _, below = plan(sidescan(pings=11, heading_deg=180.0, altitude=7.0))
    assert np.all(np.diff(track.position[:, 1]) < 0) and np.ptp(track.position[:, 0]) < METRE
    assert below == pytest.approx(np.full(11, 7.0), abs=1e-3)


def test_line_stays_off_the_land(sidescan):
    # an island west of x = 10: the water is the strip from 10 to 30
    shapes = {"bed": bed(width=20, x=20), "island": bed(depth=-5, width=40, x=-10)}
    track, _, _ = plan(sidescan(pings=3, heading_deg=0.0), **shapes)
    assert track.position[:, 0] == pytest.approx(np.full(3, 20.0), abs=0.5)
    with pytest.raises(ValueError, match="the seabed is 5.00 m above the sea surface; depths are positive down"):
        plan(sidescan(), island=shapes["island"])


def test_line_follows_the_seabed(sidescan):
    # a step from 30 to 24 m in the middle; the altitude is held over a depth smoothed along the track
    track, _, below = plan(sidescan(pings=80, heading_deg=0.0, altitude=10.0, ping_rate_hz=2.0),
                           south=bed(length=50, y=-25), north=bed(depth=24, length=50, y=25))
    assert track.position[[0, -1], 2] == pytest.approx([-20, -14], abs=1e-3)
    assert np.all(np.diff(track.position[:, 2]) > -METRE) and np.max(np.diff(track.position[:, 2])) < 1
    assert below[0] == pytest.approx(10, abs=1e-3) and np.ptp(below) > 2


def test_line_too_long(sidescan):
    with pytest.raises(ValueError, match="99999 pings cover .* m, but the seabed reaches only 99.9 m at heading 0"):
        plan(sidescan(pings=99999))


def test_line_that_meets_no_seabed(sidescan):
    frame = {"west": bed(width=10, x=-25), "east": bed(width=10, x=25)}
    with pytest.raises(ValueError, match="no seabed lies on the line .* heading 0 degrees; choose another heading"):
        plan(sidescan(pings=2, heading_deg=0.0), **frame)


@pytest.mark.parametrize("attributes, words", [
    ({"start": [0, 0, 0.5]}, "ping 0: the sonar is 0.50 m above the sea surface"),
    ({"start": [0, 0, -30.5]}, "sonar below the seabed: at ping 0 it is 30.50 m deep, the seabed 30.00 m"),
    ({"start": [0, 51, -3]}, "track outside the bathymetry: ping 0 is at x = 0.0 m, y = 51.0 m"),
    ({"altitude": 31.0}, "altitude 31.0 m puts the sonar above the sea surface: the seabed is 30.0 m deep"),
])
def test_places_where_no_sonar_can_be(sidescan, attributes, words):
    with pytest.raises(ValueError) as caught:
        plan(sidescan(pings=2, **attributes))
    assert words in str(caught.value)


# ---- the recorded track

@pytest.fixture
def recorded(tmp_path):
    path = tmp_path / "track.csv"
    path.write_text(TRACK)
    return str(path)


def test_recorded_track_is_resampled_at_the_ping_rate(sidescan, recorded):
    track, sonar, below = plan(sidescan(track=recorded, ping_rate_hz=0.2))
    assert track.time == pytest.approx([10, 15, 20, 25, 30])
    assert track.position == pytest.approx(np.array([[-10, -20, -12], [-10, -15, -13], [-10, -10, -14], [-10, -5, -15],
                                                     [-10, 0, -16]]))
    assert np.rad2deg(track.roll) == pytest.approx([1, 2, 3, 4, 5]) and np.rad2deg(track.pitch[-1]) == pytest.approx(6)
    assert np.rad2deg(track.heading) == pytest.approx([350, 0, 10, 20, 30], abs=1e-9)      # the short way round
    assert below == pytest.approx(DEPTH - np.arange(12, 17), abs=METRE)
    assert sonar.sound_speed == pytest.approx(1500 - 4)


def test_recorded_track_is_cut_after_the_pings_only_if_written(sidescan, recorded):
    assert plan(sidescan(track=recorded, ping_rate_hz=5.0))[0].pings == 101
    assert plan(sidescan(track=recorded, ping_rate_hz=5.0, pings=7))[0].pings == 7
    assert plan(sidescan(track=recorded, ping_rate_hz=5.0, pings=5000))[0].pings == 101


def test_recorded_track_of_one_ping(sidescan, tmp_path):
    path = tmp_path / "track.csv"
    path.write_text(HEADER + "7,1,2,-3,0,0,0\n")
    track, _, _ = plan(sidescan(track=str(path)))
    assert track.time == [7] and track.position.tolist() == [[1, 2, -3]]


def test_altitude_over_a_recorded_track(sidescan, recorded):
    track, _, below = plan(sidescan(track=recorded, ping_rate_hz=0.2, altitude=5.0))
    assert below == pytest.approx(np.full(5, 5.0), abs=1e-3)
    assert np.rad2deg(track.roll) == pytest.approx([1, 2, 3, 4, 5])
    with pytest.raises(ValueError, match="track outside the bathymetry: no seabed lies around ping 0"):
        plan(sidescan(track=recorded, altitude=5.0), bed=bed(x=500))


def test_georeferenced_track(sidescan, tmp_path):
    path = tmp_path / "track.csv"
    path.write_text(HEADER + "0,500000,6000000,-9,0,0,0\n10,500000,6000010,-9,0,0,0\n")
    sensor = sidescan(track=str(path), georeferenced=True, ping_rate_hz=0.1)
    track, _, _ = plan(sensor, origin=(500005.0, 6000000.0))
    assert track.position.tolist() == [[-5, 0, -9], [-5, 10, -9]]
    with pytest.raises(ValueError, match="no bathymetry of the scene has a geographic origin; set it false"):
        plan(sensor)
    with pytest.raises(ValueError, match="6021 km away from the seabed.*write georeferenced true"):
        plan(sidescan(track=str(path)))


@pytest.mark.parametrize("name, value", [("start", [0.0, 0.0, -3.0]), ("heading_deg", 0.0), ("speed_knots", 3.0)])
def test_recorded_track_leaves_no_choice(refused, recorded, name, value):
    assert f"{name} and a recorded track are both given" in refused(track=recorded, **{name: value})


# ---- refusals

@pytest.mark.parametrize("attributes, words", [
    ({"preset": "towed"}, 'preset is the string "towed"; expected one of "towed_100khz"'),
    ({"frequency_khz": 20_000.0}, "expected a number [kHz] at least 0.001 and at most 10000"),
    ({"source_level_db": 301.0}, "at least -200 and at most 300"),
    ({"noise_level_db": -201.0}, "at least -200 and at most 300"),
    ({"pulse_ms": 0.0}, "expected a number [ms] at least 1e-06"),
    ({"pulse_ms": 1e-308}, "expected a number [ms] at least 1e-06"),
    ({"beam_width_deg": 0.009}, "expected a number [degrees] at least 0.01 and at most 180"),
    ({"vertical_beam_width_deg": 0.09}, "expected a number [degrees] at least 0.1 and at most 180"),
    ({"receive_beam_width_deg": 181.0}, "at most 180"),
    ({"depression_deg": 91.0}, "at least -90 and at most 90"),
    ({"sound_speed": 300.0}, "above 300.0 and below 3000.0"),
    ({"pings": 0}, "pings is the integer 0; expected an integer at least 1"),
    ({"ping_rate_hz": 0.0}, "expected a number [Hz] above 0"),
    ({"speed_knots": -1.0}, "expected a number [knots] at least 0"),
    ({"speckle": "yes"}, 'speckle is the string "yes"; expected true or false'),
    ({"track": "no.csv"}, 'track names the file "no.csv", which is not there'),
    ({"start": [0, 0, -9], "altitude": 3.0}, "start and altitude are both given"),
    ({"medium": {"type": "homogeneous"}}, '<medium type="seawater"/>'),
    ({"film": {"type": "hdrfilm"}}, '<film type="sonar_film"/>'),
    ({"fov": 45.0}, 'unknown attribute "fov"'),
])
def test_refusals(refused, attributes, words):
    assert words in refused(**attributes)


def test_light_is_refused(sidescan):
    import mitsuba as mi

    from mitsonar.scene.errors import plain

    scene = mi.load_dict({"type": "scene", "bed": bed(), "sensor": sidescan(), "integrator": {"type": "direct"}})
    with pytest.raises(RuntimeError) as caught:
        mi.render(scene)
    assert plain(caught.value) == "a sonar_film records sound; render it with the integrator sonar_path"
    with pytest.raises(ValueError, match="sends sound; render it with the integrator sonar_path"):
        scene.sensors()[0].sample_ray(0, 0, [0, 0], [0, 0])
