"""Files of inertial systems, written byte by byte: SBET with its accuracy, and raw groups of a POS MV."""
import struct

import numpy as np

GPS_TIME, UTC_TIME = 1, 2


def write_sbet(path, time, latitude_deg, longitude_deg, height, roll=0.0, pitch=0.0, heading=0.0, wander=0.0):
    """Write an SBET; times are seconds of the week, angles of the attitude [rad], the heading from true north."""
    rows = np.zeros((len(time), 17))
    rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3] = time, np.radians(latitude_deg), np.radians(longitude_deg), height
    rows[:, 7], rows[:, 8], rows[:, 9], rows[:, 10] = roll, pitch, np.add(heading, wander), wander
    rows.astype("<f8").tofile(path)
    return path


def write_smrmsg(path, time, position=0.02, minutes=1.0):
    rows = np.full((len(time), 10), position)
    rows[:, 0], rows[:, 7:] = time, minutes
    rows.astype("<f8").tofile(path)
    return path


def group(number, body, time, clock=UTC_TIME, kind=b"$GRP"):
    """A group: header, times, body, padding to four bytes, a checksum that makes the sum of words 0, and the end."""
    content = struct.pack("<3d2B", time, 0.0, 0.0, clock, 1) + body
    content += b"\0" * (-len(content) % 4)
    whole = kind + struct.pack("<HH", number, len(content) + 4) + content
    check = -int(np.frombuffer(whole + b"\0\0$#", "<u2").sum()) % 65536
    return whole + struct.pack("<H", check) + b"$#"


def navigation_group(time, latitude_deg, longitude_deg, height, roll_deg, pitch_deg, heading_deg, number=1, heave=0.0,
                     **more):
    """Group 1, or 102 with its heave, positive down."""
    body = struct.pack("<3d3f4d", latitude_deg, longitude_deg, height, 1.0, 2.0, 0.0, roll_deg, pitch_deg, heading_deg,
                       0.0)
    rest = struct.pack("<8f2B", *range(8), 0, 0) if number == 1 else struct.pack("<7f", heave, *range(6))
    return group(number, body + rest, time, **more)


def week_group(time, week, leaps, channels=2, **more):
    body = struct.pack("<2BH", 8, channels, 20 * channels) + bytes(20 * channels)
    return group(3, body + struct.pack("<3fHId2fHI", 1, 1, 0, 0, week, leaps, 0, 40.0, 1, 0), time, **more)


def heave_group(time, delayed, at_once, valid=True, **more):
    """Group 111; both heaves are positive down."""
    return group(111, struct.pack("<2fI2f2d2I", delayed, 0.02, 3 if valid else 2, at_once, 0.05, time, 0.0, 0, 0), time,
                 **more)
