"""Vehicles' own bags as tracks and records: by frames of ROS, by frames that end in _ned, by transforms, by fixes.

Closed form: a vehicle on a circle of 20 m about (5, -3), 6 m deep, clockwise at 0.1 rad/s, rolled by 0.1 and pitched by
-0.05 rad. Its bags are written here from the definitions of the axes alone, with the rotations of scipy: about z by
90° - heading, then about y by -pitch, then about x by roll (x forward, y port, z up); or about z by heading, y by
pitch, x by roll (x forward, y starboard, z down). Tolerance 1e-9: all is float64.
"""
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from soundings_line import soundings_line
from synthetic_fan import fan, head

from mitsonar.io.bags import bag, recorded
from mitsonar.io.bags.bag_messages import BagMessage, header, vector

pytest.importorskip("rosbags", reason="rosbags is not installed")
START = 1.75e9
TIME = START + 0.1 * np.arange(30)
HEADING = 0.4 + 0.1 * (TIME - START)
PLACE = np.stack([5 - 20 * np.cos(HEADING), -3 + 20 * np.sin(HEADING), np.full(30, -6.0)], -1)
ROLL, PITCH = 0.1, -0.05
FLU = Rotation.from_euler("ZYX", np.stack([np.pi / 2 - HEADING, np.full(30, -PITCH), np.full(30, ROLL)], -1))
FRD = Rotation.from_euler("ZYX", np.stack([HEADING, np.full(30, PITCH), np.full(30, ROLL)], -1))


def quaternion(turn):
    return dict(zip("xyzw", map(float, turn)))


def odometry(number, place, turn, frame="odom", topic="/odometry"):
    stamp = round(TIME[number] * 1e9)
    return BagMessage(topic=topic, type="nav_msgs/msg/Odometry", stamp=stamp, fields={
        "header": header(stamp, frame), "child_frame_id": "base_link",
        "pose": {"pose": {"position": vector(place), "orientation": quaternion(turn)}}})


def transform(number, parent, child, place, turn, topic="/tf"):
    stamp = round(TIME[number] * 1e9)
    return BagMessage(topic=topic, type="tf2_msgs/msg/TFMessage", stamp=stamp, fields={"transforms": [
        {"header": header(stamp, parent), "child_frame_id": child,
         "transform": {"translation": vector(place), "rotation": quaternion(turn)}}]})


def check(track):
    np.testing.assert_allclose(track.time, TIME, atol=1e-6)
    np.testing.assert_allclose(np.stack([track.x, track.y, track.z], -1), PLACE, atol=1e-9)
    np.testing.assert_allclose(np.stack([track.roll, track.pitch, track.heading], -1),
                               np.stack([np.full(30, ROLL), np.full(30, PITCH), HEADING], -1), atol=1e-9)


def test_odometry_in_axes_of_ros(tmp_path):
    bag.write_messages((odometry(k, PLACE[k], FLU.as_quat()[k]) for k in range(30)), tmp_path / "a.mcap")
    check(recorded.read_track(tmp_path / "a.mcap"))


def test_odometry_in_a_frame_north_east_down(tmp_path):
    ned = PLACE[:, [1, 0, 2]] * [1, 1, -1]
    bag.write_messages((odometry(k, ned[k], FRD.as_quat()[k], "map_ned") for k in range(30)), tmp_path / "a.mcap")
    check(recorded.read_track(tmp_path / "a.mcap"))


def test_transforms_are_chained_to_the_outermost_frame(tmp_path):
    """The map's odom is turned by 1 rad about z and moved; base_link moves in odom."""
    outer, moved = Rotation.from_euler("Z", 1.0), np.array([2.0, 7.0, -1.0])
    inner, turn = outer.inv().apply(PLACE - moved), (outer.inv() * FLU).as_quat()
    stream = [transform(0, "map", "odom", moved, outer.as_quat(), "/tf_static"),
              *(transform(k, "odom", "auv/base_link", inner[k], turn[k]) for k in range(30)),
              transform(3, "auv/base_link", "arm", [1, 0, 0], [0, 0, 0, 1])]
    bag.write_messages(stream, tmp_path / "a.mcap")
    check(recorded.read_track(tmp_path / "a.mcap"))


