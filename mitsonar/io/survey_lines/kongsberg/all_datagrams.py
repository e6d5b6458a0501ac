"""Datagrams of Kongsberg .all and .wcd files: frames and tables, every length checked before it is used.

Layouts: Kongsberg, EM Series Multibeam echo sounder, Datagram formats (850-160692). A datagram is its length [bytes]
without these four, STX, a letter, model, date, milliseconds, counter, serial number; tables; ETX and a checksum.
"""
from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime, timezone
from functools import cached_property
from typing import Any, BinaryIO, Literal

import numpy as np

Order = Literal["<", ">"]
LONGEST = 1 << 20                  # bytes; the format's are split at 64 kB
FRAME = np.dtype([("length", "<u4"), ("stx", "u1"), ("kind", "S1"), ("model", "<u2"), ("date", "<u4"), ("time", "<u4"),
                  ("counter", "<u2"), ("serial", "<u2")])
HEAD, END = FRAME.itemsize, 3      # bytes

HEADS = {kind: np.dtype(fields) for kind, fields in {
    "N": [("speed", "<u2"), ("sectors", "<u2"), ("beams", "<u2"), ("detections", "<u2"), ("rate", "<f4"),
          ("doppler", "<u4")],
    "X": [("heading", "<u2"), ("speed", "<u2"), ("depth", "<f4"), ("beams", "<u2"), ("detections", "<u2"),
          ("rate", "<f4"), ("scanning", "u1"), ("spare", "u1", (3,))],
    "O": [("beams", "<u2"), ("parameters", "u1"), ("spare", "u1")],
    "P": [("latitude", "<i4"), ("longitude", "<i4"), ("quality", "<u2"), ("speed", "<u2"), ("course", "<u2"),
          ("heading", "<u2"), ("system", "u1"), ("input", "u1")],
    "A": [("entries", "<u2")],
    "n": [("entries", "<u2"), ("system", "i1"), ("spare", "u1")],
    "U": [("date", "<u4"), ("time", "<u4"), ("entries", "<u2"), ("resolution", "<u2")],
    "k": [("datagrams", "<u2"), ("number", "<u2"), ("sectors", "<u2"), ("all_beams", "<u2"), ("beams", "<u2"),
          ("speed", "<u2"), ("rate", "<u4"), ("heave", "<i2"), ("tvg_function", "u1"), ("tvg_offset", "i1"),
          ("scanning", "u1"), ("spare", "u1", (3,))]}.items()}
RANGE_SECTOR = np.dtype([("tilt", "<i2"), ("focus", "<u2"), ("length", "<f4"), ("delay", "<f4"), ("frequency", "<f4"),
                         ("absorption", "<u2"), ("form", "u1"), ("number", "u1"), ("bandwidth", "<f4")])
RANGE_BEAM = np.dtype([("angle", "<i2"), ("sector", "u1"), ("detection", "u1"), ("window", "<u2"), ("quality", "u1"),
                       ("doppler", "i1"), ("travel_time", "<f4"), ("backscatter", "<i2"), ("cleaning", "i1"),
                       ("spare", "u1")])
XYZ_BEAM = np.dtype([("z", "<f4"), ("y", "<f4"), ("x", "<f4"), ("window", "<u2"), ("quality", "u1"),
                     ("incidence", "i1"), ("detection", "u1"), ("cleaning", "i1"), ("backscatter", "<i2")])
ATTITUDE = np.dtype([("time", "<u2"), ("status", "<u2"), ("roll", "<i2"), ("pitch", "<i2"), ("heave", "<i2"),
                     ("heading", "<u2")])
CAST_NODE = np.dtype([("depth", "<u4"), ("speed", "<u4")])
COLUMN_SECTOR = np.dtype([("tilt", "<i2"), ("frequency", "<u2"), ("number", "u1"), ("spare", "u1")])
COLUMN_BEAM = np.dtype([("angle", "<i2"), ("start", "<u2"), ("samples", "<u2"), ("detected", "<u2"), ("sector", "u1"),
                        ("number", "u1")])


