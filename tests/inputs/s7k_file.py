"""A small s7k file of a sonar's records, made field by field."""
from __future__ import annotations

import struct

import numpy as np

from mitsonar.io.survey_lines.s7k import s7k_records as layouts

DAY, HOUR, DEVICE, SPEED = (2026, 121), 10, 7125, 1485.0           # 1 May, 10:00 UTC
BEAMS, RATE, DEPTH = 16, 34_482.76, 40.0
PLACE = (54.0, 7.5)


def record(kind: int, second: float, body: bytes, *, source=(DEVICE, 0), summed: bool = True) -> bytes:
    """Return one record with its frame and checksum."""
    frame = np.zeros(1, layouts.FRAME)
    values = {"version": 5, "offset": 60, "sync": 0xFFFF, "size": 64 + len(body) + 4, "year": DAY[0], "day": DAY[1],
              "seconds": second % 60, "hours": HOUR, "minutes": int(second // 60), "record_version": 1, "kind": kind,
              "device": source[0], "enumerator": source[1], "flags": int(summed)}
    for name, value in values.items():
        frame[name] = value
    whole = frame.tobytes() + body
    return whole + struct.pack("<I", sum(whole))


def records_of(content: bytes) -> list[tuple[int, bytes]]:
    """Return number and bytes of the records of a file."""
    found = []
    while content:
        size, kind = (int.from_bytes(content[place:place + 4], "little") for place in (8, 32))
        found.append((kind, content[:size]))
        content = content[size:]
    return found


def unsummed(content: bytes) -> bytes:
    """Return a file whose records state no checksum."""
    return b"".join(part[:48] + b"\0\0" + part[50:] for _, part in records_of(content))


def fields(kind: int, **values) -> bytes:
    """Return a record's first fields; those that are not given are 0."""
    row = np.zeros(1, layouts.HEADS[kind])
    for name, value in values.items():
        row[name] = value
    return row.tobytes()


def detections(angle: np.ndarray, time: np.ndarray, size: int = 34, **values) -> bytes:
    """Return the table of raw detections; ``size`` is that of the file's version."""
    table = np.zeros(angle.size, np.dtype(layouts.DETECTION))
    for name, value in {"beam": np.arange(angle.size), "sample": time * RATE, "angle": angle, "flags": 1 + (1 << 2),
                        "quality": 3, "uncertainty": 0.01, "intensity": 1000.0, **values}.items():
        table[name] = value
    return b"".join(row.tobytes()[:size].ljust(size, b"\0") for row in table)


def s7k_file(pings: int = 3, *, old: bool = False, cast: bool = True, arms: bool = True, beams: int = BEAMS,
             heads: int = 1, size: int = 34, roll: float = 0.0, stabilised: bool = False, **values) -> bytes:
    """Make the file: a level ship that goes north at 2 m/s over a level bed at 40 m, in water of one speed.

    The receive array is 9 m forward, 1 m starboard and 3 m down of the reference point, the transmit array 1 m ahead.
    """
    parts = [record(7200, 0.0, bytes(100))]
    if arms:
        parts += [record(7030, 0.0, fields(
            7030, transmit=(1.0, 10.0, -3.0, 0, 0, 0), receive=(1.0, 9.0, -3.0, 0, 0, 0), position=(0, 0, 20.0),
            waterline=-1.0), source=(DEVICE, head)) for head in range(heads)]
    if cast:
        parts.append(record(1009, 0.0, fields(1009, placed=1, latitude=np.radians(PLACE[0]), entries=2,
                                              longitude=np.radians(PLACE[1])) + struct.pack(
                                                  "<4f", 0.0, SPEED, 200.0, SPEED)))
    for ping in range(pings):
        second = 10.0 + 0.5 * ping
        parts += [
            record(1003, second, fields(1003, latitude=np.radians(PLACE[0] + ping / 111_300.0),
                                        longitude=np.radians(PLACE[1]))),
            record(1016, second, fields(1016, entries=5) + b"".join(
                struct.pack("<H4f", 100 * k, roll, 0.0, 0.0, 0.0) for k in range(5)))]
        parts += [part for head in range(heads) for part in _ping(
            second, 100 + ping, (DEVICE, head), old, beams, size, roll if stabilised else None, values)]
    return b"".join(parts) + record(7300, 20.0, bytes(20))


def _ping(second, number, source, old, beams, size, roll, values):
    angle = np.radians(np.linspace(-60, 60, beams))
    time = 2 * (DEPTH - 2.0) / np.cos(angle) / SPEED            # the arrays are 2 m deep
    settings = fields(7000, number=number, frequency=4e5, rate=RATE, bandwidth=2e4, pulse_length=1e-4, power=220.0,
                      absorption=90.0, sound_speed=SPEED, steering=0.0, receive_flags=int(roll is not None))
    if not old:
        body = fields(7027, number=number, beams=beams, field=size, rate=RATE) + detections(angle, time, size, **values)
        return [record(7000, second, settings, source=source), record(7027, second, body, source=source)]
    # angles from the vertical where the beams are stabilised
    seen = (angle - (roll or 0.0)).astype("<f4")
    shape = fields(7004, beams=beams) + bytes(4 * beams) + seen.tobytes() + bytes(8 * beams)
    body = fields(7006, number=number, beams=beams, sound_speed=SPEED) + time.astype("<f4").tobytes() + bytes(
        [3 + 8] * beams) + np.full(beams, 1000.0, "<f4").tobytes() + bytes(8 * beams)
    return [record(kind, second, part, source=source) for kind, part in ((7000, settings), (7004, shape), (7006, body))]
