"""Kongsberg's .all and .wcd files as lines of soundings, block after block.

The sounder says where a sounding lies from the transmit array's depth and the position's reference point (XYZ 88), and
when and under which angles it was heard (raw range and angle 78); the record has both, from the vessel's reference
point. Its depth under the surface is the transmit array's less the lever arm, levelled. The heave of the attitude's
stream is that of the reference point or, in files whose arrays do not rise with the pitch, that of the transmit array:
whichever gives the depths of the array that the soundings were made with; what is left is added to the stream, so that
both agree at every ping. Angles in the file are positive
to port, of an array whose cable leaves aft or not; travel times are from the sector's transmission.
"""
from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, BinaryIO

import numpy as np

from mitsonar.hydrography.record import BY_AMPLITUDE, BY_PHASE, NOT_DETECTED

from ..assembly import MOST_BEAMS, MOST_SECTORS, AssembledLine, LineColumn, Ping, cast_of
from ..motion import motion_of
from ..places import across_and_along, levelled
from .all_datagrams import (
    ATTITUDE,
    CAST_NODE,
    COLUMN_BEAM,
    COLUMN_SECTOR,
    RANGE_BEAM,
    RANGE_SECTOR,
    XYZ_BEAM,
    AllDatagram,
    at,
    datagrams,
    seconds,
)
from .kongsberg_file import KongsbergFile
from .kongsberg_install import KongsbergInstallation, of_all, part_of

_BACKSCATTER = ("as the sounder gives it: its source level, beam patterns, spreading and absorption taken out, "
                "flattened near normal incidence and by Lambert's law where its operator asked for it")
_OLD = "DfF"                       # depths and ranges of sounders before 2007
_VELOCITY = np.dtype([("time", "<u2"), ("roll", "<i2"), ("pitch", "<i2"), ("heave", "<i2"), ("heading", "<u2"),
                      ("input", "u1")])


@dataclass(kw_only=True, eq=False)
class _AllRecords:
    """What the first walk through a file has found."""

    text: str = ""
    cast: np.ndarray | None = None
    cast_time: float = 0.0
    model: int = 0
    first: float = 0.0
    soundings: dict = field(default_factory=dict)       # key -> letter -> where it is
    column: dict = field(default_factory=dict)          # key -> places of its datagrams
    positions: list = field(default_factory=list)
    attitude: list = field(default_factory=list)
    velocity: list = field(default_factory=list)
    depths: dict = field(default_factory=dict)          # of the transmit array, by key
    passed: set[str] = field(default_factory=set)
    beams: int = 0
    sectors: int = 0
    column_beams: int = 0
    column_samples: int = 0
    old: bool = False


