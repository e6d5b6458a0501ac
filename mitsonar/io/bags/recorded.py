"""Read vehicles' own bags: the track by odometry, transforms or fixes, and the images of a sonar.

    ROS 2 (.mcap, .db3, a folder with them) and ROS 1 (.bag), by `rosbags`

Poses in `map` or `odom` have x east, y north, z up, and bodies x forward, y port, z up (REP 103). A frame whose name
ends in _ned has x north, y east, z down, and bodies in it x forward, y starboard, z down.
"""
from __future__ import annotations

import contextlib
import itertools
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

from mitsonar.device.files import FilePath, check_readable
from mitsonar.device.rotations import mounting_angles

from ..records.records import SonarImage
from ..tracks.navigation import Navigation
from . import axes
from .bag_messages import IMAGE_TYPES, typestore

ODOMETRY, TF = "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"
FIX, IMU = "sensor_msgs/msg/NavSatFix", "sensor_msgs/msg/Imu"
TRACKS = (ODOMETRY, "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped", TF, FIX)
IMAGE = "marine_acoustic_msgs/msg/ProjectedSonarImage"
BODY = "base_link"                 # end of the name of a vehicle's frame
SUFFIXES = (".mcap", ".db3", ".bag")
LEAST = 0.015                      # [s] between poses of a track: denser ones are thinned out
MOST_BYTES = 4_000_000_000         # of the records of images
BYTES_EACH = 8                     # of a number: in the bag, as a level, as counts
SAME = 1e-5                        # tolerance of directions and, relatively, of ranges that stay


def read_track(path: FilePath, *, topic: str | None = None) -> Navigation:
    """Read the track of a vehicle's bag.

    Parameters
    ----------
    path : str or path
        An .mcap, .db3 or .bag file, or a folder of ROS 2.
    topic : str or None
        Topic of Odometry, PoseStamped, PoseWithCovarianceStamped, TFMessage (of base_link) or NavSatFix (with the
        attitude of the bag's Imu). None: the only topic of the first of these types that the bag has.

    Returns
    -------
    Navigation
        Times since 1970, at least 0.015 s apart. Positions are in the frame of the poses, or in degrees from fixes;
        ``z`` is None if the altitudes of fixes are not below the surface.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file is no bag, is cut short, has no such topic or several, or its poses are no numbers.
    """
    with _opened(path) as reader:
        kind, topic = _chosen(reader, path, TRACKS, topic, "a track")
        if kind == FIX:
            return _by_fixes(reader, path, topic)
        rows, frames = [], set()
        for stamp, place, turn, frame in _transforms(reader, topic) if kind == TF else _poses(reader, topic):
            rows.append((stamp, *place, *turn))
            frames.add(frame)
    table = _table(rows, path, topic)
    place, turn = table[:, 1:4], table[:, 4:]
    if not np.linalg.norm(turn, axis=1).min() > 0.5:
        raise _Told(f"cannot use {path}: some orientations of {topic} are no unit quaternions; choose another "
                         "topic.")
    if any(str(frame).endswith("_ned") for frame in frames):
        place, angles = place[:, [1, 0, 2]] * [1, 1, -1], mounting_angles(Rotation.from_quat(turn).as_matrix())
    else:
        angles = axes.attitudes(turn)
    roll, pitch, heading = angles.T
    return Navigation(time=table[:, 0], x=place[:, 0], y=place[:, 1], z=place[:, 2], heave=0 * roll, roll=roll,
                      pitch=pitch, heading=np.unwrap(heading))


