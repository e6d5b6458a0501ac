"""Bags of ROS 2, read back by `mcap_ros2`: every field, and where targets lie to port, ahead and below.

Closed form: a target at p in the scene, of a sonar at s with the rotation R from body to scene, has the direction
R^T (p - s) / |p - s| in the body. The records here have a beam in exactly that direction and a bin at exactly that
range, so that the bag, its frames and nothing else decide where the target comes out. Tolerance 1e-4 m: ranges are
float32 in the message, 24 bits of 30 m are 2e-6 m.
"""
import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from read_bag import array, in_map, one, picture, points, read, transforms, turned
from soundings_line import soundings_line
from synthetic_fan import fan, head
from synthetic_sidescan import sidescan

import mitsonar
from mitsonar.device.rotations import rotation_matrix
from mitsonar.io.bags import bag
from mitsonar.io.bags.beams import beam_widths

pytest.importorskip("rosbags", reason="rosbags is not installed")
SONAR = np.array([120.0, -40.0, -12.0])
ATTITUDES = {"level": (0.0, 0.0, 0.0), "eastwards": (0.0, 0.0, np.pi / 2), "in a seaway": (0.2, -0.15, 2.3)}


def frame_with(target, attitude, kind="fan"):
    """A record of one ping with the target's echo in the only strong bin."""
    body = rotation_matrix(*attitude).T @ (np.asarray(target) - SONAR)
    away = np.linalg.norm(body)
    direction = body / away
    if kind == "fan":                                 # in the plane of the target and starboard
        middle = np.array([direction[0], 0.0, direction[2]]) / np.hypot(direction[0], direction[2])
        bearing = np.array([-0.9, -0.3, np.arcsin(direction[1]), 1.2])
        beams = np.cos(bearing)[:, None] * middle + np.sin(bearing)[:, None] * np.array([0.0, 1.0, 0.0])
        coords = {"bearing": ("beam", bearing),
                  **{f"beam_{axis}": ("beam", column) for axis, column in zip("xyz", beams.T)}}
        dims, strong = ("ping", "beam", "range"), (0, 2, 5)
    else:
        coords = {"bearing": ("ping", [np.arctan2(direction[1], direction[0])])}
        dims, strong = ("ping", "range"), (0, 5)
    level = np.full((1, 4, 9) if kind == "fan" else (1, 9), 40.0, np.float32)
    level[strong] = 90.0
    ping = dict(zip(("x", "y", "z", "roll", "pitch", "heading"), (*SONAR, *attitude)))
    attrs = {"sound_speed": 1480.0, "frequency": 4e5, "mount": "down", "tilt": float(np.arcsin(direction[2]))}
    return xr.Dataset({"level": (dims, level)}, {
        "range": away * np.linspace(0.5, 1.3, 9), "ping_time": ("ping", [3.25]), **coords,
        **{name: ("ping", [value]) for name, value in ping.items()}}, attrs).assign_coords(
            range=("range", away + np.arange(-5, 4) * 0.5))


@pytest.mark.parametrize("attitude", ATTITUDES.values(), ids=ATTITUDES)
@pytest.mark.parametrize("kind", ["fan", "head"])
@pytest.mark.parametrize("where", [(-20, 3, 0.5), (2, 25, -1), (1, 4, -18)], ids=["to port", "ahead", "below"])
def test_a_target_comes_out_where_it_is(where, kind, attitude, tmp_path):
    # offsets are those of a ship that heads north: x to starboard, y ahead, z up
    turn = rotation_matrix(*attitude)
    target = SONAR + turn @ np.array([where[1], where[0], -where[2]])
    bag.write(frame_with(target, attitude, kind), tmp_path / "a.mcap")
    messages = read(tmp_path / "a.mcap")
    image = one(messages, "/sonar/image")
    level = picture(image.image)
    bin_, beam = np.unravel_index(level.argmax(), level.shape)
    found = image.ranges[bin_] * array(image.beam_directions[beam])
    np.testing.assert_allclose(in_map(messages, image.header, found), target, atol=1e-4)
    # and in base_link by the axes of REP 103, with the sonar's static transform alone
    _, place, quaternion = transforms(messages)["base_link", "sonar"][0]
    ahead, port, up = place + turned(quaternion, found)
    np.testing.assert_allclose((ahead, port, up), (where[1], -where[0], where[2]), atol=1e-4)


