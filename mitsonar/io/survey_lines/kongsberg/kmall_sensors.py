"""Write the KMALL datagrams other than pings: installation, settings, cast, motion, positions, clock, speed, tide.

Layouts follow Kongsberg's datagram description, revision J: little-endian, each datagram with its length before and
after. Angles are degrees; roll is positive with starboard down, pitch with the bow up, heave downwards.

The format has no field of its own for a tide. A #SHI holds it where it changes: the level of the water above the datum,
which the sentence in it names.
"""
from __future__ import annotations

import datetime
import heapq
import re
import struct
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from mitsonar.device.rotations import mounted, mounting_matrix
from mitsonar.units import deg_from_radians
from mitsonar.version import __version__

from ..lines import LineToWrite, Ping
from ..passage import LinePassage
from .kmall_datagrams import TIDE

MODEL = 2040                               # written for sounders of other makers
SKM_SECONDS, SPO_SECONDS, SCL_SECONDS = 1.0, 0.1, 1.0  # of a motion datagram; between positions; between clocks
ACTIVE, CLOCKED, CORRECTED = 1, 1 << 9, 1 << 10        # of a sensor's status
CLOCK, LEVEL = 5, 0                        # numbers of the clock and of the sensor of the water level
CONTENTS = 0b11111                         # position, roll and pitch, heading, heave, accelerations
UNKNOWN = 0b1100000                        # error fields and delayed heave hold no data
NO_HEIGHT = -999.0                         # [m] above the ellipsoid, which is unknown
MOTION = np.dtype([("type", "S4"), ("bytes", "<u2"), ("version", "<u2"), ("seconds", "<u4"), ("nanoseconds", "<u4"),
                   ("status", "<u4"), ("latitude", "<f8"), ("longitude", "<f8"), ("height", "<f4"), ("roll", "<f4"),
                   ("pitch", "<f4"), ("heading", "<f4"), ("heave", "<f4"), ("rates", "<f4", 3), ("velocity", "<f4", 3),
                   ("errors", "<f4", 7), ("acceleration", "<f4", 3), ("delayed", "<u4", 2), ("delayed_heave", "<f4")])
POINT = np.dtype([("depth", "<f4"), ("speed", "<f4"), ("pad", "<u4"), ("temperature", "<f4"), ("salinity", "<f4")])
BODY = 12                                  # bytes


def model(line: LineToWrite) -> int:
    """Return the number in the name of an EM sounder, 2040 for other sonars."""
    name = re.search(r"\bEM\s*(\d{3,4})\b", line.sonar)
    return int(name[1]) if name else MODEL


def datagram(kind: str, version: int, sounder: int, since: float, content: bytes) -> bytes:
    """Return a datagram with its frame."""
    length = 24 + len(content)
    head = struct.pack("<I4s2BH2I", length, f"#{kind}".encode(), version, 0, sounder, *_clock(since))
    return head + content + struct.pack("<I", length)


def body(ping: Ping) -> dict[str, int]:
    """Return the first fields of all datagrams of a ping, in the order of the file.

    The counter begins at 1: readers detect a new ping by a change of the counter, and their own begins at 0.
    """
    head = int(ping.get("head", 0))
    return {"numBytesCmnPart": BODY, "pingCnt": 1 + ping["cycle"] % 65_535, "rxFansPerPing": ping["fans"],
            "rxFanIndex": ping["fan"], "swathsPerPing": ping["swaths"], "swathAlongPosition": ping["swath"],
            "txTransducerInd": head, "rxTransducerInd": head, "numRxTransducers": ping["heads"], "algorithmType": 0}


def height_of(height: float) -> float:
    """Return a height above the ellipsoid as files state it."""
    return float(height) if np.isfinite(height) else NO_HEIGHT


def parts_of(line: LineToWrite) -> np.ndarray | None:
    """Return places (3, 3) [m] of the transmit array's port, middle and starboard part from it, None if it has others.

    They are of the array's frame. Sectors name them by these numbers.
    """
    if "sector_offset" not in line.first:
        return None
    offsets = line.array("sector_offset").reshape(-1, 3)
    own = offsets[np.isfinite(offsets).all(1)] @ mounting_matrix(*line.array("transmit_mounting"))
    parts, side = np.zeros((3, 3)), np.where(np.abs(own[:, 1]) < 1e-6, 1, np.where(own[:, 1] < 0, 0, 2))
    for number in np.unique(side):
        parts[number] = own[side == number][0]
        if np.abs(own[side == number] - parts[number]).max() > 1e-3:
            return None
    return parts


