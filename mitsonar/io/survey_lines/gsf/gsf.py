"""Write a line of soundings in Generic Sensor Format (GSF) 03.09.

Records follow the specification 03.06 (Leidos, 2014). Each is a multiple of four bytes long, 512 KiB at most; angles
outside pings are hundredths of degrees, heave and offsets hundredths of metres.

Arrays of beams are whole multiples of a step: depth, across and along track 0.1 mm, travel time 10 ns (up to 42.9 s),
angles 0.003 and 0.006 degrees, amplitudes 0.01 dB, errors 1 mm, quality 0.02. Positions are 1e-7 degrees (1 cm).

    beam_angle          from the vertical       beam_angle_forward   azimuth, counterclockwise from starboard
    vertical_error      1.96 sigma              horizontal_error     2.448 sigma / sqrt(2)      (95 %)
    tide_corrector      - water level above the datum; gps_tide_corrector instead where depths follow from heights
"""
from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from functools import partial
from typing import IO, Any

import numpy as np
from GSFU.gsfu import GSF_MAX_RECORD_SIZE, gsf

from mitsonar.device.files import FilePath, replacing
from mitsonar.device.rotations import mounted
from mitsonar.units import deg_from_radians, knots_from_metres_per_second

from ..directions import level
from ..lines import (
    HEADS,
    HEIGHTS,
    RESPONSE,
    SOUNDINGS,
    Blocks,
    LineToWrite,
    Ping,
    Place,
    Written,
    cycled,
    formed,
    line_of,
)
from ..passage import LinePassage, passage_of
from ..snippets import runs_of
from ..swath_figures import swath_figures

VERSION = "GSF-v03.09"
ATTITUDE_SECONDS = 10.0                    # of an attitude record; the format allows 65
NOT_APPLIED = ("DRAFT", "PITCH", "ROLL", "GYRO")
MOST_RECEIVERS = 2
OFFSETS = ("POSITION", "ANTENNA", "MRU", "CENTER_OF_ROTATION", "DEPTH_SENSOR")
KMALL_SPECIFIC = 156
MOST_SECTORS = 9
# Multiplier, offset, bytes, signed, by the number of the array in the format.
SCALES = {1: (1e4, 0.0, 4, False), 2: (1e4, 0.0, 4, True), 3: (1e4, 0.0, 4, True), 4: (1e8, 0.0, 4, False),
          5: (300.0, 0.0, 2, True), 6: (100.0, 0.0, 2, True), 9: (50.0, 0.0, 1, False), 18: (180.0, 0.0, 2, False),
          19: (1e3, 0.0, 2, False), 20: (1e3, 0.0, 2, False), 22: (1.0, 0.0, 1, False), 23: (1.0, 0.0, 1, False),
          27: (1e3, 0.0, 2, False), 28: (1e3, 0.0, 2, False), 30: (100.0, 0.0, 2, False)}
LARGEST_ERROR = 65.0                               # [m]
ERRORS = (("uncertainty", "VerticalError_m", "SonarVertUncert_m", 1.960),
          ("horizontal_uncertainty", "HorizontalError_m", "SonarHorzUncert_m", 2.448 / np.sqrt(2)))
SILENCE, STEPS = 20_000, 100                       # of samples: value of 0 dB, steps per dB
NO_HEIGHT = 9999.99                                # [m] that stands for none


class GsfWriter(gsf):
    """Writer of GSF records to an open stream."""

    def __init__(self, stream: IO[bytes]) -> None:
        super().__init__()
        self.FID = stream
        self.write_header({"Version": VERSION})

    def write_record(self, record_id: Any, payload: bytes, checksum: bool = False) -> None:
        """Append a record, padded to four bytes."""
        padded = payload + bytes(-len(payload) % 4)
        if len(padded) + 8 > GSF_MAX_RECORD_SIZE:
            raise ValueError(f"a ping takes {len(padded)} bytes, more than the {GSF_MAX_RECORD_SIZE} of a GSF record; "
                             "give the line without snippets, or write a .kmall.")
        super().write_record(record_id, padded, checksum)


