"""Write records as bags of ROS 2 (MCAP), and turn a record into messages, without ROS.

    messages      of a record or a stepped frame, as dictionaries
    serialised    the bytes of a message, which a publisher takes
    pose_of       the pose of a ping, from odometry
    write         a bag of records or of frames as they come, in the memory of some pings
    read_track, read_images      of a vehicle's own bag

A record read from a netCDF file, and frames of a generator, are converted block by block.
"""
from __future__ import annotations

import datetime
import heapq
import json
import os
import re
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from mitsonar.device.files import FilePath, check_readable, check_writable, checked_suffix, described, replacing
from mitsonar.hydrography.record import check
from mitsonar.imaging.focused import is_focused
from mitsonar.version import __version__

from . import poses
from .bag_messages import BagMessage, nanoseconds, serialised, typestore
from .beams import beams_of
from .pings import focused_messages, ping_messages
from .poses import BagNames, BagPoses, pose_of
from .recorded import read_images, read_track

__all__ = ["BagMessage", "BagNames", "messages", "pose_of", "read_images", "read_track", "serialised", "write",
           "write_files"]

SUFFIX = ".mcap"
BLOCK_BYTES = 1 << 26              # of pings that are read at once
KEPT = ("/tf_static", "/about")    # ends of topics whose last message late subscribers receive
UNITS = {"recorded": "counts of the recorder", "labels": "number of a shape, see labels",
         "picture_labels": "number of a shape, see labels", "column": "dB re 1 µPa",
         "detections": "s, rad; intensities: backscattering strength, dB", "ranges": "m; intensities: as detections",
         "soundings": "m; intensity: dB", "truth": "m; intensity: dB",
         "imu": "rad/s; no acceleration", "fix": "altitude: m above the still sea surface, not the ellipsoid"}


def messages(record: xr.Dataset, *, start: float | None = None, names: BagNames | None = None,
             cell: float | None = None, velocity: ArrayLike | None = None,
             turn_rate: ArrayLike | None = None, still: bool = True) -> Iterator[BagMessage]:
    """Yield a record's messages in the order of time.

    Parameters
    ----------
    record : xarray.Dataset
        Image, soundings, or a ping of `mitsonar.Sonar`.
    start : float or None [s]
        Date of time 0, since 1970. None: the start that the record states, else 0.
    names : BagNames or None
        Names of topics and frames. None: "/sonar/...", base_link and sonar.
    cell : float or None [m]
        Also draw fans as pictures in metres with cells of this side.
    velocity, turn_rate : (3,) or None [m/s], [rad/s]
        Motion of the sonar in the scene's frame, as given to `mitsonar.Sonar.ping`. None: by differences of the
        record's poses, and unknown of a single one.
    still : bool
        Also yield what does not change: the static transform, and units and names of labels as JSON.

    Yields
    ------
    BagMessage

    Raises
    ------
    ValueError
        If the record has no messages, such as signals, or a time does not fit in a stamp.

    Examples
    --------
    >>> frame = xr.Dataset({"level": (("ping", "range"), [[50.0, 60.0]])}, {"range": [1.0, 2.0], "ping_time": ("ping",
    ...     [0.5]), **{name: ("ping", [0.0]) for name in ("x", "y", "z", "roll", "pitch", "heading")}})
    >>> [message.topic for message in messages(frame)][-3:]
    ['/sonar/odometry', '/sonar/imu', '/sonar/image']
    """
    names = names or BagNames()
    where = _poses(record, start, cell)
    shown = np.arange(0 if where is None else where.time.size)
    yield from _of_part(record, where, shown, start=start, names=names, cell=cell, velocity=velocity,
                        turn_rate=turn_rate, still=still)


def write(records: xr.Dataset | Iterable[xr.Dataset], path: FilePath, *, start: float | None = None,
          names: BagNames | None = None, cell: float | None = None) -> dict[str, int]:
    """Write a bag of one record, or of frames or blocks of pings as they come.

    Parameters
    ----------
    records : xarray.Dataset or iterable of xarray.Dataset
        Record, or its parts in the order of time, such as the frames of `mitsonar.frames`.
    path : str or path
        Ending in .mcap. A failed write leaves no file.
    start, names, cell
        As in `messages`.

    Returns
    -------
    dict of str to int
        Number of messages by topic.

    Raises
    ------
    ValueError
        As `messages`, if rosbags is not installed, or there is no record.
    OSError
        If the file cannot be written there.
    """
    parts = iter([records] if isinstance(records, xr.Dataset) else records)
    return write_messages(of_parts(parts, start=start, names=names or BagNames(), cell=cell), path)


