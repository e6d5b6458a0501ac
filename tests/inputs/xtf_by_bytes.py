"""XTF files read by the byte offsets that the format's document gives (Triton, Rev. 41), without pyxtf."""
import struct

import numpy as np

FILE = {"format": ("B", 0), "program": ("8s", 2), "sonar": ("16s", 18), "note": ("64s", 36), "units": ("<H", 164),
        "channels": ("<H", 166)}
CHANNEL = {"type": ("B", 0), "number": ("B", 1), "correction": ("<H", 2), "unipolar": ("<H", 4), "bytes": ("<H", 6),
           "name": ("16s", 12), "frequency": ("<f", 32), "format": ("B", 74)}
PING = {"channels": ("<H", 4), "year": ("<H", 14), "month": ("B", 16), "day": ("B", 17), "hour": ("B", 18),
        "minute": ("B", 19), "second": ("B", 20), "hundredths": ("B", 21), "julian_day": ("<H", 22),
        "number": ("<I", 28), "sound_speed": ("<f", 32), "aux": ("<3f", 88), "ship_gyro": ("<f", 124),
        "ship": ("<2d", 128), "speed": ("<f", 152), "north": ("<d", 160), "east": ("<d", 168), "layback": ("<f", 184),
        "depth": ("<f", 192), "altitude": ("<f", 196), "pitch": ("<f", 204), "roll": ("<f", 208),
        "heading": ("<f", 212), "heave": ("<f", 216)}
SAMPLES = {"number": ("<H", 0), "slant_range": ("<f", 4), "ground_range": ("<f", 8), "delay": ("<f", 12),
           "duration": ("<f", 16), "per_ping": ("<f", 20), "flags": ("<H", 24), "frequency": ("<H", 26),
           "count": ("<I", 42), "weight": ("<h", 58)}


def fields(layout, data, start):
    """Return the fields of a structure that begins at a byte."""
    found = {}
    for name, (form, at) in layout.items():
        values = struct.unpack_from(form, data, start + at)
        found[name] = values[0] if len(values) == 1 else values
    return found


def read(path):
    """Return the file's header, its channels, its notes, and its pings, each with the list of its channels' samples."""
    data = path.read_bytes()
    header = fields(FILE, data, 0)
    channels = [fields(CHANNEL, data, 256 + 128 * number) for number in range(header["channels"])]
    notes, pings, at = [], [], 1024
    while at < len(data):
        magic, kind, length = (*struct.unpack_from("<HB", data, at), *struct.unpack_from("<I", data, at + 10))
        assert magic == 0xFACE and length % 64 == 0 and length > 0
        if kind == 1:
            notes.append(data[at + 56:at + 256].rstrip(b"\0").decode())
        if kind == 0:
            pings.append(ping(data, at, length, channels))
        at += length
    assert at == len(data)
    return header, channels, notes, pings


def ping(data, at, length, channels):
    """Return one sonar packet; what is behind its last channel must be zeros."""
    found, start = fields(PING, data, at), at + 256
    found["sides"] = []
    for _ in range(found["channels"]):
        side = fields(SAMPLES, data, start)
        assert channels[side["number"]]["bytes"] == 2
        side["samples"] = np.frombuffer(data, "<u2", side["count"], start + 64)
        found["sides"].append(side)
        start += 64 + 2 * side["count"]
    assert start <= at + length and not any(data[start:at + length])
    return found
