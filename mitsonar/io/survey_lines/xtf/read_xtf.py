"""Read lines of multibeam sonars from XTF files (eXtended Triton Format, rev. 41).

    65, 68      datagrams BTH0 of R2Sonic, as QINSy and as Triton store them
    61          records 7027 or 7006 of Teledyne Reson, after the packet 199 with the settings 7503

All follow a ping header of 256 bytes. The sonars state angles and travel times; places are made by our own reduction.
An XTF file has no cast: the profile is the sound speed at the head, at all depths. Track and attitude are those of
`io.xtf.navigation`. Lever arms (starboard, forward, down) and mountings are those of the bathymetry channels in the
file's header, from the reference point; the height of this point above the water stands there too.
"""
from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any, BinaryIO, NamedTuple

import numpy as np

from ...xtf.navigation import navigation_of
from ...xtf.packets import file_header, walk
from ..assembly import AssembledLine, LineCast, Ping, check_counts, uniform_cast
from ..detections import DetectedPing, checked_speed, sector
from ..motion import motion_of
from ..s7k.read_s7k import sector_of, sonar_of
from ..s7k.s7k_detections import bathymetry, raw_detections
from ..s7k.s7k_records import FRAME, HEADS, SYNC, S7kRecord
from . import r2sonic

R2SONIC, RESON, CUSTOM = (65, 68), 61, 199             # kinds of packets
READ = (*R2SONIC, RESON)
OF_NAVIGATION = (3, 23, 42, 84, 107)
PING, RAW = 256, 64                # bytes of the headers of pings and of custom packets
LONGEST = 1 << 24                  # bytes of a packet
BATHYMETRY = 3                     # type of a channel
FARTHEST_ARM = 1e3                 # [m]


class XtfPlace(NamedTuple):
    """Place of a ping in the file."""

    time: float  # [s]: since 1970
    kind: int
    offset: int
    length: int
    settings: tuple[int, int] | None  # of the packet 199 before it: offset, length


