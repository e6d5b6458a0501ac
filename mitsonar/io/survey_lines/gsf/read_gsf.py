"""GSF files as lines of soundings, ping after ping, decoded by `gsfu`.

Programs write where beams point in two ways, told by which side a beam's sounding lies on:

    of a level ship: beam_angle from the vertical, beam_angle_forward counterclockwise from starboard; with l towards
    the beam, sin(angle) = a_r·l and sin(transmit_angle) = a_t·l at the ping's attitude;
    of the arrays: beam_angle of one sign a side, beam_angle_forward from the bow, 90 degrees athwartships.

Lever arms, mountings and the draught are those that the processing parameters say were applied.

The frames of a GSF file's records, checked before a library decodes what is inside.

A record is its length [bytes], a word (bit 31: a checksum of four bytes follows; bits 0 to 21: its type) and a payload,
all with the highest byte first (Generic Sensor Format specification 03.06, Leidos, 2014).
"""
from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from datetime import datetime
from itertools import islice
from typing import Any

import numpy as np

from ..assembly import MOST_BEAMS, MOST_SECTORS, SECTOR, AssembledLine, Ping, cast_of
from ..motion import motion_of
from ..places import across_and_along, levelled, turned

FRAME, PING = struct.Struct(">II"), struct.Struct(">2I2iH")
LONGEST, TYPES, SWATH = 1 << 19, 12, 2     # bytes of a record; the last type; that of pings


@dataclass(frozen=True, kw_only=True, eq=False)
class GsfWalk:
    """Hold what the frames say."""

    positions: np.ndarray  # (P, 3) [degrees]: time since 1970, longitude and latitude of pings
    beams: int  # most of a ping


def walk(path: str) -> GsfWalk:
    """Go through all records."""
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
            after = offset + FRAME.size + checked + length
            if after > size:
                raise ValueError(f"it is cut: its last record, at byte {offset}, has {size - offset} of "
                                 f"{after - offset} bytes; copy the file again.")
            if kind == SWATH:
                if length < PING.size:
                    raise ValueError(f"its ping at byte {offset} has {length} bytes; it is damaged.")
                second, nanosecond, longitude, latitude, count = PING.unpack_from(head, FRAME.size + checked)
                positions.append((second + 1e-9 * nanosecond, 1e-7 * longitude, 1e-7 * latitude))
                beams = max(beams, count)
            offset = after
    if size == 0:
        raise ValueError("it is empty.")
    return GsfWalk(positions=np.array(positions).reshape(-1, 3), beams=beams)


DAMAGE = (struct.error, ValueError, IndexError, KeyError, OverflowError, TypeError, EOFError, MemoryError)
LEVEL = 0.9                        # share of soundings on the side that the first way says
HEAD = "RxTransducerInd"           # in a sounder's own record: number of the receive array
OURS = "log10 of depth over its spread"            # what the file's comment says where quality is the record's
ONE_SIGMA, ONE_SIGMA_LEVEL = 1.96, 2.448 / np.sqrt(2)       # errors are of 95 %
_BACKSCATTER = "mean calibrated amplitude of the file"
_SECTORS = {"frequency": "CentreFreq_Hz", "delay": "SectorTransmitDelay_sec", "pulse_length": "TotalSignalLength_sec",
            "bandwidth": "SignalBandWidth_Hz", "source_level_db": "TxNominalSourceLevel_dB"}


