"""What holds for every imaging sonar, of every kind and preset: targets, a box and a ridge, bytes, noise, bad input.

A point appears at its bearing and range, as wide as beam and compressed pulse are (`imaging_kinds`). Two of them, 1.5
such widths apart and a quarter of a cycle out of phase, are two.

A box stands on the bed, H below the sonar, its face at y0, its back at y1, h high. Straight ahead, at slant range R,

    highlight    hypot(y0, H - h) .. hypot(y1, H - h)
    layover      hypot(y0, H - h) .. hypot(y0, H): the face, and the bed before it
    shadow       hypot(y1, H - h) .. hypot(y1 H / (H - h), H)
"""
import functools

import mitsuba as mi
import numpy as np
import pytest
from exhaustive import thinned
from imaging_kinds import members, pulse_width

import mitsonar.scene.loading  # tells Dr.Jit its libraries before Mitsuba is imported
from mitsonar.scene.errors import as_exception
from mitsonar.sonar.preset_tables import TABLES, instruments
from mitsonar.survey.kinds import FRAMES
from mitsonar.validation.scenes import bed, buried_bed, lambert, point_target

DEPTH, DIRECTIONS, PER_WIDTH = 10.0, 73, 6
MEMBERS = {member.name: member for member in members()}
KINDS = {member.name.split()[0]: member for member in members(first_of_kind=True)}
NAMED = {f"{kind} {name}" for kind in TABLES for name in instruments(kind)}     # planned in test_instruments.py
every_member = pytest.mark.parametrize("name", thinned(MEMBERS, *(name for name in MEMBERS if name not in NAMED)))
every_kind = pytest.mark.parametrize("kind", KINDS)


def polar(image, name="level"):
    """A variable over bearing [rad] and range [m], and these."""
    frame = image.isel(ping=0) if "beam" in image.dims else image
    return frame[name].values, frame[("bearing" if "bearing" in frame.coords else "beam")].values, frame["range"].values


def half_power(axis, level):
    """Where a level [dB] falls by 3 dB on either side of its peak."""
    peak, down = int(np.argmax(level)), level.max() - 10 * np.log10(2)
    left = np.flatnonzero(level[:peak] < down)[-1]
    right = peak + np.flatnonzero(level[peak:] < down)[0]
    return tuple(np.interp(down, level[[low, high]], axis[[low, high]]) for low, high in
                 ((left, left + 1), (right, right - 1)))


# ---- points: one alone, two beside each other, two behind each other

@functools.cache
def pointed(name):
    """The picture of five points 5 to 6 m ahead, the widths that theory gives, and where the points are."""
    member = MEMBERS[name]
    window = {"range_min": 4.5, "range": 6.5}
    sensor = member.made({"seabed": buried_bed(12.0, size=4.0)}, fan=(10.0, 3), film=window).sensors()[0]
    wide, long = member.width(sensor), pulse_width(sensor.pulse)
    wavelength = 1500.0 / sensor.frequency
    behind = (np.ceil(2 * 1.5 * long / wavelength) + 0.25) * 0.5 * wavelength
    places = {"alone": (-4.05 * wide, 5.0 + 0.03 * long), "left": (2.25 * wide, 5.5),
              "right": (3.75 * wide, 5.5 + wavelength / 8),
              "near": (-2.0 * wide, 6.0), "far": (-2.0 * wide, 6.0 + behind)}
    points = {which: point_target([away * np.sin(angle), away * np.cos(angle), -DEPTH])
              for which, (angle, away) in places.items()}
    fan = np.rad2deg((DIRECTIONS - 1) / PER_WIDTH * wide), DIRECTIONS
    film = {**window, "bins": int(PER_WIDTH * 2.0 / long)}
    scene = member.made({"seabed": buried_bed(12.0, size=4.0), **points}, fan=fan, film=film,
                        integrator={"cell": 4.0, "rays": 400})
    return mitsonar.render(scene), wide, long, places


def near(image, place, reach):
    """The part of a picture within a reach (rad, m) of a place."""
    level, bearing, distance = polar(image)
    rows, bins = (np.flatnonzero(np.abs(axis - at) < about) for axis, at, about in
                  zip((bearing, distance), place, reach))
    return level[np.ix_(rows, bins)], bearing[rows], distance[bins]