class AllFile(KongsbergFile):
    """Read an .all file, with the .wcd file beside it for the water column."""

    def __init__(self, path: str, column_path: str | None, *, water_column: bool) -> None:
        super().__init__(path, column_path, water_column=water_column)
        found = self._found = self._walked()
        if not found.soundings:
            raise ValueError("it has depths of an older kind (before 2007), which are not read." if found.old else
                             "it has no soundings (raw ranges and XYZ of one ping).")
        self._installation = of_all(found.text, found.model)
        self._serials = self._heads()
        self._keys = sorted(found.soundings, key=lambda key: (*key[2:], key[1], self._serials.index(key[0])))
        self._start = seconds(*self._keys[0][2:])
        self._motion = self._moved()

    @property
    def line(self) -> AssembledLine:
        """What the pings share."""
        found, installed, motion = self._found, self._installation, self._motion
        cast = cast_of(found.cast)
        return AssembledLine(sonar=f"EM {found.model}", title=os.path.basename(self._paths[0]), start=self._start,
                    crs=motion.zone.crs, origin=motion.zone.origin, cast_depth=cast[0], cast_sound_speed=cast[1],
                    transmit_offset=installed.transmit_offset, transmit_mounting=installed.transmit_mounting,
                    receive_offset=installed.receive_offset[:len(self._serials)],
                    receive_mounting=installed.receive_mounting[:len(self._serials)], motion=motion.streams,
                    backscatter=_BACKSCATTER, profile="the cast of the file", beams=found.beams, sectors=found.sectors,
                    column_beams=found.column_beams, column_samples=found.column_samples,
                    left_out=self._left_out(found.passed, ("k",)))

    def _walked(self):
        """Go through both files once."""
        found = _AllRecords()
        for number, path in enumerate(self._paths):
            with open(path, "rb") as stream:
                kinds = ("INXOUPAn" + _OLD if number == 0 else "") + ("k" if self._water_column else "")
                for one in datagrams(stream, kinds, found.passed if number == 0 else None):
                    _note(found, one, number)
        found.soundings = {key: places for key, places in found.soundings.items() if {"N", "X"} <= set(places)}
        return found

    def _heads(self):
        """Return serial numbers of the receiving heads, in the order of their lever arms."""
        there = {key[0] for key in self._found.soundings}
        if len(there) > len(self._installation.receive_offset):
            raise ValueError(f"it has pings of {len(there)} heads, and lever arms of "
                             f"{len(self._installation.receive_offset)}; it is damaged.")
        text = self._found.text
        named = [int(one) for name in ("R1S", "R2S") for one in _words(text, name) if one.isdigit()]
        return [one for one in named if one in there] + sorted(there - set(named), reverse=True)

    def _moved(self):
        found = self._found
        attitude = np.concatenate(found.attitude or found.velocity or [np.zeros((0, 5))])
        attitude = attitude[np.argsort(attitude[:, 0], kind="stable")]
        places = np.array(sorted(found.positions)).reshape(-1, 3)
        # The datagrams' attitude is the vessel's: what the sensor's mounting does is taken out of it already.
        motion = motion_of(attitude, places, self._start,
                           antenna=self._installation.antenna, waterline=self._installation.waterline)
        sent = np.array([seconds(*key[2:]) - self._start for key in self._keys])
        depth = np.array([found.depths[key] for key in self._keys])
        return motion.sunk(sent, depth, self._installation.transmit_offset)

    @np.errstate(invalid="ignore", over="ignore")      # of numbers that are none; `dataset` sorts them out
    def _ping(self, streams: Sequence[BinaryIO], key: tuple[int, int, int, int]) -> Ping:
        found, installed = self._found, self._installation
        raw, xyz = (_read(streams, found.soundings[key][letter]) for letter in "NX")
        head = self._serials.index(key[0])
        count = int(raw.head["beams"])
        if count != int(xyz.head["beams"]):
            raise ValueError(f"its ping {key[1]} has {count} ranges and {int(xyz.head['beams'])} depths; it is "
                             "damaged.")
        sectors = raw.table(RANGE_SECTOR, int(raw.head["sectors"]))
        beams = raw.table(RANGE_BEAM, count, raw.after(sectors))
        points = xyz.table(XYZ_BEAM, count)
        place = self._motion.at(raw.time - self._start)
        arm = levelled(installed.transmit_offset, place["roll"], place["pitch"])
        antenna = levelled(installed.antenna, place["roll"], place["pitch"])
        transmit_depth = float(xyz.head["depth"])
        place["depth"] = transmit_depth - arm[2]
        order = np.zeros(256, int)
        order[sectors["number"]] = np.arange(sectors.size)
        sector = np.minimum(order[beams["sector"]], max(sectors.size - 1, 0))
        tilt = np.deg2rad(sectors["tilt"] / 100.0) * (-1.0 if installed.backwards else 1.0)
        across, along = points["y"] + antenna[1], points["x"] + antenna[0]
        x, y = across_and_along(place["x"], place["y"], place["heading"], across, along)
        bad = (points["detection"] & 0x80 != 0) | (points["cleaning"] < 0) | ~(beams["travel_time"] > 0)
        method = points["detection"] & 0x0F
        quality = _read(streams, found.soundings[key]["O"]) if "O" in found.soundings[key] else None
        absorption = sectors["absorption"] * 1e-5
        shot = {} if not installed.transmit_parts.any() else {
            "offset": part_of(installed, np.minimum(sectors["number"], 2))}
        return Ping(
            place=place, head_sound_speed=0.1 * float(raw.head["speed"]), head=head,
            sectors=shot | {"frequency": sectors["frequency"], "delay": sectors["delay"], "angle": tilt,
                     "pulse_length": sectors["length"], "bandwidth": sectors["bandwidth"],
                     "absorption_db": absorption, "source_level_db": np.full(sectors.size, np.nan)},
            soundings={"valid": ~bad & np.isfinite(points["z"]), "travel_time": beams["travel_time"],
                       "angle": np.deg2rad(beams["angle"] / 100.0) * _to_starboard(installed, head),
                       "transmit_angle": tilt[sector] if tilt.size else np.full(count, np.nan), "sector": sector,
                       "depth": points["z"] + transmit_depth, "x": x, "y": y, "across_track": across,
                       "along_track": along, "backscatter_db": 0.1 * points["backscatter"],
                       "detection": np.where(bad, NOT_DETECTED, np.where(method == 0, BY_AMPLITUDE, np.where(
                           method == 1, BY_PHASE, NOT_DETECTED))),
                       "quality": _quality(quality, beams["quality"])},
            column=self._column(streams, key, place, head, absorption) if self._water_column else None)

    def _column(self, streams, key, place, head, absorption):
        """Put the parts of a ping's water column together."""
        parts = [_read(streams, where) for where in self._found.column.get(key, [])]
        if not parts:
            return None
        rows = [_column_beams(part) for part in parts]
        beams: Any = np.concatenate([table for table, _ in rows])
        one = parts[0].head
        rate, speed = 0.01 * float(one["rate"]), 0.1 * float(one["speed"])
        if not (rate > 0 and speed > 0):
            raise ValueError(f"its water column of ping {key[1]} has {rate:g} samples a second; it is damaged.")
        sectors = parts[0].table(COLUMN_SECTOR, int(one["sectors"]))
        order = np.zeros(256, int)
        order[sectors["number"]] = np.arange(sectors.size)
        sector = order[beams["sector"]]
        count = beams["samples"].astype(int)
        within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        reach = (np.repeat(beams["start"], count) + within + 0.5) * speed / (2 * rate)
        lost = np.repeat(absorption[np.minimum(sector, absorption.size - 1)], count) if absorption.size else 0.0
        level = 0.5 * np.concatenate([levels for _, levels in rows]) - int(one["tvg_offset"]) \
            - int(one["tvg_function"]) * np.log10(reach) - 2 * lost * reach
        vertical = -np.deg2rad(beams["angle"] / 100.0)
        return LineColumn(angle=vertical + place["roll"] + self._installation.receive_mounting[head][0],
                      start=beams["start"] / rate, rate=np.full(beams.size, rate), sector=sector, count=count,
                      level_db=level)


