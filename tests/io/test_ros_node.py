"""The tutorial's node, with a stand-in for ROS: every message that it publishes reads back, by rosbags.

The stand-in keeps what is published; poses are objects with the fields of Odometry.
"""
import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace as Fields

import numpy as np
import pytest
import xarray as xr

import mitsonar
from mitsonar.io import bag

pytest.importorskip("rosbags", reason="rosbags is not installed")
NODE = Path(__file__).resolve().parents[2] / "scenes" / "tutorials" / "ros_node.py"
SECONDS, NANOSECONDS = 1_777_629_600, (123_456_789, 623_456_789)


def odometry(number):
    """A vehicle that heads east at 1 m/s, in the scene of a forward-looking sonar."""
    half = np.sqrt(0.5)
    return Fields(
        header=Fields(stamp=Fields(sec=SECONDS, nanosec=NANOSECONDS[number]), frame_id="map"),
        pose=Fields(pose=Fields(position=Fields(x=0.5 * number, y=-10.0, z=-16.0),
                                orientation=Fields(x=0.0, y=0.0, z=0.1 * half, w=half * np.sqrt(2 - 0.01)))),
        twist=Fields(twist=Fields(linear=Fields(x=1.0, y=0.0, z=0.0), angular=Fields(x=0.0, y=0.0, z=0.2))))


@pytest.fixture
def published(monkeypatch):
    """A stand-in for rclpy, whose spin hands over two poses; what is published, [(topic, type, quality, bytes)]."""
    found, callbacks = [], []

    class Node:
        def create_publisher(self, kind, topic, quality):
            return Fields(publish=lambda content: found.append((topic, kind, quality, content)))

        def create_subscription(self, kind, topic, callback, depth):
            callbacks.append(callback)

    def spin(_):
        for number in range(2):
            callbacks[0](odometry(number))
    modules = {"rclpy": {"init": lambda: None, "create_node": lambda _: Node(), "spin": spin},
               "rclpy.qos": {"DurabilityPolicy": Fields(TRANSIENT_LOCAL="kept", VOLATILE="once"), "QoSProfile": Fields},
               "nav_msgs": {}, "nav_msgs.msg": {"Odometry": None}, "rosidl_runtime_py": {},
               "rosidl_runtime_py.utilities": {"get_message": str}}
    for name, values in modules.items():
        module = ModuleType(name)
        vars(module).update(values)
        monkeypatch.setitem(sys.modules, name, module)
    return found


def test_the_node_publishes_each_ping_at_the_stamp_of_its_pose(published):
    runpy.run_path(str(NODE), run_name="__main__")
    assert [topic for topic, *_ in published] == ["/sonar/about", "/tf_static", *["/sonar/image", "/sonar/recorded",
                                                                                  "/sonar/labels"] * 2]
    assert [quality.durability for _, _, quality, _ in published] == ["kept"] * 2 + ["once"] * 6
    images = [bag.typestore().deserialize_cdr(content, kind) for topic, kind, _, content in published
              if topic == "/sonar/image"]
    assert [(one.header.stamp.sec, one.header.stamp.nanosec) for one in images] == [(SECONDS, nano)
                                                                                    for nano in NANOSECONDS]
    with mitsonar.Sonar("forward_looking", seed=1, elements=16, beams=31, range=16) as sonar:
        for number, image in enumerate(images):
            frame = sonar.ping(**bag.pose_of(odometry(number), SECONDS))
            np.testing.assert_array_equal(image.image.data.view("<f4").reshape(-1, 31), frame["level"].values[0].T)


def test_a_pose_of_odometry_is_that_of_its_message():
    """There and back: a pose becomes a message, and the message the pose."""
    rng = np.random.default_rng(1)
    given = {"position": rng.normal(size=3), "attitude": np.array([0.2, -0.4, 2.5]), "velocity": rng.normal(size=3),
             "turn_rate": rng.normal(size=3), "time": 12.25}
    names = dict(zip(("x", "y", "z", "roll", "pitch", "heading", "ping_time"),
                     (*given["position"], *given["attitude"], given["time"])))
    frame = xr.Dataset({"level": (("ping", "range"), [[1.0]])}, {
        "range": [1.0], **{name: ("ping", [value]) for name, value in names.items()}})
    message = next(one for one in bag.messages(frame, start=1000.0, velocity=given["velocity"],
                                               turn_rate=given["turn_rate"]) if one.topic == "/sonar/odometry")
    read = bag.typestore().deserialize_cdr(bag.serialised(message), message.type)
    for name, value in bag.pose_of(read, 1000.0).items():
        np.testing.assert_allclose(value, given[name], atol=1e-12, err_msg=name)


def test_stepped_soundings_become_the_same_messages():
    with mitsonar.Sonar("multibeam", seed=1) as sonar:
        sounded = sonar.soundings(position=(0, -15, -1.5), velocity=(0, 2, 0), time=0.5)
    topics = {one.topic: one for one in bag.messages(sounded)}
    assert {"/sonar/detections", "/sonar/ranges", "/sonar/soundings", "/sonar/truth", "/sonar/odometry"} <= set(topics)
    found = bag.typestore().deserialize_cdr(bag.serialised(topics["/sonar/detections"]),
                                            "marine_acoustic_msgs/msg/SonarDetections")
    np.testing.assert_array_equal(found.two_way_travel_times, np.float32(sounded["travel_time"].values[0]))


def test_fields_that_a_message_lacks_and_unknown_types_are_refused():
    message = bag.BagMessage(topic="/a", type="std_msgs/msg/String", stamp=0, fields={"text": "a"})
    with pytest.raises(ValueError, match="std_msgs/msg/String has no field 'text'; it has data"):
        bag.serialised(message)
    with pytest.raises(ValueError, match="'a/b' is no known type"):
        bag.serialised(bag.BagMessage(topic="/a", type="a/b", stamp=0, fields={}))
