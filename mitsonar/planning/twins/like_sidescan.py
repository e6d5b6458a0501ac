"""Scene after a recorded sidescan line: its track, altitude, sonar, recorder, and a bed of its own strengths.

    line.xtf, .jsf, .sdf  ->  scene.xml, scene_track.csv, scene_bed.tif, scene_strength.pfm

Rendered, the scene has the pings, samples and range of the record. What the record does not have, such as the beam
widths, is that of the preset with the nearest frequency. Clauses at the head of the scene tell what was found, what was
assumed and what the scene does not have.
"""
from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from datetime import datetime, timedelta, timezone
from typing import Any
from xml.etree import ElementTree

import numpy as np

from mitsonar.device.files import FilePath, checked_suffix, replacing_all
from mitsonar.io.records import geotiff
from mitsonar.sonar.preset_tables import classes
from mitsonar.units import db_from_power, deg_from_radians, khz_from_hertz

from .sidescan_bed import FoundBed, bed_of
from .sidescan_line import SidescanLine, read_line
from .sidescan_recorder import FoundRecorder, recorder_of

USUAL = "towed_400khz"             # preset of a record without a frequency
LISTENS = 0.9                      # share of the ping interval that the track adds at its end
LONG = 1e-5                        # by which an interval may exceed the echoes' time by rounding
PARAMETERS = {"$rays": "integer", "$pings": "integer", "$bins": "integer", "$range": "float", "$glints": "float"}
TAGS = (bool, "boolean"), (int, "integer"), (float, "float"), (str, "string")
NOT_THERE = ("objects that stand on the bed or in the water are dark and bright places of the map, without height; "
             "the scene has no surface echo, and no texture finer than the cells of the map but glints: -D stones=20 "
             "lays stones")


def like_sidescan(path: FilePath, scene: FilePath, *, cell: float | None = None,     # [m]
                  pings: slice | None = None, frequency: float | None = None,             # [Hz]
                  say: Callable[[str], object] | None = None) -> tuple[str, ...]:
    """Write a scene after a recorded sidescan line, and return the paths of all files written."""
    checked_suffix(scene, (".xml",), what="the scene")
    line = read_line(path, pings, frequency)
    name, preset = _preset(line)
    recorder = recorder_of(line, preset["pulse_ms"] / 1e3)
    found = {**preset, "pulse_ms": 1e3 * recorder.pulse_length}
    bed = bed_of(line, recorder, found, cell=cell)
    words = [f"{line.counts.shape[0]} pings of {line.counts.shape[2]} samples a side to {_far(line):.4g} m, at "
             f"{line.ping_rate:.4g} Hz", *line.words, _assumed(line, name, preset), *recorder.words, *bed.words,
             NOT_THERE]
    stem = os.path.splitext(os.fspath(scene))[0]
    names = {"track": f"{stem}_track.csv", "bed": f"{stem}_bed.tif", "strength": f"{stem}_strength.pfm"}
    inside = {kind: os.path.basename(path) for kind, path in names.items()}
    root = _scene(line, recorder, bed, name, inside)
    start = datetime.fromtimestamp(line.start, timezone.utc)
    for number, text in enumerate((f"Like {os.path.basename(os.fspath(path))}: {start:%Y-%m-%dT%H:%M:%S}Z.", *words)):
        root.insert(number, ElementTree.Comment(f" {re.sub('-(?=-)', '- ', text)} "))
    ElementTree.indent(root, "    ")
    with replacing_all((scene, *names.values())) as (scene_file, track_file, bed_file, strength_file):
        track_file.write_text(_track(line, start), encoding="utf-8")
        geotiff.write(bed.depths, bed_file)
        rows, columns = bed.strength_db.shape
        pixels = bed.strength_db[::-1].astype("<f4").tobytes()
        strength_file.write_bytes(f"Pf\n{columns} {rows}\n-1.0\n".encode() + pixels)
        text = ElementTree.tostring(root, encoding="unicode")
        scene_file.write_text(f'<?xml version="1.0" encoding="utf-8"?>\n{text}\n', encoding="utf-8")
    if say is not None:
        for text in words:
            say(text)
    return (os.fspath(scene), *names.values())


def _far(line: SidescanLine) -> float:
    """Return the end of the record [m]."""
    return float(line.slant_range[-1] + 0.5 * line.spacing)


def _preset(line: SidescanLine) -> tuple[str, dict[str, Any]]:
    """Return the class of sidescans with the nearest frequency, and its attributes with the record's frequency."""
    known = classes("sidescan")
    khz = float(khz_from_hertz(line.frequency))
    name = min(known, key=lambda one: abs(np.log(known[one]["frequency_khz"] / khz))) if khz else USUAL
    own = {"frequency_khz": khz, "pulse_ms": 1e3 * line.pulse_length, "chirp_ms": 1e3 * line.chirp_length}
    return name, {**known[name], **{attribute: value for attribute, value in own.items() if value}}


def _assumed(line: SidescanLine, name: str, preset: Mapping[str, Any]) -> str:
    """Return a clause on what is the preset's."""
    frequency = (f"the frequency of {preset['frequency_khz']:g} kHz is the record's" if line.frequency
                 else f"the record has no frequency: {preset['frequency_khz']:g} kHz is assumed")
    return (f"{frequency}; beams of {preset['beam_width_deg']:g} by {preset['vertical_beam_width_deg']:g} degrees, "
            f"{preset['depression_deg']:g} degrees down, the pulse of {preset['pulse_ms']:g} ms and the source level "
            f"of {preset['source_level_db']:g} dB are assumed, those of {name}")


