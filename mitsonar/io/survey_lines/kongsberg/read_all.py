"""Read Kongsberg .all and .wcd files as lines of soundings.

The sounder gives the position of a sounding relative to the depth of the transmit array and the reference point of the
positions (XYZ 88), and its travel time and angles (raw range and angle 78). The record holds both, positions from the
vessel's reference point, whose depth below the surface is that of the transmit array less its levelled lever arm. The
heave of the attitude stream belongs to the reference point or, in files whose arrays do not rise with the pitch, to the
transmit array. The reader chooses the one that reproduces the array depths of the soundings and adds the remainder to
the stream, so that both agree at every ping. Angles in the file are positive to port, of an array whose cable leaves
aft or forward; travel times are from the transmission of the sector.
"""
from __future__ import annotations

from collections.abc import Sequence
from typing import Any, BinaryIO

import numpy as np

from mitsonar.hydrography.record import BY_AMPLITUDE, BY_PHASE, NOT_DETECTED

from ..assembly import LineCast, LineColumn, Ping
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
from .kongsberg_file import KongsbergFile, KongsbergRecords
from .kongsberg_install import of_all, part_of

_OLD = "DfF"                       # depths and ranges of sounders before 2007
_VELOCITY = np.dtype([("time", "<u2"), ("roll", "<i2"), ("pitch", "<i2"), ("heave", "<i2"), ("heading", "<u2"),
                      ("input", "u1")])


class AllFile(KongsbergFile):
    """Read an .all file, with the .wcd file beside it for the water column."""

    BACKSCATTER = ("as the sounder gives it: its source level, beam patterns, spreading and absorption taken out, "
                   "flattened near normal incidence and by Lambert's law where its operator asked for it")
    COLUMN_KIND = "k"

    def __init__(self, path: str, column_path: str | None, *, water_column: bool) -> None:
        super().__init__(path, column_path, water_column=water_column)
        found = self._found
        found.soundings = {key: places for key, places in found.soundings.items() if {"N", "X"} <= set(places)}
        if not found.soundings:
            raise ValueError("it has depths of an older kind (before 2007), which are not read." if found.old else
                             "it has no soundings (raw ranges and XYZ of one ping).")
        self._installation = of_all(found.text, found.model)
        self._serials = self._serial_numbers()
        self._heads = len(self._serials)
        self._keys = sorted(found.soundings, key=lambda key: (*key[2:], key[1], self._serials.index(key[0])))
        self._start = seconds(*self._keys[0][2:])
        # The attitude in the datagrams is the vessel's: the mounting of the sensor has been corrected already.
        motion = motion_of(found.samples("A", "n"), np.array(sorted(found.positions)).reshape(-1, 3), self._start,
                           antenna=self._installation.antenna, waterline=self._installation.waterline)
        self._motion = motion.sunk(np.array([seconds(*key[2:]) - self._start for key in self._keys]),
                                   np.array([found.depths[key] for key in self._keys]),
                                   self._installation.transmit_offset)

    def _walk(self, stream: BinaryIO, number: int) -> None:
        kinds = ("INXOUPAn" + _OLD if number == 0 else "") + ("k" if self._water_column else "")
        for datagram in datagrams(stream, kinds, self._found.passed if number == 0 else None):
            _note(self._found, datagram, number)

    def _serial_numbers(self):
        """Return the serial numbers of the receiving heads, in the order of their lever arms."""
        present = {key[0] for key in self._found.soundings}
        if len(present) > len(self._installation.receive_offset):
            raise ValueError(f"it has pings of {len(present)} heads, and lever arms of "
                             f"{len(self._installation.receive_offset)}; it is damaged.")
        named = [int(text) for name in ("R1S", "R2S") for text in _parameter(self._found.text, name) if text.isdigit()]
        return [serial for serial in named if serial in present] + sorted(present - set(named), reverse=True)

    @np.errstate(invalid="ignore", over="ignore")      # `dataset` removes NaN and infinity
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
        # angles in the file are positive to port unless the cable of the receive array leaves forward
        to_starboard = 1.0 if installed.receive_backwards[head] else -1.0
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
                       "angle": np.deg2rad(beams["angle"] / 100.0) * to_starboard,
                       "transmit_angle": tilt[sector] if tilt.size else np.full(count, np.nan), "sector": sector,
                       "depth": points["z"] + transmit_depth, "x": x, "y": y, "across_track": across,
                       "along_track": along, "backscatter_db": 0.1 * points["backscatter"],
                       "detection": np.where(bad, NOT_DETECTED, np.where(method == 0, BY_AMPLITUDE, np.where(
                           method == 1, BY_PHASE, NOT_DETECTED))),
                       "quality": _quality(quality, beams["quality"])},
            column=self._column(streams, key, place, head, absorption) if self._water_column else None)

    def _column(self, streams, key, place, head, absorption) -> LineColumn | None:
        """Join the datagrams of a ping's water column."""
        parts = [_read(streams, where) for where in self._found.column.get(key, [])]
        if not parts:
            return None
        tables, samples = zip(*(_column_beams(part) for part in parts))
        beams: Any = np.concatenate(tables)
        common = parts[0].head
        sectors = parts[0].table(COLUMN_SECTOR, int(common["sectors"]))
        order = np.zeros(256, int)
        order[sectors["number"]] = np.arange(sectors.size)
        return self._column_of(
            key[1], place, head, absorption, rate=0.01 * float(common["rate"]), speed=0.1 * float(common["speed"]),
            angle=beams["angle"] / 100.0, start=beams["start"], count=beams["samples"].astype(int),
            sector=order[beams["sector"]], samples=np.concatenate(samples), offset=int(common["tvg_offset"]),
            spreading=int(common["tvg_function"]))


