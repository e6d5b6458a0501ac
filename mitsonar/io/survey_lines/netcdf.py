"""Write a line of soundings as netCDF-4: the record without loss, and beside it the groups of SONAR-netCDF4.

The variables of the record are in the root group, where `mitsonar.read` and xarray find them. Pings are appended block
by block. The groups follow SONAR-netCDF4 2.0 (ICES 2018 and later):

    /Environment                            sound speed, absorption; Sound_speed_profile: the cast
    /Platform                               arrays and sensors; Attitude/001, Position/001: the motion
    /Sonar/Beam_group1                      beams of the water column (of the soundings if there is none), sectors
    /Provenance                             software that wrote the file

Names and units are those of the convention: degrees, nanoseconds since 1970. Three points differ: dimensions keep the
names of the record; samples form a rectangle padded with NaN, not ragged arrays; and ``backscatter_r`` [dB re 1 µPa] is
a second name of the record's ``column_level_db``, so that the water column is stored once.
"""
from __future__ import annotations

import errno
import json
import os
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import xarray as xr

from mitsonar.device.files import FilePath, replacing
from mitsonar.device.rotations import mounted
from mitsonar.version import __version__

from ..records.netcdf import BESIDE, full_disk_told, has_room, packing
from ..records.netcdf4 import Group, conventional
from ..records.records import encoded
from .lines import Blocks, LineToWrite, Place, Written, line_of
from .passage import passage_of

BACKSCATTER = "Sonar/Beam_group1/backscatter_r"
VERSION = "2.0"
TIME = "nanoseconds since 1970-01-01 00:00:00Z"
RECEIVE_ONLY, TRANSMIT_ONLY = 0, 1
CHUNK_BYTES, CHUNK_PINGS = 1 << 18, 512


def root_attributes(line: LineToWrite) -> dict[str, str]:
    """Return the global attributes that the convention requires."""
    return {"Conventions": f"CF-1.7, SONAR-netCDF4-{VERSION}, ACDD-1.3", "keywords": line.sonar,
            "sonar_convention_authority": "ICES", "sonar_convention_name": "SONAR-netCDF4",
            "sonar_convention_version": VERSION, "summary": line.provenance()}


def _put(group: Group, name: str, dims: tuple[str, ...], values: Any, units: str = "", about: str = "") -> None:
    group.put(name, dims, np.asarray(values), {
        key: text for key, text in (("units", units), ("long_name", about)) if text})


def _nanoseconds(since: np.ndarray) -> np.ndarray:
    return np.rint(np.asarray(since, float) * 1e9).astype(np.int64)


def _environment(root, line, passage):
    group = root.group("Environment")
    sectors, lost = line.array("sector_frequency")[0], line.array("sector_absorption_db")[0]
    frequency = np.unique(sectors)
    absorption = [float(lost[(sectors == value) | (np.isnan(sectors) & np.isnan(value))].mean()) for value in frequency]
    _put(group, "frequency", ("frequency",), frequency, "Hz", "acoustic frequency")
    _put(group, "absorption_indicative", ("frequency",), np.array(absorption), "dB/m", "indicative acoustic absorption")
    _put(group, "sound_speed_indicative", (), float(line.array("head_sound_speed")[0]), "m/s",
         "indicative sound speed")
    group.set_dimensions()
    cast = group.group("Sound_speed_profile")
    _put(cast, "sample_depth", ("node",), line.array("cast_depth"), "m", "depth of the samples")
    _put(cast, "sound_speed", ("node",), line.array("cast_sound_speed"), "m/s", "sound speed")
    _put(cast, "time", (), _nanoseconds(passage.time[:1])[0], TIME, "time of the profile")
    _put(cast, "latitude", (), float(passage.latitude[0]), "degrees_north", "latitude of the profile")
    _put(cast, "longitude", (), float(passage.longitude[0]), "degrees_east", "longitude of the profile")
    cast.set_dimensions()


