"""Raw data groups of POS MV inertial systems (files .000, .001, ...): navigation and delayed heave.

A group begins with $GRP, its number and the count of bytes that follow, two times, a distance and the types of both
times; it ends with a checksum and $#; all little-endian (layouts as in the public readers of NOAA and Guardian
Geomatics). Used are

    1    position, attitude of the vessel's reference point          102  the same of sensor 1, with heave, without a 1
    3    week, and GPS time less UTC                                 111  delayed heave, and the heave of then

Heave counts downwards. Times are of the group's first clock that is UTC or GPS time. A group whose checksum is wrong is
left out, and the next one is searched for.
"""
from __future__ import annotations

import mmap
import os
import re
import struct
from array import array
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mitsonar.device.files import FilePath

from .gps_time import EPOCH, WEEK, ahead, unwrapped
from .navigation import Navigation
from .sbet import heave_of

GROUP, MESSAGE, END = b"$GRP", b"$MSG", b"$#"
_START = re.compile(rb"\$(?:GRP|MSG)")
MOST_BYTES = 2_000_000_000         # of a file; loggers split a day's files
_TIMES = struct.Struct("<8x3d2B")
_BODY = {1: struct.Struct("<34x3d12x4d"), 102: struct.Struct("<34x3d12x4df"), 111: struct.Struct("<34x2fI2f2d")}
_VALID = 1                         # bit of the status of a delayed heave
POS_TIME, GPS_TIME, UTC_TIME = 0, 1, 2


@dataclass(frozen=True, kw_only=True, eq=False)
class DelayedHeave:
    """Heave computed with the record before and after, beside that of its time; positive up.

    Parameters
    ----------
    time : array (N,) [s]
        Increasing times: since 1970, or seconds of the week if ``week``.
    delayed, at_once : array (N,) [m]
        Delayed heave, and the one that the soundings were made with.
    week : bool
        True for seconds of a week that the file does not name.
    """

    time: np.ndarray
    delayed: np.ndarray
    at_once: np.ndarray
    week: bool


def recognised(path: FilePath) -> bool:
    """Return True if a file begins with a group or a message of a POS MV."""
    with open(path, "rb") as file:
        start = file.read(8)
    return start[:4] in (GROUP, MESSAGE) and len(start) == 8


def read(path: FilePath) -> Navigation:
    """Read the navigation of a file: group 1, or else 102.

    Raises
    ------
    ValueError
        If the file is too large or has neither group.
    """
    found = _Groups.of(path, (1, 102))
    number = 1 if len(found.rows[1]) > 1 else 102
    if len(found.rows[number]) < 2:
        raise ValueError(f"cannot read the navigation {path}: it has no two groups 1 or 102, position and attitude; "
                         "log one of them.")
    rows, dated = _timed(path, found, number)
    heading = np.unwrap(np.radians(rows[:, 6]))
    heave = -rows[:, 8] if number == 102 else heave_of(rows[:, 0], rows[:, 3])
    return Navigation(time=rows[:, 0], x=np.unwrap(rows[:, 2], period=360), y=rows[:, 1], z=None, heave=heave,
                      roll=np.radians(rows[:, 4]), pitch=np.radians(rows[:, 5]), heading=heading, geographic=True,
                      height=rows[:, 3], week=not dated)


def delayed_heave(path: FilePath) -> DelayedHeave:
    """Read the delayed heave of a file: group 111.

    Raises
    ------
    ValueError
        If the file is too large or has no delayed heave.
    """
    found = _Groups.of(path, (111,))
    found.rows[111] = found.rows[111][found.rows[111][:, 3].astype(int) & _VALID > 0]
    if len(found.rows[111]) < 2:
        raise ValueError(f"cannot read the delayed heave {path}: it has no two valid groups 111; log them, for some "
                         "minutes beyond the line.")
    rows, dated = _timed(path, found, 111)
    return DelayedHeave(time=rows[:, 0], delayed=-rows[:, 1], at_once=-rows[:, 4], week=not dated)