def _note(found: KongsbergRecords, datagram: AllDatagram, number: int) -> None:
    """Keep the contents of a datagram, or its place in file ``number``."""
    where = (number, datagram.offset, len(datagram.raw) - 4, datagram.order)
    kind = datagram.kind
    if kind in _OLD:
        found.old = True
    elif kind == "I" and not found.text:
        found.text = datagram.raw[18:].decode("ascii", "replace")
        found.model = int(datagram.frame["model"])
    elif kind in "NXO":
        found.soundings.setdefault(datagram.key, {})[kind] = where
        head = datagram.head
        found.note_ping(datagram.key[1], int(head["beams"]), int(head["sectors"]) if kind == "N" else 0)
        if kind == "X":
            found.depths[datagram.key] = float(head["depth"])
    elif kind == "k":
        found.column.setdefault(datagram.key, []).append(where)
        table: Any = _column_beams(datagram)[0]
        found.note_column(datagram.key[1], max(int(datagram.head["all_beams"]), table.size),
                          int(table["samples"].max(initial=0)))
    elif kind == "U":
        head = datagram.head
        table = datagram.table(CAST_NODE, int(head["entries"]))
        found.casts.append(LineCast(
            time=datagram.time, place=None,
            nodes=np.column_stack([table["depth"] * (0.01 * float(head["resolution"])), 0.1 * table["speed"]])))
    elif kind == "P" and int(datagram.head["system"]) & 0x80:
        head = datagram.head
        found.positions.append((datagram.time, 1e-7 * int(head["longitude"]), int(head["latitude"]) / 2e7))
    elif kind in "An":
        table = _velocity_table(datagram) if kind == "n" else datagram.table(ATTITUDE, int(datagram.head["entries"]))
        angles = [np.deg2rad(table[name] / 100.0) for name in ("roll", "pitch", "heading")]
        found.attitude.setdefault(kind, []).append(
            np.column_stack([datagram.time + 1e-3 * table["time"], *angles, 0.01 * table["heave"]]))


def _velocity_table(datagram: AllDatagram) -> np.ndarray:
    """Return the samples of a network attitude datagram, where each is followed by the sensor's own text."""
    rows, offset = [], datagram.after()
    for _ in range(int(datagram.head["entries"])):
        rows.append(datagram.table(_VELOCITY, 1, offset)[0])
        offset += _VELOCITY.itemsize + int(rows[-1]["input"])
    return np.array(rows, _VELOCITY) if rows else np.zeros(0, _VELOCITY)


def _column_beams(datagram: AllDatagram) -> tuple[np.ndarray, np.ndarray]:
    """Return the beams of a water column datagram (a structured array) and their samples, beam after beam."""
    offset = datagram.after(datagram.table(COLUMN_SECTOR, int(datagram.head["sectors"])))
    rows, samples = [np.zeros(0, COLUMN_BEAM.newbyteorder(datagram.order))], [np.zeros(0, np.int8)]
    for _ in range(int(datagram.head["beams"])):
        beam: np.ndarray = datagram.table(COLUMN_BEAM, 1, offset)
        rows.append(beam)
        samples.append(datagram.table(np.dtype(np.int8), int(beam["samples"][0]), offset + COLUMN_BEAM.itemsize))
        offset += COLUMN_BEAM.itemsize + samples[-1].size
    return np.concatenate(rows), np.concatenate(samples)


def _read(streams, where):
    number, offset, length, order = where
    return at(streams[number], offset, length, order)


def _parameter(text, name):
    """Return a list of the value of an installation parameter, empty if the parameter is missing."""
    return [part.partition("=")[2] for part in text.split(",") if part.strip().startswith(f"{name}=")][:1]


def _quality(ifremer, deviation):
    """Return the quality factor: the sounder's own, else from its deviation (spread of range over range, times 250)."""
    if ifremer is not None and int(ifremer.head["beams"]) == deviation.size and int(ifremer.head["parameters"]) == 1:
        return ifremer.table(np.dtype("<f4"), deviation.size).astype(float)
    return -np.log10(np.maximum(deviation, 0.5) / 250.0)