def test_a_ship_that_heads_north_looks_along_the_y_axis_of_the_map(tmp_path):
    bag.write(frame_with(SONAR + [0, 10, 0], (0.0, 0.0, 0.0)), tmp_path / "a.mcap")
    messages = read(tmp_path / "a.mcap")
    turn = array(one(messages, "/sonar/odometry").pose.pose.orientation)
    for body, scene in (([1, 0, 0], [0, 1, 0]), ([0, 1, 0], [-1, 0, 0]), ([0, 0, 1], [0, 0, 1])):
        np.testing.assert_allclose(turned(turn, np.array(body, float)), scene, atol=1e-12)
    _, _, turn = transforms(messages)["base_link", "sonar"][0]
    # of a fan ahead: x up, y to starboard, z ahead
    for sonar, body in (([1, 0, 0], [0, 0, 1]), ([0, 1, 0], [0, -1, 0]), ([0, 0, 1], [1, 0, 0])):
        np.testing.assert_allclose(turned(turn, np.array(sonar, float)), body, atol=1e-12)


def moving_fan(pings=5):
    """A fan on a platform that turns to starboard at 0.1 rad/s, at 2 m/s over ground."""
    time = 1000.0 + 0.5 * np.arange(pings)
    heading = 0.3 + 0.1 * (time - time[0])
    record = fan(pings=pings, beams=7, bins=11)
    course = 20 * np.stack([-np.cos(heading), np.sin(heading)])
    record["recorded"] = record["level"].dims, np.arange(record["level"].size, dtype=np.uint8).reshape(
        record["level"].shape)
    for name, values in {"seabed_x": 3.0, "seabed_y": -2.0}.items():
        record[name] = record["level"].dims, np.full(record["level"].shape, values, np.float32)
    values = {"ping_time": time, "x": course[0], "y": course[1], "z": np.full(pings, -4.0), "heading": heading,
              "roll": np.zeros(pings), "pitch": np.zeros(pings)}
    return record.assign_coords({name: ("ping", value) for name, value in values.items()})


def test_every_field_of_an_image_comes_back(tmp_path):
    record = moving_fan()
    counts = bag.write(record, tmp_path / "a.mcap", start=1.75e9)
    messages = read(tmp_path / "a.mcap")
    assert {topic: len(found) for topic, found in messages.items()} == counts
    assert counts == {"/sonar/about": 1, "/tf_static": 1, **dict.fromkeys(
        ("/tf", *(f"/sonar/{name}" for name in ("odometry", "imu", "image", "recorded", "labels", "truth"))), 5)}
    for number in range(5):
        stamp = round((1.75e9 + 1000 + 0.5 * number) * 1e9)
        for topic, variable in (("image", "level"), ("recorded", "recorded"), ("labels", "label")):
            log_time, message = messages[f"/sonar/{topic}"][number]
            assert log_time == stamp == message.header.stamp.sec * 10 ** 9 + message.header.stamp.nanosec
            assert message.header.frame_id == "sonar"
            assert (message.ping_info.frequency, message.ping_info.sound_speed) == (750e3, 1500.0)
            assert list(message.ping_info.tx_beamwidths) == [] and message.image.is_bigendian is False
            kinds = {"image": 8, "recorded": 0, "labels": 4}
            assert message.image.beam_count == 7 and message.image.dtype == kinds[topic]
            np.testing.assert_array_equal(np.float32(message.ranges), np.float32(record["range"]))
            np.testing.assert_allclose([array(beam) for beam in message.beam_directions], np.stack(
                [0 * record["bearing"], np.sin(record["bearing"]), np.cos(record["bearing"])], -1), atol=1e-15)
            np.testing.assert_array_equal(picture(message.image), record[variable].values[number].T)
        found = points(one(messages, "/sonar/truth", number))
        seen = np.isfinite(record["seabed_depth"].values[number])
        assert found.size == seen.sum() > 0 and found.dtype.names == ("x", "y", "z", "intensity", "label")
        np.testing.assert_array_equal(found["label"], record["label"].values[number][seen])
        np.testing.assert_array_equal(found["intensity"], record["level"].values[number][seen])
        assert set(found["x"]) == {3.0} and set(found["y"]) == {-2.0} and set(found["z"]) == {-10.0}
    about = json.loads(one(messages, "/sonar/about").data)
    assert about["labels"] == record.attrs["labels"] and about["units"]["recorded"] == "counts of the recorder"


