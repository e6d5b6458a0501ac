"""Read s7k files as lines of soundings.

The sonar gives a travel time and a receive angle for every sounding (raw detections 7027; in older files bathymetry
7006 at the angles of the beam geometry 7004), positive to starboard, and one transmit angle a ping, positive forward.
Settings 7000 of the same ping hold the sound speed that steered the beams. Places are made by our own reduction.

Lever arms are those of the installation parameters 7030. Without that record, or where it holds only zeros, the arrays
stand where the settings 7503 put them: the reference point is the receive array's athwartships and in depth, and the
transmit array's along the ship. Positions are those of the reference point (1015), or else of the antenna (1003).
Where beams of 7006 are stabilised against roll, their angles are from the vertical; the roll then brings them back to
the array.
"""
from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, BinaryIO

import numpy as np

from ..assembly import AssembledLine, LineCast, Ping, cast_of, check_counts, uniform_cast
from ..detections import checked_speed, sector
from ..motion import motion_of
from .s7k_detections import bathymetry, columns, raw_detections
from .s7k_records import ATTITUDE, CAST_NODE, CTD_NODE, HEADS, S7kRecord, at, records

SILENT = {7200, 7300}              # the file's own header and catalogue
STABILISED = 1                     # receive flag of 7000
FARTHEST_ARM = 1e3                 # [m]
MODELS = {20: "T20-P", 22: "T20-R", 30: "F30", 50: "T50-P", 52: "T50-R", 103: "multibeam", 1000: "MB1", 1002: "MB2",
          7005: "BlueView"}
NORBIT = range(13000, 13100)       # device numbers


@dataclass(kw_only=True, eq=False)
class S7kContents:
    """Contents of a file, and the places of its pings, after the first pass through it."""

    pings: dict = field(default_factory=dict)           # key -> kind -> place
    geometry: dict = field(default_factory=dict)        # source -> place of the last 7004
    arms: dict = field(default_factory=dict)            # source -> 7030
    tilts: dict = field(default_factory=dict)           # source -> 7503
    casts: list[LineCast] = field(default_factory=list)
    positions: dict = field(default_factory=dict)       # kind -> [(time, longitude, latitude)]
    attitude: dict = field(default_factory=dict)        # kind -> arrays
    passed: set[int] = field(default_factory=set)
    grids: int = 0                                      # positions in grid coordinates
    beams: int = 0


