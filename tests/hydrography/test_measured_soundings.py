"""Soundings of a real EM 710 reduced from its angles and times, against the places its own processing gave them.

The file is read here byte by byte (Kongsberg EM series datagram formats, 850-160692: N, X, A, U and I), so that only
the reduction is tested. What is left is the file's rounding: heave and roll in steps of 1 cm and 0.01 degrees, which
shift and tilt a swath as a whole (0.01 degrees are 45 mm at 260 m), times of motion in ms. Within a ping the depths
differ by 1 to 3.5 mm rms, with the head's sound speed as the node; by 20 mm without.
"""
import re
import struct
from pathlib import Path

import numpy as np
import pytest

from mitsonar.hydrography.reduction.attitude import PlatformMotion
from mitsonar.hydrography.reduction.reduction import Installation, Measured, located
from mitsonar.water import SoundSpeedProfile

LINE = Path(__file__).resolve().parents[2] / "../shared/data/measured/multibeam/em710_122m.all"
PINGS = range(1, 7)                # the last pings end after the motion of the file
SECTOR = np.dtype([("tilt", "<i2"), ("focus", "<u2"), ("length", "<f4"), ("delay", "<f4"), ("rest", "V12")])
BEAM = np.dtype([("angle", "<i2"), ("sector", "u1"), ("info", "u1"), ("window", "<u2"), ("quality", "u1"), ("d", "i1"),
                 ("time", "<f4"), ("rest", "V4")])
PLACE = np.dtype([("z", "<f4"), ("y", "<f4"), ("x", "<f4"), ("rest", "V8")])
MOTION = np.dtype([("time", "<u2"), ("status", "<u2"), ("roll", "<i2"), ("pitch", "<i2"), ("heave", "<i2"),
                   ("heading", "<u2")])
pytestmark = pytest.mark.skipif(not LINE.is_file(), reason="the shared recording of an EM 710 is not here")


@pytest.fixture(scope="module")
def datagrams():
    """Bodies of the file's datagrams by type, each with its time [s]."""
    data, found, at = LINE.read_bytes(), {}, 0
    while at < len(data):
        size, _, kind, _, _, milliseconds, _, _ = struct.unpack_from("<IBcHIIHH", data, at)
        found.setdefault(kind, []).append((milliseconds / 1000, data[at + 20:at + 4 + size - 3]))
        at += 4 + size
    return found


def installed(datagrams):
    """Arrays and water line; the receive array stands the other way round, as mountings 2 say."""
    words = dict(re.findall(rb"(S\d[XYZRPH]|WLZ)=(-?[\d.]+)", datagrams[b"I"][0][1]))
    number = {name.decode(): float(value) for name, value in words.items()}
    place = [[number[f"S{i}{axis}"] for axis in "XYZ"] for i in (1, 2)]
    transmit, receive = ([number[f"S{i}{axis}"] for axis in "RPH"] for i in (1, 2))
    turned = [-receive[0], -receive[1], receive[2] - 180]
    return Installation(transmit_offset=place[0], receive_offset=place[1], transmit_mounting=np.radians(transmit),
                        receive_mounting=np.radians(turned)), number["WLZ"]


def moved(datagrams, water_line):
    """Motion of the reference point; heave is down, and the offsets of the sensor are in the angles already."""
    parts = []
    for start, body in datagrams[b"A"]:
        rows = np.frombuffer(body, MOTION, int.from_bytes(body[:2], "little"), 2)
        parts.append(np.stack([start + rows["time"] / 1000, *(rows[name] / 100 for name in (
            "roll", "pitch", "heave", "heading"))]))
    time, roll, pitch, heave, heading = np.concatenate(parts, axis=1)
    time, first = np.unique(time, return_index=True)
    return PlatformMotion(time=time, x=0 * time, y=0 * time, depth=heave[first] - water_line,
                          roll=np.radians(roll[first]),
                  pitch=np.radians(pitch[first]), heading=np.radians(heading[first]))


def cast(datagrams):
    body = datagrams[b"U"][0][1]
    count, centimetres = struct.unpack_from("<HH", body, 8)
    depth, speed = np.frombuffer(body, "<u4", 2 * count, 12).reshape(-1, 2).T
    return SoundSpeedProfile(depth * centimetres / 100, speed / 10)


def pinged(datagrams, ping):
    """What was measured, and places (B, 3) by the sounder: depth, across, along."""
    sent, body = datagrams[b"N"][ping]
    speed, sectors, beams = struct.unpack_from("<HHH", body)
    sector = np.frombuffer(body, SECTOR, sectors, 16)
    beam = np.frombuffer(body, BEAM, beams, 16 + sectors * SECTOR.itemsize)
    measured = Measured(ping_time=sent, transmit_time=sent + sector["delay"][beam["sector"]], travel_time=beam["time"],
                        angle=np.radians(beam["angle"] / 100),
                        transmit_angle=np.radians(sector["tilt"][beam["sector"]] / 100), head_sound_speed=speed / 10)
    body = datagrams[b"X"][ping][1]
    place = np.frombuffer(body, PLACE, beams, 20)
    return measured, np.stack([place["z"] + struct.unpack_from("<f", body, 4)[0], place["y"], place["x"]]).astype(float)


@pytest.mark.parametrize("node, least, most", [(True, 0.0, 0.004), (False, 0.015, 0.025)])
def test_soundings_lie_where_the_sounder_has_them(datagrams, node, least, most):
    arms, water_line = installed(datagrams)
    motion, water = moved(datagrams, water_line), cast(datagrams)
    for ping in PINGS:
        measured, wanted = pinged(datagrams, ping)
        found = located(measured, motion, arms, water, node=node)
        off = np.stack([found.depth, found.across_track, found.along_track]) - wanted
        assert np.abs(off.mean(1)).max() < 0.04                       # heave, and what roll and heading are rounded to
        tilt = np.polynomial.polynomial.polyfit(wanted[1], off.T, 1)
        assert np.abs(tilt[1, 0]) < np.radians(0.01)
        rest = off - np.polynomial.polynomial.polyval(wanted[1], tilt)
        assert least < rest[0].std() < most
        assert rest[1].std() < 0.01 and rest[2].std() < 0.008
