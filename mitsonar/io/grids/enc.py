"""Soundings and depth contours of an electronic chart (S-57 ENC, ``.000``), as a list of soundings.

An ENC is a file of ISO/IEC 8211: records of a leader (24 characters), a directory of fields (tag, length, place) and
the fields. Spatial records hold coordinates as integers, features name spatial records by type and number (IHO, S-57
edition 3.1, part 3):

    longitude = XCOO / COMF        latitude = YCOO / COMF        depth = VE3D / SOMF        (SOUNDG)
    depth = VALDCO along the edges and their end nodes                                      (DEPCNT)

Depths are below the chart's sounding datum. Depth areas, coast lines and updates (.001 and so on) are not read.
"""
from __future__ import annotations

import os
import struct
from collections.abc import Iterator

import numpy as np

from mitsonar.device.files import FilePath

from .soundings import Soundings, in_metres

__all__ = ["read", "recognised"]

LARGEST, MOST = 1 << 27, 5_000_000                     # bytes, an ENC has 5 MB at most; points
LEADER, END, UNIT = 24, b"\x1e", b"\x1f"
PARAMETERS = struct.Struct("<BI3BI4B2I")           # RCNM RCID HDAT VDAT SDAT CSCL DUNI HUNI PUNI COUN COMF SOMF
NAME, OBJECT, ATTRIBUTE = struct.Struct("<BI"), struct.Struct("<H"), struct.Struct("<H")
SOUNDING, CONTOUR, VALUE = 129, 43, 174            # classes SOUNDG, DEPCNT; attribute VALDCO
WGS84, METRES, DEGREES = 2, 1, 1                   # HDAT, DUNI, COUN
Key = tuple[int, int]                              # type and number of a record


def recognised(path: FilePath) -> bool:
    """Return True if a file begins as an S-57 data set does."""
    try:
        with open(path, "rb") as file:
            head = file.read(2048)
    except OSError:
        return False
    return head[:5].isdigit() and head[6:7] == b"L" and b"DSID" in head


def read(path: FilePath) -> Soundings:
    """Read the soundings and depth contours of an ENC.

    Parameters
    ----------
    path : path

    Returns
    -------
    Soundings
        In metres of the UTM zone at their middle; z is the depth below the chart's sounding datum.

    Raises
    ------
    ValueError
        If the file is damaged, is in other units than degrees of WGS 84 and metres, or holds fewer than three depths.
    """
    from rasterio.crs import CRS

    if os.path.getsize(path) > LARGEST:
        raise ValueError(f"the chart has more than {LARGEST >> 20} MB, an ENC has 5 at most; give one cell.")
    with open(path, "rb") as file:
        data = file.read()
    try:
        points = _depths(data)
    except (struct.error, IndexError, KeyError, UnicodeDecodeError):
        raise ValueError("the chart is damaged: its records do not fit together; copy it again.") from None
    if len(points) < 3:
        raise ValueError(f"the chart has {len(points)} soundings and points of depth contours; a seabed needs three at "
                         "least.")
    longitude, latitude, depth = points.T
    if not (np.abs(longitude) <= 180).all() or not (np.abs(latitude) <= 90).all():
        raise ValueError("a sounding of the chart lies off the Earth; the chart is damaged.")
    return in_metres(longitude, latitude, depth, CRS.from_epsg(4326))


