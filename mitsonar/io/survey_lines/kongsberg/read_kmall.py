"""KMALL files of Kongsberg's echo sounders as lines of soundings, block after block.

The sounder says where a sounding lies from the vessel's reference point, levelled, along its heading (#MRZ), and when
and under which angles it was heard. Angles in the file are positive to port, tilts positive towards an array's own
forward; travel times are from the sector's transmission. The motion sensor's samples (#SKM) are its own: its mounting
is taken out here. Extra detections, in the water column, are left out.
"""
from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import BinaryIO

import numpy as np

from ..assembly import MOST_BEAMS, MOST_SECTORS, AssembledLine, LineColumn, Ping, cast_of
from ..motion import motion_of
from ..places import across_and_along
from .kmall_datagrams import KmallDatagram, at, beams_of, column_of, datagrams, decoded, position_of
from .kongsberg_file import KongsbergFile
from .kongsberg_install import of_kmall

_BACKSCATTER = ("as the sounder gives it (reflectivity 1): its source level, beam patterns, spreading and absorption "
                "taken out, flattened near normal incidence and by Lambert's law where its operator asked for it")
_NORMAL = 0                        # type of a detection
WHOLE = ("txSectorNumb", "detectionType", "detectionMethod")
REAL = ("twoWayTravelTime_sec", "beamAngleReRx_deg", "z_reRefPoint_m", "y_reRefPoint_m", "x_reRefPoint_m",
        "reflectivity1_dB", "qualityFactor", "detectionUncertaintyVer_m", "detectionUncertaintyHor_m",
        "meanAbsCoeff_dbPerkm")
_ACTIVE = 1                        # of a sensor


@dataclass(kw_only=True, eq=False)
class _KmallRecords:
    """What the first walk through a file has found."""

    text: str = ""
    cast: np.ndarray | None = None
    model: int = 0
    soundings: dict = field(default_factory=dict)       # key -> where it is
    column: dict = field(default_factory=dict)
    positions: list = field(default_factory=list)
    attitude: dict = field(default_factory=dict)        # whether the sensor is active -> samples
    passed: set[str] = field(default_factory=set)
    extra: int = 0                                      # detections in the water column
    beams: int = 0
    sectors: int = 0
    column_beams: int = 0
    column_samples: int = 0