def test_odometry_says_pose_and_speed_forward_and_the_turn_to_starboard_is_negative(tmp_path):
    record = moving_fan()
    bag.write(record, tmp_path / "a.mcap")
    messages = read(tmp_path / "a.mcap")
    for number in range(5):
        message, imu = one(messages, "/sonar/odometry", number), one(messages, "/sonar/imu", number)
        assert (message.header.frame_id, message.child_frame_id, imu.header.frame_id) == ("map", "base_link",
                                                                                          "base_link")
        place = [float(record[name][number]) for name in "xyz"]
        np.testing.assert_allclose(array(message.pose.pose.position), place, atol=1e-12)
        heading = float(record["heading"][number])
        np.testing.assert_allclose(turned(array(message.pose.pose.orientation), np.array([1.0, 0, 0])),
                                   [np.sin(heading), np.cos(heading), 0], atol=1e-12)
        # with a turn of a = 0.05 rad from ping to ping: 2 m/s * a² / 6, and at either end 2 m/s * a / 2
        np.testing.assert_allclose(array(message.twist.twist.linear), [2, 0, 0], atol=1e-3 if 0 < number < 4 else 0.06)
        for rate in (message.twist.twist.angular, imu.angular_velocity):
            np.testing.assert_allclose(array(rate), [0, 0, -0.1], atol=1e-9)
        assert message.twist.covariance[0] == 0 and imu.linear_acceleration_covariance[0] == -1
        np.testing.assert_array_equal(array(imu.orientation), array(message.pose.pose.orientation))
        stamp, moved, turn = transforms(messages)["map", "base_link"][number]
        assert stamp == messages["/sonar/odometry"][number][0]
        np.testing.assert_allclose(moved, place, atol=1e-12)
        np.testing.assert_array_equal(turn, array(imu.orientation))


def test_frames_as_they_come_give_the_bag_of_the_whole_record(tmp_path):
    record = moving_fan()
    bag.write(record, tmp_path / "whole.mcap")
    bag.write((record.isel(ping=[number]) for number in range(5)), tmp_path / "frames.mcap")
    mitsonar.io.write(record, tmp_path / "a.nc")
    bag.write_files([tmp_path / "a.nc"], tmp_path / "file.mcap")
    whole, *others = ((tmp_path / f"{name}.mcap").read_bytes() for name in ("whole", "frames", "file"))
    assert others == [whole, whole]


def test_a_single_frame_has_the_velocity_that_is_given_or_none():
    frame = moving_fan().isel(ping=[2])
    heading = float(frame["heading"][0])
    velocity = 2.0 * np.array([np.sin(heading), np.cos(heading), 0])
    given, unknown = ({message.topic: message for message in bag.messages(frame, **options)}["/sonar/odometry"].fields
                      for options in ({"velocity": velocity, "turn_rate": (0, 0, -0.1)}, {}))
    np.testing.assert_allclose(list(given["twist"]["twist"]["linear"].values()), [2, 0, 0], atol=1e-12)
    assert given["twist"]["twist"]["angular"]["z"] == pytest.approx(-0.1) and not given["twist"]["covariance"].any()
    assert unknown["twist"]["covariance"][0] == -1


def test_soundings_come_back_in_all_their_messages(tmp_path):
    line = soundings_line(pings=3)
    bag.write(line, tmp_path / "a.mcap")
    messages = read(tmp_path / "a.mcap")
    start = bag.seconds_of(line.attrs["start"])
    assert len(messages["/sonar/odometry"]) == line.sizes["motion"]
    for number in range(3):
        ping = line.isel(ping=number)
        valid = ping["valid"].values
        delay = np.float32(ping["sector_delay"].values[ping["sector"].values])
        stamp, message = messages["/sonar/detections"][number]
        assert stamp == round((start + float(ping["ping_time"])) * 1e9) and message.header.frame_id == "sonar"
        assert message.ping_info.sound_speed == np.float32(ping["head_sound_speed"])
        assert message.ping_info.frequency == np.float32(ping["sector_frequency"].mean())
        assert [flag.flag for flag in message.flags] == [0 if good else 1 for good in valid]
        for field, values in (("two_way_travel_times", ping["travel_time"]), ("tx_delays", delay),
                              ("intensities", ping["backscatter_db"]), ("tx_angles", ping["transmit_angle"]),
                              ("rx_angles", ping["angle"])):
            np.testing.assert_array_equal(np.float32(getattr(message, field)), np.float32(values), field)
        ranges = one(messages, "/sonar/ranges", number)
        np.testing.assert_allclose(ranges.ranges, 0.5 * ping["head_sound_speed"].values * ping["travel_time"].values,
                                   rtol=1e-6)
        np.testing.assert_array_equal(np.float32(ranges.transmit_delays), delay)
        found, truth = (points(one(messages, f"/sonar/{topic}", number)) for topic in ("soundings", "truth"))
        assert found.dtype.names[:3] == ("x", "y", "z")
        np.testing.assert_array_equal(found["beam"], np.flatnonzero(valid))
        for columns, depth in ((found, "depth"), (truth, "true_depth")):
            for name, values in (("x", ping["x"]), ("y", ping["y"]), ("z", -ping[depth])):
                np.testing.assert_array_equal(columns[name], np.float32(values.values[valid]))
        np.testing.assert_array_equal(found["intensity"], np.float32(ping["backscatter_db"].values[valid]))
        np.testing.assert_array_equal(truth["error"], np.float32(ping["error"].values[valid]))
        # In water of one speed the ranges lead to the soundings, but for the way of the ship between sending and
        # receiving: 0.07 s at some metres a second, and a roll of some degrees a second at 100 m.
        for beam in np.flatnonzero(valid)[::5]:
            place = in_map(messages, ranges.header, ranges.ranges[beam] * array(ranges.beam_unit_vec[beam]))
            np.testing.assert_allclose(place, [ping["x"][beam], ping["y"][beam], -ping["depth"][beam]], atol=1.5)