def read_images(path: FilePath, *, topic: str | None = None, track: Navigation | None = None,
                pings: slice | None = None) -> list[SonarImage]:
    """Read the images of a sonar's bag as records.

    Parameters
    ----------
    path : str or path
        As in `read_track`.
    topic : str or None
        Topic of ProjectedSonarImage. None: the only one of the bag.
    track : Navigation or None
        Gives the records the poses of their pings. None: they have none.
    pings : slice or None
        Images to read, by their numbers in the order of the bag. None: all.

    Returns
    -------
    list of SonarImage
        Records over (ping, beam, range), or of a single beam over (ping, range); a new one wherever beams, ranges or
        the type of numbers change. Floats are taken as levels [dB]; of integers, ``level`` is 20 log10 of the counts
        over full scale, and ``recorded`` the counts. Beams are as in `mitsonar.render`; the sonar looks ahead and is
        level, unless the bag states its mounting.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        As `read_track`, or if an image's numbers do not fit its beams and ranges, or the images take too much memory.
    """
    with _opened(path) as reader:
        _, topic = _chosen(reader, path, (IMAGE,), topic, "images of a sonar")
        runs: list[list[_Image]] = []
        size = 0
        part = pings or slice(None)
        for stamp, message in itertools.islice(_messages(reader, topic), part.start, part.stop, part.step):
            image = _Image(stamp, message, path, topic)
            size += image.values.size * BYTES_EACH
            if size > MOST_BYTES:
                raise _Told(f"cannot read {path}: the images of {topic} take more than {MOST_BYTES / 1e9:g} GB; read "
                            "some of them at a time, such as --pings 0:500.")
            if not runs or not image.like(runs[-1][0]):
                runs.append([])
            runs[-1].append(image)
        if not runs:
            raise _Told(f"cannot use {path}: {topic} has no such images; choose another topic or other pings.")
        mounts = {image.frame: _mount(reader, image.frame) for run in runs for image in run[:1]}
    return [_record(run, mounts[run[0].frame], topic, track) for run in runs]


def track_if_any(path: FilePath) -> Navigation | None:
    """Return the track of a bag, or None if it has none, or several."""
    try:
        return read_track(path)
    except _Told:
        return None


def image_times(path: FilePath) -> np.ndarray:
    """Return the times of the images of a bag's only or first topic of images (P,) [s] since 1970; often none."""
    with _opened(path) as reader:
        topics = sorted(connection.topic for connection in reader.connections if connection.msgtype == IMAGE)
        return np.array(sorted(stamp for stamp, _ in _messages(reader, *topics[:1])))


# ---- the file

@contextlib.contextmanager
def _opened(path: FilePath) -> Iterator[Any]:
    """Open a bag; raise `ValueError` in one sentence for one that is none, is cut or damaged."""
    store = typestore()
    from rosbags import highlevel  # pyright: ignore[reportMissingImports]  # of the extra ros

    target = Path(path)
    if not target.is_dir():
        check_readable(path, "the bag", "an .mcap, .db3 or .bag file")
        if target.suffix not in SUFFIXES:
            raise _Told(f"cannot read {path}: the name of a bag ends in {', '.join(SUFFIXES)}; rename it, or give "
                        "another file.")
    try:
        with highlevel.AnyReader([target], default_typestore=store) as reader:
            yield reader
    except (MemoryError, _Told):
        raise
    except Exception as error:                         # its type depends on where the file is damaged
        said = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(f"cannot read {path}: it is cut short, damaged or no bag ({said[:120].rstrip('.')}); repair "
                         "it, as by mcap recover.") from None


class _Told(ValueError):
    """Error that already says in a sentence what is wrong."""


def _chosen(reader: Any, path: FilePath, kinds: tuple[str, ...], topic: str | None, what: str) -> tuple[str, str]:
    """Return the type and the name of a topic: the one asked for, or the only one of the first type."""
    found = {connection.topic: connection.msgtype for connection in reader.connections
             if connection.msgtype in kinds and connection.topic != "/tf_static" and connection.msgcount}
    if topic is not None:
        if topic not in found:
            raise _Told(f"cannot use {path}: it has no topic {topic} with {what}; it has "
                        f"{', '.join(sorted(found)) or 'none'}.")
        return found[topic], topic
    for kind in kinds:
        names = sorted(name for name, one in found.items() if one == kind)
        if len(names) > 1:
            raise _Told(f"cannot use {path}: it has several topics with {what}, {', '.join(names)}; choose one by "
                        "--topic.")
        if names:
            return kind, names[0]
    raise _Told(f"cannot use {path}: it has no topic with {what} ({', '.join(kinds)}).")


def _messages(reader: Any, *topics: str) -> Iterator[tuple[float, Any]]:
    """Yield the messages of topics with the times of their headers [s], or of the log where these are 0."""
    chosen = [connection for connection in reader.connections if connection.topic in topics]
    for connection, logged, raw in reader.messages(chosen) if chosen else ():
        message = reader.deserialize(raw, connection.msgtype)
        yield _seconds(getattr(message, "header", None), logged), message


def _seconds(header: Any, logged: int) -> float:
    stamp = 0.0 if header is None else header.stamp.sec + 1e-9 * header.stamp.nanosec
    return stamp or 1e-9 * logged


