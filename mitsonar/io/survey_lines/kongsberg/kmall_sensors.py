"""KMALL datagrams that are not of pings: installation, settings, cast, motion, positions, the head's sound speed.

After Kongsberg's datagram description, revision J, as instruments' files have it: little-endian, each with its length
before and after. Angles are degrees; roll is positive with starboard down, pitch with the bow up, heave downwards.
"""
from __future__ import annotations

import datetime
import heapq
import re
import struct
from collections.abc import Iterator

import numpy as np

from mitsonar.units import deg_from_radians
from mitsonar.version import __version__

from ..lines import LineToWrite, Ping
from ..passage import LinePassage

MODEL = 2040                               # of sounders that are none of Kongsberg's
SKM_SECONDS, SPO_SECONDS = 1.0, 0.1        # of a motion datagram; between positions
ACTIVE, CLOCKED, CORRECTED = 1, 1 << 9, 1 << 10        # of a sensor's status
CONTENTS = 0b11111                         # position, roll and pitch, heading, heave, accelerations
UNKNOWN = 0b1100000                        # error fields and delayed heave are no data
NO_HEIGHT = -999.0                         # [m] above the ellipsoid, which a line does not know
MOTION = np.dtype([("type", "S4"), ("bytes", "<u2"), ("version", "<u2"), ("seconds", "<u4"), ("nanoseconds", "<u4"),
                   ("status", "<u4"), ("latitude", "<f8"), ("longitude", "<f8"), ("height", "<f4"), ("roll", "<f4"),
                   ("pitch", "<f4"), ("heading", "<f4"), ("heave", "<f4"), ("rates", "<f4", 3), ("velocity", "<f4", 3),
                   ("errors", "<f4", 7), ("acceleration", "<f4", 3), ("delayed", "<u4", 2), ("delayed_heave", "<f4")])
POINT = np.dtype([("depth", "<f4"), ("speed", "<f4"), ("pad", "<u4"), ("temperature", "<f4"), ("salinity", "<f4")])
BODY = 12                                  # bytes


def model(line: LineToWrite) -> int:
    """Return the number of the sounder: the one in its name, 2040 where there is none."""
    found = re.search(r"\bEM\s*(\d{3,4})\b", line.sonar)
    return int(found[1]) if found else MODEL


def datagram(kind: str, version: int, sounder: int, since: float, content: bytes) -> bytes:
    """Return a whole datagram."""
    length = 24 + len(content)
    head = struct.pack("<I4s2BH2I", length, f"#{kind}".encode(), version, 0, sounder, *_clock(since))
    return head + content + struct.pack("<I", length)


def body(ping: Ping, number: int) -> dict[str, int]:
    """Return what all datagrams of a ping begin with, in the order of the file.

    Counters begin at 1: readers take a change of the counter for a new ping, and their own begins at 0.
    """
    head = int(ping.get("head", 0))
    return {"numBytesCmnPart": BODY, "pingCnt": 1 + number % 65_535, "rxFansPerPing": 1, "rxFanIndex": 0,
            "swathsPerPing": 1, "swathAlongPosition": 0, "txTransducerInd": 0, "rxTransducerInd": head,
            "numRxTransducers": 1, "algorithmType": 0}


def installation(line: LineToWrite, passage: LinePassage) -> bytes:
    """Give #IIP: arrays and sensors in the ship."""
    number = model(line)
    # Readers look for the versions before they find the serial numbers.
    parts = ["OSCV:Empty", f"EMXV:EM{number}", "\nPU_0", "\nSN=0", "\nVERSIONS:", f"\nCPU:mitsonar {__version__}",
             "\nVERSIONS-END", "\nSERIALno:\nTX:1", "\nRX:1", "\nSERIALno-END",
             "\nKMALL:Rev J 2023-09-15", f"\nSYSTEM:EM {number} - Single Tx single Rx",
             f"TRAI_TX1:N=1;{_mounted(line.array('transmit_offset'), line.array('transmit_mounting'))}"]
    parts += [f"TRAI_RX{head + 1}:N={head + 1};{_mounted(offset, mounting)};G=0.00"
              for head, (offset, mounting) in enumerate(zip(*line.receivers))]
    nothing = "X=0.000;Y=0.000;Z=0.000"
    parts += [f"POSI_1:{nothing};D=0.000;G=WGS84;T=Datagram;C=On;F=GGA;Q=Off;I=Net port 1;U=ACTIVE",
              f"ATTI_1:{nothing};R=0.000;P=0.000;H=0.000;D=0.000;M=Rotation;F=KM Binary;I=Net port 2;U=ACTIVE",
              "SVPI:F=AML NMEA;I=Integrated probe;U=ACTIVE", f"EMXI:SWLZ={-passage.draught:.4f}", "\n"]
    return datagram("IIP", 0, number, passage.time[0], _text(",".join(parts)))


def settings(line: LineToWrite, passage: LinePassage) -> bytes:
    """Give #IOP: what an operator would have chosen, and where the line comes from."""
    frequency = float(line.first["sector_frequency"][0].mean())
    remark = line.provenance().replace(":", "")
    kept = "On" if "column_level_db" in line.first else "Off"
    text = (f"\nSector coverage\nBeam spacing: {line.first.sizes['beam']} soundings\n\nDepth settings\n"
            f"Frequency: {frequency / 1e3:.0f}kHz\nWater column data: {kept}\n\nSound velocity at Transducer\n"
            f"Sound Velocity source: Probe\n\nWater Column: {kept}\nWater column: 0 log R\n\nRemark: {remark}\n")
    return datagram("IOP", 0, model(line), passage.time[0], _text(text))


