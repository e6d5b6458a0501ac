"""Tracks and way points from files: CSV, with a header and one line per ping, XTF, SBET and POS MV.

    time,x,y,z,roll,pitch,heading
    0.0,431000.0,5200000.0,-8.0,0.2,-1.0,270.0

``time`` in seconds, or as ISO 8601 (``2012-08-21T10:11:12.5Z``; UTC where no offset is given), which becomes seconds
since 1970; ``x`` east and ``y`` north [m] (or ``easting``, ``northing``), or in their place ``latitude`` and
``longitude`` on WGS 84 [degrees] (or ``lat``, ``lon``); ``z`` up [m] or, in its place, ``depth`` positive down [m];
``heave`` [m], positive up, optional, is added to z; the angles in degrees, optional (0, but the heading then is the
course), named with or without the suffix ``_deg``. With latitudes, headings refer to true north. The order of columns
is free; other columns, empty lines and lines starting with # are ignored. Commas, semicolons or tabs separate columns.

Positions repeated until the next fix are used once each (`navigation.unrepeated`), with a warning.

Without ``time`` the lines are way points: x and y, or latitude and longitude, and optionally z or depth. A column
``line`` numbers survey lines, of which one may be read; `planning.line_files` writes such files.

XTF files are recognised by their first bytes, see `io.xtf.navigation`; SBET and POS MV by theirs (`sbet`, `posmv`).
Times of an SBET are seconds of a GPS week, unless a date names the week: then they are seconds since 1970, of its own
clock.
"""
import os
import re
from dataclasses import replace

import numpy as np

from mitsonar.device.files import FilePath, check_readable
from mitsonar.sonar.motion.track import Track
from mitsonar.units import radians_from_deg

from ..scene_files import tables
from ..xtf import navigation as navigation_xtf
from . import posmv, sbet
from .gps_time import instant, week_of
from .navigation import Frame, Navigation, Waypoints, unrepeated

ANGLES = ("roll", "pitch", "heading")
DEGREES = {"lat": "latitude", "lon": "longitude", "long": "longitude"}
METRES = {"easting": "x", "eastings": "x", "east": "x", "northing": "y", "northings": "y", "north": "y"}
LARGEST_DEG = {"roll": 180, "pitch": 90, "latitude": 90, "longitude": 360}
POINT = re.compile(r"([\d.]+)\s*([NS])[\s]+([\d.]+)\s*([EW])(?:\s+(\S+))?", re.IGNORECASE)
FARTHEST = {"x": 1e8, "y": 1e8, "z": 1e5, "depth": 1e5, "heave": 1e5}      # [m]
LATEST = 1e11                      # [s] from 1970, three thousand years
SHOWN = 20                         # numbers of lines in an error
LARGEST_FILE = 200_000_000         # bytes of a CSV file, which take sixteen times as much while they are read


def read(path: FilePath, *, frame: Frame | None = None, depth: float = 0.0) -> Track:
    """Read a recorded track.

    Parameters
    ----------
    path : str or path
        A CSV file with the columns named above, or an XTF file.
    frame : mitsonar.io.tracks.navigation.Frame or None
        Place on Earth of x = y = 0. None: metres stay as in the file, degrees are projected about the middle of the
        track.
    depth : float [m]
        Depth of the sonar below the mean sea surface, for an XTF file without it.

    Returns
    -------
    Track
        Angles in radians.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        As `load`; or if the file holds way points, or the frame does not reach the track.
    """
    record = load(path)
    if isinstance(record, Waypoints):
        raise ValueError(f"cannot read the track {path}: the column time is missing, so it holds way points; add the "
                         "times, or sail along them at a speed.")
    return record.placed(frame, depth)


