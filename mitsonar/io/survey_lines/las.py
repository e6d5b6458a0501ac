"""Write a line of soundings as a point cloud, LAS 1.4 with point format 6: 1 mm resolution, one return a sounding.

    z = -depth            intensity = 100 (backscatter [dB] + 100)            class 1 valid, 7 (noise) not valid

Other variables of the soundings are extra bytes under their own names. Times are GPS standard time less 1e9 s.
"""
from __future__ import annotations

import datetime

import laspy
import numpy as np

from mitsonar.device.earth import metric_system
from mitsonar.device.files import FilePath, replacing
from mitsonar.hydrography.record import VARIABLES
from mitsonar.version import __version__

from .clouds import ONLY_SOUNDINGS, cloud, of_soundings
from .lines import NO_SYSTEM, Blocks, Place, Written, line_of

SCALE = 0.001                              # [m]
VALID, NOISE = 1, 7                        # classes of the American Society for Photogrammetry and Remote Sensing
GPS = 315_964_800 - 18 + 1_000_000_000     # [s] from 1970; GPS is 18 s ahead of UTC since 2017
SCAN_STEP = 0.006                          # degrees
OWN = {"x", "y", "depth", "valid"}         # variables with a field of their own in the point format


def write(blocks: Blocks, path: FilePath, *, place: Place | None = None, start: str | None = None) -> Written:
    """Write a line of soundings as LAS.

    Arguments, result and errors are those of `mitsonar.io.survey_lines.write`. With ``place``, the cloud lies in a
    transverse Mercator projection centred there.
    """
    line, remaining = line_of(blocks, place=place, start=start)
    crs = line.frame.crs if line.first.attrs.get("crs") or place is not None else None
    extra = [name for name in of_soundings(line) if name not in OWN]
    header = _header(line, extra, crs)
    number = valid = 0
    with replacing(path) as temporary, open(temporary, "wb") as stream, \
            laspy.open(stream, mode="w", header=header, closefd=False) as writer:
        for block in remaining:
            for soundings in cloud(line, block, number):
                writer.write_points(_points(header, soundings, extra))
                valid += int(soundings["valid"].sum())
            number += block.sizes["ping"]
    return Written(pings=number, soundings=valid, words=tuple(text for text in (
        "" if crs else NO_SYSTEM,
        "intensity is 100 (backscatter [dB] + 100)" if "backscatter_db" in extra else "",
        ONLY_SOUNDINGS) if text))


def _header(line, extra, crs):
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales = np.full(3, SCALE)
    header.offsets = np.floor([line.frame.origin[0] / 1000, line.frame.origin[1] / 1000, 0.0]) * 1000
    header.add_extra_dims([laspy.ExtraBytesParams(name="ping", type="u4", description=""),
                           laspy.ExtraBytesParams(name="beam", type="u2", description=""),
                           *(laspy.ExtraBytesParams(name=name, type=VARIABLES[name].dtype, description=_unit(name))
                             for name in extra)])
    header.global_encoding.gps_time_type = laspy.header.GpsTimeType.STANDARD
    header.creation_date = datetime.datetime.fromtimestamp(line.start, datetime.timezone.utc).date()
    header.generating_software, header.system_identifier = f"mitsonar {__version__}", "simulation"
    if crs is not None:
        header.add_crs(metric_system(crs))
    return header


def _unit(name):
    unit = VARIABLES[name].unit
    return "" if unit == "1" else unit.replace("µ", "u")[:31]


def _points(header, soundings, extra):
    points = laspy.ScaleAwarePointRecord.zeros(soundings["x"].size, header=header)
    points.x, points.y, points.z = soundings["easting"], soundings["northing"], -soundings["depth"]
    points.classification = np.where(soundings["valid"], VALID, NOISE)
    points.return_number[:] = points.number_of_returns[:] = 1
    points.gps_time = soundings["since"] - GPS
    points.scan_angle = np.clip(np.rint(np.degrees(soundings["angle"]) / SCAN_STEP), -30_000, 30_000)
    if "backscatter_db" in soundings:
        level = np.rint(100 * (np.nan_to_num(soundings["backscatter_db"], nan=-100.0) + 100))
        points.intensity = np.clip(level, 0, 65_535)
    for name in ("ping", "beam", *extra):
        points[name] = soundings[name]
    return points