def _track(line: SidescanLine, start: datetime) -> str:
    """Return the track: a row per ping, and one after the last echo."""
    interval = 1 / line.ping_rate
    rows = np.column_stack([line.place, *map(deg_from_radians, (line.roll, line.pitch, line.heading))])
    rows = np.concatenate([rows, rows[-1:] + LISTENS * (rows[-1:] - rows[-2:-1])])
    when = interval * np.append(np.arange(len(line.place)), len(line.place) - 1 + LISTENS)
    return "time,x,y,z,roll_deg,pitch_deg,heading_deg\n" + "".join(
        ",".join([f"{(start + timedelta(seconds=float(second))).isoformat(timespec='microseconds')[:26]}Z",
                  *(f"{value:.5f}" for value in row)]) + "\n" for second, row in zip(when, rows))


def _scene(line: SidescanLine, recorder: FoundRecorder, bed: FoundBed, preset: str,
           files: Mapping[str, str]) -> ElementTree.Element:
    """Return the scene."""
    root = ElementTree.Element("scene", {"version": "3.0.0"})
    rate = min(line.ping_rate, (1 - LONG) * line.sound_speed / (2 * _far(line)))
    for name, value in {**files, "preset": preset, "pings": len(line.place), "rays": 200_000, "stones": 0,
                        "glints": bed.glints, "range": f"{_far(line):.7g}", "bins": line.slant_range.size}.items():
        ElementTree.SubElement(root, "default", {"name": name, "value": str(value)})
    _part(root, "integrator", "sonar_path", rays="$rays")
    sensor = _part(root, "sensor", "sidescan", "sonar", preset="$preset")
    if line.frequency:
        _add(sensor, frequency_khz=float(khz_from_hertz(line.frequency)))
    if line.chirp_length:
        _add(sensor, chirp_ms=1e3 * line.chirp_length)
    _add(sensor, pulse_ms=1e3 * recorder.pulse_length, track="$track", pings="$pings", ping_rate_hz=rate,
         noise=False, self_noise_db=bed.self_noise_db, **_recorded(recorder, bed))
    _part(sensor, "medium", "seawater", "water", sound_speed=line.sound_speed)
    _part(sensor, "film", "sonar_film", range="$range", bins="$bins")
    ground = _part(root, "bsdf", "lambert", "bed", glints="$glints",
                   **({"glint_share": recorder.glints[1]} if bed.glints else {}))
    texture = ElementTree.SubElement(ground, "texture", {"name": "mu_db", "type": "bitmap"})
    _add(texture, filename="$strength", raw=True)
    seabed = _part(root, "shape", "bathymetry", "seabed", filename="$bed", vertical="depth", smooth_normals=True,
                   local_origin=", ".join(f"{value:.10g}" for value in line.frame.origin))
    ElementTree.SubElement(seabed, "ref", {"id": "bed"})
    _part(root, "bsdf", "lambert", "stone", mu_db=-18.0)
    half = max(10.0, float(np.ptp(line.place[:, :2], axis=0).max()) / 2)
    middle = line.place[:, :2].mean(0)
    stones = _part(root, "shape", "targets", "stones", species="rounded_stone, angular_stone", count="$stones",
                   scale="0.3, 0.9", pose="rest", burial="0.1, 0.6",
                   area=", ".join(f"{value:.4g}" for value in (*(middle - half), *(middle + half))))
    for name in ("seabed", "stone"):
        ElementTree.SubElement(stones, "ref", {"id": name})
    return root


def _recorded(recorder: FoundRecorder, bed: FoundBed) -> dict[str, Any]:
    """Return the recorder's attributes."""
    return {
        "recorder": "sidescan_8bit" if recorder.bits <= 8 else "sidescan_16bit", "recorder_bits": recorder.bits,
        "recorder_full_scale_db": bed.full_scale_db, "recorder_tvg": bed.gain,
        "recorder_sectors_db": f"{bed.sides_db[0]:.3g}, {bed.sides_db[1]:.3g}", "recorder_row_gain_db": 0.0,
        "recorder_detector": recorder.law, "recorder_peak": recorder.peak, "recorder_low_pass": recorder.low_pass,
        "recorder_decimation": recorder.decimation, "recorder_noise_db": _db(bed.noise.own),
        "recorder_common_noise_db": _db(bed.noise.common), "recorder_line_db": recorder.line_db,
        "recorder_line_ms": 1e3 * recorder.line_length, "recorder_ringing_ms": 1e3 * recorder.ringing,
        "recorder_ping_gain_db": recorder.ping_gain_db, "recorder_lost": recorder.lost,
        "recorder_repeated": recorder.repeated, "recorder_bright": recorder.bright,
        "recorder_bright_db": recorder.bright_db}


def _db(power: float) -> float:
    """Return a level [dB re full scale], the lowest of an attribute for nothing."""
    return max(float(db_from_power(max(power, 1e-20))), -200.0)


def _part(parent: ElementTree.Element, tag: str, kind: str, name: str = "", **values: Any) -> ElementTree.Element:
    """Add a plugin with an id and attributes, and return it."""
    part = ElementTree.SubElement(parent, tag, {"type": kind, **({"id": name} if name else {})})
    _add(part, **values)
    return part


def _add(part: ElementTree.Element, **values: Any) -> None:
    """Add attributes, each with the tag of its type."""
    for name, value in values.items():
        tag = PARAMETERS.get(str(value)) or next(tag for kind, tag in TAGS if isinstance(value, kind))
        text = f"{value:.7g}" if isinstance(value, float) else str(value).lower() if tag == "boolean" else str(value)
        ElementTree.SubElement(part, tag, {"name": name, "value": text})