@pytest.mark.filterwarnings("error")
def test_the_water_column_comes_back(tmp_path):
    line = soundings_line(pings=2)
    for name in ("column_start", "column_rate", "column_level_db"):       # ping 0 has none, ping 1 a beam that pads it
        line[name][0] = line[name][1, -1] = np.nan
    bag.write(line, tmp_path / "a.mcap")
    ping, message = line.isel(ping=1), one(read(tmp_path / "a.mcap"), "/sonar/column")
    rate, sector = float(ping["column_rate"][0]), ping["column_sector"].values
    first = np.round(ping["column_start"].values[:-1] * rate).astype(int)
    assert message.sample_rate == np.float32(rate) and message.sample0 == first.min()
    assert message.image.beam_count == line.sizes["column_beam"]
    np.testing.assert_array_equal(np.float32(message.rx_angles), np.float32(ping["column_angle"]))
    np.testing.assert_array_equal(np.float32(message.tx_angles), np.float32(ping["sector_angle"].values[sector]))
    np.testing.assert_array_equal(np.float32(message.tx_delays), np.float32(ping["sector_delay"].values[sector]))
    level = picture(message.image)
    assert message.samples_per_beam == len(level)
    assert np.isnan(level[:, -1]).all()
    for beam, row in enumerate(ping["column_level_db"].values[:-1]):
        late = first[beam] - first.min()
        np.testing.assert_array_equal(level[late:late + row.size, beam], row)
        assert np.isnan(level[:late, beam]).all()


def test_records_that_hold_something_else_are_refused_in_one_sentence(tmp_path):
    record = moving_fan(pings=2)
    steps = head(steps=2, bins=4).assign_coords(ping_time=("ping", [0.0, 1.0]))
    for words, odd in (("has no range", record.drop_vars("range")), ("has no ping_time", record.drop_vars("ping_time")),
                       ("ping_time of the record is not finite", record.assign_coords(ping_time=("ping", [0, np.nan]))),
                       ("x of the record is not finite", record.assign_coords(x=("ping", [0, np.nan]))),
                       ("-5 s since 1970", record.assign_coords(ping_time=("ping", [-5.0, 0.0]))),
                       ("no pings", record.isel(ping=slice(0, 0))), ("complex64", record.astype("c8")),
                       ("mounted 'sideways'", steps.assign_attrs(mount="sideways")),
                       ("'yesterday' is no date", record.assign_attrs(start="yesterday")),
                       ("none that PROJ knows", record.assign_attrs(crs="EPSG:99999")),
                       ("neither levels nor soundings", xr.Dataset()),
                       ("lacks sector_delay", soundings_line(pings=1).drop_vars("sector_delay"))):
        with pytest.raises(ValueError, match=words):
            bag.write(odd, tmp_path / "a.mcap")
        assert not list(tmp_path.iterdir())
    half = record.assign(level=record["level"].astype(np.float16))
    bag.write(half, tmp_path / "a.mcap")
    np.testing.assert_array_equal(picture(one(read(tmp_path / "a.mcap"), "/sonar/image").image), half["level"][0].T)