def _platform(root, line, passage):
    group = root.group("Platform", {"platform_name": "simulated", "platform_type": "ship"})
    for index, axis in enumerate("xyz"):
        _put(group, f"transducer_offset_{axis}", ("transducer",),
             [line.array("transmit_offset")[index], line.array("receive_offset")[index]], "m",
             f"{axis} of the transducer from the platform's origin: forward, starboard, down")
        _put(group, f"transducer_rotation_{axis}", ("transducer",),
             np.degrees([line.array("transmit_mounting")[index], line.array("receive_mounting")[index]]), "arc_degree",
             f"rotation of the transducer about {axis}")
        _put(group, f"MRU_offset_{axis}", (), 0.0, "m", f"{axis} of the motion sensor")
        _put(group, f"position_offset_{axis}", (), 0.0, "m", f"{axis} of the position sensor")
    _put(group, "transducer_function", ("transducer",), np.array([TRANSMIT_ONLY, RECEIVE_ONLY], np.int8), "",
         "0 receives only, 1 transmits only")
    _put(group, "water_level", (), -passage.draught, "m", "of the still surface from the platform's origin, down")
    group.set_dimensions()
    attitude, position = group.group("Attitude").group("001"), group.group("Position").group("001")
    for sensor in (attitude, position):
        _put(sensor, "time", ("time",), _nanoseconds(passage.time), TIME, "time of the sample")
    for name, values, about in (("roll", passage.roll, "starboard down"), ("pitch", passage.pitch, "bow up"),
                                ("heading", passage.heading % (2 * np.pi), "from true north")):
        _put(attitude, name, ("time",), np.degrees(values), "arc_degree", about)
    _put(attitude, "vertical_offset", ("time",), passage.depth - passage.depth.mean(), "m",
         "of the platform's origin below its mean depth")
    north, east, _ = passage.velocity.T
    for name, values, units in (("latitude", passage.latitude, "degrees_north"),
                                ("longitude", passage.longitude, "degrees_east"),
                                ("speed_over_ground", np.hypot(north, east), "m/s"),
                                ("course_over_ground", np.degrees(np.arctan2(east, north)) % 360.0, "degrees")):
        _put(position, name, ("time",), values, units)
    attitude.set_dimensions()
    position.set_dimensions()


def _sonar(root, file, line):
    texts = (("manufacturer", "simulated"), ("model", line.sonar), ("serial_number", "none"),
             ("software_name", "mitsonar"), ("software_version", __version__), ("type", "multibeam sonar"))
    sonar = root.group("Sonar", {f"sonar_{name}": text for name, text in texts})
    group = sonar.group("Beam_group1", {"beam_mode": "vertical"})
    _ship(file, line, group)
    columns = "column_angle" in file
    beam = "column_beam" if columns else "beam"
    angle = file["column_angle" if columns else "angle"][:]
    _put(group, "rx_beam_rotation_phi", ("ping", beam), np.degrees(angle), "arc_degree",
         "receiving beam about forward, positive to starboard, from the receive array's normal")
    _put(group, "transmit_beam_index", ("ping", beam), file["column_sector" if columns else "sector"][:], "",
         "sector that the beam receives")
    _transmissions(file, group)
    if columns:
        rate = file["column_rate"][:]
        _put(group, "sample_interval", ("ping", beam), 1 / rate, "s", "between samples")
        _put(group, "sample_time_offset", ("ping", beam), file["column_start"][:], "s",
             "of the first sample, after the beam's transmission")
    group.set_dimensions()
    if columns:
        file[BACKSCATTER] = file["column_level_db"]    # a second name of the same data, not a copy


def _ship(file, line, group):
    time, x, y = (file[f"ping_{name}"][:] for name in ("time", "x", "y"))
    latitude, longitude, convergence = line.frame.on_globe(np.stack([x, y], -1))
    heading = (file["ping_heading"][:] + convergence) % (2 * np.pi)
    offset = line.array("transmit_offset")
    roll, pitch, depth = (file[f"ping_{name}"][:] for name in ("roll", "pitch", "depth"))
    down = mounted(offset, roll, pitch)[:, 2]
    for name, values, units, about in (
            ("ping_time", _nanoseconds(line.start + time), TIME, "time of the ping's first transmission"),
            ("platform_latitude", latitude, "degrees_north", "latitude of the platform's origin"),
            ("platform_longitude", longitude, "degrees_east", "longitude of the platform's origin"),
            ("platform_heading", np.degrees(heading), "arc_degree", "heading from true north"),
            ("platform_roll", np.degrees(roll), "arc_degree", "roll, starboard down"),
            ("platform_pitch", np.degrees(pitch), "arc_degree", "pitch, bow up"),
            ("platform_vertical_offset", depth, "m", "of the platform's origin below the still surface"),
            ("tx_transducer_depth", depth + down, "m", "of the transmit array below the still surface"),
            ("sound_speed_at_transducer", file["head_sound_speed"][:], "m/s", "by the head's own sensor")):
        _put(group, name, ("ping",), values, units, about)