class S7kFile:
    """Read an s7k file."""

    def __init__(self, path: str, column_path: str | None = None, *, water_column: bool = False) -> None:
        self._path = path
        self._found = found = S7kContents()
        with open(path, "rb") as stream:
            for record in records(stream, HEADS, found.passed):
                _note(found, record)
        self._kind = 7027 if any(7027 in places for places in found.pings.values()) else 7006
        needed = {self._kind, 7000} | ({7004} if self._kind == 7006 else set())
        pings = {key: places for key, places in found.pings.items() if needed <= set(places)}
        if not pings:
            raise ValueError("it has no soundings (detections 7027, or 7006 and 7004, with the settings 7000 of the "
                             "same ping).")
        self._pings = pings
        self._left = len([1 for places in found.pings.values() if self._kind in places]) - len(pings)
        self._keys = sorted(pings, key=lambda key: (pings[key]["time"], key))
        self._sources = sorted({key[:2] for key in self._keys})
        self._start = pings[self._keys[0]]["time"]
        first = self._installation(self._sources[0])
        antenna, mounting, waterline = np.zeros(3), np.zeros(3), 0.0
        if first is not None:
            antenna, mounting, waterline = _arm(first["position"]), _turn(first["motion"]), -float(first["waterline"])
        kind = 1015 if 1015 in found.positions else 1003
        self._motion = motion_of(
            _attitude(found), np.array(sorted(found.positions.get(kind, []))).reshape(-1, 3), self._start,
            antenna=np.zeros(3) if kind == 1015 else antenna, mounting=mounting, waterline=waterline)
        self._arrays = [self._installed(source) for source in self._sources]

    def __len__(self) -> int:
        return len(self._keys)

    @property
    def casts(self) -> Sequence[LineCast]:
        """Return the casts of the file, in its order."""
        return self._found.casts

    @property
    def line(self) -> AssembledLine:
        """Content that the pings share."""
        found, motion, arrays = self._found, self._motion, self._arrays
        depth, speed = cast_of(found.casts[0].nodes) if found.casts else uniform_cast(self._first_speed())
        kinds = ", ".join(str(kind) for kind in sorted(found.passed - SILENT))
        turned = any(not np.array_equal(one[1], arrays[0][1]) for one in arrays)
        tilted = any(np.any(head["tilt"][1:]) for head in found.tilts.values())
        left_out = (
            f"{self._left} pings without settings are left out" if self._left else "",
            f"{found.grids} positions in grid coordinates are left out" if found.grids else "",
            "transmit arrays of other heads have the mounting of the first" if turned else "",
            "tilts of heads along the ship are not applied" if tilted else "",
            f"records of the kinds {kinds} are not read" if kinds else "")
        return AssembledLine(
            sonar=sonar_of(self._sources[0][0]), title=os.path.basename(self._path), start=self._start,
            crs=motion.frame.crs, origin=motion.frame.origin, cast_depth=depth, cast_sound_speed=speed,
            transmit_offset=arrays[0][0], transmit_mounting=arrays[0][1],
            receive_offset=np.stack([one[2] for one in arrays]), receive_mounting=np.stack([one[3] for one in arrays]),
            motion=motion.streams, backscatter="intensity of the sonar's detections, 20 log10, not calibrated",
            profile="the cast of the file" if found.casts else "the head's sound speed at all depths",
            beams=found.beams, sectors=1, left_out=", and ".join(filter(None, left_out)), placed=False)

    def pings(self, start: int, stop: int) -> Iterator[Ping]:
        """Read pings, in the order of time."""
        with open(self._path, "rb") as stream:
            for key in self._keys[start:stop]:
                yield self._ping(stream, key)

    def _first_speed(self):
        with open(self._path, "rb") as stream:
            return _speed(at(stream, *self._pings[self._keys[0]][7000]))

    def _installation(self, source):
        """Return the installation of a sonar, else of another device with its enumerator, else of any; or None."""
        arms = self._found.arms
        alike = [one for one in arms if one[1] == source[1]] or list(arms)
        return arms.get(source, arms[alike[0]] if alike else None)

    def _installed(self, source):
        """Return lever arm and mounting of the transmit array, then those of the receive array."""
        head = self._installation(source)
        if head is not None and any(np.any(list(head[name].item())) for name in ("transmit", "receive")):
            return _arm(head["transmit"]), _turn(head["transmit"]), _arm(head["receive"]), _turn(head["receive"])
        head = self._found.tilts.get(source)
        if head is None:
            return (np.zeros(3),) * 4
        apart = _arm(head["transmit"])
        turn = _checked(np.array([-float(head["tilt"][0]), 0.0, 0.0]), "tilts")      # positive turns beams to starboard
        return apart * (0, 1, 1), turn, apart * (-1, 0, 0), turn

    @np.errstate(all="ignore")      # `dataset` removes NaN and infinity
    def _ping(self, stream: BinaryIO, key: tuple[int, ...]) -> Ping:
        places = self._pings[key]
        record, settings = at(stream, *places[self._kind]), at(stream, *places[7000])
        place = self._motion.at(places["time"] - self._start)
        about, number = settings.head, self._sources.index(key[:2])
        arrays = self._arrays[number]
        if self._kind == 7027:
            detected = raw_detections(record)
        else:
            shape = at(stream, *places[7004])
            angle = columns(shape, int(shape.head["beams"]), "<f4", "<f4")[1]
            if int(about["receive_flags"]) & STABILISED:
                angle = angle + place["roll"] + arrays[3][0]
            detected = bathymetry(record, angle, float(about["steering"]))
        shot = {} if len(self._arrays) == 1 else {"offset": (arrays[0] - self._arrays[0][0])[None]}
        return Ping(place=place, head_sound_speed=_speed(settings), head=number, soundings=detected.soundings(),
                    sectors=shot | sector_of(about, detected.steering))