def test_fixes_with_the_attitude_of_the_imu(tmp_path):
    stream = []
    for k in range(30):
        stamp = round(TIME[k] * 1e9)
        stream += [BagMessage(topic="/imu", type="sensor_msgs/msg/Imu", stamp=stamp, fields={
            "header": header(stamp, "base_link"), "orientation": quaternion(FLU.as_quat()[k])}),
            BagMessage(topic="/fix", type="sensor_msgs/msg/NavSatFix", stamp=stamp, fields={
                "header": header(stamp, "gps"), "latitude": 54.0 + 1e-6 * k, "longitude": 8.0 - 2e-6 * k,
                "altitude": 41.2, "status": {"status": 0 if k != 5 else -1}})]
    bag.write_messages(stream, tmp_path / "a.mcap")
    track = recorded.read_track(tmp_path / "a.mcap")
    kept = np.arange(30) != 5                         # no fix there
    assert track.geographic and track.z is None       # 41 m above the ellipsoid says nothing of a depth
    np.testing.assert_allclose(track.y, 54.0 + 1e-6 * np.flatnonzero(kept), atol=1e-12)
    np.testing.assert_allclose(track.x, 8.0 - 2e-6 * np.flatnonzero(kept), atol=1e-12)
    np.testing.assert_allclose(track.heading, HEADING[kept], atol=1e-6)
    np.testing.assert_allclose(track.roll, ROLL, atol=1e-9)