@every_member
def test_a_point_lies_at_its_place_and_is_as_wide_as_theory_says(name):
    image, wide, long, places = pointed(name)
    level, bearing, distance = near(image, places["alone"], (2 * wide, 5 * long))
    row, bin = np.unravel_index(np.argmax(level), level.shape)
    assert bearing[row] == pytest.approx(places["alone"][0], abs=0.51 * np.diff(bearing).max())
    assert distance[bin] == pytest.approx(places["alone"][1], abs=0.51 * np.diff(distance).max())
    assert np.ptp(half_power(bearing, level[:, bin])) == pytest.approx(wide, rel=0.1)
    assert np.ptp(half_power(distance, level[row])) == pytest.approx(long, rel=0.1)


@every_member
@pytest.mark.parametrize("pair", [("left", "right"), ("near", "far")])
def test_two_points_a_cell_and_a_half_apart_are_two(name, pair):
    image, wide, long, places = pointed(name)
    apart = np.subtract(*(places[which] for which in pair[::-1]))
    across = pair == ("left", "right")
    middle = np.mean([places[which] for which in pair], axis=0)
    reach = (1.6 * wide, 0.3 * long) if across else (0.3 * wide, 1.6 * apart[1])
    level, *axes = near(image, middle, reach)
    along, axis = (level.max(1), axes[0]) if across else (level.max(0), axes[1])
    inner = along[1:-1]
    peaks = 1 + np.flatnonzero((inner > along[:-2]) & (inner >= along[2:]) & (inner > along.max() - 6))
    assert len(peaks) == 2
    assert along[peaks].min() - along[peaks[0]:peaks[1]].min() > 1.5
    cell = wide if across else long
    np.testing.assert_allclose(axis[peaks], [places[which][0 if across else 1] for which in pair], atol=0.25 * cell)


# ---- a box ahead, and a ridge of the bed to port

H, HEIGHT, NEAR, FAR, HALF = 2.0, 0.8, 4.0, 4.6, 0.6


@pytest.fixture(scope="module")
def ridge_file(tmp_path_factory):
    """A level bed 12 m deep with a ridge 0.6 m high at y = 5 from x = -4 to -1.5; nodes 0.1 m apart."""
    x, y = np.meshgrid(np.arange(-10, 10.01, 0.1), np.arange(-10, 10.01, 0.1))
    high = 0.6 * np.clip(1 - np.abs(y - 5) / 0.3, 0, 1) * ((x > -4) & (x < -1.5))
    path = tmp_path_factory.mktemp("bed") / "ridge.npy"
    np.save(path, high - DEPTH - H)
    return str(path)


@functools.cache
def boxed(name, path):
    """The picture, and how long the compressed pulse is [m]."""
    mitsonar.scene.loading.prepare()
    to_world = mi.ScalarTransform4f().translate([0, 0.5 * (NEAR + FAR), -DEPTH - H + HEIGHT / 2])
    shapes = {"seabed": {"type": "bathymetry", "filename": path, "spacing": 0.1, "bsdf": lambert()},
              "box": {"type": "cube", "bsdf": lambert(-15.0),
                      "to_world": to_world.scale([HALF, 0.5 * (FAR - NEAR), HEIGHT / 2])}}
    member = MEMBERS[name]
    tilt = {"array": {}, "multibeam": {"mounting_deg": "0, 70, 0", "transmit_beam_width_deg": 60.0}}.get(
        name.split()[0], {"tilt_deg": 20.0, "vertical_beam_width_deg": 60.0})
    film = {"range_min": 3.5, "range": 8.6, **({"bins": 300} if name.startswith("sector") else {})}
    scene = member.made(shapes, fan=(60.0, 61), depth=DEPTH, sensor=tilt, film=film, integrator={"rays": 20_000})
    return mitsonar.render(scene), pulse_width(scene.sensors()[0].pulse)


def span(distance, flags):
    found = distance[np.flatnonzero(flags)]
    assert len(found), "there is none"
    return [found[0], found[-1]]


