"""Read GSF files as lines of soundings; frames are checked here before `gsfu` decodes the records.

A record is its length [bytes], a word (bit 31: a checksum of four bytes follows; bits 0 to 21: its type) and a payload,
all with the highest byte first (Generic Sensor Format specification 03.06, Leidos, 2014).

Programs write beam directions in one of two ways, which differ in the side on which the soundings then lie:

    relative to a level ship: beam_angle from the vertical, beam_angle_forward counterclockwise from starboard; with l
    towards the beam, sin(angle) = a_r·l and sin(transmit_angle) = a_t·l at the ping's attitude;
    relative to the arrays: beam_angle of one sign a side, beam_angle_forward from the bow, 90 degrees athwartships.

Lever arms, mountings and the draught are those that the processing parameters list as applied. Depths include the tide
corrector (minus the water level) where the parameters say so, and heights above the ellipsoid where it is that of GPS.
"""
from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from contextlib import closing
from datetime import datetime
from itertools import islice
from typing import Any

import numpy as np

from mitsonar.device.rotations import mounting_matrix

from ..assembly import DEEPEST, FASTEST, LEVELS, SECTOR, SLOWEST, AssembledLine, LineCast, Ping, cast_of, check_counts
from ..motion import motion_of
from ..places import across_and_along, levelled

FRAME, PING = struct.Struct(">II"), struct.Struct(">2I2iH")
LONGEST, TYPES = 1 << 19, 12               # bytes of a record; the last type
SWATH, CAST, PARAMETERS, COMMENT, ATTITUDE = 2, 3, 4, 6, 12              # types of records
DAMAGE = (struct.error, ValueError, IndexError, KeyError, OverflowError, TypeError, EOFError, MemoryError)
LEVEL = 0.9                        # share of soundings on the side given by the first way of writing directions
NOTHING = (99.99, 9999.99)         # [m] for no corrector and no height
HEAD = "RxTransducerInd"           # in a sounder's own record: number of the receive array
OURS = "log10 of depth over its spread"            # in the comment of a file whose quality is the record's
ONE_SIGMA, ONE_SIGMA_LEVEL = 1.96, 2.448 / np.sqrt(2)       # errors in the file are of 95 %
_SECTORS = {"frequency": "CentreFreq_Hz", "delay": "SectorTransmitDelay_sec", "pulse_length": "TotalSignalLength_sec",
            "bandwidth": "SignalBandWidth_Hz", "source_level_db": "TxNominalSourceLevel_dB"}


def walk(path: str) -> tuple[np.ndarray, int]:
    """Check all frames; return time [s since 1970], longitude, latitude [degrees] of pings (P, 3), and most beams."""
    positions, beams, offset = [], 0, 0
    size = os.path.getsize(path)
    with open(path, "rb") as stream:
        while offset < size:
            stream.seek(offset)
            head = stream.read(FRAME.size + 4 + PING.size)
            if len(head) < FRAME.size:
                raise ValueError(f"it is cut at byte {offset}: there are {len(head)} bytes of a record.")
            length, word = FRAME.unpack_from(head)
            kind, checked = word & 0x3FFFFF, 4 if word >> 31 else 0
            if not 1 <= kind <= TYPES or not 8 < length + checked <= LONGEST or (offset == 0 and kind != 1):
                raise ValueError("it is no GSF file: it does not begin with a header." if offset == 0 else
                                 f"it is damaged at byte {offset}: there is no record.")
            end = offset + FRAME.size + checked + length
            if end > size:
                raise ValueError(f"it is cut: its last record, at byte {offset}, has {size - offset} of "
                                 f"{end - offset} bytes; copy the file again.")
            if kind == SWATH:
                if length < PING.size:
                    raise ValueError(f"its ping at byte {offset} has {length} bytes; it is damaged.")
                second, nanosecond, longitude, latitude, count = PING.unpack_from(head, FRAME.size + checked)
                positions.append((second + 1e-9 * nanosecond, 1e-7 * longitude, 1e-7 * latitude))
                beams = max(beams, count)
            offset = end
    if size == 0:
        raise ValueError("it is empty.")
    return np.array(positions).reshape(-1, 3), beams