def _transmissions(file, group):
    frequency, width = (file[f"sector_{name}"][:] for name in ("frequency", "bandwidth"))
    for name, values, units, about in (
            ("transmit_frequency_start", frequency - width / 2, "Hz", "lower end of the band"),
            ("transmit_frequency_stop", frequency + width / 2, "Hz", "upper end of the band"),
            ("transmit_bandwidth", width, "Hz", "bandwidth of the pulse"),
            ("transmit_duration_nominal", file["sector_pulse_length"][:], "s", "length of the pulse"),
            ("transmit_source_level", file["sector_source_level_db"][:], "dB re 1 µPa at 1m", "source level"),
            ("transmit_time_offset", file["sector_delay"][:], "s", "after the ping's first transmission"),
            ("tx_beam_rotation_theta", np.degrees(file["sector_angle"][:]), "arc_degree",
             "transmitted beam about starboard, positive forward")):
        _put(group, name, ("ping", "sector"), values, units, about)


def write(blocks: Blocks, path: FilePath, *, place: Place | None = None, start: str | None = None) -> Written:
    """Write a line of soundings as netCDF-4; arguments, result and errors are those of `survey_lines.write`.

    Raises TypeError for an attribute of a type that files cannot hold.
    """
    line, remaining = line_of(blocks, place=place, start=start)
    first = next(remaining)
    if start is not None:
        first = first.assign_attrs(start=start)
    number, valid = first.sizes["ping"], int(first["valid"].sum())
    with replacing(path) as temporary, full_disk_told():
        record = encoded(first)
        beside = {name: value for name, value in root_attributes(line).items() if name not in record.attrs}
        record.attrs = record.attrs | beside | {BESIDE: json.dumps(list(beside))}
        packed = _encoding(record)
        variables, attrs = conventional(record)
        _check_room(temporary, record.nbytes)
        with h5py.File(temporary, "w", track_order=True, rdcc_nbytes=2 * CHUNK_BYTES) as file:
            root = Group(file)
            root.set_attributes(attrs)
            growing = {}
            for name, variable in variables.items():
                moves = variable.dims[:1] == ("ping",)
                if name == "ping":                     # the numbers of pings are their places
                    continue
                made = root.put(str(name), variable.dims, variable.values, variable.attrs, packed.get(str(name)),
                                growing=moves)
                growing |= {str(name): made} if moves else {}
            for block in remaining:
                _check_room(temporary, block.nbytes)
                _append(growing, block, number)
                number, valid = number + block.sizes["ping"], valid + int(block["valid"].sum())
            root.set_dimensions()
            passage = passage_of(line)
            _environment(root, line, passage)
            _platform(root, line, passage)
            _sonar(root, file, line)
            root.group("Provenance", {"conversion_software_name": "mitsonar", "conversion_software_version":
                                      __version__, "history": line.provenance()})
    return Written(pings=number, soundings=valid, words=(line.placed,) if line.placed else ())


def _check_room(path: Path, size: int) -> None:
    """Raise the error of a full disk here, since HDF5 can end the process when the disk is full."""
    if not has_room(path, size):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def _encoding(record: xr.Dataset) -> dict[str, dict[str, bool | int | tuple[int, ...]]]:
    """Return the encoding of each variable; variables of pings are chunked by pings."""
    encoding: dict[str, dict[str, bool | int | tuple[int, ...]]] = {}
    for name, packed in packing(record).items():
        encoding[name] = {**packed}
        variable = record.variables[name]
        if variable.dims[:1] == ("ping",):
            others = variable.shape[1:]
            size = max(1, variable.dtype.itemsize * int(np.prod(others)))
            pings = int(np.clip(CHUNK_BYTES // size, 1, CHUNK_PINGS))
            encoding[name]["chunksizes"] = (pings, *(max(1, other) for other in others))
    return encoding


def _append(growing: dict[str, h5py.Dataset], block: xr.Dataset, at: int) -> None:
    end = at + block.sizes["ping"]
    # The data sets stay open, so that a chunk is compressed once it is full and not at every block.
    for name, data in growing.items():
        data.resize(end, axis=0)
        values = block[name].values
        data[at:end] = values.astype(np.int8) if values.dtype == bool else values