MEASURED = Path(__file__).resolve().parents[2] / "../shared/data/measured/multibeam"


@pytest.mark.skipif(not MEASURED.is_dir(), reason="the shared survey lines are not here")
@pytest.mark.parametrize("name", ["em2040_56m.all", "em2042_os01.kmall", "em710_122m.all"])
def test_ranges_of_real_lines_lead_to_their_soundings(name, tmp_path):
    """Positions are the sounder's own, by its rays through its cast; here a straight ray and two transforms.

    The tolerance is what these leave out, 2 % of the range: at 60 degrees, 1 % of sound speed bends a ray by 1.7 %. The
    first line is of two heads that look to either side.
    """
    bag.write_files([MEASURED / name], tmp_path / "a.mcap")
    messages = read(tmp_path / "a.mcap")
    ranges, found = one(messages, "/sonar/ranges", 2), points(one(messages, "/sonar/soundings", 2))
    for sounding in found[::37]:
        beam = sounding["beam"]
        place = in_map(messages, ranges.header, ranges.ranges[beam] * array(ranges.beam_unit_vec[beam]))
        assert np.linalg.norm(place - [sounding[axis] for axis in "xyz"]) < 0.02 * ranges.ranges[beam]


def test_a_line_in_blocks_has_every_pose_once(tmp_path):
    line = soundings_line(pings=6)
    whole = bag.write(line, tmp_path / "whole.mcap")
    parts = bag.write((line.isel(ping=slice(k, k + 2)) for k in (0, 2, 4)), tmp_path / "parts.mcap")
    assert parts == whole
    one_by_one, at_once = (read(tmp_path / f"{name}.mcap")["/sonar/odometry"] for name in ("parts", "whole"))
    assert [stamp for stamp, _ in one_by_one] == [stamp for stamp, _ in at_once]


def test_fixes_are_those_of_the_projection(tmp_path):
    from pyproj import Transformer

    line = soundings_line(pings=2)
    bag.write(line, tmp_path / "a.mcap")
    message = one(read(tmp_path / "a.mcap"), "/sonar/fix", 7)
    east, north = (float(line[f"motion_{axis}"][7]) + origin for axis, origin in zip("xy", line.attrs["origin"]))
    longitude, latitude = Transformer.from_crs("EPSG:32632", "EPSG:4326", always_xy=True).transform(east, north)
    assert (message.latitude, message.longitude) == pytest.approx((latitude, longitude), abs=1e-9)
    assert message.altitude == pytest.approx(-float(line["motion_depth"][7])) and message.status.status == 0
    assert message.position_covariance_type == 0


def test_a_sidescan_looks_to_both_sides_and_below(tmp_path):
    scene = '<scene><sensor type="sidescan"><string name="preset" value="towed_100khz"/></sensor></scene>'
    record = sidescan(pings=3, bins=20).assign_attrs(depression_angle=0.3, scene=scene)
    bag.write(record, tmp_path / "a.mcap")
    messages = read(tmp_path / "a.mcap")
    image = one(messages, "/sonar/image", 1)
    np.testing.assert_array_equal(picture(image.image), record["level"].values[1].T)
    _, _, turn = transforms(messages)["base_link", "sonar"][0]
    for beam, port in enumerate((1, -1)):
        np.testing.assert_allclose(turned(turn, array(image.beam_directions[beam])),
                                   [0, port * np.cos(0.3), -np.sin(0.3)], atol=1e-12)
    # of the preset, but for what the scene itself says
    assert list(image.ping_info.rx_beamwidths) == [pytest.approx(np.radians(1.0))]
    assert list(image.ping_info.tx_beamwidths) == [pytest.approx(np.radians(50.0))]
    wider = scene.replace("<string", '<float name="vertical_beam_width_deg" value="60"/><string')
    assert beam_widths({"sonar": "sidescan", "scene": wider})["tx_beamwidths"] == [pytest.approx(np.radians(60.0))]
    for unknown in ({}, {"sonar": "sidescan", "scene": "<scene"}, {"sonar": "array_sonar", "scene": scene}):
        assert beam_widths(unknown) == {"tx_beamwidths": [], "rx_beamwidths": []}


def test_a_fan_without_directions_lies_level_and_ahead(tmp_path):
    record = moving_fan(pings=2)
    plain = record.drop_vars(["beam_x", "beam_y", "beam_z"])
    for name, one_record in (("whole", record), ("plain", plain)):
        bag.write(one_record, tmp_path / f"{name}.mcap")
    assert (tmp_path / "plain.mcap").read_bytes() == (tmp_path / "whole.mcap").read_bytes()


