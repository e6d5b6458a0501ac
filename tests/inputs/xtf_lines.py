"""Small XTF files of multibeam sonars: datagrams of R2Sonic or records of Reson, made field by field."""
from __future__ import annotations

import struct

import numpy as np
import pyxtf

from mitsonar.io.survey_lines.xtf.r2sonic import HEAD

from .s7k_file import BEAMS, DEPTH, DEVICE, PLACE, SPEED, detections, fields, record

START = 1_777_629_610              # 1 May 2026, 10:00:10 UTC
STEP, ANGLE_STEP = 1e-6, 1e-4      # [s], [rad]: units of the datagram's numbers


def xtf_file(pings: int = 3, *, kind: str = "65", beams: int = BEAMS, **values) -> bytes:
    """Make the file: a level ship that goes north over a level bed, its array 2 m deep, 5 m forward and 1 m starboard.

    ``kind`` is "65" or "68" of R2Sonic, "7027" or "7006" of Reson.
    """
    header = pyxtf.XTFFileHeader()
    header.NumberOfBathymetryChannels, header.NavUnits, header.SonarName = 1, 3, b"made up"
    channel = header.ChanInfo[0]
    channel.TypeOfChannel, channel.OffsetX, channel.OffsetY, channel.OffsetZ = 3, 1.0, 5.0, 2.0
    parts = [bytes(header).ljust(1024, b"\0")]
    for number in range(12):
        parts.append(_packet(pyxtf.XTFPosRawNavigation, 107, 0.25 * number, {
            "RawYcoordinate": PLACE[0] + number / 222_600.0, "RawXcoordinate": PLACE[1]}))
        parts.append(_packet(pyxtf.XTFAttitudeData, 3, 0.25 * number, {"Heading": 0.01}))
    angle = np.radians(np.linspace(-60, 60, beams))
    time = 2 * (DEPTH - 2.0) / np.cos(angle) / SPEED
    for ping in range(pings):
        second, number = 0.5 + 0.5 * ping, 100 + ping
        if kind.startswith("7"):
            parts.append(_custom(record(7503, 10 + second, fields(
                7503, number=number, frequency=2e5, sound_speed=SPEED, power=210.0, absorption=60.0))))
            inside, packet = _reson(kind, number, 10 + second, angle, time, values), 61
        else:
            inside, packet = bth0(number, START + second, angle, time, **values), int(kind)
        parts.append(_packet(pyxtf.XTFPingHeader, packet, second, {
            "SoundVelocity": SPEED / 2, "ShipYcoordinate": PLACE[0], "ShipXcoordinate": PLACE[1]}, inside))
    return b"".join(parts)


def bth0(number: int, when: float, angle: np.ndarray, time: np.ndarray, *, even: bool = False, flags: int = 0xB,
         points: int | None = None) -> bytes:
    """Return one datagram; its angles are the first and the last, or steps."""
    count = angle.size + (angle.size & 1)
    head = np.zeros(1, HEAD)
    about = {"name": b"H0", "size": HEAD.itemsize, "model": b"2026", "serial": b"100996", "second": int(when),
             "nanosecond": round(1e9 * (when % 1)), "number": number, "sound_speed": SPEED, "frequency": 4e5,
             "power": 206.0, "pulse_length": 3.5e-5, "bandwidth": 3e4, "absorption": 81.0,
             "points": angle.size if points is None else points}
    for name, value in about.items():
        head[name] = value
    steps = np.diff(np.rint((angle - angle[0]) / ANGLE_STEP), prepend=0)
    parts = [head.tobytes(), _section(b"R0", struct.pack(">f", 4 * STEP), np.rint(time / STEP / 4), count)]
    parts += [_section(b"A0", struct.pack(">8f", angle[0], angle[-1], *[0] * 6), [], 0) if even else
              _section(b"A2", struct.pack(">8f", angle[0], ANGLE_STEP, *[0] * 6), steps, count),
              _section(b"I1", struct.pack(">f", 10.0), np.full(angle.size, 100), count)]
    quality = bytes([17 * flags] * (4 * -(-angle.size // 8)))
    parts.append(b"Q0" + struct.pack(">H", 4 + len(quality)) + quality)
    body = b"".join(parts)
    return b"BTH0" + struct.pack(">2I", 12 + len(body), 0) + body


def _section(name, start, values, count):
    numbers = np.zeros(count, ">u2")
    numbers[:len(values)] = values
    return name + struct.pack(">H", 4 + len(start) + numbers.nbytes) + start + numbers.tobytes()


def _reson(kind, number, second, angle, time, values):
    if kind == "7027":
        return record(7027, second, fields(7027, number=number, beams=angle.size, field=34, rate=34_482.76)
                      + detections(angle, time, **values))
    floats = [column.astype("<f4").tobytes() for column in (time, np.full(angle.size, 1000.0), 0 * time, 0 * time)]
    body = fields(7006, number=number, beams=angle.size, sound_speed=SPEED) + floats[0] + bytes([3 + 8] * angle.size)
    shape = fields(7004, beams=angle.size) + b"".join(
        column.astype("<f4").tobytes() for column in (0 * angle, angle, 0 * angle, 0 * angle))
    return record(7006, second, body + b"".join(floats[1:]), source=(DEVICE, 0)) + shape


def _packet(layout, kind, second, values, inside=b""):
    packet = layout()
    packet.HeaderType, packet.NumBytesThisRecord = kind, len(bytes(packet)) + len(inside)
    packet.Year, packet.Month, packet.Day, packet.Hour, packet.Minute = 2026, 5, 1, 10, 0
    packet.Second = 10 + int(second)
    fraction = next(name for name in ("Microsecond", "Millisecond", "HSeconds") if hasattr(packet, name))
    setattr(packet, fraction, round((second % 1) * {"Microsecond": 1e4, "Millisecond": 1e3, "HSeconds": 100}[fraction]))
    for name, value in values.items():
        setattr(packet, name, value)
    return bytes(packet) + inside


def _custom(inside):
    packet = pyxtf.XTFRawCustomHeader()
    packet.PacketID, packet.NumBytesThisRecord = 7503, 64 + len(inside)
    return bytes(packet) + inside
