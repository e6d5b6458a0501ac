"""Write a line of soundings as s7k: records of a file header, installation, cast, motion, settings and detections.

Records are in the order of time. A ping of several sectors is written as the pings of a multi-ping sequence, each at
its own transmission, since detections 7027 have one transmit angle a ping. Attitude (1016) and navigation (1015) have
one record a sample of the motion. In the units of the format:

    heave = draught - depth of the reference point, upwards       waterline = draught, above the reference point
    sample = travel_time · rate          uncertainty = 10^(-quality)          intensity = 10^(strength / 20)
"""
from __future__ import annotations

import re
import struct
from collections.abc import Callable, Iterator
from datetime import datetime, timezone
from functools import partial

import numpy as np

from mitsonar.device.files import FilePath, replacing
from mitsonar.hydrography.record import BY_PHASE
from mitsonar.version import __version__

from ..lines import HEADS as SEVERAL_HEADS, SOUNDINGS, Blocks, LineToWrite, Ping, Place, Written, line_of, pings
from ..passage import LinePassage, passage_of
from .read_s7k import MODELS
from .s7k_records import ATTITUDE, CAST_NODE, DETECTION, FRAME, HEADS, SUMMED

VERSION, OFFSET, GENERIC = 5, 60, 103              # of the format; to a record's header; device of no known model
RATE = 50_000.0                                    # [Hz] of the sample numbers of detections
ELLIPSOID, DATUM = 1, 3                            # vertical references of navigation
AMPLITUDE, PHASE, JUDGED, PASSED = 1, 2, 1 << 2, 3
ALIKE = 1e-6                                       # [rad] of transmit angles
HELD = (SOUNDINGS - {"snippet_rate", "snippet_start", "snippet_db", "uncertainty", "horizontal_uncertainty",
                     "written_backscatter_db", "written_snippet_db"}) | SEVERAL_HEADS


def write(blocks: Blocks, path: FilePath, *, place: Place | None = None, start: str | None = None) -> Written:
    """Write a line of soundings as s7k; arguments, result and errors are those of `mitsonar.io.survey_lines.write`."""
    line, remaining = line_of(blocks, place=place, start=start)
    passage, device = passage_of(line), device_of(line.sonar)
    waiting = _sensors(passage, device)
    due = next(waiting, None)
    number = valid = empty = most = 0
    apart = 0.0
    with replacing(path) as temporary, open(temporary, "wb") as stream:
        stream.write(b"".join(_opening(line, passage, device)))
        for ping in (ping for block in remaining for ping in pings(line, block)):
            passage.note(ping)
            while due is not None and due[0] <= ping["since"]:
                stream.write(due[1]())
                due = next(waiting, None)
            if not ping["valid"].size:
                empty += 1
                continue
            if ping["since"] < 0:
                raise ValueError(f"ping {number} does not go into s7k: it is before 1970; give another start.")
            shots = np.unique(ping["sector"])
            for shot in shots:
                records, spread = _soundings(ping, number, int(shot), shots.size > 1, device)
                stream.write(records)
                apart = max(apart, spread)
            number, valid, most = number + 1, valid + int(ping["valid"].sum()), max(most, shots.size)
        while due is not None:
            stream.write(due[1]())
            due = next(waiting, None)
    return Written(pings=number, soundings=valid, words=line.remarks(
        "s7k", HELD, empty, f"pings of {most} sectors are written as {most} pings" if most > 1 else "",
        f"s7k has one transmit angle a ping; those of soundings differ from it by up to {np.degrees(apart):.2g} degrees"
        if apart > ALIKE else "", "" if device != GENERIC else "the file names a generic sonar"))


def device_of(sonar: str) -> int:
    """Return the device number of a sonar by its name, or that of a generic one."""
    named = {name: device for device, name in MODELS.items()} | {
        f"SeaBat {found[1]}": int(found[1]) for found in [re.fullmatch(r"SeaBat (\d{4})", sonar)] if found}
    return named.get(sonar, GENERIC)


def _opening(line: LineToWrite, passage: LinePassage, device: int) -> Iterator[bytes]:
    """Yield the file header, the installation of every head, and the cast."""
    first = passage.time[0]
    texts = ((str(line.first.attrs.get("title") or "line"), 64), (f"mitsonar {__version__}", 16), ("", 64),
             (line.provenance(), 128))
    heads = range(len(line.receivers[0]))
    yield _record(7200, first, bytes(16) + struct.pack("<I16x2I", 1, 6 * len(heads), len(heads)) + b"".join(
        text.encode("ascii", "replace")[:size - 1].ljust(size, b"\0") for text, size in texts) + b"".join(
            struct.pack("<IH", device, head) for head in heads), (device, 0))
    sent = _arm(line.array("transmit_offset"), line.array("transmit_mounting"))
    frequency = float(line.first["sector_frequency"][0].mean())
    for head, (offset, mounting) in enumerate(zip(*line.receivers)):
        yield _record(7030, first, _head(7030, frequency=frequency, transmit=sent, receive=_arm(offset, mounting),
                                         waterline=passage.draught), (device, head))
    nodes = np.zeros(line.first.sizes["node"], CAST_NODE)
    nodes["depth"], nodes["speed"] = line.array("cast_depth"), line.array("cast_sound_speed")
    latitude, longitude = np.radians([passage.latitude[0], passage.longitude[0]])
    yield _record(1009, first, _head(1009, placed=1, latitude=latitude, longitude=longitude, entries=nodes.size)
                  + nodes.tobytes(), (device, 0))