def _note(found: _AllRecords, one: AllDatagram, number: int) -> None:
    """Keep what a datagram says, or where it is."""
    where = (number, one.offset, len(one.raw) - 4, one.order)
    kind = one.kind
    if kind in "NXO":
        found.soundings.setdefault(one.key, {})[kind] = where
        beams, sectors = int(one.head["beams"]), int(one.head["sectors"]) if kind == "N" else 0
        if beams > MOST_BEAMS or sectors > MOST_SECTORS:
            raise ValueError(f"its ping {one.key[1]} says that it has {beams} beams and {sectors} sectors; at most "
                             f"{MOST_BEAMS} and {MOST_SECTORS} are believed.")
        found.beams, found.sectors = max(found.beams, beams), max(found.sectors, sectors)
        if kind == "X":
            found.depths[one.key] = float(one.head["depth"])
    elif kind == "k":
        found.column.setdefault(one.key, []).append(where)
        table: Any = _column_beams(one)[0]
        if int(one.head["all_beams"]) > MOST_BEAMS:
            raise ValueError(f"its water column of ping {one.key[1]} says that it has {int(one.head['all_beams'])} "
                             f"beams; at most {MOST_BEAMS} are believed.")
        found.column_beams = max(found.column_beams, int(one.head["all_beams"]), table.size)
        found.column_samples = max(found.column_samples, int(table["samples"].max(initial=0)))
    elif kind == "I" and not found.text:
        found.text = one.raw[18:].decode("ascii", "replace")
        found.model = int(one.frame["model"])
    elif kind == "U" and found.cast is None:
        table = one.table(CAST_NODE, int(one.head["entries"]))
        found.cast = np.column_stack([table["depth"] * (0.01 * float(one.head["resolution"])), 0.1 * table["speed"]])
    elif kind == "P" and int(one.head["system"]) & 0x80:
        found.positions.append((one.time, 1e-7 * int(one.head["longitude"]), int(one.head["latitude"]) / 2e7))
    elif kind == "A":
        table = one.table(ATTITUDE, int(one.head["entries"]))
        found.attitude.append(_attitude(one.time, table))
    elif kind == "n":
        found.velocity.append(_attitude(one.time, _velocity_table(one)))
    elif kind in _OLD:
        found.old = True


