"""Read bags by `mcap_ros2`, which is not ours, and chain their transforms by hand."""
import numpy as np
import pytest


def read(path):
    """All messages of a bag by topic, in the order of time, each with its log time [ns]."""
    reader = pytest.importorskip("mcap_ros2.reader", reason="mcap-ros2-support is not installed")
    found = {}
    for message in reader.read_ros2_messages(str(path)):
        found.setdefault(message.channel.topic, []).append((message.log_time_ns, message.ros_msg))
    return found


def one(messages, topic, number=0):
    """A message of a topic."""
    return messages[topic][number][1]


def array(vector):
    """A vector or a quaternion as an array."""
    return np.array([getattr(vector, name) for name in "xyzw" if hasattr(vector, name)])


def turned(quaternion, vector):
    """A vector turned by a quaternion x, y, z, w: v + 2 w q × v + 2 q × (q × v)."""
    q, w = np.asarray(quaternion)[:3], quaternion[3]
    return vector + 2 * w * np.cross(q, vector) + 2 * np.cross(q, np.cross(q, vector))


def transforms(messages):
    """The transforms of a bag, {(parent, child): [(stamp [ns], translation, quaternion)]}."""
    found = {}
    for topic in ("/tf_static", "/tf"):
        for _, message in messages[topic]:
            for one in message.transforms:
                stamp = one.header.stamp.sec * 10 ** 9 + one.header.stamp.nanosec
                found.setdefault((one.header.frame_id, one.child_frame_id), []).append(
                    (stamp, array(one.transform.translation), array(one.transform.rotation)))
    return found


def in_map(messages, header, point):
    """A point of a message's frame in the map, by the transform of the message's own stamp."""
    stamp, known = header.stamp.sec * 10 ** 9 + header.stamp.nanosec, transforms(messages)
    frame, point = header.frame_id, np.asarray(point, float)
    while frame != "map":
        (parent, _), chain = next((names, every) for names, every in known.items() if names[1] == frame)
        _, place, turn = min(chain, key=lambda each: abs(each[0] - stamp))
        frame, point = parent, place + turned(turn, point)
    return point


def points(message):
    """The columns of a PointCloud2."""
    types = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
    layout = np.dtype({"names": [field.name for field in message.fields],
                       "formats": ["<" + types[field.datatype] for field in message.fields],
                       "offsets": [field.offset for field in message.fields], "itemsize": message.point_step})
    return np.frombuffer(bytes(message.data), layout)


def picture(image):
    """The numbers of a SonarImageData, (range, beam)."""
    kind = ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8")[image.dtype]
    return np.frombuffer(bytes(image.data), f"<{kind}").reshape(-1, image.beam_count)