class KmallFile(KongsbergFile):
    """Read a .kmall file, with the .kmwcd file beside it for the water column."""

    def __init__(self, path: str, column_path: str | None, *, water_column: bool) -> None:
        super().__init__(path, column_path, water_column=water_column)
        found = self._found = self._walked()
        if not found.soundings:
            raise ValueError("it has no soundings (#MRZ).")
        self._installation = of_kmall(found.text)
        self._keys = sorted(found.soundings, key=lambda key: (*key[3:], key[2], key[1]))
        self._start = self._keys[0][3] + 1e-9 * self._keys[0][4]
        attitude = np.concatenate(found.attitude.get(True) or found.attitude.get(False) or [np.zeros((0, 5))])
        self._motion = motion_of(attitude[np.argsort(attitude[:, 0], kind="stable")],
                                 np.array(sorted(found.positions)).reshape(-1, 3), self._start,
                                 mounting=self._installation.motion_mounting, waterline=self._installation.waterline)

    @property
    def line(self) -> AssembledLine:
        """What the pings share."""
        found, installed, motion = self._found, self._installation, self._motion
        depth, speed = cast_of(found.cast)
        return AssembledLine(sonar=f"EM {found.model}", title=os.path.basename(self._paths[0]), start=self._start,
                    crs=motion.zone.crs, origin=motion.zone.origin, cast_depth=depth, cast_sound_speed=speed,
                    transmit_offset=installed.transmit_offset, transmit_mounting=installed.transmit_mounting,
                    receive_offset=installed.receive_offset, receive_mounting=installed.receive_mounting,
                    motion=motion.streams, backscatter=_BACKSCATTER, profile="the cast of the file", beams=found.beams,
                    sectors=found.sectors, column_beams=found.column_beams, column_samples=found.column_samples,
                    left_out=self._left_out(found.passed, ("MWC",), found.extra))

    def _walked(self):
        """Go through both files once."""
        found = _KmallRecords()
        for number, path in enumerate(self._paths):
            with open(path, "rb") as stream:
                kinds = ("IIP", "SVP", "SKM", "MRZ") if number == 0 else ()
                for one in datagrams(stream, (*kinds, "MWC") if self._water_column else kinds,
                                     found.passed if number == 0 else None):
                    _note(found, one, number)
        return found

    @np.errstate(invalid="ignore", over="ignore")      # of numbers that are none; `dataset` sorts them out
    def _ping(self, streams: Sequence[BinaryIO], key: tuple[int, ...]) -> Ping:
        installed = self._installation
        datagram = _read(streams, self._found.soundings[key])
        whole = decoded(datagram)
        info, receiver = whole["pingInfo"], whole["rxInfo"]
        count = receiver["numSoundingsMaxMain"]
        sounding = {name: np.asarray(values)[:count] for name, values in whole["sounding"].items()} if count else \
            {name: np.zeros(0, int if name in WHOLE else float) for name in (*WHOLE, *REAL)}
        head = whole["cmnPart"]["rxTransducerInd"]
        if head >= len(installed.receive_offset):
            raise ValueError(f"its ping {key[0]} is of receiver {head + 1} of {len(installed.receive_offset)}; it is "
                             "damaged.")
        waterline = info["z_waterLevelReRefPoint_m"]
        place = self._motion.at(datagram.time - self._start)
        place["depth"] = -waterline
        shots = {name: np.asarray(values) for name, values in whole["txSectorInfo"].items()}
        sectors = _sectors(shots, sounding)
        sectors["angle"] = np.deg2rad(shots["tiltAngleReTx_deg"]) * (-1.0 if installed.backwards else 1.0)
        if installed.transmit_parts.any():
            sectors["offset"] = installed.transmit_parts[np.minimum(shots["txSubArray"], 2)]
        sector = np.minimum(sounding["txSectorNumb"], sectors["angle"].size - 1)
        across, along = sounding["y_reRefPoint_m"], sounding["x_reRefPoint_m"]
        x, y = across_and_along(place["x"], place["y"], place["heading"], across, along)
        valid = (sounding["detectionType"] == _NORMAL) & (sounding["twoWayTravelTime_sec"] > 0)
        return Ping(
            place=place, head_sound_speed=info["soundSpeedAtTxDepth_mPerSec"], head=head, sectors=sectors,
            soundings={"valid": valid, "travel_time": sounding["twoWayTravelTime_sec"],
                       "angle": np.deg2rad(sounding["beamAngleReRx_deg"])
                       * (1.0 if installed.receive_backwards[head] else -1.0),
                       "transmit_angle": sectors["angle"][sector], "sector": sector,
                       "depth": sounding["z_reRefPoint_m"] - waterline, "x": x, "y": y, "across_track": across,
                       "along_track": along, "backscatter_db": sounding["reflectivity1_dB"],
                       "detection": np.where(valid, np.minimum(sounding["detectionMethod"], 2), 0),
                       "quality": 2 - np.log10(np.maximum(sounding["qualityFactor"], 1e-6)),
                       "uncertainty": sounding["detectionUncertaintyVer_m"],
                       "horizontal_uncertainty": sounding["detectionUncertaintyHor_m"]},
            column=self._column(streams, key, place, head, sectors["absorption_db"]) if self._water_column else None)

    def _column(self, streams, key, place, head, absorption):
        """Put the water column of a ping together."""
        where = self._found.column.get(key)
        if where is None:
            return None
        whole = decoded(_read(streams, where))
        receiver, beams = whole["rxInfo"], dict(whole["beamData"].items())
        rate, speed = receiver["sampleFreq_Hz"], receiver["soundVelocity_mPerSec"]
        if not (0 < rate < np.inf and 0 < speed < np.inf) or not beams:
            raise ValueError(f"its water column of ping {key[0]} has {rate:g} samples a second; it is damaged.")
        count, start = np.asarray(beams["numSampleData"]), np.asarray(beams["startRangeSampleNum"])
        sector = np.asarray(beams["beamTxSectorNum"])
        within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        reach = (np.repeat(start, count) + within + 0.5) * speed / (2 * rate)
        lost = np.repeat(absorption[np.minimum(sector, absorption.size - 1)], count)
        level = 0.5 * np.concatenate([np.asarray(values, np.int8) for values in beams["sampleAmplitude05dB_p"]]) \
            - receiver["TVGoffset_dB"] - receiver["TVGfunctionApplied"] * np.log10(reach) - 2 * lost * reach
        vertical = -np.deg2rad(np.asarray(beams["beamPointAngReVertical_deg"]))
        return LineColumn(angle=vertical + place["roll"] + self._installation.receive_mounting[head][0],
                      start=start / rate, rate=np.full(count.size, rate), sector=sector, count=count, level_db=level)


