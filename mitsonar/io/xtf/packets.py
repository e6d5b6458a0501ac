"""Walk from packet to packet of an XTF file, so that a damaged length costs neither an endless loop nor memory.

The layouts of packets are pyxtf's. A file begins with a header of 1024 bytes, which has room for 6 channels and grows
by 1024 bytes for each 8 more.
"""
from __future__ import annotations

import os
from collections.abc import Iterator
from typing import TYPE_CHECKING, BinaryIO

from mitsonar.device.files import FilePath

from .pings import MAGIC

if TYPE_CHECKING:
    import pyxtf

HEADER = 1024                      # bytes
SONAR = 0                          # type of the packets of a sidescan
_START = 14                        # bytes of a packet from the magic number to its length


def file_header(file: BinaryIO) -> tuple[pyxtf.XTFFileHeader, bytes]:
    """Return a file's header as pyxtf knows it, and all its bytes."""
    import pyxtf

    head = file.read(HEADER)
    if len(head) < HEADER or head[0] != 123:
        raise ValueError("it is not an XTF file, which starts with the number 123 and a header of 1024 bytes.")
    header = pyxtf.XTFFileHeader.from_buffer_copy(head)
    return header, head + file.read(HEADER * max(0, -(-(header.channel_count() - 6) // 8)))


def holds(path: FilePath, kind: int) -> bool:
    """Return True if a file has a packet of a type, or is damaged before one is found."""
    with open(path, "rb") as file:
        try:
            return any(found == kind for found, _, _ in walk(file, len(file_header(file)[1])))
        except ValueError:
            return True


def walk(file: BinaryIO, at: int) -> Iterator[tuple[int, int, int]]:
    """Yield the type, place and length of every packet from a place of the file."""
    size = os.fstat(file.fileno()).st_size
    while at < size:
        file.seek(at)
        start = file.read(_START)
        magic, kind = int.from_bytes(start[:2], "little"), start[2] if len(start) > 2 else -1
        length = int.from_bytes(start[10:14], "little")
        if len(start) == _START and (magic != MAGIC or length < _START):
            raise ValueError(f"no packet starts at byte {at}: the file is damaged there; record or copy it again.")
        if len(start) < _START or at + length > size:
            raise ValueError(f"it ends within a packet that starts at byte {at}: the file is cut off; copy it again.")
        yield kind, at, length
        at += length
