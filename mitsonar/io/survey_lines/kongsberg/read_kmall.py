"""Read Kongsberg .kmall files as lines of soundings.

The sounder gives the position of a sounding relative to the vessel's reference point, levelled, along its heading, with
travel time and angles (#MRZ). Angles in the file are positive to port, tilts positive towards an array's own forward;
travel times are from the transmission of the sector. Samples of the motion sensor (#SKM) are relative to the sensor:
its mounting is corrected here. Depths are below the surface, or below the datum of a tide that the writer of these
files put into #SHI. Extra detections, in the water column, are left out.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import BinaryIO

import numpy as np

from ..assembly import LineCast, LineColumn, LineSnippets, Ping
from ..motion import motion_of
from ..places import across_and_along
from .kmall_datagrams import KmallDatagram, at, beams_of, column_of, datagrams, decoded, position_of, tide_of
from .kongsberg_file import KongsbergFile, KongsbergRecords
from .kongsberg_install import of_kmall

_NORMAL = 0                        # type of a detection
WHOLE = ("txSectorNumb", "detectionType", "detectionMethod")
REAL = ("twoWayTravelTime_sec", "beamAngleReRx_deg", "z_reRefPoint_m", "y_reRefPoint_m", "x_reRefPoint_m",
        "reflectivity1_dB", "qualityFactor", "detectionUncertaintyVer_m", "detectionUncertaintyHor_m",
        "meanAbsCoeff_dbPerkm")
_ACTIVE = 1                        # of a sensor
NO_SAMPLE = -32_768                # of a seabed image
NO_HEIGHT = -999.0                 # [m] above the ellipsoid: there is none


class KmallFile(KongsbergFile):
    """Read a .kmall file, with the .kmwcd file beside it for the water column."""

    BACKSCATTER = ("as the sounder gives it (reflectivity 1): its source level, beam patterns, spreading and "
                   "absorption taken out, flattened near normal incidence and by Lambert's law where its operator "
                   "asked for it")
    COLUMN_KIND = "MWC"

    def __init__(self, path: str, column_path: str | None, *, water_column: bool) -> None:
        super().__init__(path, column_path, water_column=water_column)
        found = self._found
        if not found.soundings:
            raise ValueError("it has no soundings (#MRZ).")
        self._installation = of_kmall(found.text)
        self._heads = len(self._installation.receive_offset)
        self._keys = sorted(found.soundings, key=lambda key: (*key[3:], key[2], key[1]))
        self._start = self._keys[0][3] + 1e-9 * self._keys[0][4]
        self._motion = motion_of(found.samples(True, False), np.array(sorted(found.positions)).reshape(-1, 3),
                                 self._start, mounting=self._installation.motion_mounting,
                                 waterline=self._installation.waterline)
        self._tides = np.array(sorted(found.tides)).reshape(-1, 2)
        if len(self._tides):
            streams = self._motion.streams
            self._motion = replace(self._motion, streams=streams | {
                "depth": streams["depth"] - np.interp(streams["time"] + self._start, *self._tides.T)})

    def _walk(self, stream: BinaryIO, number: int) -> None:
        kinds = ("IIP", "SVP", "SKM", "SHI", "MRZ") if number == 0 else ()
        for datagram in datagrams(stream, (*kinds, "MWC") if self._water_column else kinds,
                                  self._found.passed if number == 0 else None):
            _note(self._found, datagram, number)

    @np.errstate(invalid="ignore", over="ignore")      # `dataset` removes NaN and infinity
    def _ping(self, streams: Sequence[BinaryIO], key: tuple[int, ...]) -> Ping:
        installed = self._installation
        datagram = _read(streams, self._found.soundings[key])
        content = decoded(datagram)
        info, receiver = content["pingInfo"], content["rxInfo"]
        count = receiver["numSoundingsMaxMain"]
        sounding = {name: np.asarray(values)[:count] for name, values in content["sounding"].items()} if count else \
            {name: np.zeros(0, int if name in WHOLE else float) for name in (*WHOLE, *REAL)}
        head = content["cmnPart"]["rxTransducerInd"]
        if head >= self._heads:
            raise ValueError(f"its ping {key[0]} is of receiver {head + 1} of {self._heads}; it is damaged.")
        waterline = info["z_waterLevelReRefPoint_m"]
        place = self._motion.at(datagram.time - self._start)
        # A tide is stated where it changes, and holds until then.
        stated = np.searchsorted(self._tides[:, 0], datagram.time + 1e-6)
        level = float(self._tides[max(stated - 1, 0), 1]) if len(self._tides) else 0.0
        place["depth"] = -waterline - level
        height = info["ellipsoidHeightReRefPoint_m"]
        shots = {name: np.asarray(values) for name, values in content["txSectorInfo"].items()}
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
            levels={"tide": level, "ping_height": height if height > NO_HEIGHT else np.nan},
            soundings={"valid": valid, "travel_time": sounding["twoWayTravelTime_sec"],
                       "angle": np.deg2rad(sounding["beamAngleReRx_deg"])
                       * (1.0 if installed.receive_backwards[head] else -1.0),
                       "transmit_angle": sectors["angle"][sector], "sector": sector,
                       "depth": sounding["z_reRefPoint_m"] - waterline - level, "x": x, "y": y, "across_track": across,
                       "along_track": along, "backscatter_db": sounding["reflectivity1_dB"],
                       "detection": np.where(valid, np.minimum(sounding["detectionMethod"], 2), 0),
                       "quality": 2 - np.log10(np.maximum(sounding["qualityFactor"], 1e-6)),
                       "uncertainty": sounding["detectionUncertaintyVer_m"],
                       "horizontal_uncertainty": sounding["detectionUncertaintyHor_m"]},
            snippets=_snippets(content, valid) if self._water_column and self._found.snippet_samples else None,
            column=self._column(streams, key, place, head, sectors["absorption_db"]) if self._water_column else None)

    def _column(self, streams, key, place, head, absorption) -> LineColumn | None:
        where = self._found.column.get(key)
        if where is None:
            return None
        content = decoded(_read(streams, where))
        receiver, beams = content["rxInfo"], dict(content["beamData"].items())
        if not beams:
            raise ValueError(f"its water column of ping {key[0]} has no beams; it is damaged.")
        samples = np.concatenate([np.asarray(values, np.int8) for values in beams["sampleAmplitude05dB_p"]])
        return self._column_of(
            key[0], place, head, absorption, rate=receiver["sampleFreq_Hz"], speed=receiver["soundVelocity_mPerSec"],
            angle=np.asarray(beams["beamPointAngReVertical_deg"]), start=np.asarray(beams["startRangeSampleNum"]),
            count=np.asarray(beams["numSampleData"]), sector=np.asarray(beams["beamTxSectorNum"]), samples=samples,
            offset=receiver["TVGoffset_dB"], spreading=receiver["TVGfunctionApplied"])


def _note(found: KongsbergRecords, datagram: KmallDatagram, number: int) -> None:
    """Keep the contents of a datagram, or its place in file ``number``."""
    where = (number, datagram.offset, len(datagram.raw))
    if datagram.kind == "MRZ":
        beams, sectors, extra, snippet = beams_of(datagram)
        found.snippet_samples = max(found.snippet_samples, snippet)
        if not sectors:
            raise ValueError(f"its ping {datagram.key[0]} has no sectors; it is damaged.")
        found.note_ping(datagram.key[0], beams, sectors)
        found.soundings[datagram.key] = where
        found.extra += extra
        longitude, latitude, height = position_of(datagram)
        found.positions.append((datagram.time, longitude, latitude))
        found.heights |= height > NO_HEIGHT
        found.model = datagram.model
    elif datagram.kind == "MWC":
        found.note_column(datagram.key[0], *column_of(datagram))
        found.column[datagram.key] = where
    elif datagram.kind == "IIP" and not found.text:
        found.text = datagram.raw[26:-4].decode("utf-8", "replace")
    elif datagram.kind == "SVP":
        content = decoded(datagram)
        if nodes := content["sensorData"]:
            found.casts.append(LineCast.at(
                datagram.time, float(content["latitude_deg"]), float(content["longitude_deg"]),
                np.column_stack([nodes["depth_m"], nodes["soundVelocity_mPerSec"]])))
    elif datagram.kind == "SHI":
        if (tide := tide_of(datagram)) is not None:
            found.tides.append((datagram.time, tide[0]))
            found.datum = "" if tide[1] == "datum" else tide[1]
        else:
            found.passed.add("SHI")
    elif datagram.kind == "SKM":
        content = decoded(datagram)
        if samples := content["sample"]["KMdefault"]:
            angles = [np.deg2rad(samples[name]) for name in ("roll_deg", "pitch_deg", "heading_deg")]
            found.attitude.setdefault(bool(content["infoPart"]["sensorStatus"] & _ACTIVE), []).append(
                np.column_stack([samples["dgtime"], *angles, samples["heave_m"]]))


def _sectors(shots, sounding):
    """Return the sectors by the names of the record; each has the mean absorption of its soundings."""
    values = [1e-3 * sounding["meanAbsCoeff_dbPerkm"][sounding["txSectorNumb"] == number]
              for number in shots["txSectorNumb"]]
    absorption = [float(np.mean(of_sector)) if of_sector.size else 0.0 for of_sector in values]
    return {"frequency": shots["centreFreq_Hz"], "delay": shots["sectorTransmitDelay_sec"],
            "pulse_length": shots["totalSignalLength_sec"], "bandwidth": shots["signalBandWidth_Hz"],
            "source_level_db": shots["txNominalSourceLevel_dB"], "absorption_db": np.array(absorption)}


def _snippets(content, valid) -> LineSnippets | None:
    """Return the seabed image of a ping; the sample of the sounding, not the first, has a time in the file."""
    rate, soundings = content["rxInfo"]["seabedImageSampleRate"], content["sounding"]
    if not 0 < rate < np.inf:
        return None
    centre, count, time = (np.asarray(soundings[name])[:valid.size] for name in (
        "SIcentreSample", "SInumSamples", "twoWayTravelTime_sec"))
    # Those of rejected beams are left out, as all else of them.
    level = np.asarray(content["SIsample_desidB"], float)[:int(count.sum())][np.repeat(valid, count)]
    return LineSnippets(rate=rate, start=np.where(valid & (count > 0), time - centre / rate, np.nan),
                        count=np.where(valid, count, 0), level_db=np.where(level > NO_SAMPLE, 0.1 * level, np.nan))


def _read(streams, where):
    number, offset, length = where
    return at(streams[number], offset, length)