def load(path: FilePath, line: int = 0, date: str | None = None) -> Navigation | Waypoints:
    """Read a track or way points as in their file.

    Parameters
    ----------
    path : str or path
    line : int
        Number in the column ``line`` of the records to read, without run-ins (``point``); 0 for all.
    date : str or None
        Any date of the week, such as "2026-05-01", for a file that counts seconds of a week.

    Returns
    -------
    Navigation or Waypoints

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If a column is missing or doubled, a field is not a finite number (the line is named), time does not increase,
        a position lies above the sea surface or off the Earth, or the file is empty; for XTF as in `io.xtf.navigation`.
    """
    check_readable(path, "the track", "a CSV, XTF, SBET or POS MV file")
    for known in (posmv, sbet):
        if known.recognised(path):
            found = known.read(path)
            if date is None or not found.week:
                return found
            return replace(found, time=found.time + week_of(instant(date, "date of the week")), week=False)
    if date is not None:
        raise ValueError(f"a date of the week is given, and the track {path} is no SBET and names its own dates; leave "
                         "the date out.")
    if navigation_xtf.recognised(path):
        if line:
            raise ValueError(f"cannot read line {line} of the track {path}: XTF holds one line; leave line out.")
        return navigation_xtf.read(path)
    if os.path.getsize(path) > LARGEST_FILE:
        raise ValueError(f"cannot read the track {path}: it has {os.path.getsize(path) / 1e6:.0f} MB, more than "
                         f"{LARGEST_FILE / 1e6:g}; thin it out or split it.")
    numbers, columns = _columns(path, line)
    values = {name: tables.floats(path, numbers, name, column) for name, column in columns.items() if name != "time"}
    for name, limit in LARGEST_DEG.items():
        _refuse(path, numbers, columns, name, np.abs(values.get(name, np.zeros(1))) > limit,
                f"degrees, beyond +-{limit}; check the columns and units.")
    for name in FARTHEST:
        _refuse(path, numbers, columns, name, np.abs(values.get(name, np.zeros(1))) > FARTHEST[name],
                "m, farther than any place on Earth; check the columns and units.")
    geographic = "latitude" in columns
    x, y = (values[name] for name in (("longitude", "latitude") if geographic else ("x", "y")))
    z = values["z"] if "z" in columns else -values["depth"] if "depth" in columns else None
    if z is not None:
        height = "z" if "z" in columns else "depth"
        _refuse(path, numbers, columns, height, z > 0, "m is above the sea surface; z is positive up, and a column of "
                "positive depths must be named depth.", verb="=")
    if geographic:
        x = np.unwrap(x, period=360)
    if "time" not in columns:
        return Waypoints(x=x, y=y, z=z, geographic=geographic)
    time = tables.times(path, numbers, "time", columns["time"])
    _refuse(path, numbers, columns, "time", np.abs(time) > LATEST,
            f"s, and no time lies beyond +-{LATEST:g} s; check the columns and units.")
    late = np.flatnonzero(np.diff(time) <= 0)
    if late.size:
        line = late[0] + 1
        raise ValueError(f"{path}, line {numbers[line]}: time {columns['time'][line]} is not later than "
                         f"{columns['time'][line - 1]} before it; sort the lines and drop repeated times.")
    x, y = unrepeated(path, time, np.stack([x, y], -1), time).T
    nothing = np.zeros(time.size)
    angles = {name: radians_from_deg(values[name]) if name in values else nothing for name in ANGLES}
    return Navigation(time=time, x=x, y=y, z=z,
                      heave=values.get("heave", nothing), roll=angles["roll"], pitch=angles["pitch"],
                      heading=angles["heading"] if "heading" in values else None, geographic=geographic)


