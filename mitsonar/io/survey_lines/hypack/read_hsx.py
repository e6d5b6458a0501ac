"""Read HSX files of HYPACK as lines of soundings.

A ping (RMB) holds slant ranges, which are travel times at the sound speed that the record states, and beam angles: of a
fixed fan, roll angles, or angles from the vertical with directions. Roll angles have the sign of a ship's roll, so that
a positive one lies to port. Beams that the sonar stabilises are turned back to the arrays by the attitude. Places are
made by our own reduction.

Positions are of a grid that most files do not name: x = y = 0 is then a point of that grid, and headings count from its
north. The depth of the reference point is that of the water line less the heave, which is upwards, with the dynamic
draught (DFT). Tides are left out.
"""
from __future__ import annotations

import os
import re
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

import numpy as np

from mitsonar.device.earth import Frame
from mitsonar.device.rotations import mounting_matrix
from mitsonar.hydrography.record import BY_AMPLITUDE

from ..assembly import AssembledLine, LineCast, Ping, check_counts, uniform_cast
from ..detections import DetectedPing, checked_speed, sector
from ..motion import motion_in
from .hsx import KINDS, LONGEST, HsxDevice, bits, header_of, lines, numbers, whole

DAY = 86_400.0
ROLLED, PITCHED, TWO_HEADS = 1, 2, 4       # flags of a sonar: beams stabilised against roll and pitch
SPHERICAL = 3                              # kind of sonar: angles from the vertical and directions
ANTENNA, GYRO, MRU, FIRST_HEAD = 0, 1, 2, 3            # kinds of offsets
SEABATS = (22, 53, 60, 62)                 # sonars whose settings are known: range, dB, gain, kHz, microseconds
FARTHEST_ARM = 1e3                         # [m]
READ = ("POS", "HCP", "GYR", "DFT", "PSA", "SNR", "RMB")


class HsxPlace(NamedTuple):
    """Place of a head's beams in the file."""

    time: float  # [s]: since 1970
    offset: int  # of the record RMB
    head: int
    steering: float  # [rad]
    settings: tuple[float, float, float]  # frequency [Hz], pulse [s], source level [dB]