class GsfFile:
    """Read a GSF file."""

    def __init__(self, path: str, column_path: str | None = None, *, water_column: bool = False) -> None:
        self._path = path
        self._walked = walk(path)
        if not len(self._walked.positions):
            raise ValueError("it has no pings of soundings.")
        if self._walked.beams > MOST_BEAMS:
            raise ValueError(f"a ping says that it has {self._walked.beams} beams; at most {MOST_BEAMS} are believed.")
        self._start = float(self._walked.positions[0, 0])
        self._parameters: dict[str, str] = next((one["Parameters"] for one in self._records(4)), {})
        self._ours = any(OURS in (one["Comment"] or "") for one in self._records(6))
        self._cast = next((np.column_stack([one["Depth_m"], one["SoundSpeed_mPerSec"]]) for one in self._records(3)),
                          None)
        self._draught = _numbers(self._parameters.get("APPLIED_DRAFT"))[0]
        self._motion = self._moved()
        self._sectors, told = 1, True
        for one in self._records(2):
            told &= HEAD in (one.get("SensorSpecific") or {})
            self._sectors = max(self._sectors, _count(_shots(one)))
            if self._sectors > MOST_SECTORS:
                raise ValueError(f"a ping says that it has {self._sectors} sectors; at most {MOST_SECTORS} are "
                                 "believed.")
        # Some files say that there are two, and give the arms of one.
        arms = (self._parameters.get("APPLIED_RX_TRANSDUCER_OFFSET") or "").count(",") + 1
        self._heads = 2 if told and self._parameters.get("NUMBER_OF_RECEIVERS") == "2" and arms >= 6 else 1

    def __len__(self) -> int:
        return len(self._walked.positions)

    @property
    def line(self) -> AssembledLine:
        """What the pings share."""
        depth, speed = cast_of(self._cast)
        return AssembledLine(sonar="multibeam", title=os.path.basename(self._path), start=self._start,
                    crs=self._motion.zone.crs, origin=self._motion.zone.origin, cast_depth=depth,
                    cast_sound_speed=speed, transmit_offset=self._array("", "OFFSET"),
                    transmit_mounting=self._array("", "MOUNTING"), receive_offset=self._receivers("OFFSET"),
                    receive_mounting=self._receivers("MOUNTING"), motion=self._motion.streams,
                    backscatter=_BACKSCATTER, profile="the cast of the file", beams=self._walked.beams,
                    sectors=self._sectors)

    def pings(self, start: int, stop: int) -> Iterator[Ping]:
        """Read pings, in the order of the file."""
        for number, one in enumerate(islice(self._records(2), start, stop), start):
            try:
                yield self._ping(one, number)
            except DAMAGE as error:
                raise ValueError(f"its ping {number} is damaged ({error}).") from None

    def _records(self, kind: int) -> Iterator[dict[str, Any]]:
        """Decode the records of a type."""
        from GSFU import GSFError, gsf

        file = gsf(self._path)
        try:
            with closing(file.iter_records(kind)) as records:
                while True:
                    with np.errstate(all="ignore"):            # of scale factors 0; `dataset` sorts them out
                        found = next(records, None)
                    if found is None:
                        return
                    yield found[2]
        except (*DAMAGE, GSFError):                        # in words of NumPy that mean nothing to a reader
            raise ValueError(f"a record of type {kind} is damaged or cut short; export the line again.") from None
        finally:
            if file.FID is not None:
                file.FID.close()

    def _moved(self):
        columns = [np.column_stack([one["Time"].astype("int64") * 1e-9, *(np.deg2rad(one[name]) for name in (
            "Roll_deg", "Pitch_deg", "Heading_deg")), -one["Heave_m"]]) for one in self._records(12)]
        attitude = np.concatenate(columns) if columns else np.zeros((0, 5))
        if not len(attitude):
            attitude = np.array([[when, *np.deg2rad([one["Roll_deg"], one["Pitch_deg"], one["Heading_deg"]]),
                                  -one["Heave_m"]] for (when, _, _), one in zip(self._walked.positions,
                                                                                self._records(2))])
        return motion_of(attitude[np.argsort(attitude[:, 0], kind="stable")], self._walked.positions, self._start,
                         waterline=-self._draught)

    def _array(self, prefix, what, head=0):
        """Return a lever arm or a mounting of the processing parameters; a receiver's is the transmitter's by default.
        """
        def value(of: str, name: str, size: int) -> np.ndarray:
            return _numbers(self._parameters.get(f"APPLIED_{of}TRANSDUCER_{name}"), head * size, size)

        of = prefix if f"APPLIED_{prefix}TRANSDUCER_OFFSET" in self._parameters else ""
        if what == "OFFSET":
            return value(of, "OFFSET", 3)
        return np.deg2rad([value(of, f"{name}_OFFSET", 1)[0] for name in ("ROLL", "PITCH", "HEADING")])

    def _receivers(self, what):
        """Return the lever arms or the mountings (R, 3) of the receive arrays."""
        return np.stack([self._array("RX_", what, head) for head in range(self._heads)])

    @np.errstate(invalid="ignore", over="ignore")      # of numbers that are none; `dataset` sorts them out
    def _ping(self, one, number):
        beams = {name: values for name, values in one["Beams"].items()
                 if values is not None and len(values) == one["NumberBeams"]}
        needed = ("Depth_m", "AcrossTrack_m", "AlongTrack_m")
        lacking = [name for name in needed if name not in beams]
        if not one["NumberBeams"]:
            beams = {name: np.zeros(0) for name in (*needed, "BeamAngle_deg")}
        elif lacking:
            raise ValueError(f"it lacks {lacking[0]}")
        count, own = one["NumberBeams"], one.get("SensorSpecific") or {}
        since = datetime.fromisoformat(one["PingTime"]).timestamp()
        place = self._motion.at(since - self._start)
        place |= {"roll": np.deg2rad(one["Roll_deg"]), "pitch": np.deg2rad(one["Pitch_deg"]),
                  "heading": float(np.deg2rad(one["Heading_deg"]) + self._motion.zone.convergence),
                  "depth": self._draught - one["Heave_m"]}
        across, along = beams["AcrossTrack_m"], beams["AlongTrack_m"]
        x, y = across_and_along(place["x"], place["y"], place["heading"], across, along)
        nothing = np.full(count, np.nan)
        flags = beams.get("BeamFlags", np.zeros(count)).astype(np.uint8)
        valid = (flags & 1 == 0) & (beams["Depth_m"] > 0)
        shots = _shots(one)
        sectors = {name: np.full(max(_count(shots), 1), np.nan) for name in SECTOR}
        sectors |= {name: shots[column] for name, column in _SECTORS.items() if shots}
        sectors["delay"] = np.nan_to_num(sectors["delay"])
        sector = np.clip(beams.get("SectorNumber", np.zeros(count)), 0, sectors["delay"].size - 1).astype(int)
        head = min(int(own.get(HEAD, 0)), self._heads - 1)
        sent, heard = self._angles(beams, place, head)
        if shots:
            sectors["angle"] = np.deg2rad(shots["TiltAngleReTx_deg"])
            sent = sent if "BeamAngleForward_deg" in beams else sectors["angle"][sector]
        if "MeanAbsCoeff" in beams:
            sectors["absorption_db"] = np.array([1e-3 * np.mean(beams["MeanAbsCoeff"][sector == each])
                                                 if (sector == each).any() else np.nan
                                                 for each in range(sectors["delay"].size)])
        soundings = {"valid": valid, "travel_time": beams.get("TravelTime_s", nothing), "angle": heard,
                     "transmit_angle": sent, "sector": sector, "depth": beams["Depth_m"], "x": x, "y": y,
                     "across_track": across, "along_track": along}
        return Ping(place=place, head_sound_speed=self._head_speed(own, place), head=head, sectors=sectors,
                    soundings=soundings | self._kept(beams))

    def _kept(self, beams):
        """Return what a sounding may have besides; every ping has the same."""
        nothing = np.full(len(beams["Depth_m"]), np.nan)
        kept = {"backscatter_db": beams.get("MeanCalAmplitude_dB", nothing),
                "uncertainty": beams.get("VerticalError_m", nothing) / ONE_SIGMA,
                "horizontal_uncertainty": beams.get("HorizontalError_m", nothing) / ONE_SIGMA_LEVEL}
        if self._ours:
            kept |= {"quality": beams.get("QualityFactor", nothing),
                     "detection": np.clip(np.nan_to_num(beams.get("DetectionInfo", nothing)), 0, 2)}
        return kept

    def _angles(self, beams, place, head):
        """Return transmit angles and angles of the beams of a ping of a head."""
        if "BeamAngle_deg" not in beams:
            nothing = np.full(len(beams["Depth_m"]), np.nan)
            return nothing, nothing
        angle, across = np.deg2rad(beams["BeamAngle_deg"]), beams["AcrossTrack_m"]
        forward = np.deg2rad(beams.get("BeamAngleForward_deg", np.full(len(angle), 90.0)))
        some = np.abs(across) > 0.1 * np.abs(across).max(initial=0.0)
        if not some.any() or np.mean(np.sin(angle[some]) * np.cos(forward[some]) * across[some] > 0) <= LEVEL:
            return np.pi / 2 - forward, (1.0 if np.sum(np.sin(angle) * across) >= 0 else -1.0) * angle
        away = np.stack([np.sin(angle) * np.sin(forward), np.sin(angle) * np.cos(forward), np.cos(angle)], -1)
        body = away @ turned(place["roll"], place["pitch"])
        along, starboard = (turned(*self._array(prefix, "MOUNTING", which))[:, axis]
                            for prefix, which, axis in (("", 0, 0), ("RX_", head, 1)))
        return tuple(np.arcsin(np.clip(body @ axis, -1, 1)) for axis in (along, starboard))

    def _head_speed(self, own, place):
        """Return the sound speed at the head: the sounder's own word, else the cast's at its depth."""
        for name in ("SoundSpeedAtTxDepth_mPerSec", "SurfaceVelocity_mps"):
            value = float(np.ravel(own.get(name, 0.0))[0])
            if 300 < value < 3000:
                return value
        arm = levelled(self._array("", "OFFSET"), place["roll"], place["pitch"])
        depth, speed = cast_of(self._cast)
        return float(np.interp(place["depth"] + arm[2], depth, speed))


def _shots(one) -> dict[str, np.ndarray]:
    """Return the table of sectors, where the sounder's own record has one."""
    table = (one.get("SensorSpecific") or {}).get("TxSectors")
    if not isinstance(table, dict) or not {*_SECTORS.values(), "TiltAngleReTx_deg"} <= set(table):
        return {}
    return {name: np.asarray(values) for name, values in table.items()} if len(table["CentreFreq_Hz"]) else {}


def _count(shots):
    return len(shots["CentreFreq_Hz"]) if shots else 0


def _numbers(text: str | None, first: int = 0, count: int = 3) -> np.ndarray:
    """Return some numbers of a parameter, 0 where it is not known."""
    numbers = np.zeros(count)
    for axis, part in enumerate((text or "").split(",")[first:first + count]):
        try:
            value = float(part)
        except ValueError:
            continue
        numbers[axis] = value if abs(value) < 1e4 else 0.0
    return numbers