# ---- the track

def _poses(reader: Any, topic: str) -> Iterator[tuple[float, list[float], list[float], str]]:
    """Yield the poses of a topic: time, position, quaternion, and the name of the frame."""
    for stamp, message in _messages(reader, topic):
        pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
        yield stamp, _xyz(pose.position), _xyz(pose.orientation), message.header.frame_id


def _transforms(reader: Any, topic: str) -> Iterator[tuple[float, list[float], list[float], str]]:
    """Yield the poses of base_link in the outermost frame, by the latest transforms above it."""
    above: dict[str, tuple[str, np.ndarray, Rotation]] = {}
    for _, message in _messages(reader, "/tf_static", topic):
        for one in message.transforms:
            child, moved = one.child_frame_id.lstrip("/"), one.transform
            above[child] = (one.header.frame_id.lstrip("/"), np.array(_xyz(moved.translation)),
                            Rotation.from_quat(_xyz(moved.rotation)))
            if child.endswith(BODY):
                frame, place, turn = above[child]
                for _ in range(len(above)):            # a ring of frames has no outermost one
                    if frame not in above:
                        break
                    frame, outer, outer_turn = above[frame]
                    place, turn = outer + outer_turn.apply(place), outer_turn * turn
                yield _seconds(one.header, 0), place.tolist(), turn.as_quat().tolist(), frame


def _by_fixes(reader: Any, path: FilePath, topic: str) -> Navigation:
    """Return a track in degrees, with the attitude of the bag's Imu between the fixes if there is one."""
    fixes = _table([(stamp, one.longitude, one.latitude, one.altitude) for stamp, one in _messages(reader, topic)
                    if one.status.status >= 0], path, topic, finite=3)
    time, longitude, latitude, altitude = fixes.T
    imus = sorted(connection.topic for connection in reader.connections if connection.msgtype == IMU)
    roll = pitch = 0 * time
    heading = None
    if imus:
        turns = _table([(stamp, *_xyz(one.orientation)) for stamp, one in _messages(reader, imus[0])], path, imus[0])
        if np.linalg.norm(turns[:, 1:], axis=1).min() > 0.5:
            angles = np.unwrap(axes.attitudes(turns[:, 1:]), axis=0)
            roll, pitch, heading = (np.interp(time, turns[:, 0], column) for column in angles.T)
    below = np.isfinite(altitude).all() and altitude.max() <= 0
    return Navigation(time=time, x=np.unwrap(longitude, period=360), y=latitude, z=altitude if below else None,
                      heave=0 * time, roll=roll, pitch=pitch, heading=heading, geographic=True)


def _table(rows: list, path: FilePath, topic: str, finite: int | None = None) -> np.ndarray:
    """Return rows (P, columns) with increasing times that are far enough apart."""
    table = np.array(sorted(rows), float).reshape(len(rows), -1)
    if len(table) and not np.isfinite(table[:, :finite]).all():
        raise _Told(f"cannot use {path}: some numbers of {topic} are not finite; choose another topic.")
    kept, last = [], -np.inf
    for number, stamp in enumerate(table[:, 0] if len(table) else ()):
        if stamp - last >= LEAST:
            kept.append(number)
            last = stamp
    if len(kept) < 2:
        raise _Told(f"cannot use {path}: {topic} has {len(kept)} poses at different times; a track takes two or more.")
    return table[kept]


def _xyz(value: Any) -> list[float]:
    return [float(getattr(value, name)) for name in "xyzw" if hasattr(value, name)]


# ---- images

class _Image:
    """Image of a ping as in its message."""

    def __init__(self, stamp: float, message: Any, path: FilePath, topic: str):
        self.time, self.frame, self.info = stamp, message.header.frame_id, message.ping_info
        self.ranges = np.asarray(message.ranges, float)
        self.directions = np.array([_xyz(one) for one in message.beam_directions]).reshape(-1, 3)
        kind = {number: name for name, number in IMAGE_TYPES.items()}.get(message.image.dtype)
        beams, data = message.image.beam_count, np.ascontiguousarray(message.image.data, np.uint8)
        wanted = self.ranges.size * len(self.directions) * np.dtype(kind or "u1").itemsize
        if kind is None or not data.size or data.size != wanted or beams != len(self.directions):
            raise _Told(f"cannot use {path}: an image of {topic} has {data.size} bytes of type {message.image.dtype} "
                        f"for {beams} beams, {len(self.directions)} directions and {self.ranges.size} ranges; choose "
                        "another topic.")
        order = ">" if message.image.is_bigendian else "<"
        self.values = data.view(f"{order}{kind}").reshape(-1, beams).T.astype(kind)      # (beam, range)

    def like(self, other: _Image) -> bool:
        """Return True if both have the same beams, ranges and type; a single beam may turn."""
        return (self.values.shape == other.values.shape and self.values.dtype == other.values.dtype
                and self.frame == other.frame and np.allclose(self.ranges, other.ranges, rtol=SAME, atol=0)
                and (len(self.directions) == 1 or np.allclose(self.directions, other.directions, atol=SAME)))