def write_files(paths: Sequence[FilePath], path: FilePath, *, start: float | None = None,
                cell: float | None = None) -> dict[str, int]:
    """Write a bag of one or several files of records, of which some pings are in memory at a time.

    Parameters
    ----------
    paths : sequence of str or path
        Images or soundings (.exr, .nc) or recorded lines (.all, .kmall, .gsf, .s7k, .xtf, .hsx). An EXR is read whole.
        Topics and frames of one of several files begin with its name.
    path, start, cell
        As in `write`.

    Returns
    -------
    dict of str to int
        Number of messages by topic.

    Raises
    ------
    FileNotFoundError, PermissionError, ValueError, OSError
        As `write`, or if a file is none of these; the file is named.
    """
    stems = [re.sub(r"\W", "_", Path(one).stem, flags=re.ASCII) for one in paths]
    names = [BagNames()] if len(stems) == 1 else [BagNames.of(f"_{stem}" if stem[:1].isdigit() else stem)
                                                  for stem in stems]
    twice = next((one.topics for one in names if names.count(one) > 1), None)
    if twice is not None:
        raise ValueError(f"two of the records have the topics {twice}/...; give files of different names.")
    for one in paths:
        check_readable(one, "the record", "an image or soundings")
    return write_messages(heapq.merge(*(_of_file(one, start, name, cell) for one, name in zip(paths, names)),
                                      key=_stamp), path)


def _of_file(path: FilePath, start: float | None, names: BagNames, cell: float | None) -> Iterator[BagMessage]:
    """Yield the messages of a file."""
    from mitsonar.io import reading
    from mitsonar.io.records import netcdf
    from mitsonar.io.survey_lines import reading as lines

    with open(path, "rb") as stream:
        head = stream.read(8)
    try:
        if reading.is_netcdf(path):
            with netcdf.opened(path) as record:
                yield from of_parts(iter([record]), start=start, names=names, cell=cell)
        elif lines.recognised(head) and not described(path):
            yield from of_parts(lines.blocks(path), start=start, names=names, cell=cell)
        else:
            record: Any = reading.read(path)
            yield from of_parts(iter([record]), start=start, names=names, cell=cell)
    except ValueError as error:
        told = str(error)
        raise ValueError(told if os.fspath(path) in told else f"cannot use {path}: {told}") from None


def of_parts(parts: Iterator[xr.Dataset], *, start: float | None, names: BagNames,
             cell: float | None) -> Iterator[BagMessage]:
    """Yield the messages of a record's parts in the order of time; speeds follow from poses of neighbouring parts."""
    part, first = next(parts, None), True
    before: BagPoses | None = None
    since = -np.inf                                    # [s]
    while part is not None:
        following = next(parts, None)
        where, after = _poses(part, start, cell), None if following is None else _poses(following, start, cell)
        shown = np.arange(0 if where is None else where.time.size)
        if where is not None and where.by_sensors:
            # each part has the motion of the whole line
            until = np.inf if following is None else float(following["ping_time"][0])
            shown, since = np.flatnonzero((where.time > since) & (where.time <= until)), until
        elif where is not None:
            (where, shown), before = where.beside(before, after), where
        yield from _of_part(part, where, shown, start=start, names=names, cell=cell, still=first)
        part, first = following, False


def write_messages(stream: Iterable[BagMessage], path: FilePath) -> dict[str, int]:
    """Write messages in the order in which they come to a bag; return their numbers by topic."""
    checked_suffix(path, (SUFFIX,))
    target, store = check_writable(path), typestore()
    from rosbags import rosbag2  # pyright: ignore[reportMissingImports]  # of the extra ros

    known: dict[str, Any] = {}
    written: dict[str, int] = {}
    with replacing(path) as temporary, tempfile.TemporaryDirectory(dir=target.parent, prefix=".bag") as folder:
        # rosbags writes a folder with the file in it
        writer = rosbag2.Writer(Path(folder) / "bag", version=9, storage_plugin=rosbag2.StoragePlugin.MCAP)
        writer.set_compression(rosbag2.CompressionMode.STORAGE, rosbag2.CompressionFormat.ZSTD)
        with writer:
            for message in stream:
                if message.topic not in known:
                    known[message.topic] = writer.add_connection(
                        message.topic, message.type, typestore=store,
                        offered_qos_profiles=[_kept()] if message.topic.endswith(KEPT) else ())
                writer.write(known[message.topic], message.stamp, serialised(message))
                written[message.topic] = written.get(message.topic, 0) + 1
            if not written:
                raise ValueError(f"cannot write {path}: there is no record; give one or more.")
        os.replace(Path(folder) / "bag" / "bag.mcap", temporary)
    return written


def seconds_of(date: str) -> float:
    """Return the seconds since 1970 of an ISO 8601 date; UTC if it names no other offset."""
    try:
        found = datetime.datetime.fromisoformat(date.strip().removesuffix("Z"))
    except ValueError:
        raise ValueError(f"{date[:40]!r} is no date; give one such as 2026-05-01T10:00:00Z.") from None
    return (found if found.tzinfo else found.replace(tzinfo=datetime.timezone.utc)).timestamp()


