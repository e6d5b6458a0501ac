"""Records of s7k files: frames and tables, every length checked before it is used.

Layouts: Teledyne RESON, Data Format Definition, 7k Data Format, version 3.12 (2020). A record is a frame of 64 bytes,
its header, its table and a checksum, the sum of all bytes before it; all with the lowest byte first. Distances in
records are starboard, forward and up; roll is positive with the port side up, heave up.
"""
from __future__ import annotations

import os
from collections.abc import Container, Iterator
from dataclasses import dataclass
from datetime import datetime, timezone
from functools import cached_property
from typing import Any, BinaryIO

import numpy as np

SYNC = b"\xff\xff\0\0"             # after the version and the offset of two bytes each
LONGEST = 1 << 28                  # bytes of a record
SUMMED, END = 1, 4                 # flag of a frame with a checksum; bytes of the checksum
FRAME = np.dtype([("version", "<u2"), ("offset", "<u2"), ("sync", "<u4"), ("size", "<u4"), ("optional", "<u4"),
                  ("optional_kind", "<u4"), ("year", "<u2"), ("day", "<u2"), ("seconds", "<f4"), ("hours", "u1"),
                  ("minutes", "u1"), ("record_version", "<u2"), ("kind", "<u4"), ("device", "<u4"), ("spare", "<u2"),
                  ("enumerator", "<u2"), ("spare_2", "<u4"), ("flags", "<u2"), ("spare_3", "<u2"), ("spare_4", "<u4"),
                  ("fragments", "<u4"), ("fragment", "<u4")])
_PING = [("sonar", "<u8"), ("number", "<u4"), ("sequence", "<u2")]
_ARM = [(name, "<f4") for name in ("x", "y", "z", "roll", "pitch", "heading")]
_SETTINGS = [
    ("frequency", "<f4"), ("rate", "<f4"), ("bandwidth", "<f4"), ("pulse_length", "<f4"), ("pulse_kind", "<u4"),
    ("envelope", "<u4"), ("envelope_parameter", "<f4"), ("pulse_mode", "<u2"), ("spare", "<u2"), ("ping_rate", "<f4"),
    ("period", "<f4"), ("range", "<f4"), ("power", "<f4"), ("gain", "<f4"), ("control", "<u4"), ("projector", "<u4"),
    ("steering", "<f4"), ("steering_across", "<f4"), ("width", "<f4"), ("width_across", "<f4"), ("focus", "<f4"),
    ("window", "<u4"), ("window_parameter", "<f4"), ("transmit_flags", "<u4"), ("hydrophone", "<u4"),
    ("receive_window", "<u4"), ("receive_parameter", "<f4"), ("receive_flags", "<u4")]
_LIMITS = [(name, "<f4") for name in ("least_range", "largest_range", "least_depth", "largest_depth", "absorption",
                                      "sound_speed", "spreading")]
HEADS = {kind: np.dtype(fields) for kind, fields in {
    1003: [("datum", "<u4"), ("latency", "<f4"), ("latitude", "<f8"), ("longitude", "<f8"), ("height", "<f8"),
           ("grid", "u1"), ("zone", "u1"), ("quality", "u1"), ("method", "u1")],
    1009: [("placed", "u1"), ("spare", "u1"), ("spare_2", "<u2"), ("latitude", "<f8"), ("longitude", "<f8"),
           ("entries", "<u4")],
    1010: [("frequency", "<f4"), ("source", "u1"), ("algorithm", "u1"), ("salinity", "u1"), ("depth", "u1"),
           ("placed", "u1"), ("known", "u1"), ("spare", "<u2"), ("latitude", "<f8"), ("longitude", "<f8"),
           ("rate", "<f4"), ("entries", "<u4")],
    1012: [("roll", "<f4"), ("pitch", "<f4"), ("heave", "<f4")],
    1013: [("heading", "<f4")],
    1015: [("vertical", "u1"), ("latitude", "<f8"), ("longitude", "<f8"), ("accuracy", "<f4"), ("height", "<f4"),
           ("height_accuracy", "<f4"), ("speed", "<f4"), ("course", "<f4"), ("heading", "<f4")],
    1016: [("entries", "u1")],
    7000: [*_PING, *_SETTINGS, ("receive_width", "<f4"), *_LIMITS, ("spare_2", "<u2")],
    7004: [("sonar", "<u8"), ("beams", "<u4")],
    7006: [*_PING, ("beams", "<u4"), ("flags", "u1"), ("entered", "u1"), ("sound_speed", "<f4")],
    7027: [*_PING, ("beams", "<u4"), ("field", "<u4"), ("algorithm", "u1"), ("flags", "<u4"), ("rate", "<f4"),
           ("steering", "<f4"), ("applied_roll", "<f4"), ("spare", "<u4", (15,))],
    7030: [("frequency", "<f4"), ("firmware", "<u2"), ("firmware_text", "S128"), ("software", "<u2"),
           ("software_text", "S128"), ("centre", "<u2"), ("centre_text", "S128"), ("protocol", "<u2"),
           ("protocol_text", "S128"), ("transmit", _ARM), ("receive", _ARM), ("motion", _ARM), ("motion_delay", "<u2"),
           ("position", _ARM[:3]), ("position_delay", "<u2"), ("waterline", "<f4")],
    7503: [*_PING[:2], *_SETTINGS, *_LIMITS, ("vernier", "u1"), ("filter", "u1"), ("transmit", _ARM[:3]),
           ("tilt", "<f4", (3,))]}.items()}
