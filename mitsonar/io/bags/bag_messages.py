"""Messages of ROS 2 as dictionaries, their definitions, and their bytes (CDR) without ROS.

Standard messages are those of `rosbags`; `marine_acoustic_msgs` is given here by its fields and their types (release
2.0.2), which is all that a reader needs.
"""
from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mitsonar.device.extras import MissingExtra

NANO = 1_000_000_000               # of a second
LATEST = (1 << 31) - 1             # [s] since 1970 that a stamp can hold
# each field as "type name", in the order of the message
ACOUSTIC = {
    "DetectionFlag": "uint8 flag",
    "PingInfo": "float32 frequency; float32 sound_speed; float32[] tx_beamwidths; float32[] rx_beamwidths",
    "SonarImageData": "bool is_bigendian; uint32 dtype; uint32 beam_count; uint8[] data",
    "ProjectedSonarImage": "std_msgs/Header header; PingInfo ping_info; geometry_msgs/Vector3[] beam_directions; "
                           "float32[] ranges; SonarImageData image",
    "RawSonarImage": "std_msgs/Header header; PingInfo ping_info; float32 sample_rate; uint32 samples_per_beam; "
                     "uint32 sample0; float32[] tx_delays; float32[] tx_angles; float32[] rx_angles; "
                     "SonarImageData image",
    "SonarDetections": "std_msgs/Header header; PingInfo ping_info; DetectionFlag[] flags; "
                       "float32[] two_way_travel_times; float32[] tx_delays; float32[] intensities; "
                       "float32[] tx_angles; float32[] rx_angles",
    "SonarRanges": "std_msgs/Header header; PingInfo ping_info; DetectionFlag[] flags; float32[] transmit_delays; "
                   "float32[] intensities; geometry_msgs/Vector3[] beam_unit_vec; float32[] ranges",
}
BAD = 1                            # DetectionFlag: flagged by the sonar
# SonarImageData.dtype by NumPy's name of a type
IMAGE_TYPES = {name: number for number, name in enumerate(("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8"))}
# PointField.datatype likewise
FIELD_TYPES = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}


@dataclass(frozen=True, kw_only=True, eq=False)
class BagMessage:
    """Message of ROS 2 on a topic.

    Parameters
    ----------
    topic : str
        Such as "/sonar/image".
    type : str
        Such as "nav_msgs/msg/Odometry".
    stamp : int [ns]
        Since 1970.
    fields : dict
        Values by the names of the message's fields; messages within it are dictionaries. Missing fields are 0 or empty.
    """

    topic: str
    type: str
    stamp: int
    fields: Mapping[str, Any]


def nanoseconds(seconds: float, start: float = 0.0) -> int:
    """Return a time [s] after a start [s] since 1970 in nanoseconds; raise `ValueError` if a stamp cannot hold it."""
    if not 0 <= start + seconds <= LATEST:
        raise ValueError(f"a time of the record is {start + seconds:.10g} s since 1970, and stamps of ROS hold 0 to "
                         f"{LATEST}; give another date of time 0 (--start).")
    # the sum of both has the spacing of float64 today, 2e-7 s
    return round(start * NANO) + round(seconds * NANO)


def header(stamp: int, frame: str) -> dict[str, Any]:
    """Return a message's header."""
    return {"stamp": {"sec": stamp // NANO, "nanosec": stamp % NANO}, "frame_id": frame}


def vector(values: np.ndarray) -> dict[str, float]:
    """Return a vector (3,) as the fields of a message."""
    return dict(zip("xyz", map(float, values)))


def cloud(points: Mapping[str, np.ndarray], stamp: int, frame: str) -> dict[str, Any]:
    """Return the fields of a PointCloud2 from columns (P,)."""
    columns = {name: np.asarray(column) for name, column in points.items()}
    layout = np.dtype([(name, column.dtype.newbyteorder("<")) for name, column in columns.items()])
    table = np.empty(len(next(iter(columns.values()))), layout)
    for name, column in columns.items():
        table[name] = column
    assert layout.fields is not None
    return {"header": header(stamp, frame), "height": 1, "width": table.size, "point_step": layout.itemsize,
            "row_step": table.nbytes, "data": table.view(np.uint8), "is_dense": True,
            "fields": [{"name": name, "offset": layout.fields[name][1], "count": 1,
                        "datatype": FIELD_TYPES[columns[name].dtype.str[1:]]} for name in columns]}


@functools.cache
def typestore() -> Any:
    """Return the known types of messages; raise `MissingExtra` if rosbags is not installed."""
    try:
        from rosbags import typesys  # pyright: ignore[reportMissingImports]  # of the extra ros
    except ImportError:
        raise MissingExtra("bags of ROS need the package rosbags", "ros") from None
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    types = {}
    for name, fields in ACOUSTIC.items():
        types |= typesys.get_types_from_msg(fields.replace("; ", "\n"), f"marine_acoustic_msgs/msg/{name}")
    store.register(types)
    return store


def serialised(message: BagMessage) -> bytes:
    """Return the bytes of a message, as ROS 2 sends it.

    Parameters
    ----------
    message : BagMessage

    Returns
    -------
    bytes
        CDR, little-endian. A publisher of rclpy takes them in place of a message.

    Raises
    ------
    ValueError
        If rosbags is not installed, the type is unknown, or a field does not belong to it.
    """
    store = typestore()
    if message.type not in store.fielddefs:
        raise ValueError(f"{message.type!r} is no known type of message; take one such as nav_msgs/msg/Odometry.")
    return bytes(store.serialize_cdr(_filled(store, message.type, message.fields), message.type, little_endian=True))


def _filled(store, name, fields):
    """Return an object of a type from the values of its fields."""
    known = dict(store.fielddefs[name][1])
    if stray := sorted(set(fields) - set(known)):
        raise ValueError(f"{name} has no field {stray[0]!r}; it has {', '.join(known)}.")
    return store.types[name](**{field: _value(store, fields.get(field), *kind) for field, kind in known.items()})


def _value(store, value, node, kind):
    """Return the value of a field by the node of its type, or 0 or nothing in its place."""
    if node == 1:                                      # a number or text
        empty = {"string": "", "bool": False}.get(kind[0], 0)
        return empty if value is None else type(empty)(value) if kind[0] in ("string", "bool") else value
    if node == 2:                                      # a message
        return _filled(store, kind, {} if value is None else value)
    (inner, of), length = kind                         # an array or a sequence
    if inner == 2:
        return [_filled(store, of, item) for item in ([] if value is None else value)]
    if of[0] == "string":
        return list(value or ())
    return np.zeros(length, of[0]) if value is None else np.ascontiguousarray(value, of[0]).reshape(-1)