@every_member
def test_highlight_layover_and_shadow_of_a_box_lie_where_geometry_puts_them(name, ridge_file):
    """To two cells of the pulse and half a bin; a shadow begins when the box, brighter than the bed, has died away."""
    image, long = boxed(name, ridge_file)
    box = next(int(number) for number, shape in image.attrs["labels"].items() if shape == "box")
    (label, bearing, distance), (shadow, *_), (layover, *_) = (
        polar(image, variable) for variable in ("label", "object_shadow", "layover"))
    ahead = int(np.argmin(np.abs(bearing)))
    top, foot, rear = np.hypot(NEAR, H - HEIGHT), np.hypot(NEAR, H), np.hypot(FAR, H - HEIGHT)
    bin = np.diff(distance).max()
    edge = 2 * max(bin, long) + 0.5 * bin
    np.testing.assert_allclose(span(distance, label[ahead] == box), [top, rear], atol=edge)
    np.testing.assert_allclose(span(distance, shadow[ahead] == box), [rear, np.hypot(FAR * H / (H - HEIGHT), H)],
                               atol=1.5 * edge)
    over = (distance > top + edge) & (distance < foot - edge)
    assert (layover[ahead, over] >= 2).mean() > 0.8 and (layover[ahead, distance < top - edge] <= 1).mean() > 0.95
    aside = int(np.argmin(np.abs(bearing - 0.4)))
    assert (layover[aside] <= 1).mean() > 0.95 and not (shadow[aside] == box).any() and not (label[aside] == box).any()


@every_member
def test_what_the_bed_hides_is_no_shadow_of_an_object(name, ridge_file):
    """None with a class's beams; the two degrees of the Oculus M370s leave a few lone bins, 0.2 % of these rows."""
    image, _ = boxed(name, ridge_file)
    (dark, bearing, distance), (shadow, *_) = polar(image, "shadow"), polar(image, "object_shadow")
    rows = (np.sin(bearing) < -0.36) & (np.sin(bearing) > -0.44)               # x = -1.9 to -2.3 at the ridge
    bins = (distance > 5.75) & (distance < 7.3)                                # its shadow lasts to hypot(7.14, 2)
    assert (dark[np.ix_(rows, bins)] == 1).mean() > 0.95
    assert (shadow[rows] > 0).mean() <= (0.005 if name in NAMED else 0.0)


@every_member
def test_shares_add_to_one_or_nothing(name, ridge_file):
    total = boxed(name, ridge_file)[0]["share"].sum("shape").values
    assert np.all(np.isclose(total, 1, atol=1e-5) | (total == 0)) and (total > 0).mean() > 0.5


# ---- bytes and noise

def small(kind, **sensor):
    """A coarse scene of a kind under way, of a point above the bed."""
    return KINDS[kind].made({"seabed": bed(12.0, size=20.0), "ball": point_target([0.5, 5.0, -11.0], -10.0)},
                            fan=(40.0, 9), coarse=True, film={"range": 6.0, "bins": 320},
                            integrator={"cell": 0.2, "rays": 2000},
                            sensor={"speed_knots": 3.0, "roll_deg": 3.0, **sensor})


def same(one, other):
    assert one.sizes == other.sizes
    for name in one.data_vars:
        np.testing.assert_array_equal(one[name].values, other[name].values, err_msg=name)


@every_kind
def test_same_bytes_whatever_the_threads_and_pings(kind):
    """Pings one by one where a ping is a picture; else the first five of nine, whose means have rays of their own."""
    import drjit as dr

    pings = 3 if kind in FRAMES else 9
    threads = dr.thread_count()
    whole = mitsonar.render(small(kind, noise=True, pings=pings), seed=4)
    try:
        for count in {1, 2} - {threads}:
            dr.set_thread_count(count)
            same(mitsonar.render(small(kind, noise=True, pings=pings), seed=4), whole)
    finally:
        dr.set_thread_count(threads)
    if kind in FRAMES:
        for ping, frame in enumerate(mitsonar.frames(small(kind, noise=True, pings=pings), seed=4)):
            same(frame, whole.isel(ping=[ping]))
    else:
        fewer = mitsonar.render(small(kind, noise=True, pings=5), seed=4)["level"].values
        if kind == "sector_scan":
            # A longer run's track is another spline: its velocities differ in the last bit, and so do a few echoes. The
            # transforms, in single precision, spread that over the ping: 1e-8 of its strongest echo. Levels in single
            # precision are 8e-6 dB apart at 110 dB, which is 9e-7 of the amplitude.
            fewer, most = 10 ** (fewer / 20), 10 ** (whole["level"].values[:5] / 20)
            assert (np.abs(fewer - most) <= 1e-6 * most.max(axis=1, keepdims=True)).all()
        else:
            np.testing.assert_array_equal(fewer, whole["level"].values[:5])
    assert not np.array_equal(mitsonar.render(small(kind, noise=True, pings=pings), seed=5)["level"].values,
                              whole["level"].values)


