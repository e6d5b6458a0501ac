"""Write a line of soundings as Kongsberg KMALL, with the water column in the same file.

Installation, settings and cast come first, then in the order of time motion (#SKM), clock (#SCL), positions (#SPO,
#CPO), sound speed at the head (#SVT), tide (#SHI), pings (#MRZ) and their heave (#CHE) and water column (#MWC, see
`column`). Heads and swaths of one cycle share a ping counter. In #MRZ:

    z = depth - depth of the reference point             z of the water line = - its depth below the surface
    beam angle = - angle        (positive to port)        tilt = angle of the sector  (positive forward)
    quality factor [%] = 100 / 10^quality                 seabed image: 0.1 dB
    uncertainties: standard deviations                    ellipsoid height: of the reference point

The format has no ``transmit_angle`` of a sounding; the tilt of its sector is written instead. Rejected beams have the
places and times that their neighbours suggest, as an instrument's have.
"""
from __future__ import annotations

import struct
from typing import IO, Any

import numpy as np
from KMALL.kmall import kmall

from mitsonar.device.files import FilePath, replacing
from mitsonar.device.rotations import mounted, mounting_matrix

from .. import lines
from ..directions import from_vertical
from ..lines import COLUMN, HEADS, HEIGHTS, RESPONSE, SOUNDINGS, Blocks, LineToWrite, Ping, Place, Written
from ..passage import passage_of
from ..snippets import Runs, runs_of
from ..swath_figures import swath_figures
from . import kmall_sensors as about
from .column import KongsbergColumn, column_of, offset_of, water_column
from .kmall_sensors import BODY, MODEL

VERSION = 3
INFO, SECTOR, RECEIVER, SOUNDING = 152, 48, 32, 120      # bytes
NO_SOUNDING_DB = -100.0                                # reflectivity of beams without a sounding
NORMAL, REJECTED = 0, 2                                # types of detections
NO_SAMPLE = -32_768
SVT_SECONDS = 1.0                                      # between sound speeds at the head
HELD = (SOUNDINGS - {"transmit_angle"}) | COLUMN | HEADS | HEIGHTS | RESPONSE


def soundings(stream: IO[bytes], line: LineToWrite, ping: Ping, sounder: int, column: KongsbergColumn | None) -> None:
    """Append a ping's #MRZ."""
    runs, figures = runs_of(ping), swath_figures(ping)
    sectors, count = ping["sector_frequency"].size, ping["valid"].size
    samples = 0 if runs is None else int(runs.count.sum())
    length = 24 + 4 + BODY + INFO + sectors * SECTOR + RECEIVER + count * SOUNDING + 2 * samples
    writer = kmall()
    writer.FID = stream
    writer.write_EMdgmMRZ({
        "header": {"numBytesDgm": length, "dgmType": b"#MRZ", "dgmVersion": VERSION, "systemID": 0,
                   "echoSounderID": sounder, "dgtime": float(ping["since"])},
        "partition": {"numOfDgms": 1, "dgmNum": 1}, "cmnPart": about.body(ping),
        "pingInfo": _info(line, ping, sectors, figures),
        "txSectorInfo": _sectors(line, ping, sectors), "extraDetClassInfo": {},
        "rxInfo": _receiver(ping, runs, column, figures),
        "sounding": _columns(_soundings(line, ping, runs, column), count), "SIsample_desidB": _image(runs)})


def _info(line, ping, sectors, figures) -> dict[str, Any]:
    half = ping["sector_bandwidth"] / 2
    array = mounted(line.array("transmit_offset"), float(ping["ping_roll"]), float(ping["ping_pitch"]))
    steer = np.degrees(from_vertical(line, ping, ping["angle"])) if ping["valid"].size else np.zeros(1)
    across = ping["across_track"][ping["valid"]] if ping["valid"].any() else np.zeros(1)
    fan = steer[ping["valid"]] if ping["valid"].any() else np.zeros(1)
    length = float(ping["sector_pulse_length"].max())
    zeros = dict.fromkeys(("padding0", "beamSpacing", "depthMode", "subDepthMode", "distanceBtwSwath",
                           "detectionMode", "pulseForm", "padding1", "modeAndStabilisation", "runtimeFilter1",
                           "runtimeFilter2", "pipeTrackingStatus", "transmitPower_dB", "SLrampUpTimeRemaining",
                           "padding2", "yawAngle_deg", "x_kmallToall_m", "y_kmallToall_m", "posSensorStatus",
                           "attitudeSensorStatus", "padding3", "bsCorrectionOffset_dB", "lambertsLawApplied",
                           "iceWindow", "activeModes"), 0)
    return zeros | {name: value for name, value in figures.items() if name.endswith("_deg")} | {
        "numBytesInfoData": INFO, "numTxSectors": sectors, "numBytesPerTxSector": SECTOR, "pingRate_Hz": ping["rate"],
        "frequencyMode_Hz": float(ping["sector_frequency"].mean()), "latLongInfo": 1,
        "freqRangeLowLim_Hz": float((ping["sector_frequency"] - half).min()),
        "freqRangeHighLim_Hz": float((ping["sector_frequency"] + half).max()), "maxTotalTxPulseLength_sec": length,
        "maxEffTxPulseLength_sec": length, "maxEffTxBandWidth_Hz": float(ping["sector_bandwidth"].max()),
        "absCoeff_dBPerkm": 1e3 * float(ping["sector_absorption_db"].mean()), "portSectorEdge_deg": float(steer.max()),
        "starbSectorEdge_deg": float(steer.min()), "portMeanCov_deg": float(fan.max()),
        "stbdMeanCov_deg": float(fan.min()), "portMeanCov_m": int(np.clip(across.min(), -32e3, 32e3)),
        "starbMeanCov_m": int(np.clip(across.max(), -32e3, 32e3)),
        "headingVessel_deg": float(np.degrees(ping["true_heading"]) % 360.0),
        "soundSpeedAtTxDepth_mPerSec": float(ping["head_sound_speed"]),
        "txTransducerDepth_m": float(ping["below_surface"] + array[2]),
        "z_waterLevelReRefPoint_m": -ping["below_surface"], "latitude_deg": float(ping["ping_latitude"]),
        "longitude_deg": float(ping["ping_longitude"]),
        "ellipsoidHeightReRefPoint_m": about.height_of(ping.get("ping_height", np.nan))}


