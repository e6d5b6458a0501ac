"""Datagrams of KMALL files: their frames, checked before a library decodes their contents.

A datagram is its length [bytes, the whole datagram], a type such as ``#MRZ``, version, system, model, seconds and
nanoseconds since 1970; a body; and its length again (Kongsberg, EM datagrams on *.kmall format, 410224). `pykmall`
gets the bytes of one datagram alone, so that false lengths in it cannot make it read elsewhere.
"""
from __future__ import annotations

import io
import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np

LONGEST = 1 << 26                  # bytes; water columns have a few megabytes
FRAME = struct.Struct("<I4sBBHII")
BODY = struct.Struct("<2H8B")                      # of multibeam datagrams, after the numbers of parts
PING_INFO = "<2H1f6B1H11f2h2B1H1I3f2H1f2H6f4B2d1f"
PLACE = struct.calcsize(PING_INFO[:-4])            # offset of the latitude in it
SECTORS = struct.calcsize("<2H1f6B1H11f2h2B1H1I3f2H1f")
RECEIVER, SOUNDING = struct.Struct("<4H4f4H"), 120
TIDE = "tide above "               # begins the sentence of a #SHI that holds a tide; the datum ends it
COLUMN_RECEIVER, COLUMN_BEAM = struct.Struct("<2H3B1b2f"), struct.Struct("<f4Hf")


@dataclass(frozen=True, kw_only=True)
class KmallDatagram:
    """One datagram."""

    offset: int  # [bytes]: in the file
    raw: bytes
    kind: str  # three letters
    model: int
    time: float  # [s]: since 1970
    stamp: tuple[int, int]  # [s], [ns]: the same time, exact

    def part(self, layout: struct.Struct, offset: int) -> tuple[Any, ...]:
        """Unpack the fields at an offset."""
        if offset < 0 or offset + layout.size > len(self.raw) - 4:
            raise ValueError(f"its datagram #{self.kind} at byte {self.offset} is too short for its entries; it is "
                             "damaged.")
        return layout.unpack_from(self.raw, offset)

    @property
    def key(self) -> tuple[int, ...]:
        """Fields that datagrams of one fan of a ping share: counter, fan, swath and time."""
        _, counter, _, fan, _, swath, *_ = self.part(BODY, FRAME.size + 4)
        return (counter, fan, swath, *self.stamp)

    @property
    def body(self) -> int:
        """Offset after the part that all multibeam datagrams share."""
        return FRAME.size + 4 + self.part(BODY, FRAME.size + 4)[0]


def datagrams(stream: BinaryIO, kinds: tuple[str, ...], passed: set[str] | None = None) -> Iterator[KmallDatagram]:
    """Yield the datagrams of some kinds; the kinds of the others are added to ``passed``."""
    size, offset = os.fstat(stream.fileno()).st_size, 0
    while offset < size:
        stream.seek(offset)
        head = stream.read(FRAME.size)
        length = int.from_bytes(head[:4], "little")
        if len(head) < FRAME.size or head[4:5] != b"#" or not FRAME.size + 4 <= length <= LONGEST:
            raise ValueError("it is no .kmall file: it does not begin with a datagram." if offset == 0 else
                             f"it is damaged or cut at byte {offset}: there is no datagram.")
        if offset + length > size:
            raise ValueError(f"it is cut: its last datagram, at byte {offset}, has {size - offset} of {length} bytes; "
                             "copy the file again.")
        kind = head[5:8].decode("ascii", "replace")
        if kind in kinds:
            yield at(stream, offset, length)
        elif passed is not None:
            passed.add(kind)
        offset += length
    if size == 0:
        raise ValueError("it is empty.")


def at(stream: BinaryIO, offset: int, length: int) -> KmallDatagram:
    """Read one datagram of a checked length [bytes]."""
    stream.seek(offset)
    raw = stream.read(length)
    if len(raw) != length or raw[-4:] != raw[:4]:
        raise ValueError(f"its datagram at byte {offset} does not end after its {length} bytes; it is damaged.")
    _, kind, _, _, model, second, nanosecond = FRAME.unpack_from(raw)
    return KmallDatagram(offset=offset, raw=raw, kind=kind[1:].decode("ascii", "replace"), model=model,
                         time=second + 1e-9 * nanosecond, stamp=(second, nanosecond))


def beams_of(ping: KmallDatagram) -> tuple[int, int, int, int]:
    """Return the numbers of soundings, sectors, extra detections and samples of the longest snippet of #MRZ, checked.
    """
    info = ping.body
    length, _ = ping.part(struct.Struct("<2H"), info)
    sectors, of_sector = ping.part(struct.Struct("<2H"), info + SECTORS)
    receiver = info + length + sectors * of_sector
    own, main, _, of_sounding, *_, extra, classes, of_class = ping.part(RECEIVER, receiver)
    if of_sounding != SOUNDING:
        raise ValueError(f"its soundings take {of_sounding} bytes each; only {SOUNDING} can be read.")
    soundings = receiver + own + classes * of_class
    images = soundings + (main + extra) * of_sounding
    ping.part(struct.Struct("<"), images)
    counts = np.frombuffer(ping.raw, "<u2", (main + extra) * SOUNDING // 2, soundings)[SOUNDING // 2 - 1::SOUNDING // 2]
    ping.part(struct.Struct("<"), images + 2 * int(counts.sum(dtype=int)))
    return main, sectors, extra, int(counts[:main].max(initial=0))


def position_of(ping: KmallDatagram) -> tuple[float, float, float]:
    """Return longitude, latitude [degrees] and height above the ellipsoid [m] of #MRZ; -999 is no height."""
    latitude, longitude, height = ping.part(struct.Struct("<2df"), ping.body + PLACE)
    return longitude, latitude, height


def tide_of(height: KmallDatagram) -> tuple[float, str] | None:
    """Return the tide [m] and its datum of #SHI, None if it is another height."""
    level, = height.part(struct.Struct("<f"), FRAME.size + 10)
    words = height.raw[FRAME.size + 14:-4].split(b"\0")[0].decode("ascii", "replace")
    return (level, words.removeprefix(TIDE)) if words.startswith(TIDE) else None


def column_of(column: KmallDatagram) -> tuple[int, int]:
    """Return the number of beams of #MWC and of samples of its longest beam, checked to fit into it."""
    info = column.body
    length, sectors, of_sector = column.part(struct.Struct("<3H"), info)
    receiver = info + length + sectors * of_sector
    own, beams, of_beam, phase, *_ = column.part(COLUMN_RECEIVER, receiver)
    if of_beam != COLUMN_BEAM.size or phase > 2:
        raise ValueError(f"its water column has {of_beam} bytes a beam and phases of kind {phase}; only "
                         f"{COLUMN_BEAM.size} bytes and kinds 0 to 2 can be read.")
    offset, longest = receiver + own, 0
    for _ in range(beams):
        count = column.part(COLUMN_BEAM, offset)[4]
        longest = max(longest, count)
        offset += of_beam + count * (1 + phase)
    column.part(struct.Struct("<"), offset)
    return beams, longest


def decoded(datagram: KmallDatagram) -> dict[str, Any]:
    """Decode a datagram with `pykmall`."""
    from KMALL import kmall

    library = kmall(None)
    library.FID = io.BytesIO(datagram.raw)
    try:
        return getattr(library, f"read_EMdgm{datagram.kind}")()
    except (struct.error, ValueError, KeyError, IndexError, OverflowError, OSError, MemoryError) as error:
        raise ValueError(f"its datagram #{datagram.kind} at byte {datagram.offset} is damaged ({error}).") from None