def _mount(reader: Any, frame: str) -> np.ndarray | None:
    """Return the columns (3, 3) of a sonar's frame in the body's, by the static transforms up to base_link; or None."""
    above = {one.child_frame_id: (one.header.frame_id, Rotation.from_quat(_xyz(one.transform.rotation)))
             for _, message in _messages(reader, "/tf_static") for one in message.transforms}
    turn = Rotation.identity()
    for _ in range(len(above)):
        if frame.endswith(BODY) or frame not in above:
            break
        frame, step = above[frame]
        turn = step * turn
    return axes.FLIP[:, None] * turn.as_matrix() if frame.endswith(BODY) and above else None


def _record(run: list[_Image], mount: np.ndarray | None, topic: str, track: Navigation | None) -> SonarImage:
    """Return the record of images of one geometry."""
    first, dims = run[0], ("ping", "beam", "range")
    values = np.stack([image.values for image in run])
    turned = np.stack([image.directions for image in run])
    bearing = np.arctan2(turned[..., 1], turned[..., 2])                     # (ping, beam)
    speed = float(first.info.sound_speed) or 1500.0
    rad = {"units": "rad", "long_name": "angle from the middle, positive to starboard"}
    coords: dict[str, Any] = {
        "ping": ("ping", np.arange(len(run)), {"units": "1", "long_name": "ping number"}),
        "ping_time": ("ping", np.array([image.time for image in run]), {"units": "s", "long_name": "since 1970"}),
        "range": ("range", first.ranges, {"units": "m", "long_name": "slant range"}),
        "time": ("range", 2 * first.ranges / speed, {"units": "s", "long_name": "two-way travel time"})}
    if len(first.directions) == 1:                     # a rotating head, or one that stands still
        dims, values, bearing = ("ping", "range"), values[:, 0], bearing[:, 0]
        turn = np.cumsum(np.abs(np.diff(bearing, prepend=bearing[0])) > np.pi)
        coords |= {"bearing": ("ping", bearing, rad), "turn": ("ping", turn, {"units": "1", "long_name": "turn"})}
    else:
        body = first.directions @ (axes.AHEAD if mount is None else mount).T
        coords |= dict.fromkeys(("beam", "bearing"), ("beam", bearing[0], rad))
        coords |= {f"beam_{axis}": ("beam", column, {"units": "1"}) for axis, column in zip("xyz", body.T)}
    counts = values.dtype.kind != "f"
    level, unit = values, "dB"
    if counts:
        level, unit = 20 * np.log10(np.maximum(values, 0.5) / float(np.iinfo(values.dtype).max)), "dB re full scale"
    variables = {"level": (dims, level.astype(np.float32), {"units": unit, "long_name": "level"})}
    if counts:
        variables["recorded"] = (dims, values, {"units": "1", "long_name": "counts in the bag"})
    if track is not None:
        placed, times = track.placed(), coords["ping_time"][1]
        columns = [*placed.position.T, placed.roll, placed.pitch, np.unwrap(placed.heading)]
        if times[0] < track.time[0] - 1 or times[-1] > track.time[-1] + 1:
            warnings.warn("some images are before or after the track; they have its first or last pose", stacklevel=3)
        coords |= {name: ("ping", np.interp(times, track.time, column))
                   for name, column in zip(("x", "y", "z", "roll", "pitch", "heading"), columns)}
    attrs = {"sonar": "recorded", "topic": topic, "frequency": float(first.info.frequency), "sound_speed": speed,
             "bin_width": float(np.diff(first.ranges).mean()) if first.ranges.size > 1 else 0.0, "picture": "beams"}
    return SonarImage.of(xr.Dataset(variables, coords, attrs))