def test_a_multibeam_that_rolls_holds_its_beams_level(tmp_path):
    bearing = np.linspace(-1, 1, 5)
    record = fan(pings=2, beams=5, bins=4).assign_attrs(sonar="multibeam")
    record = record.assign_coords(
        {"ping_time": ("ping", [1.0, 2.0]), "roll": ("ping", [0.0, 0.2]), "pitch": ("ping", [0.0, 0.0]),
         "heading": ("ping", [0.5, 0.5]), "bearing": ("beam", bearing), "beam_x": ("beam", 0 * bearing),
         "beam_y": ("beam", np.sin(bearing)), "beam_z": ("beam", np.cos(bearing))})
    bag.write(record, tmp_path / "a.mcap")
    messages = read(tmp_path / "a.mcap")
    for number in range(2):
        image = one(messages, "/sonar/image", number)
        for angle, direction in zip(bearing, image.beam_directions):
            seen = in_map(messages, image.header, array(direction)) - [float(record[axis][number]) for axis in "xyz"]
            # starboard of a ship at heading 0.5 rad is (cos, -sin, 0)
            np.testing.assert_allclose(seen, [np.sin(angle) * np.cos(0.5), -np.sin(angle) * np.sin(0.5),
                                              -np.cos(angle)], atol=1e-12)


def test_pictures_in_metres_are_those_of_the_raster(tmp_path):
    record = moving_fan(pings=2)
    drawn = mitsonar.imaging.cartesian(record, 0.5)
    bag.write(record, tmp_path / "fan.mcap", cell=0.5)
    bag.write(drawn, tmp_path / "drawn.mcap")
    for name in ("fan", "drawn"):
        messages = read(tmp_path / f"{name}.mcap")
        for topic, variable, encoding in (("picture", "level", "32FC1"), ("picture_labels", "label", "32SC1")):
            image = one(messages, f"/sonar/{topic}", 1)
            assert (image.height, image.width, image.encoding) == (*drawn[variable].shape[1:], encoding)
            assert image.step == 4 * image.width and image.is_bigendian == 0
            np.testing.assert_array_equal(np.frombuffer(bytes(image.data), "<f4" if topic == "picture" else "<i4")
                                          .reshape(image.height, image.width), drawn[variable].values[1])
    about = json.loads(one(messages, "/sonar/about").data)
    assert about["cell"] == 0.5 and about["picture"]["y"] == [float(drawn["y"][0]), float(drawn["y"][-1])]


def test_rosbags_and_the_bag_itself_agree_on_a_heads_steps(tmp_path):
    """A second reader: rosbags by itself, which reads the definitions in the file."""
    from rosbags.highlevel import AnyReader

    record = head(steps=4, bins=6)
    record = record.assign_coords({"ping_time": ("ping", np.arange(4.0)), **{
        name: ("ping", np.zeros(4)) for name in ("roll", "pitch", "heading")}})
    bag.write(record, tmp_path / "a.mcap")
    messages = read(tmp_path / "a.mcap")
    with AnyReader([tmp_path / "a.mcap"]) as reader:
        chosen = [one for one in reader.connections if one.topic == "/sonar/image"]
        for number, (connection, stamp, raw) in enumerate(reader.messages(chosen)):
            message = reader.deserialize(raw, connection.msgtype)
            assert stamp == number * 10 ** 9
            np.testing.assert_array_equal(message.image.data.view("<f4"), record["level"].values[number])
            other = one(messages, "/sonar/image", number)
            assert array(message.beam_directions[0]).tolist() == array(other.beam_directions[0]).tolist()


def test_memory_holds_three_frames_at_most(tmp_path):
    """They are the frame that is written, the next one for the speed, and the one that is being made."""
    import weakref

    frame, alive, most = moving_fan(pings=1), weakref.WeakSet(), []

    class Counted(xr.Dataset):
        __slots__ = ()
        __hash__ = object.__hash__

    def frames():
        for number in range(40):
            made = frame.assign_coords(ping_time=("ping", [1000.0 + 0.5 * number]))
            made = Counted(made.data_vars, made.coords, made.attrs)
            alive.add(made)
            most.append(len(alive))
            yield made
    assert bag.write(frames(), tmp_path / "a.mcap")["/sonar/image"] == 40
    assert max(most) <= 3