def _sectors(line, ping, sectors) -> dict[str, list[Any]]:
    length, parts = ping["sector_pulse_length"], about.parts_of(line)
    part = np.zeros(sectors, int) if parts is None else np.linalg.norm(
        (ping["sector_offset"] @ mounting_matrix(*line.array("transmit_mounting")))[:, None] - parts, axis=-1).argmin(1)
    return _columns({"txSectorNumb": np.arange(sectors), "sectorTransmitDelay_sec": ping["sector_delay"],
                     "tiltAngleReTx_deg": np.degrees(ping["sector_angle"]), "centreFreq_Hz": ping["sector_frequency"],
                     "txNominalSourceLevel_dB": ping["sector_source_level_db"], "totalSignalLength_sec": length,
                     "signalBandWidth_Hz": ping["sector_bandwidth"], "effectiveSignalLength_sec": length,
                     "txArrNumber": int(ping.get("head", 0)), "txSubArray": part, **dict.fromkeys(
                         ("padding0", "txFocusRange_m", "pulseShading", "signalWaveForm", "padding1",
                          "highVoltageLevel_dB", "sectorTrackingCorr_dB"), 0)}, sectors)


def _receiver(ping, runs, column, figures) -> dict[str, Any]:
    return {"numBytesRxInfo": RECEIVER, "numSoundingsMaxMain": ping["valid"].size,
            "numSoundingsValidMain": int(ping["valid"].sum()), "numBytesPerSounding": SOUNDING,
            "WCSampleRate": 0.0 if column is None else column.rate,
            "seabedImageSampleRate": 0.0 if runs is None else runs.rate,
            "BSnormal_dB": float(ping.get("normal_incidence_db", figures["BSnormal_dB"])),
            "BSoblique_dB": float(ping.get("oblique_incidence_db", figures["BSoblique_dB"])),
            "extraDetectionAlarmFlag": 0, "numExtraDetections": 0, "numExtraDetectionClasses": 0, "numBytesPerClass": 4}