class GsfFile:
    """Read a GSF file."""

    def __init__(self, path: str, column_path: str | None = None, *, water_column: bool = False) -> None:
        self._path = path
        self._positions, self._beams = walk(path)
        if not len(self._positions):
            raise ValueError("it has no pings of soundings.")
        check_counts("a ping", self._beams)
        self._start = float(self._positions[0, 0])
        self._parameters: dict[str, str] = next((record["Parameters"] for record in self._records(PARAMETERS)), {})
        self._ours = any(OURS in (record["Comment"] or "") for record in self._records(COMMENT))
        self.casts = [LineCast.at(
            datetime.fromisoformat(record["ApplicationTime"]).timestamp(), record["Latitude_deg"],
            record["Longitude_deg"], np.column_stack([record["Depth_m"], record["SoundSpeed_mPerSec"]]))
            for record in self._records(CAST)]
        self._cast = self.casts[0].nodes if self.casts else None
        self._draught = _numbers(self._parameters.get("APPLIED_DRAFT"))[0]
        self._sectors, heads_named = 1, True
        levels = []
        for record in self._records(SWATH):
            levels.append(self._levels(record))
            heads_named &= HEAD in (record.get("SensorSpecific") or {})
            self._sectors = max(self._sectors, _count(_shots(record)))
            check_counts("a ping", 0, self._sectors)
        table = {name: np.array([level[name] for level in levels]) for name in LEVELS}
        self._gnss = any("gnss" in level for level in levels)
        self._stated = tuple(name for name, values in table.items() if (np.isfinite(values) & (values != 0)).any())
        self._motion = self._moved(np.nan_to_num(table["tide"]))
        # Some files state two receivers, but have the lever arm of one.
        arms = (self._parameters.get("APPLIED_RX_TRANSDUCER_OFFSET") or "").count(",") + 1
        self._heads = 2 if heads_named and self._parameters.get("NUMBER_OF_RECEIVERS") == "2" and arms >= 6 else 1

    def __len__(self) -> int:
        return len(self._positions)

    @property
    def line(self) -> AssembledLine:
        """Content that the pings share."""
        depth, speed = cast_of(self._cast)
        return AssembledLine(
            sonar="multibeam", title=os.path.basename(self._path), start=self._start, crs=self._motion.frame.crs,
            origin=self._motion.frame.origin, cast_depth=depth, cast_sound_speed=speed,
            transmit_offset=self._array("", "OFFSET"), transmit_mounting=self._array("", "MOUNTING"),
            receive_offset=self._receivers("OFFSET"), receive_mounting=self._receivers("MOUNTING"),
            motion=self._motion.streams, backscatter="mean calibrated amplitude of the file",
            levels=self._stated, heights="gnss" if self._gnss else "", datum=_datum(self._parameters),
            profile="the cast of the file", beams=self._beams, sectors=self._sectors)

    def pings(self, start: int, stop: int) -> Iterator[Ping]:
        """Read pings, in the order of the file."""
        for number, record in enumerate(islice(self._records(SWATH), start, stop), start):
            try:
                yield self._ping(record)
            except DAMAGE as error:
                raise ValueError(f"its ping {number} is damaged ({error}).") from None

    def _records(self, kind: int) -> Iterator[dict[str, Any]]:
        """Yield the decoded records of a type."""
        from GSFU import GSFError, gsf

        file = gsf(self._path)
        try:
            with closing(file.iter_records(kind)) as records:
                while True:
                    with np.errstate(all="ignore"):            # of scale factors 0; `dataset` removes NaN and infinity
                        record = next(records, None)
                    if record is None:
                        return
                    yield record[2]
        except (*DAMAGE, GSFError):                        # the library's messages do not help a user
            raise ValueError(f"a record of type {kind} is damaged or cut short; export the line again.") from None
        finally:
            if file.FID is not None:
                file.FID.close()

    def _levels(self, record) -> dict[str, float]:
        """Return the levels of a ping, NaN where the file states none; "gnss" where the tide follows from heights."""
        def value(name: str) -> float:
            number = float(record.get(name, np.nan))
            return number if abs(number) < DEEPEST and number not in NOTHING else np.nan

        by_gps, by_tide = value("GPSTideCorrector_m"), value("TideCorrector_m")
        tidal = self._parameters.get("TIDE_COMPENSATED") == "YES"
        gnss = tidal and by_gps and np.isfinite(by_gps) and not by_tide
        return {"tide": -(by_gps if gnss else by_tide) if tidal else 0.0, "ping_height": value("Height_m"),
                "separation": value("SEP_m"), **({"gnss": 1.0} if gnss else {})}

    def _moved(self, tides):
        angles = ("Roll_deg", "Pitch_deg", "Heading_deg")
        columns = [np.column_stack([record["Time"].astype("int64") * 1e-9, *(np.deg2rad(record[name])
                                    for name in angles), -record["Heave_m"]]) for record in self._records(ATTITUDE)]
        attitude = np.concatenate(columns) if columns else np.zeros((0, 5))
        if not len(attitude):
            attitude = np.array([[time, *np.deg2rad([ping[name] for name in angles]), -ping["Heave_m"]]
                                 for time, ping in zip(self._positions[:, 0], self._records(SWATH))])
        attitude = attitude[np.argsort(attitude[:, 0], kind="stable")]
        times, order = np.unique(self._positions[:, 0], return_index=True)
        attitude[:, 4] -= np.interp(attitude[:, 0], times, tides[order])
        return motion_of(attitude, self._positions, self._start, waterline=-self._draught)

    def _array(self, prefix, name, head=0):
        """Return a lever arm or mounting from the parameters; the default of a receiver is that of the transmitter."""
        prefix = prefix if f"APPLIED_{prefix}TRANSDUCER_OFFSET" in self._parameters else ""

        def value(name: str, size: int) -> np.ndarray:
            return _numbers(self._parameters.get(f"APPLIED_{prefix}TRANSDUCER_{name}"), head * size, size)

        if name == "OFFSET":
            return value("OFFSET", 3)
        return np.deg2rad([value(f"{axis}_OFFSET", 1)[0] for axis in ("ROLL", "PITCH", "HEADING")])

    def _receivers(self, name):
        """Return the lever arms or the mountings (R, 3) of the receive arrays."""
        return np.stack([self._array("RX_", name, head) for head in range(self._heads)])

    @np.errstate(invalid="ignore", over="ignore")      # `dataset` removes NaN and infinity
    def _ping(self, record):
        beams = {name: values for name, values in record["Beams"].items()
                 if values is not None and len(values) == record["NumberBeams"]}
        needed = ("Depth_m", "AcrossTrack_m", "AlongTrack_m")
        lacking = [name for name in needed if name not in beams]
        if not record["NumberBeams"]:
            beams = {name: np.zeros(0) for name in (*needed, "BeamAngle_deg")}
        elif lacking:
            raise ValueError(f"it lacks {lacking[0]}")
        count, own = record["NumberBeams"], record.get("SensorSpecific") or {}
        since = datetime.fromisoformat(record["PingTime"]).timestamp()
        place, levels = self._motion.at(since - self._start), self._levels(record)
        place |= {"roll": np.deg2rad(record["Roll_deg"]), "pitch": np.deg2rad(record["Pitch_deg"]),
                  "heading": float(np.deg2rad(record["Heading_deg"]) - self._motion.convergence),
                  "depth": self._draught - record["Heave_m"] - float(np.nan_to_num(levels["tide"]))}
        across, along = beams["AcrossTrack_m"], beams["AlongTrack_m"]
        x, y = across_and_along(place["x"], place["y"], place["heading"], across, along)
        flags = beams.get("BeamFlags", np.zeros(count)).astype(np.uint8)
        valid = (flags & 1 == 0) & (beams["Depth_m"] > 0)
        shots = _shots(record)
        sectors = {name: np.full(max(_count(shots), 1), np.nan) for name in SECTOR}
        sectors |= {name: shots[column] for name, column in _SECTORS.items() if shots}
        sectors["delay"] = np.nan_to_num(sectors["delay"])
        sector = np.clip(beams.get("SectorNumber", np.zeros(count)), 0, sectors["delay"].size - 1).astype(int)
        head = min(int(own.get(HEAD, 0)), self._heads - 1)
        sent, received = self._angles(beams, place, head)
        if shots:
            sectors["angle"] = np.deg2rad(shots["TiltAngleReTx_deg"])
            sent = sent if "BeamAngleForward_deg" in beams else sectors["angle"][sector]
        if "MeanAbsCoeff" in beams:
            sectors["absorption_db"] = np.array([1e-3 * np.mean(beams["MeanAbsCoeff"][sector == number])
                                                 if (sector == number).any() else np.nan
                                                 for number in range(sectors["delay"].size)])
        missing = np.full(count, np.nan)
        soundings = {"valid": valid, "travel_time": beams.get("TravelTime_s", missing), "angle": received,
                     "transmit_angle": sent, "sector": sector, "depth": beams["Depth_m"], "x": x, "y": y,
                     "across_track": across, "along_track": along,
                     "backscatter_db": beams.get("MeanCalAmplitude_dB", missing),
                     "uncertainty": beams.get("VerticalError_m", missing) / ONE_SIGMA,
                     "horizontal_uncertainty": beams.get("HorizontalError_m", missing) / ONE_SIGMA_LEVEL}
        if self._ours:
            soundings |= {"quality": beams.get("QualityFactor", missing),
                          "detection": np.clip(np.nan_to_num(beams.get("DetectionInfo", missing)), 0, 2)}
        return Ping(place=place, head_sound_speed=self._head_speed(own, place), head=head, sectors=sectors,
                    soundings=soundings, levels=levels)

    def _angles(self, beams, place, head):
        """Return transmit angles and receive angles of the beams of a ping."""
        if "BeamAngle_deg" not in beams:
            missing = np.full(len(beams["Depth_m"]), np.nan)
            return missing, missing
        angle, across = np.deg2rad(beams["BeamAngle_deg"]), beams["AcrossTrack_m"]
        forward = np.deg2rad(beams.get("BeamAngleForward_deg", np.full(len(angle), 90.0)))
        aside = np.abs(across) > 0.1 * np.abs(across).max(initial=0.0)
        if not aside.any() or np.mean(np.sin(angle[aside]) * np.cos(forward[aside]) * across[aside] > 0) <= LEVEL:
            return np.pi / 2 - forward, (1.0 if np.sum(np.sin(angle) * across) >= 0 else -1.0) * angle
        away = np.stack([np.sin(angle) * np.sin(forward), np.sin(angle) * np.cos(forward), np.cos(angle)], -1)
        body = away @ mounting_matrix(place["roll"], place["pitch"])
        along = mounting_matrix(*self._array("", "MOUNTING"))[:, 0]
        starboard = mounting_matrix(*self._array("RX_", "MOUNTING", head))[:, 1]
        return tuple(np.arcsin(np.clip(body @ axis, -1, 1)) for axis in (along, starboard))

    def _head_speed(self, own, place):
        """Return the sound speed at the head, from the sounder's own record or else from the cast at the array."""
        for name in ("SoundSpeedAtTxDepth_mPerSec", "SurfaceVelocity_mps"):
            value = float(np.ravel(own.get(name, 0.0))[0])
            if SLOWEST < value < FASTEST:
                return value
        arm = levelled(self._array("", "OFFSET"), place["roll"], place["pitch"])
        depth, speed = cast_of(self._cast)
        return float(np.interp(place["depth"] + arm[2], depth, speed))


def _datum(parameters: dict[str, str]) -> str:
    """Return the vertical datum of the processing parameters, "" if they name none."""
    name = (parameters.get("TIDAL_DATUM") or "").strip()
    return "" if name.upper() in ("", "UNKNOWN", "UNKNWN") else name


def _shots(record) -> dict[str, np.ndarray]:
    """Return the table of sectors in the sounder's own record, empty if there is none."""
    table = (record.get("SensorSpecific") or {}).get("TxSectors")
    if not isinstance(table, dict) or not {*_SECTORS.values(), "TiltAngleReTx_deg"} <= set(table):
        return {}
    return {name: np.asarray(values) for name, values in table.items()} if len(table["CentreFreq_Hz"]) else {}


def _count(shots):
    return len(shots["CentreFreq_Hz"]) if shots else 0


def _numbers(text: str | None, first: int = 0, count: int = 3) -> np.ndarray:
    """Return ``count`` numbers of a parameter from number ``first``, 0 for numbers that are missing."""
    numbers = np.zeros(count)
    for axis, part in enumerate((text or "").split(",")[first:first + count]):
        try:
            value = float(part)
        except ValueError:
            continue
        numbers[axis] = value if abs(value) < 1e4 else 0.0
    return numbers
