"""The frames of a GSF file's records, checked before a library decodes what is inside.

A record is its length [bytes], a word (bit 31: a checksum of four bytes follows; bits 0 to 21: its type) and a payload,
all with the highest byte first (Generic Sensor Format specification 03.06, Leidos, 2014).
"""
from __future__ import annotations

import os
import struct
from dataclasses import dataclass

import numpy as np

__all__ = ["Walked", "walk"]

FRAME, PING = struct.Struct(">II"), struct.Struct(">2I2iH")
LONGEST, TYPES, SWATH = 1 << 19, 12, 2     # bytes of a record; the last type; that of pings


@dataclass(frozen=True, kw_only=True, eq=False)
class Walked:
    """Hold what the frames say.

    Attributes
    ----------
    positions : (P, 3) [s], [degrees]
        Time since 1970, longitude and latitude of pings.
    beams : int
        Most of a ping.
    """

    positions: np.ndarray
    beams: int


def walk(path: str) -> Walked:
    """Go through all records.

    Raises
    ------
    ValueError
        If the file is no GSF file, or cut or damaged.
    """
    positions, beams, offset = [], 0, 0
    size = os.path.getsize(path)
    with open(path, "rb") as stream:
        while offset < size:
            stream.seek(offset)
            head = stream.read(FRAME.size + 4 + PING.size)
            if len(head) < FRAME.size:
                raise ValueError(f"it is cut at byte {offset}: there are {len(head)} bytes of a record.")
            length, word = FRAME.unpack_from(head)
            kind, checked = word & 0x3FFFFF, 4 if word >> 31 else 0
            if not 1 <= kind <= TYPES or not 8 < length + checked <= LONGEST or (offset == 0 and kind != 1):
                raise ValueError("it is no GSF file: it does not begin with a header." if offset == 0 else
                                 f"it is damaged at byte {offset}: there is no record.")
            after = offset + FRAME.size + checked + length
            if after > size:
                raise ValueError(f"it is cut: its last record, at byte {offset}, has {size - offset} of "
                                 f"{after - offset} bytes; copy the file again.")
            if kind == SWATH:
                if length < PING.size:
                    raise ValueError(f"its ping at byte {offset} has {length} bytes; it is damaged.")
                second, nanosecond, longitude, latitude, count = PING.unpack_from(head, FRAME.size + checked)
                positions.append((second + 1e-9 * nanosecond, 1e-7 * longitude, 1e-7 * latitude))
                beams = max(beams, count)
            offset = after
    if size == 0:
        raise ValueError("it is empty.")
    return Walked(positions=np.array(positions).reshape(-1, 3), beams=beams)