class XtfFile:
    """Read the multibeam pings of an XTF file."""

    casts: tuple[LineCast, ...] = ()

    def __init__(self, path: str, column_path: str | None = None, *, water_column: bool = False) -> None:
        self._path, self._beams = path, 0
        self._passed: set[int] = set()
        heads: dict[Any, None] = {}
        places: list[tuple[XtfPlace, Any]] = []
        settings = None
        with open(path, "rb") as stream:
            self._header, head = file_header(stream)
            for kind, offset, length in walk(stream, len(head)):
                if kind == CUSTOM:
                    settings = (offset, length)
                elif kind in READ and (found := self._noted(stream, kind, offset, length, settings)):
                    places.append(found)
                    heads[found[1]] = None
                elif kind not in OF_NAVIGATION:
                    self._passed.add(kind)
        if not places:
            raise ValueError("it has no soundings of a multibeam sonar that is read from XTF (packets 61 of Reson, 65 "
                             "and 68 of R2Sonic).")
        self._heads = list(heads)
        self._places = sorted(places, key=lambda place: place[0].time)
        self._start = self._places[0][0].time
        track = navigation_of(path)
        if not track.geographic:
            raise ValueError("its positions are in metres of a projection that it does not name; export it with "
                             "latitudes and longitudes.")
        angles = [np.zeros(track.time.size) if values is None else values for values in (
            track.roll, track.pitch, track.heading, track.heave)]
        head = self._header
        self._motion = motion_of(
            np.column_stack([track.time, *angles[:3], -angles[3]]), np.column_stack([track.time, track.x, track.y]),
            self._start, waterline=_checked([head.ReferencePointHeight])[0],
            antenna=_checked([head.NavOffsetY, head.NavOffsetX, head.NavOffsetZ]),
            mounting=np.deg2rad(_checked([head.MRUOffsetRoll, head.MRUOffsetPitch, head.MRUOffsetYaw])))
        channels = [one for one in head.ChanInfo if one.TypeOfChannel == BATHYMETRY] or [head.ChanInfo[0]]
        self._arrays = [self._installed(channels[min(number, len(channels) - 1)]) for number in range(len(self._heads))]

    def __len__(self) -> int:
        return len(self._places)

    @property
    def line(self) -> AssembledLine:
        """Content that the pings share."""
        motion, arrays = self._motion, self._arrays
        with open(self._path, "rb") as stream:
            first = self._detected(stream, self._places[0][0], {"roll": 0.0})
        depth, speed = uniform_cast(first[1])
        kinds = ", ".join(map(str, sorted(self._passed)))
        return AssembledLine(
            sonar=first[3], title=os.path.basename(self._path), start=self._start, crs=motion.frame.crs,
            origin=motion.frame.origin, cast_depth=depth, cast_sound_speed=speed, transmit_offset=arrays[0][0],
            transmit_mounting=arrays[0][1], receive_offset=np.stack([one[0] for one in arrays]),
            receive_mounting=np.stack([one[1] for one in arrays]), motion=motion.streams,
            backscatter="intensity of the sonar's detections, 20 log10, not calibrated",
            profile="the head's sound speed at all depths", beams=self._beams, sectors=1, placed=False,
            left_out=f"packets of the kinds {kinds} are not read" if kinds else "")

    def pings(self, start: int, stop: int) -> Iterator[Ping]:
        """Read pings, in the order of time."""
        with open(self._path, "rb") as stream:
            for place, head in self._places[start:stop]:
                yield self._ping(stream, place, self._heads.index(head))

    def _noted(self, stream, kind, offset, length, settings):
        """Return the place of a ping and the name of its head, or None if the packet is no bathymetry."""
        if not PING < length <= LONGEST:
            return None
        raw = _bytes(stream, offset, min(length, PING + 256))
        inside = raw[PING:]
        if kind in R2SONIC:
            head = r2sonic.head_of(inside)
            if head is None:
                return None
            self._beams = max(self._beams, int(head["points"]))
            time = float(head["second"]) + 1e-9 * float(head["nanosecond"])
            return XtfPlace(time, kind, offset, length, None), (raw[3], bytes(head["serial"]))
        record = _record(inside, length - PING)
        if record is None or record.kind not in (7006, 7027):
            return None
        count = int(record.head["beams"])
        check_counts(f"its ping {int(record.head['number'])}", count)
        self._beams = max(self._beams, count)
        return XtfPlace(record.time, kind, offset, length, settings), record.source

    @np.errstate(all="ignore")      # `dataset` removes NaN and infinity
    def _ping(self, stream: BinaryIO, place: XtfPlace, head: int) -> Ping:
        pose = self._motion.at(place.time - self._start)
        detected, speed, shot, _ = self._detected(stream, place, pose)
        apart = self._arrays[head][0] - self._arrays[0][0]
        return Ping(place=pose, head_sound_speed=speed, head=head, soundings=detected.soundings(),
                    sectors=shot if len(self._arrays) == 1 else shot | {"offset": apart[None]})

    def _detected(self, stream, place: XtfPlace, pose) -> tuple[DetectedPing, float, dict, str]:
        """Return the detections of a ping, the sound speed at the head, the sector and the sonar's name."""
        raw = _bytes(stream, place.offset, place.length)
        if place.kind in R2SONIC:
            ping = r2sonic.ping_of(raw[PING:])
            head, detected = ping.head, ping.detections()
            shot = sector(detected.steering, frequency=head["frequency"], pulse_length=head["pulse_length"],
                          bandwidth=head["bandwidth"], source_level_db=head["power"],
                          absorption_db=1e-3 * float(head["absorption"]))
            speed = checked_speed(float(head["sound_speed"]), int(head["number"]))
            return detected, speed, shot, f"R2Sonic {head['model'].decode('ascii', 'replace')}"
        record = _record(raw[PING:], len(raw) - PING)
        if record is None:
            raise ValueError(f"its packet at byte {place.offset} changed while it was read.")
        about = self._settings(stream, place.settings)
        speed = float(np.frombuffer(raw, "<f4", 1, 32)[0]) if about is None else float(about["sound_speed"])
        speed = checked_speed(2 * speed if speed < 1000 else speed, int(record.head["number"]))  # some state half of it
        if record.kind == 7027:
            detected = raw_detections(record)
        else:
            angle = _angles(raw[PING + len(record.raw):])
            steering = 0.0 if about is None else float(about["steering"])
            if about is not None and int(about["receive_flags"]) & 1:
                angle = angle + pose["roll"] + self._arrays[0][1][0]
            detected = bathymetry(record, angle, steering)
        shot = sector(detected.steering) if about is None else sector_of(about, detected.steering)
        return detected, speed, shot, sonar_of(record.source[0])

    def _settings(self, stream, place):
        """Return the head of the settings 7503 in a custom packet, or None."""
        if place is None or place[1] > LONGEST:
            return None
        record = _record(_bytes(stream, *place)[RAW:], place[1] - RAW)
        return None if record is None or record.kind != 7503 else record.head

    def _installed(self, channel):
        """Return lever arm and mounting of a channel's array."""
        return (_checked([channel.OffsetY, channel.OffsetX, channel.OffsetZ]),
                np.deg2rad(_checked([channel.OffsetRoll, channel.OffsetPitch, channel.OffsetYaw])))


def _record(inside: bytes, length: int) -> S7kRecord | None:
    """Return the record of s7k that a packet's content begins with, or None; ``length`` [bytes] is the content's."""
    if len(inside) < FRAME.itemsize or inside[4:8] != SYNC:
        return None
    frame = np.frombuffer(inside, FRAME, 1)[0]
    size = int(frame["size"])
    if not FRAME.itemsize + 4 <= size <= length or int(frame["offset"]) + 4 < FRAME.itemsize:
        raise ValueError(f"it has a record {int(frame['kind'])} of {size} bytes in a packet of {length}; it is "
                         "damaged.")
    return S7kRecord(offset=0, raw=inside[:size])


def _angles(geometry: bytes) -> np.ndarray:
    """Return the angles of beams in a record 7004 without its frame."""
    about = HEADS[7004].itemsize
    count = int(np.frombuffer(geometry, HEADS[7004], 1)["beams"][0]) if len(geometry) >= about else 0
    if about + 8 * count > len(geometry):
        raise ValueError(f"it has a beam geometry 7004 of {len(geometry)} bytes for {count} beams; it is damaged.")
    return np.frombuffer(geometry, "<f4", count, about + 4 * count)


def _bytes(stream, offset, length):
    stream.seek(offset)
    return stream.read(length)


def _checked(values):
    values = np.array(values, float)
    if not (np.abs(values) < FARTHEST_ARM).all():
        raise ValueError(f"it states lever arms or mountings of {', '.join(f'{value:g}' for value in values)}; it is "
                         "damaged.")
    return values