def profile(line: LineToWrite, passage: LinePassage) -> bytes:
    """Give #SVP: the cast."""
    points = np.zeros(line.first.sizes["node"], POINT)
    points["depth"], points["speed"] = line.array("cast_depth"), line.array("cast_sound_speed")
    head = struct.pack("<2H4sI2d", 28, len(points), b"S00\0", int(passage.time[0]), passage.latitude[0],
                       passage.longitude[0])
    return datagram("SVP", 1, model(line), passage.time[0], head + points.tobytes())


def head_speed(line: LineToWrite, ping: Ping) -> bytes:
    """Give #SVT: what the head's own sensor says at a ping."""
    since = float(ping["since"])
    about = struct.pack("<6H2f", 20, ACTIVE, 1, 1, 24, 1, 0.0, 0.0)
    sample = struct.pack("<2I4f", *_clock(since), float(ping["head_sound_speed"]), 0.0, -9999.0, -9999.0)
    return datagram("SVT", 0, model(line), since, about + sample)


def sensors(line: LineToWrite, passage: LinePassage) -> Iterator[tuple[float, bytes]]:
    """Give #SKM and #SPO with their times [s since 1970], in their order."""
    return heapq.merge(_motion(line, passage), _positions(line, passage), key=lambda one: one[0])


def _motion(line, passage) -> Iterator[tuple[float, bytes]]:
    rates = passage.rate(np.stack([passage.roll, passage.pitch, np.unwrap(passage.heading)], -1))
    samples = np.zeros(passage.time.size, MOTION)
    samples["type"], samples["bytes"], samples["version"], samples["status"] = b"#KMB", MOTION.itemsize, 1, UNKNOWN
    samples["seconds"] = np.floor(passage.time)
    samples["nanoseconds"] = np.minimum(np.rint(1e9 * (passage.time % 1)), 999_999_999)
    samples["latitude"], samples["longitude"], samples["height"] = passage.latitude, passage.longitude, NO_HEIGHT
    samples["roll"], samples["pitch"] = deg_from_radians(passage.roll), deg_from_radians(passage.pitch)
    samples["heading"], samples["heave"] = deg_from_radians(passage.heading) % 360.0, -passage.heave
    samples["rates"], samples["velocity"] = deg_from_radians(rates), passage.velocity
    samples["acceleration"] = passage.rate(passage.velocity)
    number = np.floor((passage.time - passage.time[0]) / SKM_SECONDS)
    for one in np.unique(number):
        some = samples[number == one]
        head = struct.pack("<H2B4H", 12, 0, ACTIVE, 1, len(some), MOTION.itemsize, CONTENTS)
        since = float(passage.time[np.argmax(number == one)])
        yield since, datagram("SKM", 1, model(line), since, head + some.tobytes())


def _positions(line, passage) -> Iterator[tuple[float, bytes]]:
    due = -np.inf
    for index, time in enumerate(passage.time):
        if time < due:
            continue
        due, since = time + SPO_SECONDS - 1e-6, float(time)
        north, east, _ = passage.velocity[index]
        latitude, longitude = float(passage.latitude[index]), float(passage.longitude[index])
        height = -float(passage.depth[index])
        fix = struct.pack("<4H2If2d3f", 8, 0, ACTIVE | CLOCKED | CORRECTED, 0, *_clock(since), 0.0, latitude, longitude,
                          np.hypot(north, east), np.degrees(np.arctan2(east, north)) % 360.0, NO_HEIGHT)
        yield since, datagram("SPO", 0, model(line), since, fix + _gga(since, latitude, longitude, height))


def _gga(since, latitude, longitude, height):
    """NMEA 0183's sentence of a fix: the height is above the still surface, the geoid's own is not known."""
    time = datetime.datetime.fromtimestamp(since, datetime.timezone.utc).strftime("%H%M%S.%f")[:9]
    sides = []
    for value, digits, names in ((latitude, 2, "NS"), ((longitude + 180) % 360 - 180, 3, "EW")):
        # A ten-millionth of a minute at once, so that no minute rounds up to 60.
        minutes = round(abs(value) * 60e7)
        whole, part = divmod(minutes, 600_000_000)
        sides.append(f"{whole:0{digits}d}{part / 1e7:010.7f},{names[value < 0]}")
    text = f"INGGA,{time},{sides[0]},{sides[1]},4,12,0.7,{height:.2f},M,,M,1.0,0000"
    checksum = 0
    for letter in text.encode():
        checksum ^= letter
    return f"${text}*{checksum:02X}\r\n".encode()


def _mounted(offset, turned):
    angles = deg_from_radians(np.asarray(turned))
    named = [*zip("XYZ", offset), *zip("RPH", (angles[0], angles[1], angles[2] % 360.0))]
    return ";".join(f"{name}={value:.4f}" for name, value in named)


def _text(text):
    plain = text.replace("µ", "u").encode("ascii", "replace")
    return struct.pack("<3H", 6 + len(plain), 0, 0) + plain


def _clock(since):
    seconds = int(since)
    return seconds, int((since - seconds) * 1e9)       # as pykmall has it, so that a ping's datagrams have one time