class HsxFile:
    """Read an HSX file."""

    casts: tuple[LineCast, ...] = ()

    def __init__(self, path: str, column_path: str | None = None, *, water_column: bool = False) -> None:
        self._path, self._beams, self._places = path, 0, []
        self._passed: set[str] = set()
        self._device: int | None = None
        self._samples: dict[tuple[str, int], list] = {}
        with open(path, "rb") as stream:
            self._header = header = header_of(stream)
            self._walk(stream)
        if not self._places or self._device is None:
            raise ValueError("it has no soundings of a multibeam sonar (RMB with slant ranges).")
        device = header.devices.get(self._device, HsxDevice())
        self._name = device.name or "multibeam"
        heads = 1 + max(place.head for place in self._places)
        self._arrays = [self._installed(device, FIRST_HEAD + head) for head in range(heads)]
        self._places.sort()
        self._start = self._places[0].time
        self._motion, self._frame = self._moved()

    def __len__(self) -> int:
        return len(self._places)

    @property
    def line(self) -> AssembledLine:
        """Content that the pings share."""
        arrays, frame = self._arrays, self._frame
        with open(self._path, "rb") as stream:
            depth, speed = uniform_cast(self._ping(stream, self._places[0]).head_sound_speed)
        kinds = ", ".join(sorted(self._passed))
        where = "" if frame.crs else (f"x = y = 0 is easting {frame.origin[0]:.0f} m, northing {frame.origin[1]:.0f} m "
                                      "of a grid that the file does not name")
        return AssembledLine(
            sonar=self._name, title=os.path.basename(self._path), start=self._start, crs=frame.crs or None,
            origin=frame.origin, cast_depth=depth, cast_sound_speed=speed, transmit_offset=arrays[0][0],
            transmit_mounting=arrays[0][1], receive_offset=np.stack([one[0] for one in arrays]),
            receive_mounting=np.stack([one[1] for one in arrays]), motion=self._motion.streams,
            backscatter="intensity of the sonar's beams, 20 log10, not calibrated",
            profile="the head's sound speed at all depths", beams=self._beams, sectors=1, placed=False,
            left_out=", and ".join(filter(None, (where, f"records {kinds} are not read" if kinds else ""))))

    def pings(self, start: int, stop: int) -> Iterator[Ping]:
        """Read pings, in the order of time."""
        with open(self._path, "rb") as stream:
            for place in self._places[start:stop]:
                yield self._ping(stream, place)

    def _walk(self, stream: BinaryIO) -> None:
        """Note the records of sensors, and the places of pings."""
        days, last, steering, settings = 0.0, None, (0.0, 0.0), (np.nan,) * 3
        for place, (tag, *rest) in lines(stream):
            if tag not in READ or len(rest) < 3:
                self._passed |= {tag} - {*READ, "EOL"} if len(tag) == 3 else set()
                continue
            number, second = whole(rest[0]), float(numbers(rest[1:2])[0])
            if not 0 <= second <= 2 * DAY:
                raise ValueError(f"its record {tag} at byte {place} is {second:g} s past midnight; it is damaged.")
            late = last is not None and second > last + DAY / 2 and days > 0         # from before midnight
            if not late:
                days += DAY if last is not None and second < last - DAY / 2 else 0.0
                last = second
            time = self._header.midnight + days + second - (DAY if late else 0.0)
            if tag == "RMB":
                self._noted(place, rest, number, time, steering, settings)
            elif tag == "PSA" and len(rest) > 3:
                angles = np.deg2rad(numbers(rest[3:5]))
                steering = (float(angles[0]), float(angles[-1]))
            elif tag == "SNR" and len(rest) > 9 and whole(rest[3]) in SEABATS:
                level, _, frequency, pulse = numbers(rest[6:10])
                settings = (1e3 * frequency, 1e-6 * pulse, level)
            elif tag in ("POS", "HCP", "GYR", "DFT"):
                values = numbers(rest[2:{"POS": 4, "HCP": 5}.get(tag, 3)])
                self._samples.setdefault((tag, number), []).append([time, *values])

    def _noted(self, place, rest, number, time, steering, settings):
        """Note a ping, one place a head."""
        if len(rest) < 8 or not bits(rest[4]) & 1 or self._device not in (None, number):
            self._passed.add("RMB without ranges or of another sonar")
            return
        self._device = number
        count = whole(rest[5])
        check_counts(f"its ping {rest[7]}", count)
        first, second = self._header.devices.get(number, HsxDevice()).beams
        heads = (first, count - first) if bits(rest[3]) & TWO_HEADS and 0 < first < count else (count,)
        self._beams = max(self._beams, *heads)
        self._places += [HsxPlace(time, place, head, steering[head], settings) for head in range(len(heads))]

    @np.errstate(all="ignore")      # `dataset` removes NaN and infinity
    def _ping(self, stream: BinaryIO, place: HsxPlace) -> Ping:
        stream.seek(place.offset)
        _, _, _, shape, flags, known, count, speed, name = stream.readline(LONGEST).decode("latin-1").split()[:9]
        bad, beams, pose = bits(flags), whole(count), self._motion.at(place.time - self._start)
        sound_speed = checked_speed(float(numbers([speed])[0]), whole(name))
        table = {}
        for number, kind in enumerate(KINDS):
            if bits(known) >> number & 1:
                table[kind] = numbers(stream.readline(LONGEST).decode("latin-1").split())
                if table[kind].size != beams:
                    raise ValueError(f"its ping {name} has {table[kind].size} values of {kind} for {beams} beams; it "
                                     "is damaged.")
        device = self._header.devices.get(self._device or 0, HsxDevice())
        some = slice(None)
        if bad & TWO_HEADS and 0 < device.beams[0] < beams:
            some = slice(device.beams[0], None) if place.head else slice(device.beams[0])
        table = {kind: values[some] for kind, values in table.items()}
        mounting = self._arrays[place.head][1]
        sent = np.full(table["range"].size, place.steering)
        if bits(shape) == SPHERICAL and {"takeoff", "direction"} <= set(table):
            angle, sent = _of_directions(np.deg2rad(table["takeoff"]), np.deg2rad(table["direction"]), bad, pose,
                                         mounting)
        else:
            first, step = device.fan
            turned = np.deg2rad(table["roll"] if "roll" in table else (first + step * np.arange(beams))[some])
            angle = -turned + (pose["roll"] + mounting[0] if bad & ROLLED else 0.0)      # positive angles lie to port
        good = table["quality"] >= self._header.good if "quality" in table else np.ones(angle.size, bool)
        detected = DetectedPing(
            travel_time=2 * self._header.unit * table["range"] / sound_speed, angle=angle, steering=place.steering,
            valid=good, method=np.full(angle.size, BY_AMPLITUDE),
            intensity=table.get("intensity", np.full(angle.size, np.nan)))
        frequency, pulse, level = place.settings
        shot = sector(place.steering, frequency=frequency, pulse_length=pulse, source_level_db=level)
        apart = self._arrays[place.head][0] - self._arrays[0][0]
        soundings = detected.soundings() | {"transmit_angle": sent}
        soundings.pop("detection")                             # which the format does not state
        return Ping(place=pose, head_sound_speed=sound_speed, head=place.head, soundings=soundings,
                    sectors=shot if len(self._arrays) == 1 else shot | {"offset": apart[None]})

    def _moved(self):
        """Return the motion, and the frame of its places."""
        header, unit = self._header, self._header.unit
        numbers_of = {tag: sorted(number for kind, number in self._samples if kind == tag) for tag in READ}
        if not numbers_of["POS"]:
            raise ValueError("it has no position of the vessel.")
        navigator = header.primary if header.primary in numbers_of["POS"] else numbers_of["POS"][0]
        fixes, antenna = self._stream("POS", navigator, ANTENNA)
        fixes[:, 1:] *= unit
        fixes = fixes[np.unique(fixes[:, 0], return_index=True)[1]]
        if not len(fixes) or not (np.abs(fixes[:, 1:]) < 1e8).all():
            raise ValueError("its positions are no places on Earth; it is damaged.")
        frame = Frame(crs=_system(header.system), origin=(float(np.round(fixes[0, 1])), float(np.round(fixes[0, 2]))))
        fixes[:, 1:] -= frame.origin
        attitude, mounting = np.zeros((0, 5)), np.zeros(7)
        heading, gyro = self._stream("GYR", numbers_of["GYR"][0], GYRO) if numbers_of["GYR"] else (None, None)
        if numbers_of["HCP"]:
            motion, mounting = self._stream("HCP", numbers_of["HCP"][0], MRU)
            attitude = np.column_stack([motion[:, 0], *np.deg2rad(motion[:, [2, 3]]).T, np.zeros(len(motion)),
                                        -motion[:, 1]])
        elif heading is not None:
            attitude = np.column_stack([heading[:, 0], np.zeros((len(heading), 4))])
        if heading is not None and gyro is not None:
            attitude[:, 3] = np.interp(attitude[:, 0], heading[:, 0], np.unwrap(np.deg2rad(heading[:, 1] + gyro[3])))
        if numbers_of["DFT"]:
            draught, _ = self._stream("DFT", numbers_of["DFT"][0], -1)
            attitude[:, 4] += unit * np.interp(attitude[:, 0], draught[:, 0], draught[:, 1])
        turn = _checked(np.deg2rad(mounting[[4, 5]]))
        convergence = float(frame.on_globe(np.zeros((1, 2)))[2][0]) if frame.crs else 0.0
        return motion_in(frame, attitude, fixes, self._start, waterline=0.0, convergence=convergence,
                         mounting=np.array([*turn, 0.0]), antenna=_arm(antenna, unit)), frame

    def _stream(self, tag, number, kind):
        """Return the samples of a device in the order of time, earlier by its latency, and its offsets."""
        device = self._header.devices.get(number, HsxDevice())
        offsets = device.offsets.get(kind, np.zeros(7))
        rows = np.array(self._samples[tag, number], float)
        rows = rows[np.isfinite(rows).all(1)]
        rows[:, 0] -= offsets[6] if abs(offsets[6]) < DAY else 0.0
        return rows[np.argsort(rows[:, 0], kind="stable")], offsets

    def _installed(self, device, kind):
        """Return lever arm and mounting of a head."""
        offsets = device.offsets.get(kind, np.zeros(7))
        return _arm(offsets, self._header.unit), _checked(np.deg2rad(offsets[[4, 5, 3]]))