@dataclass(frozen=True, kw_only=True, eq=False)
class AllDatagram:
    """One datagram."""

    offset: int  # [bytes]: in the file
    raw: bytes  # the whole datagram, in the byte order of the file
    order: Order

    @cached_property
    def frame(self) -> Any:
        """First fields, by name."""
        return np.frombuffer(self.raw, FRAME.newbyteorder(self.order), 1)[0]

    @property
    def kind(self) -> str:
        """Letter of the datagram's type."""
        return chr(self.raw[5])

    @cached_property
    def time(self) -> float:
        """Seconds since 1970, UTC."""
        return seconds(int(self.frame["date"]), int(self.frame["time"]))

    @property
    def key(self) -> tuple[int, int, int, int]:
        """Fields that datagrams of one ping share: serial number, counter, date and time."""
        serial, counter, date, time = (int(self.frame[name]) for name in ("serial", "counter", "date", "time"))
        return serial, counter, date, time

    @cached_property
    def head(self) -> Any:
        """Fields before the tables, by name."""
        return self.table(HEADS[self.kind], 1, HEAD)[0]

    def table(self, layout: np.dtype, count: int, offset: int | None = None) -> np.ndarray:
        """Return a table of ``count`` rows, by default the table after the head."""
        start = self.after() if offset is None else offset
        if start + count * layout.itemsize > len(self.raw) - END:
            raise ValueError(f"its datagram {self.kind!r} at byte {self.offset} is too short for its {count} entries; "
                             "it is damaged.")
        return np.frombuffer(self.raw, layout.newbyteorder(self.order), count, start)

    def after(self, *tables: np.ndarray) -> int:
        """Return the offset after the head and the tables that follow it."""
        return HEAD + HEADS[self.kind].itemsize + sum(table.nbytes for table in tables)


def seconds(date: int, milliseconds: int) -> float:
    """Return seconds since 1970 of a date (20261231) and milliseconds of the day."""
    try:
        day = datetime(date // 10000, date // 100 % 100, date % 100, tzinfo=timezone.utc)
    except ValueError:
        raise ValueError(f"a datagram has the date {date}, which does not exist; the file is damaged.") from None
    return day.timestamp() + 1e-3 * milliseconds


def datagrams(stream: BinaryIO, kinds: str, passed: set[str] | None = None) -> Iterator[AllDatagram]:
    """Yield the datagrams of some kinds; the letters of the others are added to ``passed``."""
    size, offset = os.fstat(stream.fileno()).st_size, 0
    stream.seek(0)
    head = stream.read(HEAD)
    orders: tuple[Order, ...] = "<", ">"
    order: Order | None = next((order for order in orders if _length(head, order)), None)
    if order is None:
        raise ValueError("it is no .all or .wcd file: it does not begin with a datagram.")
    while offset < size:
        stream.seek(offset)
        head = stream.read(HEAD)
        length = _length(head, order)
        if not length:
            raise ValueError(f"it is damaged or cut at byte {offset}: there is no datagram.")
        if offset + 4 + length > size:
            raise ValueError(f"it is cut: its last datagram, at byte {offset}, has {size - offset} of {length + 4} "
                             "bytes; copy the file again.")
        if chr(head[5]) in kinds:
            yield at(stream, offset, length, order)
        elif passed is not None:
            passed.add(chr(head[5]))
        offset += 4 + length


def at(stream: BinaryIO, offset: int, length: int, order: Order) -> AllDatagram:
    """Read one datagram of a checked length [bytes]."""
    stream.seek(offset)
    raw = stream.read(4 + length)
    if len(raw) != 4 + length or raw[-END] != 3:
        raise ValueError(f"its datagram at byte {offset} does not end after its {length} bytes; it is damaged.")
    return AllDatagram(offset=offset, raw=raw, order=order)


def _length(head, order):
    """Return the length [bytes] in the first bytes of a datagram, 0 if no datagram begins with them."""
    length = int.from_bytes(head[:4], "little" if order == "<" else "big")
    return length if len(head) == HEAD and HEAD - 4 + END <= length <= LONGEST and head[4] == 2 else 0