def order_of(line: LineToWrite) -> np.ndarray:
    """Return the numbers (R,) of the receive arrays from port to starboard, the order of GSF, two at most."""
    return np.argsort(line.receivers[0][:, 1], kind="stable")[:MOST_RECEIVERS]


def parameters(line: LineToWrite, passage: LinePassage) -> dict[str, Any]:
    """Return the processing parameters: all corrections are marked as applied."""
    zero, zeros = "+0.000", "+0.000,+0.000,+0.000"
    tidal, gnss = ("YES" if held else "NO" for held in ("tide" in line.first, by_height(line)))
    values = {"REFERENCE TIME": "1970/001 00:00:00", "PLATFORM_TYPE": "SURFACE_SHIP", "FULL_RAW_DATA": "TRUE",
              "ROLL_COMPENSATED": "YES", "PITCH_COMPENSATED": "YES", "HEAVE_COMPENSATED": "YES",
              "TIDE_COMPENSATED": tidal, "NUMBER_OF_RECEIVERS": f"{len(order_of(line))}", "NUMBER_OF_TRANSMITTERS": "1",
              "DEPTH_CALCULATION": "CORRECTED", "RAY_TRACING": "YES", "MSB_APPLIED_TO_ATTITUDE": "NO",
              "HEAVE_REMOVED_FROM_GPS_TC": gnss, "UTC_OFFSET": "0", "ROLL_REFERENCE": "ROTATED"}
    values |= {f"{name}_TO_APPLY": zero for name in NOT_APPLIED}
    values |= {f"{name}_OFFSET_TO_APPLY": zeros for name in (*OFFSETS, "TRANSDUCER", "RX_TRANSDUCER")}
    values |= {"APPLIED_DRAFT": f"{passage.draught:+.3f}"}
    values |= {f"APPLIED_{name}_OFFSET": zeros for name in OFFSETS}
    transmitter = line.array("transmit_offset")[None], line.array("transmit_mounting")[None]
    receivers = tuple(array[order_of(line)] for array in line.receivers)
    for prefix, (offsets, mountings) in (("", transmitter), ("RX_", receivers)):
        values[f"APPLIED_{prefix}TRANSDUCER_OFFSET"] = _text(offsets)
        values |= {f"APPLIED_{prefix}TRANSDUCER_{name}_OFFSET": _text(deg_from_radians(angle))
                   for name, angle in zip(("ROLL", "PITCH", "HEADING"), mountings.T)}
    values |= {f"APPLIED_{name}_LATENCY": zero for name in ("POSITION", "ATTITUDE", "DEPTH_SENSOR")}
    values |= {"GEOID": "WGS-84", "TIDAL_DATUM": line.datum or "UNKNOWN"}
    return {"ParamTime": passage.time[0], "Parameters": values}


def _text(numbers: np.ndarray) -> str:
    return ",".join(f"{value:+.4f}" for value in np.ravel(numbers))


def cast(line: LineToWrite, passage: LinePassage) -> dict[str, Any]:
    """Return the sound-velocity profile."""
    return {"ObservationTime": passage.time[0], "ApplicationTime": passage.time[0],
            "Latitude_deg": float(passage.latitude[0]), "Longitude_deg": float(passage.longitude[0]),
            "Depth_m": np.maximum(line.array("cast_depth"), 0.0), "SoundSpeed_mPerSec": line.array("cast_sound_speed")}


def by_height(line: LineToWrite) -> bool:
    """Return True if depths were reduced by heights above the ellipsoid."""
    return line.first.attrs.get("heights") == "gnss"