CAST_NODE = np.dtype([("depth", "<f4"), ("speed", "<f4")])
CTD_NODE = np.dtype([("salinity", "<f4"), ("temperature", "<f4"), ("depth", "<f4"), ("speed", "<f4"),
                     ("absorption", "<f4")])
ATTITUDE = np.dtype([("time", "<u2"), ("roll", "<f4"), ("pitch", "<f4"), ("heave", "<f4"), ("heading", "<f4")])
DETECTION = [("beam", "<u2"), ("sample", "<f4"), ("angle", "<f4"), ("flags", "<u4"), ("quality", "<u4"),
             ("uncertainty", "<f4"), ("intensity", "<f4"), ("least", "<f4"), ("largest", "<f4")]
GROWN = (7000, 7503)               # records that have grown from version to version
NEEDED = 5                         # fields of a detection that every version has, two bytes and then four bytes each


@dataclass(frozen=True, kw_only=True, eq=False)
class S7kRecord:
    """One record."""

    offset: int  # [bytes]: in the file
    raw: bytes  # the whole record

    @cached_property
    def frame(self) -> Any:
        """First fields, by name."""
        return np.frombuffer(self.raw, FRAME, 1)[0]

    @property
    def kind(self) -> int:
        """Number of the record's type."""
        return int(self.frame["kind"])

    @property
    def source(self) -> tuple[int, int]:
        """Device and enumerator, which differ between receiving heads."""
        return int(self.frame["device"]), int(self.frame["enumerator"])

    @property
    def summed(self) -> bool:
        """True if the checksum is right."""
        total = int(np.frombuffer(self.raw, np.uint8)[:-END].sum(dtype=np.uint32))
        return total == int.from_bytes(self.raw[-END:], "little")

    @cached_property
    def time(self) -> float:
        """Seconds since 1970, UTC."""
        year, day, second, hour, minute = (self.frame[name].item() for name in (
            "year", "day", "seconds", "hours", "minutes"))
        if not (1970 <= year < 2200 and 1 <= day <= 366 and hour < 24 and minute < 60 and 0 <= second <= 61):
            raise ValueError(f"its record {self.kind} at byte {self.offset} has the time {year}, day {day}, {hour}:"
                             f"{minute}:{second:g}, which does not exist; it is damaged.")
        return (datetime(year, 1, 1, tzinfo=timezone.utc).timestamp() + 86_400.0 * (day - 1) + 3600.0 * hour
                + 60.0 * minute + second)

    @cached_property
    def head(self) -> Any:
        """Fields before the table, by name; 0 for those that a version of the settings does not have yet."""
        layout = HEADS[self.kind]
        if self.kind in GROWN and (lacking := layout.itemsize - self._end + int(self.frame["offset"]) + 4) > 0:
            known = self.table(np.dtype(np.uint8), layout.itemsize - lacking, 0) if lacking < layout.itemsize else b""
            return np.frombuffer(bytes(known).ljust(layout.itemsize, b"\0"), layout, 1)[0]
        return self.table(layout, 1, 0)[0]

    @property
    def _end(self) -> int:
        """Byte after the last one of the table."""
        return min(int(self.frame["optional"]) or len(self.raw), len(self.raw) - END)

    def table(self, layout: np.dtype, count: int, start: int | None = None) -> np.ndarray:
        """Return a table of ``count`` rows at a byte after the frame, by default after the head."""
        start = int(self.frame["offset"]) + 4 + (HEADS[self.kind].itemsize if start is None else start)
        if start + count * layout.itemsize > self._end:
            raise ValueError(f"its record {self.kind} at byte {self.offset} is too short for its {count} entries; "
                             "it is damaged.")
        return np.frombuffer(self.raw, layout, count, start)


def records(stream: BinaryIO, kinds: Container[int], passed: set[int]) -> Iterator[S7kRecord]:
    """Yield the records of some kinds; the numbers of the other kinds are added to ``passed``.

    Programs exist that state checksums and do not keep them. They are checked if that of the first record is right.
    """
    size, offset, kept = os.fstat(stream.fileno()).st_size, 0, None
    while offset < size:
        stream.seek(offset)
        head = stream.read(FRAME.itemsize)
        if len(head) < FRAME.itemsize or head[4:8] != SYNC:
            raise ValueError(f"it is damaged or cut at byte {offset}: there is no record.")
        frame = np.frombuffer(head, FRAME, 1)[0]
        length = int(frame["size"])
        if not FRAME.itemsize + END <= length <= LONGEST or int(frame["offset"]) + 4 < FRAME.itemsize:
            raise ValueError(f"its record at byte {offset} has {length} bytes; it is damaged.")
        if offset + length > size:
            raise ValueError(f"it is cut: its last record, at byte {offset}, has {size - offset} of {length} bytes; "
                             "copy the file again.")
        if int(frame["kind"]) in kinds:
            record = at(stream, offset, length)
            if int(frame["flags"]) & SUMMED and kept is not False:
                right = record.summed
                if kept and not right:
                    raise ValueError(f"its record {record.kind} at byte {offset} is damaged: its checksum is wrong.")
                kept = right
            yield record
        else:
            passed.add(int(frame["kind"]))
        offset += length


def at(stream: BinaryIO, offset: int, length: int) -> S7kRecord:
    """Read one record of a checked length [bytes]."""
    stream.seek(offset)
    return S7kRecord(offset=offset, raw=stream.read(length))