def _note(found: S7kContents, record: S7kRecord) -> None:
    """Keep the contents of a record, or its place."""
    kind, head, where = record.kind, record.head, (record.offset, len(record.raw))
    if kind in (7000, 7006, 7027):
        key = (*record.source, int(head["number"]), int(head["sequence"]))
        ping: dict[Any, Any] = found.pings.setdefault(key, {})
        if kind != 7000:
            check_counts(f"its ping {key[2]}", int(head["beams"]))
            found.beams = max(found.beams, int(head["beams"]))
            ping["time"] = record.time
        if kind == 7006 and record.source in found.geometry:
            ping[7004] = found.geometry[record.source]
        ping.setdefault(kind, where)
    elif kind == 7004:
        check_counts("its beam geometry", int(head["beams"]))
        found.geometry[record.source] = where
    elif kind in (7030, 7503):
        (found.arms if kind == 7030 else found.tilts).setdefault(record.source, head)
    elif kind in (1003, 1015):
        if kind == 1003 and head["grid"]:
            found.grids += 1
        else:
            found.positions.setdefault(kind, []).append((record.time, *np.rad2deg([head["longitude"],
                                                                                   head["latitude"]])))
    elif kind in (1009, 1010):
        table = record.table(CAST_NODE if kind == 1009 else CTD_NODE, int(head["entries"]))
        if kind == 1009 or (head["depth"] and int(head["known"]) & 12 == 12):
            place = np.rad2deg([head["latitude"], head["longitude"]]) if head["placed"] else (0.0, 0.0)
            found.casts.append(LineCast.at(record.time, float(place[0]), float(place[1]),
                                           np.column_stack([table["depth"], table["speed"]]).astype(float)))
    if kind == 1012:
        row = [[record.time, head["roll"], head["pitch"], head["heave"]]]
        found.attitude.setdefault(kind, []).append(np.array(row, float))
    elif kind in (1013, 1015):
        found.attitude.setdefault(kind, []).append(np.array([[record.time, head["heading"]]], float))
    elif kind == 1016:
        table = record.table(ATTITUDE, int(head["entries"]))
        found.attitude.setdefault(kind, []).append(np.column_stack(
            [record.time + 1e-3 * table["time"], *(table[name] for name in ("roll", "pitch", "heave", "heading"))]))


def _attitude(found: S7kContents) -> np.ndarray:
    """Return the attitude (M, 5): of 1016, or else of 1012 with the headings of 1013 or 1015."""
    streams = {kind: _sorted(np.concatenate(rows)) for kind, rows in found.attitude.items()}
    if 1016 in streams:
        time, roll, pitch, heave, heading = streams[1016].T
    elif 1012 in streams:
        time, roll, pitch, heave = streams[1012].T
        heading = np.zeros(time.size)
        for kind in (1013, 1015):
            if kind in streams:
                heading = np.interp(time, streams[kind][:, 0], np.unwrap(streams[kind][:, 1]))
                break
    else:
        kind = next((kind for kind in (1013, 1015) if kind in streams), None)
        time, heading = streams[kind].T if kind else np.zeros((2, 0))
        roll = pitch = heave = np.zeros(time.size)
    return np.column_stack([time, roll, pitch, heading, -heave])


def _sorted(rows):
    rows = rows[np.isfinite(rows).all(1)]
    return rows[np.argsort(rows[:, 0], kind="stable")]


def sector_of(about: Any, steering: float) -> dict[str, np.ndarray]:
    """Return the sector of a ping from the head of its settings 7000 or 7503."""
    return sector(steering, frequency=about["frequency"], pulse_length=about["pulse_length"],
                  bandwidth=about["bandwidth"], source_level_db=about["power"],
                  absorption_db=1e-3 * float(about["absorption"]))


def sonar_of(device: int) -> str:
    """Return the name of a sonar by its device number."""
    return "Norbit" if device in NORBIT else MODELS.get(device, f"SeaBat {device}")


def _speed(settings: S7kRecord) -> float:
    return checked_speed(float(settings.head["sound_speed"]), int(settings.head["number"]))


def _arm(fields) -> np.ndarray:
    """Return a lever arm (starboard, forward, up) as forward, starboard, down."""
    return _checked(np.array([fields["y"], fields["x"], -fields["z"]], float), "lever arms")


def _turn(fields) -> np.ndarray:
    return _checked(np.array([fields[name] for name in ("roll", "pitch", "heading")], float), "mountings")


def _checked(values, name):
    if not (np.abs(values) < FARTHEST_ARM).all():
        raise ValueError(f"its {name} are {', '.join(f'{value:g}' for value in values)}; it is damaged.")
    return values