def _attitude(time, table):
    """Return time, roll, pitch, heading and heave of a datagram's samples."""
    angles = [np.deg2rad(table[name] / 100.0) for name in ("roll", "pitch", "heading")]
    return np.column_stack([time + 1e-3 * table["time"], *angles, 0.01 * table["heave"]])


def _velocity_table(one):
    """Pick the samples of a network attitude datagram: each has the sensor's own text behind it."""
    rows, offset, end = [], one.after(), len(one.raw) - 3
    for _ in range(int(one.head["entries"])):
        if offset + 11 > end:
            raise ValueError(f"its attitude datagram at byte {one.offset} is too short for its entries; it is damaged.")
        rows.append(np.frombuffer(one.raw, _VELOCITY.newbyteorder(one.order), 1, offset)[0])
        offset += 11 + int(rows[-1]["input"])
    return np.array(rows, _VELOCITY) if rows else np.zeros(0, _VELOCITY)


def _column_beams(one: AllDatagram) -> tuple[np.ndarray, np.ndarray]:
    """Return the beams of a water column's datagram (a structured array) and their samples, one after the other."""
    offset = one.after(one.table(COLUMN_SECTOR, int(one.head["sectors"])))
    layout, end = COLUMN_BEAM.newbyteorder(one.order), len(one.raw) - 3
    rows, samples = [], []
    for _ in range(int(one.head["beams"])):
        row = one.table(COLUMN_BEAM, 1, offset)
        offset += layout.itemsize
        count = int(row["samples"][0])
        if offset + count > end:
            raise ValueError(f"its water column at byte {one.offset} is too short for its beams; it is damaged.")
        rows.append(row)
        samples.append(np.frombuffer(one.raw, np.int8, count, offset))
        offset += count
    if not rows:
        return np.zeros(0, layout), np.zeros(0, np.int8)
    return np.concatenate(rows), np.concatenate(samples)


def _read(streams, where):
    number, offset, length, order = where
    return at(streams[number], offset, length, order)


def _words(text, name):
    """Return the value of a parameter, none or one."""
    return [part.partition("=")[2] for part in text.split(",") if part.strip().startswith(f"{name}=")][:1]


def _to_starboard(installed: KongsbergInstallation, head: int) -> float:
    """Return the sign that makes an angle positive to starboard."""
    return 1.0 if installed.receive_backwards[head] else -1.0


def _quality(ifremer, deviation):
    """Return the quality factor: the sounder's own, else from its deviation (range's spread over range, of 250)."""
    if ifremer is not None and int(ifremer.head["beams"]) == deviation.size and int(ifremer.head["parameters"]) == 1:
        return ifremer.table(np.dtype("<f4"), deviation.size).astype(float)
    return -np.log10(np.maximum(deviation, 0.5) / 250.0)