def _of_part(record: xr.Dataset, where: BagPoses | None, shown: np.ndarray, *, start: float | None,
             names: BagNames, cell: float | None, still: bool, velocity: ArrayLike | None = None,
             turn_rate: ArrayLike | None = None) -> Iterator[BagMessage]:
    """Yield the messages of a part of a record and of some of the poses."""
    zero = _start_of(record, start)
    if is_focused(record):
        if still:
            yield _about(record, names, nanoseconds(0.0, zero))
        yield from focused_messages(record, names, zero)
        return
    beams = beams_of(record)
    if still:
        first = nanoseconds(min([float(record["ping_time"].values.min()),
                                 *([] if where is None else [float(where.time.min())])]), zero)
        yield _about(record, names, first)
        yield poses.mounting(first, names, beams.frame, beams.offset)
    moving = iter(()) if where is None else poses.navigation(where, shown, names, record.attrs, velocity=velocity,
                                                             turn_rate=turn_rate)
    yield from heapq.merge(moving, _of_pings(record, beams, names, zero, cell), key=_stamp)


def _poses(record: xr.Dataset, start: float | None, cell: float | None) -> BagPoses | None:
    """Return the poses of a record that has messages."""
    _check(record, cell)
    return poses.poses_of(record, _start_of(record, start))


def _stamp(message: BagMessage) -> int:
    return message.stamp


def _start_of(record: xr.Dataset, start: float | None) -> float:
    if start is not None:
        return start
    stated = record.attrs.get("start")
    return seconds_of(stated) if isinstance(stated, str) else 0.0


def _check(record: object, cell: float | None) -> None:
    """Raise `ValueError` for a record that has no messages."""
    if not isinstance(record, xr.Dataset) or not {"level", "travel_time"} & set(record):
        raise ValueError("the record holds neither levels nor soundings, and signals of elements have no message of "
                         "ROS; give an image as mitsonar render makes it, or soundings.")
    needed = () if is_focused(record) else ("ping_time",) if {"x", "y"} <= set(record.dims) else ("ping_time", "range")
    if "travel_time" in record:
        check(record, "the soundings")
    if record.sizes.get("ping") == 0:
        raise ValueError("the record has no pings; give one with at least one.")
    if "level" in record and (lacking := [name for name in needed if name not in record.variables]):
        raise ValueError(f"the record has no {lacking[0]}, which its messages need; give one as mitsonar wrote it.")
    if cell is not None and set(record["level"].dims if "level" in record else ()) != {"ping", "beam", "range"}:
        raise ValueError("--cell draws fans of beams, and this record is none; draw it by mitsonar raster first, or "
                         "leave --cell out.")


def _of_pings(record, beams, names, zero, cell) -> Iterator[BagMessage]:
    """Yield the messages of the pings, of which a block is in memory at a time."""
    pings = record.sizes["ping"]
    moving = [name for name, variable in record.variables.items() if "ping" in variable.dims]
    # shares of shapes take the most memory, and no message has them
    record = record.drop_vars([name for name in ("share", "shape") if name in record.variables])
    each = sum(record[name].nbytes for name in moving if name in record.variables) / max(pings, 1)
    size = max(int(BLOCK_BYTES // max(each, 1)), 1)
    for begin in range(0, pings, size):
        block = record.isel(ping=slice(begin, begin + size)).load()
        if cell is not None:
            from mitsonar.imaging.maps.raster import cartesian

            drawn = cartesian(block, cell, names=[name for name in ("level", "label") if name in block])
        for number in range(block.sizes["ping"]):
            one = slice(number, number + 1)
            yield from ping_messages(block.isel(ping=one), beams, names, zero)
            if cell is not None:
                yield from ping_messages(drawn.isel(ping=one), beams, names, zero)


def _about(record, names, stamp) -> BagMessage:
    """Return what messages have no room for, as JSON."""
    attrs = record.attrs
    units = record["level"].attrs.get("units", "dB") if "level" in record else "dB"
    said = {"software": f"mitsonar {__version__}", "units": {"image": units, "picture": units, **UNITS},
            "image_order": "index = range * beam_count + beam",
            "frames": {"map": "x east, y north, z up; z = 0 is the still sea surface",
                       names.base: "x forward, y port, z up", names.sonar: "z along the middle of the beams"},
            **{name: attrs[name] for name in ("sonar", "file", "seed", "preset", "labels", "classes", "label_class",
                                              "objects", "crs", "local_origin", "recorder", "cell", "grid_origin_x",
                                              "grid_origin_y", "grid_heading", "backscatter")
               if attrs.get(name) is not None}}
    for name in ("x", "y", "along_track", "across_track"):
        values = record.coords.get(name)
        if values is not None and values.dims == (name,) and values.size > 1:
            said.setdefault("picture", {})[name] = [float(values[0]), float(values[-1])]
    return BagMessage(topic=f"{names.topics}/about", type="std_msgs/msg/String", stamp=stamp,
                      fields={"data": json.dumps(said, default=_plain, ensure_ascii=False)})


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else str(value)


def _kept() -> Any:
    """Return the quality of service of topics whose last message late subscribers receive."""
    from rosbags import interfaces as ros  # pyright: ignore[reportMissingImports]  # of the extra ros

    never = ros.QosTime(2147483647, 4294967295)
    return ros.Qos(ros.QosHistory.KEEP_LAST, 1, ros.QosReliability.RELIABLE, ros.QosDurability.TRANSIENT_LOCAL, never,
                   never, ros.QosLiveliness.AUTOMATIC, never, False)