def installation(line: LineToWrite, passage: LinePassage) -> bytes:
    """Return #IIP: lever arms and mountings of arrays and sensors."""
    number = model(line)
    # Readers search the versions before the serial numbers.
    receivers = line.receivers
    # Readers expect a transmit array for each of two heads; that of a line is listed once for each.
    heads = range(1, len(receivers[0]) + 1)
    system = "Single Tx single Rx" if len(heads) == 1 else "Dual Tx dual Rx"
    parts = ["OSCV:Empty", f"EMXV:EM{number}", "\nPU_0", "\nSN=0", "\nVERSIONS:", f"\nCPU:mitsonar {__version__}",
             "\nVERSIONS-END", "\nSERIALno:\nTX:1", *(f"\nTX{head}:{head}" for head in heads[1:]), "\nRX:1",
             *(f"\nRX{head}:{head}" for head in heads[1:]), "\nSERIALno-END",
             "\nKMALL:Rev J 2023-09-15", f"\nSYSTEM:EM {number} - {system}"]
    array = _mounted(line.array("transmit_offset"), line.array("transmit_mounting"))
    if (inner := parts_of(line)) is not None:
        array += "".join(f";{name}{axis}={value:.5f}" for name, part in zip(("IP", "IC", "IS"), inner)
                         for axis, value in zip("XYZ", part))
    parts += [f"TRAI_TX{head}:N={head};{array}" for head in heads]
    parts += [f"TRAI_RX{head + 1}:N={head + 1};{_mounted(offset, mounting)};G=0.00"
              for head, (offset, mounting) in enumerate(zip(*receivers))]
    zero = "X=0.000;Y=0.000;Z=0.000"
    parts += [f"POSI_1:{zero};D=0.000;G=WGS84;T=Datagram;C=On;F=GGA;Q=Off;I=Net port 1;U=ACTIVE",
              f"ATTI_1:{zero};R=0.000;P=0.000;H=0.000;D=0.000;M=Rotation;F=KM Binary;I=Net port 2;U=ACTIVE",
              "SVPI:F=AML NMEA;I=Integrated probe;U=ACTIVE", f"EMXI:SWLZ={-passage.draught:.4f}", "\n"]
    return datagram("IIP", 0, number, passage.time[0], _text(",".join(parts)))


def settings(line: LineToWrite, passage: LinePassage) -> bytes:
    """Return #IOP: settings of the sounder, and the origin of the line as a remark."""
    frequency = float(line.first["sector_frequency"][0].mean())
    remark = line.provenance().replace(":", "")
    kept = "On" if "column_level_db" in line.first else "Off"
    text = (f"\nSector coverage\nBeam spacing: {line.first.sizes['beam']} soundings\n\nDepth settings\n"
            f"Frequency: {frequency / 1e3:.0f}kHz\nWater column data: {kept}\n\nSound velocity at Transducer\n"
            f"Sound Velocity source: Probe\n\nWater Column: {kept}\nWater column: 0 log R\n\nRemark: {remark}\n")
    return datagram("IOP", 0, model(line), passage.time[0], _text(text))


def profile(line: LineToWrite, passage: LinePassage) -> bytes:
    """Return #SVP: the cast."""
    points = np.zeros(line.first.sizes["node"], POINT)
    points["depth"], points["speed"] = line.array("cast_depth"), line.array("cast_sound_speed")
    head = struct.pack("<2H4sI2d", 28, len(points), b"S00\0", int(passage.time[0]), passage.latitude[0],
                       passage.longitude[0])
    return datagram("SVP", 1, model(line), passage.time[0], head + points.tobytes())


def head_speed(line: LineToWrite, ping: Ping) -> bytes:
    """Return #SVT: the sound speed at the head during a ping."""
    since = float(ping["since"])
    about = struct.pack("<6H2f", 20, ACTIVE, 1, 1, 24, 1, 0.0, 0.0)
    sample = struct.pack("<2I4f", *_clock(since), float(ping["head_sound_speed"]), 0.0, -9999.0, -9999.0)
    return datagram("SVT", 0, model(line), since, about + sample)


def compatible_heave(line: LineToWrite, passage: LinePassage, ping: Ping) -> bytes:
    """Return #CHE: the heave of the transmit array at a ping, downwards, for programs of the older format."""
    arm = line.array("transmit_offset")
    deeper = mounted(arm, float(ping["ping_roll"]), float(ping["ping_pitch"]))[2] - arm[2]
    heave = float(ping["below_surface"] - passage.draught + deeper)
    return datagram("CHE", 0, model(line), float(ping["since"]),
                    struct.pack("<2H8Bf", *body(ping).values(), heave))


def tide(line: LineToWrite, ping: Ping) -> bytes:
    """Return #SHI: the level of the water above the datum at a ping."""
    words = f"{TIDE}{line.datum or 'datum'}\0".encode("ascii", "replace")
    content = struct.pack("<4HHf", 8, 0, ACTIVE, 0, LEVEL, ping["level"]) + words
    return datagram("SHI", 0, model(line), float(ping["since"]), content)


Due = tuple[float, Callable[[], bytes]]    # time [s since 1970]; function that makes the datagrams then


def sensors(line: LineToWrite, passage: LinePassage) -> Iterator[Due]:
    """Yield #SKM, #SPO with #CPO, and #SCL by time, to be made once ``passage`` knows a ping after them."""
    return heapq.merge(_motion(line, passage), _clocks(line, passage), _positions(line, passage),
                       key=lambda timed: timed[0])