def attitudes(passage: LinePassage) -> Iterator[tuple[float, Callable[[], dict[str, Any]]]]:
    """Yield the ends [s since 1970] of attitude records of ten seconds, and functions that make them then."""
    record = np.floor((passage.time - passage.time[0]) / ATTITUDE_SECONDS)
    nanoseconds = np.rint(passage.time * 1e9).astype("int64").view("datetime64[ns]")

    def made(part: slice) -> dict[str, Any]:
        return {"Time": nanoseconds[part], "Pitch_deg": deg_from_radians(passage.pitch[part]),
                "Roll_deg": deg_from_radians(passage.roll[part]), "Heave_m": passage.heave(part),
                "Heading_deg": deg_from_radians(passage.heading[part]) % 360.0}

    first = np.flatnonzero(np.diff(record, prepend=-1.0))
    for begin, end in zip(first, [*first[1:], record.size]):
        yield float(passage.time[end - 1]), partial(made, slice(begin, end))


def comments(line: LineToWrite, passage: LinePassage) -> Iterator[dict[str, Any]]:
    """Yield the comments: the origin of the line, and definitions that the format leaves open."""
    below = f"the datum {line.datum}".strip() if line.datum or "tide" in line.first else "the still surface"
    for text in (line.provenance(), line.placed,
                 f"depths are below {below}, across and along track about the reference point; depths below the "
                 "surface and the tide corrector add up to them; heave is "
                 "positive upwards; beam angles are from the vertical, beam angles forward counterclockwise from "
                 "starboard; quality factor is log10 of depth over its spread; detection info 0 none, 1 amplitude, "
                 "2 phase; mean calibrated amplitude is bottom backscattering strength; intensity series are the same, "
                 "(value - 20000) / 100 dB, 0 for none"):
        if text:
            plain = text.replace("µ", "u").encode("ascii", "replace").decode("ascii")
            yield {"CommentTime": passage.time[0], "Comment": plain + "\0"}


def swath(line: LineToWrite, passage: LinePassage, ping: Ping) -> dict[str, Any]:
    """Return the record of a ping in the terms of GSFU."""
    course, speed = passage.way(ping["since"])
    roll, pitch = float(ping["ping_roll"]), float(ping["ping_pitch"])
    array = ping["below_surface"] + mounted(line.array("transmit_offset"), roll, pitch)[2]
    record = {"PingTime": float(ping["since"]), "Longitude_deg": float(ping["ping_longitude"]),
              "Latitude_deg": float(ping["ping_latitude"]), "NumberBeams": ping["valid"].size,
              "CenterBeam": int(np.argmin(np.abs(ping["angle"]))) if ping["valid"].size else 0, "PingFlags": 0,
              **_heights(line, ping), "DepthCorrector_m": float(array), "Roll_deg": np.degrees(roll),
              "Pitch_deg": np.degrees(pitch), "Heading_deg": float(np.degrees(ping["true_heading"]) % 360.0),
              "Heave_m": passage.draught - ping["below_surface"], "Course_deg": float(np.degrees(course)),
              "Speed_kn": float(knots_from_metres_per_second(speed)), "Beams": _beams(line, ping),
              "SensorSpecificID": KMALL_SPECIFIC, "SensorSpecific": _specific(line, ping, float(array))}
    series = _series(ping)
    return record if series is None else record | {"IntensityTimeSeries": series}


def _heights(line, ping):
    """Return the correctors of the tide, and heights above the ellipsoid."""
    gnss = by_height(line)
    height, separation = (float(ping.get(name, np.nan)) for name in ("ping_height", "separation"))
    return {"TideCorrector_m": 0.0 if gnss else -ping["level"], "GPSTideCorrector_m": -ping["level"] if gnss else 0.0,
            "Height_m": height if np.isfinite(height) else NO_HEIGHT,
            "SEP_m": separation if np.isfinite(separation) else NO_HEIGHT}