def _note(found: _KmallRecords, one: KmallDatagram, number: int) -> None:
    """Keep what a datagram says, or where it is."""
    where = (number, one.offset, len(one.raw))
    if one.kind == "MRZ":
        beams, sectors, extra = beams_of(one)
        if beams > MOST_BEAMS or not 0 < sectors <= MOST_SECTORS:
            raise ValueError(f"its ping {one.key[0]} says that it has {beams} soundings and {sectors} sectors; at most "
                             f"{MOST_BEAMS} and {MOST_SECTORS} are believed.")
        found.soundings[one.key] = where
        found.extra += extra
        found.beams, found.sectors = max(found.beams, beams), max(found.sectors, sectors)
        found.positions.append((one.time, *position_of(one)))
        found.model = one.model
    elif one.kind == "MWC":
        beams, samples = column_of(one)
        if beams > MOST_BEAMS:
            raise ValueError(f"its water column of ping {one.key[0]} says that it has {beams} beams; at most "
                             f"{MOST_BEAMS} are believed.")
        found.column[one.key] = where
        found.column_beams = max(found.column_beams, beams)
        found.column_samples = max(found.column_samples, samples)
    elif one.kind == "IIP" and not found.text:
        found.text = one.raw[26:-4].decode("utf-8", "replace")
    elif one.kind == "SVP" and found.cast is None:
        nodes = decoded(one)["sensorData"]
        found.cast = np.column_stack([nodes["depth_m"], nodes["soundVelocity_mPerSec"]]) if nodes else None
    elif one.kind == "SKM":
        whole = decoded(one)
        samples = whole["sample"]["KMdefault"]
        if samples:
            angles = [np.deg2rad(samples[name]) for name in ("roll_deg", "pitch_deg", "heading_deg")]
            found.attitude.setdefault(bool(whole["infoPart"]["sensorStatus"] & _ACTIVE), []).append(
                np.column_stack([samples["dgtime"], *angles, samples["heave_m"]]))


def _sectors(shots, sounding):
    """Return what sectors are like, by the record's names."""
    absorption = [_mean(1e-3 * sounding["meanAbsCoeff_dbPerkm"][sounding["txSectorNumb"] == number])
                  for number in shots["txSectorNumb"]]
    return {"frequency": shots["centreFreq_Hz"], "delay": shots["sectorTransmitDelay_sec"],
            "pulse_length": shots["totalSignalLength_sec"], "bandwidth": shots["signalBandWidth_Hz"],
            "source_level_db": shots["txNominalSourceLevel_dB"], "absorption_db": np.array(absorption)}


def _mean(values):
    return float(np.mean(values)) if values.size else 0.0


def _read(streams, where):
    number, offset, length = where
    return at(streams[number], offset, length)