def _motion(line, passage) -> Iterator[Due]:
    rates = passage.rate(np.stack([passage.roll, passage.pitch, np.unwrap(passage.heading)], -1))
    samples = np.zeros(passage.time.size, MOTION)
    samples["type"], samples["bytes"], samples["version"], samples["status"] = b"#KMB", MOTION.itemsize, 1, UNKNOWN
    samples["seconds"] = np.floor(passage.time)
    samples["nanoseconds"] = np.minimum(np.rint(1e9 * (passage.time % 1)), 999_999_999)
    samples["latitude"], samples["longitude"] = passage.latitude, passage.longitude
    samples["roll"], samples["pitch"] = deg_from_radians(passage.roll), deg_from_radians(passage.pitch)
    samples["heading"] = deg_from_radians(passage.heading) % 360.0
    samples["rates"], samples["velocity"] = deg_from_radians(rates), passage.velocity
    samples["acceleration"] = passage.rate(passage.velocity)
    second = np.floor((passage.time - passage.time[0]) / SKM_SECONDS)

    def made(since: float, part: slice) -> bytes:
        now = samples[part]
        now["heave"] = -passage.heave(part)
        now["height"] = np.nan_to_num(passage.height(part), nan=NO_HEIGHT)
        head = struct.pack("<H2B4H", 12, 0, ACTIVE, 1, len(now), MOTION.itemsize, CONTENTS)
        return datagram("SKM", 1, model(line), since, head + now.tobytes())

    first = np.flatnonzero(np.diff(second, prepend=-1.0))
    for begin, end in zip(first, [*first[1:], second.size]):
        since = float(passage.time[begin])
        yield since, partial(made, since, slice(begin, end))


def _clocks(line, passage) -> Iterator[Due]:
    def made(since: float) -> bytes:
        date = datetime.datetime.fromtimestamp(since, datetime.timezone.utc)
        sentence = _sentence(f"INZDA,{date:%H%M%S}.{date.microsecond // 10_000:02d},{date:%d,%m,%Y},,")
        return datagram("SCL", 1, model(line), since, struct.pack("<4Hfi", 8, CLOCK, ACTIVE, 0, 0.0, 0) + sentence)

    for since in _spaced(passage.time, SCL_SECONDS):
        yield float(passage.time[since]), partial(made, float(passage.time[since]))


def _positions(line, passage) -> Iterator[Due]:
    def made(index: int) -> bytes:
        since, latitude, longitude = (float(row[index]) for row in (passage.time, passage.latitude, passage.longitude))
        north, east, _ = passage.velocity[index]
        height, above = float(passage.height(index)), float(passage.heave(index)) - passage.draught
        fixes = b""
        for kind, above_ellipsoid in (("SPO", height), ("CPO", height - above)):       # of the second, the surface
            fix = struct.pack("<4H2If2d3f", 8, 0, ACTIVE | CLOCKED | CORRECTED, 0, *_clock(since), 0.0, latitude,
                              longitude, np.hypot(north, east), np.degrees(np.arctan2(east, north)) % 360.0,
                              height_of(above_ellipsoid))
            fixes += datagram(kind, 0, model(line), since, fix + _gga(since, latitude, longitude, above, height))
        return fixes

    for index in _spaced(passage.time, SPO_SECONDS):
        yield float(passage.time[index]), partial(made, index)


def _spaced(time, step) -> Iterator[int]:
    """Yield the numbers of samples that are a step [s] apart."""
    due = -np.inf
    for index, now in enumerate(time):
        if now >= due:
            due = now + step - 1e-6
            yield index


def _gga(since, latitude, longitude, above, height):
    """Return a fix as an NMEA 0183 sentence: heights above the surface, and of the surface above the ellipsoid."""
    time = datetime.datetime.fromtimestamp(since, datetime.timezone.utc).strftime("%H%M%S.%f")[:9]
    sides = []
    for value, digits, names in ((latitude, 2, "NS"), ((longitude + 180) % 360 - 180, 3, "EW")):
        # Rounded to a ten-millionth of a minute first, so that no minute rounds up to 60.
        degrees, minutes = divmod(round(abs(value) * 60e7), 600_000_000)
        sides.append(f"{degrees:0{digits}d}{minutes / 1e7:010.7f},{names[value < 0]}")
    surface = f"{height - above:.2f}" if np.isfinite(height) else ""
    return _sentence(f"INGGA,{time},{sides[0]},{sides[1]},4,12,0.7,{above:.2f},M,{surface},M,1.0,0000")


def _sentence(text):
    checksum = 0
    for letter in text.encode():
        checksum ^= letter
    return f"${text}*{checksum:02X}\r\n".encode()


def _mounted(offset, mounting):
    roll, pitch, heading = deg_from_radians(np.asarray(mounting))
    values = (*offset, roll, pitch, heading % 360.0)
    return ";".join(f"{name}={value:.4f}" for name, value in zip("XYZRPH", values))


def _text(text):
    plain = text.replace("µ", "u").encode("ascii", "replace")
    return struct.pack("<3H", 6 + len(plain), 0, 0) + plain


def _clock(since):
    seconds = int(since)
    return seconds, int((since - seconds) * 1e9)       # as pykmall rounds, so that a ping's datagrams have one time