def _soundings(line, ping, runs: Runs | None, column: KongsbergColumn | None) -> dict[str, Any]:
    valid = ping["valid"]
    beams, known = np.arange(valid.size), np.flatnonzero(valid)

    def beside(values: np.ndarray) -> np.ndarray:
        """Return values of valid soundings, and between them those that they suggest."""
        return np.interp(beams, known, values[known]) if known.size else np.zeros(valid.size)

    def filled(name: str, otherwise: float = 0.0) -> np.ndarray:
        """Return the values of valid soundings, ``otherwise`` where they are missing."""
        values = ping.get(name)
        return np.full(valid.size, otherwise) if values is None else np.where(
            valid & np.isfinite(values), 1.0 * values, otherwise)

    sector = ping["sector"]
    quality = np.where(valid, 100.0 / 10.0 ** filled("quality", 2.0), 0.0) if "quality" in ping else 0.0
    zeros = dict.fromkeys(("rejectionInfo1", "rejectionInfo2", "postProcessingInfo", "detectionClass",
                           "detectionConfidenceLevel", "padding", "detectionWindowLength_sec", "echoLength_sec",
                           "receiverSensitivityApplied_dB", "BScalibration_dB", "TVG_dB", "beamAngleCorrection_deg",
                           "twoWayTravelTimeCorrection_sec", "beamIncAngleAdj_deg", "realTimeCleanInfo", "WCBeamNumb",
                           "WCrange_samples", "WCNomBeamAngleAcross_deg", "SIstartRange_samples", "SIcentreSample",
                           "SInumSamples"), 0)
    out = zeros | {
        "soundingIndex": ping["beam"], "txSectorNumb": sector, "rangeFactor": np.full(valid.size, 100.0),
        "detectionType": np.where(valid, NORMAL, REJECTED), "detectionMethod": filled("detection").astype(int),
        "qualityFactor": quality, "detectionUncertaintyVer_m": filled("uncertainty"),
        "detectionUncertaintyHor_m": filled("horizontal_uncertainty"),
        "meanAbsCoeff_dbPerkm": 1e3 * ping["sector_absorption_db"][sector],
        "reflectivity1_dB": filled("backscatter_db", NO_SOUNDING_DB),
        "reflectivity2_dB": filled("backscatter_db", NO_SOUNDING_DB),
        "sourceLevelApplied_dB": ping["sector_source_level_db"][sector],
        "beamAngleReRx_deg": -np.degrees(ping["angle"]), "twoWayTravelTime_sec": beside(filled("travel_time")),
        "z_reRefPoint_m": beside(ping["depth"] - ping["ping_depth"]),
        "deltaLatitude_deg": beside(ping["latitude"] - ping["ping_latitude"]),
        "deltaLongitude_deg": beside(ping["longitude"] - ping["ping_longitude"]),
        "y_reRefPoint_m": beside(ping["across_track"]), "x_reRefPoint_m": beside(ping["along_track"])}
    if column is not None and column.angle.size:
        beam = np.argmin(np.abs(column.angle[None] - ping["angle"][:, None]), axis=1)
        out |= {"WCBeamNumb": beam, "WCNomBeamAngleAcross_deg": column.vertical_deg[beam],
                "WCrange_samples": np.clip(np.rint(filled("travel_time") * column.rate), 0, 65_535).astype(int)}
    if runs is not None:
        out |= {"SIstartRange_samples": runs.start, "SIcentreSample": runs.centre, "SInumSamples": runs.count}
    return out


def _image(runs: Runs | None) -> list[int]:
    if runs is None:
        return []
    tenths = np.clip(np.rint(10 * runs.values), NO_SAMPLE + 1, 32_767)
    return np.where(np.isfinite(tenths), tenths, NO_SAMPLE).astype(int).tolist()


def _columns(values: dict[str, Any], count: int) -> dict[str, list[Any]]:
    return {name: np.broadcast_to(column, (count,)).tolist() for name, column in values.items()}


def write(blocks: Blocks, path: FilePath, *, place: Place | None = None, start: str | None = None) -> Written:
    """Write a line of soundings as KMALL; arguments, result and errors are those of `mitsonar.io.survey_lines.write`.

    Raises ValueError also for a ping that does not fit into a datagram.
    """
    line, remaining = lines.line_of(blocks, place=place, start=start)
    passage, sounder, offset = passage_of(line), about.model(line), None
    waiting = about.sensors(line, passage)
    due = next(waiting, None)
    number = valid = louder = quieter = 0
    empty: list[float] = []
    measured, told = (-np.inf, 0.0), -np.inf
    with replacing(path) as temporary, open(temporary, "wb") as stream:
        for datagram in (about.installation, about.settings, about.profile):
            stream.write(datagram(line, passage))
        for ping in lines.cycled(lines.formed(line, remaining, empty), line.receivers[0]):
            passage.note(ping)
            while due is not None and due[0] <= ping["since"]:
                stream.write(due[1]())
                due = next(waiting, None)
            offset = offset_of(ping) if offset is None else offset
            try:
                column = column_of(line, ping, offset)
                if ping["since"] >= measured[0] + SVT_SECONDS or ping["head_sound_speed"] != measured[1]:
                    stream.write(about.head_speed(line, ping))
                    measured = ping["since"], ping["head_sound_speed"]
                if "tide" in ping and ping["level"] != told:
                    stream.write(about.tide(line, ping))
                    told = ping["level"]
                soundings(stream, line, ping, sounder, column)
                if column is not None and offset is not None:
                    stream.write(about.compatible_heave(line, passage, ping))
                    stream.write(water_column(passage, ping, sounder, column, offset))
                    louder, quieter = louder + column.outside[0], quieter + column.outside[1]
            except (struct.error, OverflowError) as error:
                raise ValueError(f"ping {number} does not go into a KMALL datagram: {error}; check its values, or "
                                 "write a .nc.") from None
            number, valid = number + 1, valid + int(ping["valid"].sum())
        while due is not None:
            stream.write(due[1]())
            due = next(waiting, None)
    held = HELD if about.parts_of(line) is None else HELD | {"sector_offset"}
    words = line.remarks("KMALL", held, len(empty), "" if f"{sounder}" in line.sonar else
                         f"KMALL is for Kongsberg's sounders only, so the file names an EM {MODEL}")
    if offset is not None:
        outside = f", {louder} samples are louder and {quieter} quieter" if louder or quieter else ""
        words += (f"the water column is in steps of 0.5 dB from {-64 - offset} to {63.5 - offset:g} dB{outside}",)
    return Written(pings=number, soundings=valid, words=words)