def _beams(line, ping):
    away, valid = level(line, ping), ping["valid"]
    beams = {"Depth_m": np.maximum(np.where(valid, ping["depth"], 0.0), 0.0), "AcrossTrack_m": ping["across_track"],
             "AlongTrack_m": ping["along_track"], "TravelTime_s": ping["travel_time"],
             "BeamAngle_deg": deg_from_radians(np.arccos(np.clip(away[:, 2], -1.0, 1.0))),
             "BeamAngleForward_deg": deg_from_radians(np.arctan2(away[:, 0], away[:, 1])) % 360.0,
             "SectorNumber": ping["sector"], "MeanAbsCoeff": 1e3 * ping["sector_absorption_db"][ping["sector"]]}
    if "backscatter_db" in ping:
        beams["MeanCalAmplitude_dB"] = ping["backscatter_db"]
    if "detection" in ping:
        beams["DetectionInfo"] = ping["detection"]
    if "quality" in ping:
        beams["QualityFactor"] = np.clip(ping["quality"], 0.0, 5.1)
    for name, array, own, factor in ERRORS:
        if name in ping:
            beams |= {array: np.clip(factor * ping[name], 0.0, LARGEST_ERROR),
                      own: np.clip(ping[name], 0.0, LARGEST_ERROR)}
    beams = {name: np.where(np.isfinite(values), values, 0.0) for name, values in beams.items()}
    return beams | {"BeamFlags": np.where(valid, 0, 1).astype(np.uint8)}


def _specific(line, ping, array):
    """Return the sensor-specific record of a KMALL sounder, since GSF has no generic record of sectors."""
    low = ping["sector_frequency"] - ping["sector_bandwidth"] / 2
    high = ping["sector_frequency"] + ping["sector_bandwidth"] / 2
    length = ping["sector_pulse_length"]
    across = ping["across_track"][ping["valid"]] if ping["valid"].any() else np.zeros(1)
    runs = runs_of(ping)
    rates = ping.get("column_rate", np.zeros(0))
    rates = rates[np.isfinite(rates)]
    head = int(np.argmax(order_of(line) == int(ping.get("head", 0))))
    height = float(ping.get("ping_height", np.nan))
    figures = {name[0].upper() + name[1:]: value for name, value in swath_figures(ping).items()}
    specific = figures | {"DgmType": 1, "DgmVersion": 3, "NumBytesCmnPart": 12, "PingCnt": 1 + ping["cycle"] % 65_535,
                "RxFansPerPing": ping["fans"], "RxFanIndex": ping["fan"], "SwathsPerPing": ping["swaths"],
                "SwathAlongPosition": ping["swath"], "RxTransducerInd": head, "PingRate_Hz": ping["rate"],
                "EllipsoidHeightReRefPoint_m": height if np.isfinite(height) else 0.0,
                "NumRxTransducers": len(order_of(line)), "NumBytesInfoData": 152,
                "FrequencyMode_Hz": float(ping["sector_frequency"].mean()),
                "FreqRangeLowLim_Hz": float(low.min()), "FreqRangeHighLim_Hz": float(high.max()),
                "MaxTotalTxPulseLength_sec": float(length.max()), "MaxEffTxPulseLength_sec": float(length.max()),
                "MaxEffTxBandWidth_Hz": float(ping["sector_bandwidth"].max()),
                "AbsCoeff_dBPerkm": 1e3 * float(ping["sector_absorption_db"].mean()),
                "PortMeanCov_m": float(max(-across.min(), 0.0)), "StarbMeanCov_m": float(max(across.max(), 0.0)),
                "HeadingVessel_deg": float(np.degrees(ping["true_heading"]) % 360.0),
                "SoundSpeedAtTxDepth_mPerSec": float(ping["head_sound_speed"]),
                "TxTransducerDepth_m": min(array, 2000.0), "LatLongInfo": 1,
                "ZWaterLevelReRefPoint_m": max(-ping["below_surface"], -2000.0),
                "Latitude_deg": float(ping["ping_latitude"]),
                "Longitude_deg": float(ping["ping_longitude"]), "NumBytesRxInfo": 32,
                "NumSoundingsMaxMain": ping["valid"].size, "NumSoundingsValidMain": int(ping["valid"].sum()),
                "NumBytesPerSounding": 120, "SeabedImageSampleRate": 0.0 if runs is None else runs.rate,
                "WCSampleRate": float(rates[0]) if rates.size else 0.0,
                "BSnormal_dB": float(ping.get("normal_incidence_db", figures["BSnormal_dB"])),
                "BSoblique_dB": float(ping.get("oblique_incidence_db", figures["BSoblique_dB"]))}
    sectors = {"TxSectorNumb": np.arange(length.size), "SectorTransmitDelay_sec": ping["sector_delay"],
               "TiltAngleReTx_deg": np.degrees(ping["sector_angle"]), "CentreFreq_Hz": ping["sector_frequency"],
               "TxNominalSourceLevel_dB": ping["sector_source_level_db"], "TotalSignalLength_sec": length,
               "SignalBandWidth_Hz": ping["sector_bandwidth"], "EffectiveSignalLength_sec": length}
    return specific | {"TxSectors": {name: values[:MOST_SECTORS] for name, values in sectors.items()}}