def _depths(data: bytes) -> np.ndarray:
    """Return longitudes, latitudes [degrees] and depths [m] (N, 3)."""
    parameters, soundings = None, []
    places: dict[Key, list[np.ndarray]] = {}
    ends: dict[Key, list[Key]] = {}
    contours: list[tuple[float, list[Key]]] = []
    for fields in _records(data):
        tags = dict(fields)
        if "DSPM" in tags:
            parameters = PARAMETERS.unpack_from(tags["DSPM"])
        elif "VRID" in tags:
            key = NAME.unpack_from(tags["VRID"])
            ends[key] = [NAME.unpack_from(field, at) for tag, field in fields if tag == "VRPT"
                         for at in range(0, len(field) - 8, 9)]
            places[key] = [_integers(field, 2) for tag, field in fields if tag == "SG2D"]
            soundings += [_integers(field, 3) for tag, field in fields if tag == "SG3D"]
        elif "FRID" in tags and OBJECT.unpack_from(tags["FRID"], 7)[0] == CONTOUR:
            depth = _value(tags.get("ATTF", b""))
            if depth is not None:
                contours.append((depth, [NAME.unpack_from(field, at) for tag, field in fields if tag == "FSPT"
                                         for at in range(0, len(field) - 7, 8)]))
    if parameters is None:
        raise ValueError("the chart states no units (DSPM); it is damaged, or an update without its base cell.")
    _, _, datum, _, _, _, depth_unit, _, _, unit, scale, depth_scale = parameters
    if (datum, depth_unit, unit) != (WGS84, METRES, DEGREES) or not scale or not depth_scale:
        raise ValueError("the chart is not in degrees of WGS 84 and metres, as an ENC is; convert it first.")
    rows = [np.column_stack([points[:, 1] / scale, points[:, 0] / scale, points[:, 2] / depth_scale])
            for points in soundings]
    total = sum(map(len, rows))
    for depth, edges in contours:
        for points in (points for edge in edges for key in (edge, *ends.get(edge, ())) for points in
                       places.get(key, ())):
            total += len(points)
            if total > MOST:
                raise ValueError(f"the chart has more than {MOST:,} points of depths; give one cell.")
            rows.append(np.column_stack([points[:, ::-1] / scale, np.full(len(points), depth)]))
    return np.unique(np.concatenate([np.zeros((0, 3)), *rows]), axis=0)


def _records(data: bytes) -> Iterator[list[tuple[str, bytes]]]:
    """Yield the fields of the data records, each with its tag."""
    at = 0
    while at < len(data):
        leader = data[at:at + LEADER]
        sizes = leader[20:21] + leader[21:22] + leader[23:24]
        if not (len(leader) == LEADER and leader[:5].isdigit() and leader[12:17].isdigit() and sizes.isdigit()):
            raise ValueError(f"the chart is damaged or cut at byte {at}: there is no record.")
        length, base = int(leader[:5]), int(leader[12:17])
        if at + max(length, base) > len(data):
            raise ValueError(f"the chart is cut: its record at byte {at} has {len(data) - at} of {max(length, base)} "
                             "bytes; copy it again.")
        of_length, of_place, of_tag = (int(sizes[index:index + 1]) for index in range(3))
        entry, fields, end = of_tag + of_length + of_place, [], base
        for place in range(at + LEADER, at + base - 1, max(entry, 1)):
            text = data[place:place + entry].decode("ascii")
            tag, numbers = text[:of_tag], (text[of_tag:of_tag + of_length], text[of_tag + of_length:])
            if len(text) != entry or not all(number.isdigit() for number in numbers):
                raise ValueError(f"the chart is damaged at byte {place}: there is no entry of a directory.")
            size, offset = map(int, numbers)
            fields.append((tag, data[at + base + offset:at + base + offset + size]))
            end = max(end, base + offset + size)
        length = length or end                         # 0: the record has more than 99,999 bytes
        if not LEADER < end <= length <= len(data) - at:
            raise ValueError(f"the chart is damaged: its record at byte {at} is shorter than its fields.")
        if leader[6:7] == b"D":
            yield fields
        at += length


def _integers(field: bytes, columns: int) -> np.ndarray:
    """Return the coordinates (N, columns) of a field: y, x and perhaps z."""
    return np.frombuffer(field, "<i4", len(field) // (4 * columns) * columns).reshape(-1, columns).astype(float)


def _value(field: bytes) -> float | None:
    """Return the depth of a contour, None if it has none."""
    at = 0
    while at + 2 < len(field):
        code, = ATTRIBUTE.unpack_from(field, at)
        end = field.find(UNIT, at + 2)
        if end < 0:
            return None
        if code == VALUE:
            try:
                return float(field[at + 2:end])
            except ValueError:
                return None
        at = end + 1
    return None
