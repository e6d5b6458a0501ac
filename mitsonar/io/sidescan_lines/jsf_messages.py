"""Layouts of JSF messages (EdgeTech, JSF File and Message Descriptions, 0023492), and the walk from one to the next.

A message has a header of 16 bytes, which begins with 0x1601 and holds the length of what follows. Numbers are little
endian. ``ANGLE`` turns pitch and roll into degrees; headings are in hundredths of degrees, depths in millimetres.
"""
from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np

SYNC = b"\x01\x16"
HEADER = np.dtype([("sync", "<u2"), ("version", "u1"), ("session", "u1"), ("type", "<u2"), ("command", "u1"),
                   ("subsystem", "u1"), ("channel", "u1"), ("sequence", "u1"), ("reserved", "<u2"), ("size", "<i4")])
SONAR, NMEA, MOTION, PRESSURE, DOPPLER = 80, 2002, 2020, 2060, 2080     # types
NAMES = {40: "status", SONAR: "sonar data that is no sidescan", 181: "navigation offsets", 182: "system information",
         426: "file timestamp", 428: "file padding", NMEA: "NMEA", MOTION: "pitch and roll", PRESSURE: "pressure",
         2071: "reflection", DOPPLER: "Doppler log", 2091: "situation", 2100: "cable counter", 2101: "pipe",
         2111: "container timestamp", 3000: "bathymetry", 3001: "attitude of bathymetry",
         3002: "pressure of bathymetry", 3003: "altitude of bathymetry", 3004: "position of bathymetry",
         3005: "status of bathymetry"}
ANGLE = 180 / 32768                # [degrees] a step of pitch and roll
MINUTES = 600_000                  # a degree, in ten thousandths of a minute of arc
PLACES = {1: 1e-3, 3: 0.1, 4: 0.01}                      # [m] a step of x and y, by coordinate units
DEGREES = 2                        # coordinate units of latitude and longitude
# bits of the validity of a sonar message
PLACE, COURSE, SPEED, HEADING, ATTITUDE, ALTITUDE, HEAVE, DEPTH, NOTE, INTERPOLATED, SOUND = (
    1 << bit for bit in (0, 1, 2, 3, 5, 6, 7, 9, 10, 13, 14))
PITCH_2020, ROLL_2020, HEAVE_2020, HEADING_2020 = (1 << bit for bit in (6, 7, 8, 9))
DEPTH_2060, SOUND_2060 = 1 << 5, 1 << 4
DISTANCE_2080 = 1 << 5


def _layout(size, **fields):
    """Return the type of a structure of some bytes; fields are (type, byte)."""
    return np.dtype({"names": list(fields), "formats": [kind for kind, _ in fields.values()],
                     "offsets": [at for _, at in fields.values()], "itemsize": size})


SONAR_MESSAGE = _layout(
    240, time=("<i4", 0), start=("<u4", 4), number=("<u4", 8), high=("<u2", 16), low=("<u2", 18), low_2=("<u2", 20),
    identity=("<i2", 28), valid=("<u2", 30), kind=("<i2", 34), heave=("<f4", 48), x=("<i4", 80), y=("<i4", 84),
    units=("<i2", 88), note=("S24", 90), samples=("<u2", 114), interval=("<u4", 116), gain=("<u2", 120),
    level=("<i2", 122), first=("<u2", 126), last=("<u2", 128), sweep=("<u2", 130), pressure=("<i4", 132),
    depth=("<i4", 136), rate=("<u2", 140), altitude=("<i4", 144), sound=("<f4", 148), mixer=("<f4", 152),
    year=("<i2", 156), day=("<i2", 158), hour=("<i2", 160), minute=("<i2", 162), second=("<i2", 164),
    basis=("<i2", 166), weight=("<i2", 168), pulses=("<i2", 170), heading=("<u2", 172), pitch=("<i2", 174),
    roll=("<i2", 176), fix_hour=("<i2", 186), fix_minute=("<i2", 188), fix_second=("<i2", 190), course=("<i2", 192),
    speed=("<i2", 194), fix_day=("<i2", 196), fix_year=("<i2", 198), milliseconds=("<u4", 200), largest=("<u2", 204),
    packet=("<u2", 220))
NMEA_MESSAGE = _layout(12, time=("<i4", 0), milliseconds=("<i4", 4), source=("u1", 8))
MOTION_MESSAGE = _layout(44, time=("<i4", 0), milliseconds=("<i4", 4), pitch=("<i2", 24), roll=("<i2", 26),
                         heave=("<i2", 32), heading=("<u2", 34), valid=("<u4", 36))
PRESSURE_MESSAGE = _layout(76, time=("<i4", 0), milliseconds=("<i4", 4), valid=("<u4", 24), sound=("<i4", 32),
                           depth=("<i4", 36))
DOPPLER_MESSAGE = _layout(72, time=("<i4", 0), milliseconds=("<i4", 4), valid=("<u4", 12), distance=("(4,)<i4", 16))
SMALL = {NMEA: NMEA_MESSAGE, MOTION: MOTION_MESSAGE, PRESSURE: PRESSURE_MESSAGE, DOPPLER: DOPPLER_MESSAGE}


@dataclass(frozen=True, kw_only=True)
class JsfMessage:
    """Header of a message, and the place of what follows."""

    kind: int
    version: int
    subsystem: int
    channel: int
    at: int
    size: int


def walk(file: BinaryIO) -> Iterator[JsfMessage]:
    """Yield the messages of a file."""
    size, at = os.fstat(file.fileno()).st_size, 0
    while at < size:
        file.seek(at)
        raw = file.read(HEADER.itemsize)
        if raw[:2] != SYNC:
            raise ValueError(f"no message starts at byte {at}: the file is damaged there; record or copy it again.")
        if len(raw) < HEADER.itemsize:
            raise ValueError(f"it ends within the message at byte {at}: the file is cut off; copy it again.")
        header = np.frombuffer(raw, HEADER)[0]
        begin, length = at + HEADER.itemsize, int(header["size"])
        if length < 0:
            raise ValueError(f"the message at byte {at} has {length} bytes: the file is damaged there.")
        if begin + length > size:
            raise ValueError(f"it ends within the message at byte {at}: the file is cut off; copy it again.")
        yield JsfMessage(kind=int(header["type"]), version=int(header["version"]), subsystem=int(header["subsystem"]),
                         channel=int(header["channel"]), at=begin, size=length)
        at = begin + length
