"""A small .all file of a sounder's datagrams, and the .wcd file that belongs to it, made field by field."""
from __future__ import annotations

import struct

import numpy as np

from mitsonar.io.survey_lines.kongsberg import all_datagrams as layouts

SERIAL, MODEL, DATE, MILLISECONDS = 221, 710, 20260501, 36_000_000        # 10:00 UTC
INSTALLATION = (b"\0\0WLZ=1.5,SMH=221,STC=0,S1X=10.0,S1Y=-1.0,S1Z=5.0,S1H=0.1,S1P=0.2,S1R=0.3,S2X=9.0,S2Y=1.0,S2Z=5.5,"
                b"S2H=180.0,S2P=-0.2,S2R=-0.3,APS=0,P1X=2.0,P1Y=3.0,P1Z=-20.0,ARO=2,MSR=0.0,MSP=0.0,MSG=0.0,\0")
BEAMS, SECTORS, SAMPLES = 8, 2, 30


def level(time: np.ndarray) -> np.ndarray:
    """Return the pitch [degrees] of a level ship at times [s]."""
    return 0 * time


def all_file(pings: int = 2, *, order: layouts.Order = "<", beams: int = BEAMS, pitch=level, rises: bool = True,
             heave: float = 0.2) -> bytes:
    """Make the file: a ship that goes north at 2 m/s, beams from 40 degrees to port to 40 to starboard.

    The transmit array, 10 m forward, rises with the ship's pitch or, as some files have it, does not.
    """
    parts = [_datagram("I", 0, INSTALLATION, order), _datagram("U", 0, _cast(order), order)]
    for ping in range(pings):
        angle = np.deg2rad(pitch(float(ping))) if rises else 0.0
        array = heave - 1.5 - 10 * np.sin(angle) + 5 * np.cos(angle)
        bodies = {"P": _position(ping, order), "A": _attitude(ping, order, pitch, heave), "N": _ranges(beams, order),
                  "X": _depths(beams, order, array)}
        parts += [_datagram(kind, ping, body, order) for kind, body in bodies.items()]
    return b"".join(parts)


def wcd_file(pings: int = 2) -> bytes:
    """Make the water column, in two datagrams a ping, of 30 samples of -20 dB a beam."""
    return b"".join(_datagram("k", ping, _column(number), "<") for ping in range(pings) for number in range(2))


def _datagram(kind, ping, body, order):
    head = struct.pack(f"{order}B1sHIIHH", 2, kind.encode(), MODEL, DATE, MILLISECONDS + 1000 * ping, 7 + ping, SERIAL)
    inside = head + body + (b"" if len(head + body) % 2 else b"\0")
    whole = inside + b"\3" + struct.pack(f"{order}H", sum(inside[1:]) & 0xFFFF)
    return struct.pack(f"{order}I", len(whole)) + whole


def _fields(layout, order, **values):
    row = np.zeros(1, layout.newbyteorder(order))
    for name, value in values.items():
        row[name] = value
    return row.tobytes()


def _table(layout, order, count, **values):
    table = np.zeros(count, layout.newbyteorder(order))
    for name, value in values.items():
        table[name] = value
    return table.tobytes()


def _cast(order):
    return _fields(layouts.HEADS["U"], order, date=DATE, entries=3, resolution=100) + _table(
        layouts.CAST_NODE, order, 3, depth=[0, 20, 200], speed=[15000, 15100, 14900])


def _position(ping, order):
    return _fields(layouts.HEADS["P"], order, latitude=round((54.0 + ping * 2.0 / 111_300.0) * 2e7),
                   longitude=round(7.5 * 1e7), system=0xC1)


def _attitude(ping, order, pitch, heave):
    return _fields(layouts.HEADS["A"], order, entries=10) + _table(
        layouts.ATTITUDE, order, 10, time=100 * np.arange(10), heave=round(100 * heave),
        pitch=np.rint(100 * pitch(ping + 0.1 * np.arange(10))))


def _ranges(beams, order):
    angle = np.linspace(-40, 40, beams)       # to the array's port; it is turned about, so to starboard
    return _fields(layouts.HEADS["N"], order, speed=15050, sectors=SECTORS, beams=beams, rate=14000.0) + _table(
        layouts.RANGE_SECTOR, order, SECTORS, tilt=[-100, 150], length=1e-3, delay=[0.0, 2e-3], number=[0, 1],
        frequency=[70e3, 80e3], absorption=[2000, 2500], bandwidth=1e3) + _table(
        layouts.RANGE_BEAM, order, beams, angle=np.rint(100 * angle), sector=np.arange(beams) * SECTORS // beams,
        travel_time=0.08 / np.cos(np.deg2rad(angle)), quality=5)


def _depths(beams, order, depth):
    angle = np.deg2rad(np.linspace(40, -40, beams))
    bad = np.zeros(beams, np.uint8)
    bad[1] = 0x80
    return _fields(layouts.HEADS["X"], order, depth=depth, beams=beams, speed=15050, heading=0) + _table(
        layouts.XYZ_BEAM, order, beams, z=60.0, y=-60 * np.tan(angle), x=1.5, detection=bad | (np.abs(angle) > 0.3),
        backscatter=-250)


def _column(number):
    head = _fields(layouts.HEADS["k"], "<", datagrams=2, number=number + 1, sectors=SECTORS, all_beams=4, beams=2,
                   speed=15050, rate=200_000, tvg_function=30, tvg_offset=20)
    sectors = _table(layouts.COLUMN_SECTOR, "<", SECTORS, number=[0, 1])
    beams = b"".join(_fields(layouts.COLUMN_BEAM, "<", angle=3000 - 2000 * (2 * number + beam), start=4,
                             samples=SAMPLES - 10 * beam, sector=number) + struct.pack("b", -40) * (SAMPLES - 10 * beam)
                     for beam in range(2))
    return head + sectors + beams