def _timed(path: FilePath, found: _Groups, number: int) -> tuple[np.ndarray, bool]:
    """Return the rows of a group by increasing time, in UTC since 1970 if the file names its week; True if so."""
    rows = found.rows[number]
    rows = rows[np.isfinite(rows).all(1)]
    if number != 111:
        rows = rows[(np.abs(rows[:, 1]) <= 90) & (np.abs(rows[:, 2]) <= 360) & (np.abs(rows[:, 5]) <= 90)
                    & ((rows[:, 1] != 0) | (rows[:, 2] != 0))]
    rows[:, 0] = unwrapped(rows[:, 0])
    rows = rows[np.unique(rows[:, 0], return_index=True)[1]]
    if len(rows) < 2:
        raise ValueError(f"cannot read the navigation {path}: no two of its groups {number} have a place and a time; "
                         "log them again.")
    if found.week is None:
        if found.clock == GPS_TIME:
            raise ValueError(f"cannot read the navigation {path}: it counts GPS time and names no week (group 3), so "
                             "that its leap seconds are unknown; log UTC, or group 3.")
        return rows, False
    week, leaps, seconds = found.week
    start = EPOCH + week * WEEK + round((seconds - rows[0, 0]) / WEEK) * WEEK
    rows[:, 0] += start - (0.0 if found.clock == UTC_TIME else leaps or ahead(start))
    return rows, True


@dataclass(kw_only=True, eq=False)
class _Groups:
    """Groups of a file: rows of time [s of the week] and contents by number, and their clock.

    week -> number of the week, leap seconds and time [s of the week] of the first group 3 that knows them
    """

    rows: dict[int, np.ndarray]
    clock: int = POS_TIME
    week: tuple[int, float, float] | None = None

    @classmethod
    def of(cls, path: FilePath, wanted: tuple[int, ...]) -> _Groups:
        if os.path.getsize(path) > MOST_BYTES:
            raise ValueError(f"cannot read the navigation {path}: it has {os.path.getsize(path) / 1e9:.1f} GB, more "
                             f"than {MOST_BYTES / 1e9:g}; split it.")
        if not os.path.getsize(path):
            raise ValueError(f"cannot read the navigation {path}: it is empty; copy it again.")
        found, kept = cls(rows={}), {number: array("d") for number in wanted}
        with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
            for number, group in _walked(content):
                first, second, _, types, _ = _TIMES.unpack_from(group)
                clock, time = next(((kind, at) for kind, at in ((types & 15, first), (types >> 4, second))
                                    if kind in (GPS_TIME, UTC_TIME)), (POS_TIME, 0.0))
                if clock == POS_TIME or not 0 <= time <= 2 * WEEK or found.clock not in (POS_TIME, clock):
                    continue
                if number == 3 and found.week is None:
                    at = 52 + struct.unpack_from("<H", group, 36)[0]
                    week, leaps = struct.unpack_from("<Id", group, at) if at + 12 <= len(group) else (0, 0.0)
                    found.week = (week, leaps if 0 <= leaps < 100 else 0.0, time) if 0 < week < 9999 else None
                elif number in kept and len(group) >= _BODY[number].size:
                    found.clock = clock
                    kept[number].extend((time, *_BODY[number].unpack_from(group)))
        found.rows = {number: np.array(kept[number]).reshape(-1, 1 + len(_BODY[number].unpack(bytes(
            _BODY[number].size)))) for number in wanted}
        return found


def _walked(content: mmap.mmap) -> Iterator[tuple[int, bytes]]:
    """Yield the groups of a file with their numbers, without those that are damaged."""
    place, size = 0, len(content)
    while 0 <= place <= size - 8:
        kind, number, count = content[place:place + 4], *struct.unpack_from("<HH", content, place + 4)
        end = place + 8 + count
        if kind in (GROUP, MESSAGE) and end <= size and content[end - 2:end] == END:
            if kind == GROUP and count >= 34:
                group = content[place:end]
                if end % 2 == place % 2 and int(np.frombuffer(group, "<u2").sum()) % 65536 == 0:
                    yield number, group
            place = end
        else:
            found = _START.search(content, place + 1)
            place = -1 if found is None else found.start()