def _of_directions(takeoff, direction, flags, pose, mounting):
    """Return receive and transmit angles of beams from their directions, in the body or stabilised."""
    away = np.stack([np.sin(takeoff) * np.cos(direction), np.sin(takeoff) * np.sin(direction), np.cos(takeoff)], -1)
    if not flags & (ROLLED | PITCHED):
        return np.arcsin(away[:, 1]), np.arcsin(away[:, 0])
    array = away @ mounting_matrix(pose["roll"], pose["pitch"]) @ mounting_matrix(*mounting)
    return np.arcsin(np.clip(array[:, 1], -1, 1)), np.arcsin(np.clip(array[:, 0], -1, 1))


def _system(text: str) -> str:
    """Return a coordinate system in metres that PROJ knows, or empty text."""
    if named := re.fullmatch(r"<epsg(\d+)>", text.strip(), re.IGNORECASE):
        text = f"EPSG:{named[1]}"
    elif named := re.fullmatch(r"<utm(\d{1,2})([ns])>", text.strip(), re.IGNORECASE):
        text = f"EPSG:32{6 if named[2].lower() == 'n' else 7}{int(named[1]):02d}"
    if not text:
        return ""
    from mitsonar.device.earth import metric_system

    metric_system(text)
    return text


def _arm(offsets, unit):
    """Return a lever arm (starboard, forward, down) as forward, starboard, down [m]."""
    return _checked(unit * offsets[[1, 0, 2]])


def _checked(values):
    if not (np.abs(values) < FARTHEST_ARM).all():
        raise ValueError(f"its offsets are {', '.join(f'{value:g}' for value in values)}; it is damaged.")
    return values