def test_bags_in_folders_of_sqlite_are_read_too(tmp_path):
    from rosbags.rosbag2 import StoragePlugin, Writer

    with Writer(tmp_path / "run", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        place = writer.add_connection("/odometry", "nav_msgs/msg/Odometry", typestore=bag.typestore())
        for k in range(30):
            message = odometry(k, PLACE[k], FLU.as_quat()[k])
            writer.write(place, message.stamp, bag.serialised(message))
    check(recorded.read_track(tmp_path / "run"))


def test_bags_of_ros_1_are_read_too(tmp_path):
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    kinds = {name.rpartition("/")[2]: kind for name, kind in store.types.items()
             if name.split("/")[0] in ("nav_msgs", "geometry_msgs", "builtin_interfaces") or name.endswith("/Header")}
    with Writer(tmp_path / "a.bag") as writer:
        place = writer.add_connection("/odometry", "nav_msgs/msg/Odometry", typestore=store)
        for k in range(30):
            stamp = round(TIME[k] * 1e9)
            pose = kinds["Pose"](kinds["Point"](*PLACE[k]), kinds["Quaternion"](*FLU.as_quat()[k]))
            twist = kinds["Twist"](kinds["Vector3"](0.0, 0.0, 0.0), kinds["Vector3"](0.0, 0.0, 0.0))
            message = kinds["Odometry"](
                kinds["Header"](k, kinds["Time"](*divmod(stamp, 10 ** 9)), "odom"), "base_link",
                kinds["PoseWithCovariance"](pose, np.zeros(36)), kinds["TwistWithCovariance"](twist, np.zeros(36)))
            writer.write(place, stamp, store.serialize_ros1(message, "nav_msgs/msg/Odometry"))
    check(recorded.read_track(tmp_path / "a.bag"))


def test_our_own_bag_gives_the_poses_of_its_soundings(tmp_path):
    line = soundings_line(pings=3)
    bag.write(line, tmp_path / "a.mcap")
    track = recorded.read_track(tmp_path / "a.mcap", topic="/sonar/odometry")
    for name, values in (("x", line["motion_x"]), ("z", -line["motion_depth"]), ("roll", line["motion_roll"]),
                         ("pitch", line["motion_pitch"]), ("heading", line["motion_heading"])):
        np.testing.assert_allclose(getattr(track, name), values, atol=1e-9, err_msg=name)


def with_poses(record):
    pings = record.sizes["ping"]
    values = {"ping_time": 100.0 + np.arange(pings), "heading": np.full(pings, 1.5), "z": np.full(pings, -5.0),
              "roll": np.zeros(pings), "pitch": np.zeros(pings)}
    return record.assign_coords({name: ("ping", value) for name, value in values.items()})


def test_images_come_back_as_records(tmp_path):
    record = with_poses(fan(pings=3, beams=9, bins=12))
    record["recorded"] = record["level"].dims, np.arange(324, dtype=np.uint16).reshape(3, 9, 12)
    bag.write(record, tmp_path / "a.mcap")
    track = recorded.read_track(tmp_path / "a.mcap")
    image, = recorded.read_images(tmp_path / "a.mcap", topic="/sonar/image", track=track)
    np.testing.assert_array_equal(image["level"], record["level"])
    for name in ("bearing", "beam_x", "beam_y", "beam_z", "ping_time", "x", "y", "z", "heading"):
        np.testing.assert_allclose(image[name], record[name], atol=1e-9, err_msg=name)
    np.testing.assert_allclose(image["range"], record["range"], rtol=1e-7)
    counts, = recorded.read_images(tmp_path / "a.mcap", topic="/sonar/recorded")
    np.testing.assert_array_equal(counts["recorded"], record["recorded"])
    assert counts["level"].attrs["units"] == "dB re full scale" and "x" not in counts.coords
    assert float(counts["level"][2, 8, 11]) == pytest.approx(20 * np.log10(323 / 65535), abs=1e-5)


def test_steps_of_a_head_are_one_record(tmp_path):
    record = with_poses(head(turns=2, steps=8, bins=6)).assign_attrs(mount="down", tilt=0.0)
    bag.write(record, tmp_path / "a.mcap")
    image, = recorded.read_images(tmp_path / "a.mcap", topic="/sonar/image")
    np.testing.assert_array_equal(image["level"], record["level"])
    np.testing.assert_allclose(np.cos(image["bearing"] - record["bearing"].values), 1, atol=1e-12)
    assert image["turn"].values[-1] > 0 and image.sizes == {"ping": 16, "range": 6}


def test_another_range_begins_another_record(tmp_path):
    short, long = with_poses(fan(pings=2, beams=5, bins=7)), with_poses(fan(pings=2, beams=5, bins=7, far=40.0))
    bag.write([short, long.assign_coords(ping_time=long["ping_time"] + 10)], tmp_path / "a.mcap")
    images = recorded.read_images(tmp_path / "a.mcap", topic="/sonar/image")
    assert [round(float(image["range"][-1])) for image in images] == [20, 40]


def test_what_is_no_bag_or_not_enough_is_said_in_one_sentence(tmp_path):
    whole = tmp_path / "a.mcap"
    bag.write(with_poses(fan(pings=3, beams=5, bins=7)), whole)
    content = whole.read_bytes()
    for name, data in (("cut", content[:len(content) // 2]), ("empty", b""), ("wrong", b"\x89HDF\r\n\x1a\n" * 99)):
        (tmp_path / f"{name}.mcap").write_bytes(data)
        with pytest.raises(ValueError, match=f"cannot read .*{name}.mcap: it is cut short, damaged or no bag"):
            recorded.read_track(tmp_path / f"{name}.mcap")
    (tmp_path / "a.txt").write_bytes(content)
    with pytest.raises(ValueError, match="the name of a bag ends in"):
        recorded.read_track(tmp_path / "a.txt")
    with pytest.raises(FileNotFoundError, match="there is no such file"):
        recorded.read_images(tmp_path / "none.mcap")
    with pytest.raises(ValueError, match="several topics with images of a sonar, /sonar/image, /sonar/labels; choose"):
        recorded.read_images(whole)
    with pytest.raises(ValueError, match="no topic /sonar/imu with a track; it has /sonar/odometry, /tf"):
        recorded.read_track(whole, topic="/sonar/imu")
    bag.write_messages([odometry(0, PLACE[0], FLU.as_quat()[0])], tmp_path / "one.mcap")
    with pytest.raises(ValueError, match="has 1 poses at different times"):
        recorded.read_track(tmp_path / "one.mcap")
    bag.write_messages((odometry(k, PLACE[k], [0, 0, 0, 0]) for k in range(3)), tmp_path / "zero.mcap")
    with pytest.raises(ValueError, match="no unit quaternions"):
        recorded.read_track(tmp_path / "zero.mcap")
    bag.write_messages((odometry(k, [np.nan, 0, 0], [0, 0, 0, 1]) for k in range(3)), tmp_path / "nan.mcap")
    with pytest.raises(ValueError, match="not finite"):
        recorded.read_track(tmp_path / "nan.mcap")
    message = next(one for one in bag.messages(with_poses(fan(beams=5, bins=7))) if one.topic == "/sonar/image")
    short = {**message.fields, "ranges": [1.0, 2.0]}
    bag.write_messages([BagMessage(topic="/i", type=message.type, stamp=1, fields=short)], tmp_path / "short.mcap")
    with pytest.raises(ValueError, match="140 bytes of type 8 for 5 beams, 5 directions and 2 ranges"):
        recorded.read_images(tmp_path / "short.mcap")
