"""A ping of soundings as GSF has it: the header, arrays of beams, the sectors, the intensity series.

Arrays are whole numbers of a scale: depth, across and along track 0.1 mm, travel time 10 ns (up to 42.9 s), angles
0.003 and 0.006 degrees, amplitudes 0.01 dB, errors 1 mm, quality 0.02. Positions are 1e-7 degrees (1 cm).

    beam_angle          from the vertical       beam_angle_forward   azimuth, counterclockwise from starboard
    vertical_error      1.96 sigma              horizontal_error     2.448 sigma / sqrt(2)      (95 %)
"""
from __future__ import annotations

from typing import Any

import numpy as np

from ...units import deg_from_radians, knots_from_metres_per_second
from .directions import level
from .gsf_records import order_of
from .lines import Line, Ping, rotation
from .passage import Passage
from .snippets import runs_of

__all__ = ["MOST_SECTORS", "SCALES", "swath"]

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
SILENCE, STEPS = 20_000, 100                       # of samples: value of 0 dB, steps a dB


def swath(line: Line, passage: Passage, ping: Ping, number: int) -> dict[str, Any]:
    """Give the record of a ping, as GSFU takes it."""
    course, speed = passage.way(ping["since"])
    roll, pitch = float(ping["ping_roll"]), float(ping["ping_pitch"])
    array = ping["ping_depth"] + (rotation(roll, pitch, 0.0) @ line.array("transmit_offset"))[2]
    record = {"PingTime": float(ping["since"]), "Longitude_deg": float(ping["ping_longitude"]),
              "Latitude_deg": float(ping["ping_latitude"]), "NumberBeams": ping["valid"].size,
              "CenterBeam": int(np.argmin(np.abs(ping["angle"]))) if ping["valid"].size else 0, "PingFlags": 0,
              "TideCorrector_m": 0.0, "DepthCorrector_m": float(array), "Roll_deg": np.degrees(roll),
              "Pitch_deg": np.degrees(pitch), "Heading_deg": float(np.degrees(ping["true_heading"]) % 360.0),
              "Heave_m": float(passage.draught - ping["ping_depth"]), "Course_deg": float(np.degrees(course)),
              "Speed_kn": float(knots_from_metres_per_second(speed)), "Beams": _beams(line, ping),
              "SensorSpecificID": KMALL_SPECIFIC, "SensorSpecific": _specific(line, ping, number, float(array))}
    series = _series(ping)
    return record if series is None else record | {"IntensityTimeSeries": series}


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


def _specific(line, ping, number, array):
    """What KMALL says of a ping: GSF has no generic record of sectors."""
    low = ping["sector_frequency"] - ping["sector_bandwidth"] / 2
    high = ping["sector_frequency"] + ping["sector_bandwidth"] / 2
    length = ping["sector_pulse_length"]
    across = ping["across_track"][ping["valid"]] if ping["valid"].any() else np.zeros(1)
    runs = runs_of(ping)
    rates = ping.get("column_rate", np.zeros(0))
    rates = rates[np.isfinite(rates)]
    head = int(np.argmax(order_of(line) == int(ping.get("head", 0))))
    specific = {"DgmType": 1, "DgmVersion": 3, "NumBytesCmnPart": 12, "PingCnt": 1 + number % 65_535,
                "RxFansPerPing": 1, "RxFanIndex": head, "SwathsPerPing": 1, "RxTransducerInd": head,
                "NumRxTransducers": len(order_of(line)), "NumBytesInfoData": 152,
                "FrequencyMode_Hz": float(ping["sector_frequency"].mean()),
                "FreqRangeLowLim_Hz": float(low.min()), "FreqRangeHighLim_Hz": float(high.max()),
                "MaxTotalTxPulseLength_sec": float(length.max()), "MaxEffTxPulseLength_sec": float(length.max()),
                "MaxEffTxBandWidth_Hz": float(ping["sector_bandwidth"].max()),
                "AbsCoeff_dBPerkm": 1e3 * float(ping["sector_absorption_db"].mean()),
                "PortMeanCov_m": float(max(-across.min(), 0.0)), "StarbMeanCov_m": float(max(across.max(), 0.0)),
                "HeadingVessel_deg": float(np.degrees(ping["true_heading"]) % 360.0),
                "SoundSpeedAtTxDepth_mPerSec": float(ping["head_sound_speed"]),
                "TxTransducerDepth_m": min(array, 2000.0), "ZWaterLevelReRefPoint_m": max(-ping["ping_depth"], -2000.0),
                "LatLongInfo": 1, "Latitude_deg": float(ping["ping_latitude"]),
                "Longitude_deg": float(ping["ping_longitude"]), "NumBytesRxInfo": 32,
                "NumSoundingsMaxMain": ping["valid"].size, "NumSoundingsValidMain": int(ping["valid"].sum()),
                "NumBytesPerSounding": 120, "SeabedImageSampleRate": 0.0 if runs is None else runs.rate,
                "WCSampleRate": float(rates[0]) if rates.size else 0.0}
    some = slice(0, MOST_SECTORS)
    sectors = {"TxSectorNumb": np.arange(length.size), "SectorTransmitDelay_sec": ping["sector_delay"],
               "TiltAngleReTx_deg": np.degrees(ping["sector_angle"]), "CentreFreq_Hz": ping["sector_frequency"],
               "TxNominalSourceLevel_dB": ping["sector_source_level_db"], "TotalSignalLength_sec": length,
               "SignalBandWidth_Hz": ping["sector_bandwidth"], "EffectiveSignalLength_sec": length}
    return specific | {"TxSectors": {name: values[some] for name, values in sectors.items()}}


def _series(ping):
    runs = runs_of(ping)
    if runs is None or not runs.count.size:
        return None
    beam = np.repeat(np.arange(runs.count.size), runs.count)
    position = np.arange(beam.size) - (np.cumsum(runs.count) - runs.count)[beam]
    level = np.clip(np.rint(STEPS * runs.values) + SILENCE, 1, 65_535)
    return {"BitsPerSample": 16, "AppliedCorrections": 0, "Beams": {"DetectRangeSample": runs.start + runs.centre},
            "Samples": {"Beam": beam, "RangeSample": runs.start[beam] + position,
                        "Value": np.where(np.isfinite(level), level, 0.0).astype(np.int64)}}
