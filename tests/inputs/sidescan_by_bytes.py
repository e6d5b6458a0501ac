"""JSF and SDF files made byte by byte, by the offsets of the formats' descriptions, without mitsonar."""
import struct

import numpy as np


def message(kind, content, subsystem=20, channel=0, version=0xD):
    """Return a JSF message."""
    return struct.pack("<HBBHBBBBHi", 0x1601, version, 0, kind, 2, subsystem, channel, 0, 0, len(content)) + content


def sonar(number, samples, *, channel=0, subsystem=20, seconds=1_700_000_000, milliseconds=80_000_250, kind=0, weight=0,
          packet=1, valid=0b0100_0010_0110_1101, high=0, version=0xD, place=(4_800_000, -28_200_000, 2), start=0,
          interval=20_000, band=(12_000, 13_000)):
    """Return a sonar message (type 80) with an altitude of 12.345 m, a depth of 7.5 m, a heading of 271.5 degrees."""
    raw = bytearray(240)
    for form, at, value in (("<i", 0, seconds), ("<I", 4, start), ("<I", 8, number), ("<H", 16, high), ("<H", 18, 128),
                            ("<H", 20, 500 << 4 | 7), ("<H", 30, valid), ("<h", 34, kind), ("<f", 48, 0.5),
                            ("<i", 80, place[0]), ("<i", 84, place[1]), ("<h", 88, place[2]), ("<I", 116, interval),
                            ("<H", 120, 3), ("<h", 122, 75), ("<H", 126, band[0]), ("<H", 128, band[1]), ("<H", 130, 2),
                            ("<i", 136, 7500), ("<i", 144, 12_345), ("<f", 148, 1490.0), ("<h", 168, weight),
                            ("<H", 172, 27_150), ("<h", 174, -910), ("<h", 176, 1820), ("<h", 194, 45),
                            ("<I", 200, milliseconds), ("<H", 220, packet)):
        struct.pack_into(form, raw, at, value)
    samples = np.asarray(samples)
    struct.pack_into("<H", raw, 114, (samples.size // (1 + (kind == 1))) & 0xFFFF)
    data = samples.astype("<i2" if kind else "<u2").tobytes()
    return message(80, bytes(raw) + data, subsystem, channel, version)


def motion(seconds, milliseconds, roll, valid=0x80):
    """Return a message of roll (type 2020), in its own steps."""
    raw = bytearray(44)
    struct.pack_into("<ii", raw, 0, seconds, milliseconds)
    struct.pack_into("<h", raw, 26, roll)
    struct.pack_into("<i", raw, 36, valid)
    return message(2020, bytes(raw), 101)


def nmea(seconds, milliseconds, sentence):
    """Return a message of an NMEA sentence (type 2002)."""
    return message(2002, struct.pack("<iiBxxx", seconds, milliseconds, 1) + sentence.encode() + b"\r\n", 100)


def page(number, port, starboard, *, version=3502, second=5, khz=900, header=512):
    """Return an SDF page: 47 N, 8 W [rad], altitude 6.5 m, range 50 m, 1480 m/s, 2.5 m/s, 40 kHz of samples."""
    raw = bytearray(header + 4)
    for form, at, value in (("<I", 0, 0xFFFFFFFF), ("<I", 8, version), ("<I", 16, number), ("<I", 20, len(port)),
                            ("<I", 32, 50), ("<I", 36, 250), ("<I", 40, 148_000),
                            ("<6I", 72, (2024, 2, 29, 23, 59, second)),
                            ("<f", 112, 359.5), ("<f", 116, -2.0), ("<f", 120, 3.0), ("<f", 128, 6.5),
                            ("<2d", 164, (np.radians(47), np.radians(-8))), ("<I", 180, 1), ("<I", 184, header),
                            ("<f", 208, 21.0), ("<f", 220, 0.25), ("<I", 228, 40_000), ("<I", 408, khz)):
        struct.pack_into(form, raw, at, *(value if isinstance(value, tuple) else (value,)))
    for side in (port, starboard):
        raw += struct.pack("<I", len(side)) + np.asarray(side, "<u4").tobytes()
    struct.pack_into("<I", raw, 4, len(raw) - 4)
    return bytes(raw)
