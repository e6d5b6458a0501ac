"""Text records of HSX files: the header with its devices, and lines of data found by their tags.

Layouts: HYPACK, HSX format, Hysweep text logging (2010). A record is a line of fields that begins with three letters; a
ping (RMB) is followed by one line of numbers for each kind of data that its bits name. Times are seconds past midnight.
Offsets are starboard, forward and down from the water line; roll is positive with the port side up, pitch with the bow
up, yaw clockwise.
"""
from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime, timezone
from typing import BinaryIO

import numpy as np

MARK = b"FTP NEW "                 # first bytes of the file
LONGEST = 1 << 20                  # bytes of a line
UNITS = {0: 1.0, 1: 1200 / 3937, 2: 0.3048}        # [m]: of a metre, a US survey foot and an international foot
# Kinds of data of a ping, in the order of their bits and lines.
KINDS = ("range", "easting", "northing", "depth", "along", "across", "pitch", "roll", "takeoff", "direction", "delay",
         "intensity", "quality", "flags", "uncertainty")


@dataclass(kw_only=True, eq=False)
class HsxDevice:
    """One device of the header."""

    name: str = ""
    offsets: dict[int, np.ndarray] = field(default_factory=dict)       # kind -> seven numbers
    beams: tuple[int, int] = (0, 0)                                    # of two heads
    fan: tuple[float, float] = (0.0, 0.0)                              # first angle and step [degrees]


@dataclass(kw_only=True, eq=False)
class HsxHeader:
    """Contents of the header."""

    midnight: float = np.nan           # [s]: since 1970
    unit: float = 1.0                  # [m]
    good: float = -np.inf              # least quality code of a good beam
    system: str = ""                   # coordinate system
    primary: int | None = None         # device of positions
    devices: dict[int, HsxDevice] = field(default_factory=dict)


def lines(stream: BinaryIO) -> Iterator[tuple[int, list[str]]]:
    """Yield place [bytes] and fields of the lines of a file that begin with a tag of three letters or digits."""
    place = stream.tell()
    while raw := stream.readline(LONGEST):
        if len(raw) >= LONGEST:
            raise ValueError(f"its line at byte {place} has more than {LONGEST - 1} characters; it is damaged.")
        if raw[:1].isalpha():
            yield place, raw.decode("latin-1").split()
        place += len(raw)


def header_of(stream: BinaryIO) -> HsxHeader:
    """Read the header, up to its end (EOH)."""
    header = HsxHeader()
    for _, (tag, *rest) in lines(stream):
        if tag == "EOH":
            break
        if tag == "TND" and len(rest) > 1:
            header.midnight = _midnight(rest[1])
        elif tag == "HSP" and len(rest) > 10:
            header.unit = UNITS.get(whole(rest[10]), 1.0)
            header.good = numbers(rest[7:8])[0]
        elif tag == "PRJ":
            header.system = " ".join(rest)
        elif tag in ("DEV", "OF2", "MBI", "PRI") and rest:
            number = whole(rest[0])
            device = header.devices.setdefault(number, HsxDevice())
            if tag == "PRI":
                header.primary = number
            elif tag == "DEV":
                device.name = " ".join(rest[2:]).strip('"')
            elif tag == "OF2" and len(rest) > 8:
                device.offsets[whole(rest[1])] = numbers(rest[2:9])
            elif tag == "MBI" and len(rest) > 7:
                device.beams = (whole(rest[4]), whole(rest[5]))
                device.fan = (float(numbers(rest[6:7])[0]), float(numbers(rest[7:8])[0]))
    if np.isnan(header.midnight):
        raise ValueError("it states no date (TND).")
    return header


def numbers(fields: list[str]) -> np.ndarray:
    """Return the numbers of fields."""
    try:
        return np.array(fields, float)
    except ValueError:
        raise ValueError(f"it has {' '.join(fields)[:40]!r} where numbers belong; it is damaged.") from None


def whole(text: str) -> int:
    """Return a field of a whole number."""
    value = numbers([text])[0]
    if not abs(value) < 1 << 31:
        raise ValueError(f"it has {text[:20]!r} where a whole number belongs; it is damaged.")
    return int(value)


def bits(text: str) -> int:
    """Return a field of bits, which is hexadecimal."""
    try:
        return int(text, 16)
    except ValueError:
        raise ValueError(f"it has {text[:20]!r} where a hexadecimal number belongs; it is damaged.") from None


def _midnight(text):
    for form in ("%m/%d/%Y", "%m/%d/%y"):
        try:
            return datetime.strptime(text, form).replace(tzinfo=timezone.utc).timestamp()
        except ValueError:
            continue
    raise ValueError(f"it has the date {text[:20]!r} (TND), not one such as 11/27/2010; it is damaged.")