def _series(ping):
    """Return the intensity series of the snippets, None if there are none."""
    runs = runs_of(ping)
    if runs is None or not runs.count.size:
        return None
    beam = np.repeat(np.arange(runs.count.size), runs.count)
    position = np.arange(beam.size) - (np.cumsum(runs.count) - runs.count)[beam]
    level = np.clip(np.rint(STEPS * runs.values) + SILENCE, 1, 65_535)
    return {"BitsPerSample": 16, "AppliedCorrections": 0, "Beams": {"DetectRangeSample": runs.start + runs.centre},
            "Samples": {"Beam": beam, "RangeSample": runs.start[beam] + position,
                        "Value": np.where(np.isfinite(level), level, 0.0).astype(np.int64)}}


def write(blocks: Blocks, path: FilePath, *, place: Place | None = None, start: str | None = None) -> Written:
    """Write a line of soundings as GSF; arguments, result and errors are those of `mitsonar.io.survey_lines.write`.

    Raises ValueError also for a ping that does not fit into a record.
    """
    line, remaining = line_of(blocks, place=place, start=start)
    passage = passage_of(line)
    number = soundings = 0
    empty: list[float] = []
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    time = passage.time[0]
    waiting = attitudes(passage)
    due = next(waiting, None)
    with replacing(path) as temporary, open(temporary, "wb") as stream:
        file = GsfWriter(stream)
        for comment in comments(line, passage):
            file.write_comment(comment)
        file.write_processing_parameters(parameters(line, passage))
        file.write_sound_velocity_profile(cast(line, passage))
        for ping in cycled(formed(line, remaining, empty), line.receivers[0]):
            passage.note(ping)
            while due is not None and due[0] <= ping["since"]:
                file.write_attitude(due[1]())
                due = next(waiting, None)
            record = swath(line, passage, ping)
            try:
                file.write_swath_bathymetry_ping(record, SCALES)
            except (struct.error, OverflowError, ValueError) as error:
                raise ValueError(f"ping {number} does not go into a GSF record: {error}; check its values, or write a "
                                 ".nc.") from None
            points = np.stack([ping["latitude"], ping["longitude"], ping["depth"]])[:, ping["valid"]]
            low = np.minimum(low, points.min(1, initial=np.inf))
            high = np.maximum(high, points.max(1, initial=-np.inf))
            number, soundings, time = number + 1, soundings + points.shape[1], float(ping["since"])
        while due is not None:
            file.write_attitude(due[1]())
            due = next(waiting, None)
        if soundings:
            file.write_swath_bathy_summary({
                "StartTime": line.start + float(line.first["ping_time"][0]), "EndTime": time,
                "MinLatitude_deg": low[0], "MinLongitude_deg": low[1], "MinDepth_m": low[2],
                "MaxLatitude_deg": high[0], "MaxLongitude_deg": high[1], "MaxDepth_m": high[2]})
    held = SOUNDINGS | RESPONSE | HEIGHTS | {"separation"} | (
        HEADS if len(line.receivers[0]) <= MOST_RECEIVERS else set())
    sectors = line.first.sizes["transmission"]
    few = f"GSF holds {MOST_SECTORS} of the {sectors} sectors" if sectors > MOST_SECTORS else ""
    return Written(pings=number, soundings=soundings, words=line.remarks("GSF", held, len(empty), few))