def _sensors(passage: LinePassage, device: int) -> Iterator[tuple[float, Callable[[], bytes]]]:
    """Yield times [s since 1970] of the motion, and what makes attitude and navigation then."""
    for index, since in enumerate(passage.time):
        yield float(since), partial(_moment, passage, device, index)


def _moment(passage: LinePassage, device: int, index: int) -> bytes:
    """Return attitude and navigation at a sample of the motion."""
    since, heading = float(passage.time[index]), passage.heading[index] % (2 * np.pi)
    sample, (north, east, _) = np.zeros(1, ATTITUDE), passage.velocity[index]
    for name, value in (("roll", passage.roll[index]), ("pitch", passage.pitch[index]), ("heading", heading),
                        ("heave", passage.heave(slice(index, index + 1))[0])):
        sample[name] = value
    height = float(passage.height(slice(index, index + 1))[0])
    over = {"vertical": ELLIPSOID, "height": height} if np.isfinite(height) else {
        "vertical": DATUM, "height": -passage.depth[index]}
    place = _head(1015, **over, latitude=np.radians(passage.latitude[index]), heading=heading,
                  longitude=np.radians(passage.longitude[index]), speed=np.hypot(north, east),
                  course=np.arctan2(east, north) % (2 * np.pi))
    return _record(1016, since, _head(1016, entries=1) + sample.tobytes(), (device, 0)) + _record(
        1015, since, place, (device, 0))


def _soundings(ping: Ping, number: int, shot: int, several: bool, device: int) -> tuple[bytes, float]:
    """Return the records of a sector, and the spread of its transmit angles [rad]."""
    some = np.flatnonzero(ping["sector"] == shot)
    valid, angles = ping["valid"][some], ping["transmit_angle"][some]
    steering = float(np.median(angles[valid] if valid.any() else angles))
    spread = float(np.abs(angles[valid] - steering).max(initial=0.0))
    about = {"number": 1 + number, "sequence": 1 + shot if several else 0}
    source, since = (device, int(ping.get("head", 0))), float(ping["since"] + ping["sector_delay"][shot])
    settings = _head(7000, **about, rate=RATE, steering=steering, sound_speed=ping["head_sound_speed"], pulse_mode=1,
                     frequency=ping["sector_frequency"][shot], bandwidth=ping["sector_bandwidth"][shot],
                     pulse_length=ping["sector_pulse_length"][shot], power=ping["sector_source_level_db"][shot],
                     absorption=1e3 * ping["sector_absorption_db"][shot])
    shape = np.zeros((4, some.size), "<f4")
    shape[1] = ping["angle"][some]
    table = np.zeros(some.size, DETECTION)
    table["beam"], table["angle"] = ping["beam"][some], ping["angle"][some]
    table["sample"] = np.where(valid, ping["travel_time"][some] * RATE, 0.0)
    table["quality"] = np.where(valid, PASSED, 0)
    phase = ping["detection"][some] == BY_PHASE if "detection" in ping else np.zeros(some.size, bool)
    table["flags"] = JUDGED | np.where(valid, np.where(phase, PHASE, AMPLITUDE), 0)
    for name, field, power in (("quality", "uncertainty", -1.0), ("backscatter_db", "intensity", 0.05)):
        values = np.asarray(ping.get(name, np.full(valid.size, np.nan)), float)
        values = values[some] if name in ping else values
        table[field] = np.where(valid & np.isfinite(values), 10.0 ** (power * np.nan_to_num(values)), 0.0)
    detections = _head(7027, **about, beams=some.size, field=table.itemsize, rate=RATE, steering=steering)
    return b"".join(_record(kind, since, body, source) for kind, body in (
        (7000, settings), (7004, _head(7004, beams=some.size) + shape.tobytes()),
        (7027, detections + table.tobytes()))), spread


def _head(kind, **values):
    """Return the first fields of a record; those that are not given are 0."""
    row = np.zeros(1, HEADS[kind])
    for name, value in values.items():
        row[name] = value
    return row.tobytes()


def _arm(offset, mounting):
    """Return a lever arm (forward, starboard, down) and a mounting in the order of the format."""
    return (offset[1], offset[0], -offset[2], *mounting)


def _record(kind: int, since: float, body: bytes, source: tuple[int, int]) -> bytes:
    """Return a record with its frame and checksum."""
    date = datetime.fromtimestamp(int(since), timezone.utc)
    frame = np.zeros(1, FRAME)
    values = {"version": VERSION, "offset": OFFSET, "sync": 0xFFFF, "size": FRAME.itemsize + len(body) + 4,
              "year": date.year, "day": date.timetuple().tm_yday, "seconds": date.second + since % 1,
              "hours": date.hour, "minutes": date.minute, "record_version": 1, "kind": kind, "device": source[0],
              "enumerator": source[1], "flags": SUMMED}
    for name, value in values.items():
        frame[name] = value
    whole = frame.tobytes() + body
    return whole + int(np.frombuffer(whole, np.uint8).sum(dtype=np.uint32)).to_bytes(4, "little")