def waypoints(text: str) -> Waypoints:
    """Read way points from a text such as "0 0, 50 0, 50 30" or "37.75N 122.38W, 37.76N 122.38W".

    Parameters
    ----------
    text : str
        Commas or semicolons divide the points. A point is x (east) and y (north) [m], or latitude and longitude on
        WGS 84 [degrees] with the letters of their hemispheres, and z (up) [m] if all have it.

    Returns
    -------
    Waypoints

    Raises
    ------
    ValueError
        If a point is neither, not all are alike, or a number lies out of range.
    """
    rows, kinds = [], set()
    for number, point in enumerate(re.split(r"[,;]", text.strip().rstrip(",;")), 1):
        globe = POINT.fullmatch(point.strip())
        try:
            if globe:
                latitude, north, longitude, east, height = globe.groups()
                row = [float(longitude) * (-1 if east in "Ww" else 1), float(latitude) * (-1 if north in "Ss" else 1)]
                row += [] if height is None else [float(height)]
                if abs(row[1]) > 90 or abs(row[0]) > 360:
                    raise ValueError
            else:
                row = [float(word) for word in point.split()]
            if len(row) not in (2, 3) or not np.isfinite(row).all() or (len(row) == 3 and row[2] > 0):
                raise ValueError
        except ValueError:
            raise ValueError(f'way point {number} is "{point.strip()}"; write each as x and y [m], as latitude and '
                             'longitude such as 37.75N 122.38W, with z (up, 0 or below) if all have it, and commas '
                             "between the points.") from None
        rows.append(row)
        kinds.add((bool(globe), len(row)))
    if len(kinds) > 1:
        raise ValueError("the way points are not written alike: give all in metres or all in degrees, all with z or "
                         "all without.")
    columns = np.array(rows).T
    geographic = kinds.pop()[0]
    return Waypoints(x=np.unwrap(columns[0], period=360) if geographic else columns[0], y=columns[1],
                     z=columns[2] if len(columns) == 3 else None, geographic=geographic)


def _refuse(path, numbers, columns, name, bad, remedy, verb="is"):
    """Raise for the first line marked bad."""
    first = np.flatnonzero(bad)[:1]
    if first.size:
        raise ValueError(f"{path}, line {numbers[first[0]]}: {name} {verb} {columns[name][first[0]]} {remedy}")


def _of_line(path, line, names, numbers, records):
    """Return the records of a survey line, without its run-in, and their line numbers."""
    if "line" not in names:
        raise ValueError(f"cannot read line {line} of the track {path}: it has no column line; add it, or leave line "
                         "out.")
    column, point = names.index("line"), names.index("point") if "point" in names else None
    kept = [(number, record) for number, record in zip(numbers, records, strict=True)
            if record[column].strip() == str(line) and (point is None or record[point].strip() != "run-in")]
    if not kept:
        known = list(dict.fromkeys(record[column].strip() for record in records))
        raise ValueError(f"cannot read line {line} of the track {path}: its lines are {', '.join(known[:SHOWN])}"
                         f"{' ...' if len(known) > SHOWN else ''}.")
    return [list(part) for part in zip(*kept)]


def _columns(path, line):
    """Return the line numbers of the records and the needed columns as lists of text."""
    names, numbers, records = tables.records(path, "track")
    if line:
        numbers, records = _of_line(path, line, names, numbers, records)
    names = [name.removesuffix("_deg") if name.removesuffix("_deg") in (*ANGLES, *DEGREES, *DEGREES.values()) else name
             for name in names]
    names = [DEGREES.get(name, name) for name in names]
    if not {"x", "y", "latitude", "longitude"} & {*names}:       # where several say the place, the others count
        names = [METRES.get(name, name) for name in names]
    in_degrees = not {"x", "y"} <= {*names} and {"latitude", "longitude"} & {*names}
    place = ["latitude", "longitude"] if in_degrees else ["x", "y"]
    height = "depth" if "depth" in names and "z" not in names else "z"
    timeless = "time" not in names and set(place) <= {*names} and not {*ANGLES, "heave"} & {*names}
    wanted = place + [height] * (height in names) if timeless else ["time", *place, height]
    for name in (*wanted, *ANGLES, "depth", "heave"):
        count = names.count(name)
        if count > 1 or (name in wanted and count == 0):
            raise ValueError(f"cannot read the track {path}: the column {name} is "
                             f"{'given twice' if count else 'missing'}; the header has {', '.join(names)} and needs "
                             "time, x and y (or easting and northing, or latitude and longitude) and z (or depth).")
    if "z" in names and "depth" in names:
        raise ValueError(f"cannot read the track {path}: it has both z and depth; keep one of the two.")
    wanted += [name for name in (*ANGLES, "heave") if name in names]
    return numbers, {name: [record[names.index(name)].strip() for record in records] for name in wanted}