@every_kind
def test_there_is_noise_only_where_it_is_asked_for(kind):
    """Before the first echoes, in bins of which there are hundreds; the sea's, the receivers', none."""
    quiet, sea, own = (polar(mitsonar.render(small(kind, pings=9 if kind == "sector_scan" else 1, **noise)))
                       for noise in ({}, {"noise": True, "noise_level_db": 100.0}, {"self_noise_db": 100.0}))
    early = quiet[2] < 1.2
    for noisy in (sea, own):
        assert quiet[0][:, early].max() < noisy[0][:, early].min() - 10


# ---- bad input: every attribute that is a number says what it takes

@every_kind
def test_numbers_out_of_bounds_are_refused_in_a_sentence_that_names_them(kind):
    from mitsonar.plugins.attributes import Number
    from mitsonar.plugins.attributes.groups import flat
    numbers = [one for one in flat(small(kind).sensors()[0].declared) if isinstance(one, Number) and not one.only]
    assert len(numbers) > 20
    for one in numbers:
        bad = [np.nan, np.inf, "much"]
        bad += [] if one.minimum is None else [one.minimum - 1]
        bad += [] if one.above is None else [one.above, one.above - 1]
        bad += [] if one.maximum is None else [one.maximum + 1]
        for value in bad:
            if "Float" not in one.types and value not in ("much", np.inf) and value == value:
                value = int(value)
            with pytest.raises(Exception) as caught:
                small(kind, **{one.name: value})
            said = str(as_exception(caught.value))
            assert f"{one.name} is" in said and one.expected in said and "Traceback" not in said, said


@pytest.mark.parametrize("kind, attributes, film, words", [
    ("forward_looking", {"receive_elements": 100_000}, {}, "too large for pictures in the beam domain; take fewer"),
    ("forward_looking", {"pulse_ms": 4000.0}, {}, "the pulse of 4000 ms"),
    ("forward_looking", {"pulse_ms": 100.0, "speed_knots": 300.0}, {}, "spectra; take a shorter pulse or a slower"),
    ("sector_scan", {}, {"range": 1e-9}, "the pulse of 0.3 ms"),
])
def test_what_would_take_memory_or_time_without_bound_is_refused(kind, attributes, film, words):
    member, film = KINDS[kind], {"range": 6.0, "bins": 320, **film}
    if kind == "forward_looking":
        film.pop("bins")
    with pytest.raises(ValueError, match=words):
        mitsonar.render(member.made({"seabed": bed(12.0, size=20.0)}, fan=(40.0, 9), coarse=True, film=film,
                                    sensor={"speed_knots": 3.0, **attributes}))


def test_a_fan_that_the_bed_has_no_part_in_is_empty():
    """A thousandth of a degree wide: no scatterer lies in it."""
    image = mitsonar.render(KINDS["forward_looking"].made(
        {"seabed": bed(12.0, size=20.0)}, fan=(0.001, 5), coarse=True, film={"range": 6.0}))
    assert not image["label"].values.any() and not image["layover"].values.any()


@every_kind
def test_a_sea_surface_of_kilometres_takes_the_memory_of_what_is_within_reach(kind):
    """Cut all over as finely as the bed, it would make 10^8 patches and more."""
    image = mitsonar.render(KINDS[kind].made(
        {"seabed": bed(12.0, size=20.0), "surface": {"type": "sea_surface", "wind_speed": 5.0}}, fan=(40.0, 9),
        coarse=True, depth=8.0, film={"range": 16.0, "bins": 860}, integrator={"cell": 0.5, "rays": 2000}))
    surface = next(int(number) for number, name in image.attrs["labels"].items() if name == "surface")
    assert (image["label"].values == surface).any()
