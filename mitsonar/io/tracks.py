"""Tracks from CSV files: a header names the columns, then a line per ping.

    time,x,y,z,roll,pitch,heading
    0.0,431000.0,5200000.0,-8.0,0.2,-1.0,270.0

``time`` in seconds, or as ISO 8601 (``2012-08-21T10:11:12.5Z``; UTC where no offset is given), which becomes seconds
since 1970; ``x`` east and ``y`` north [m]; ``z`` up [m] or, in its place, ``depth`` positive down [m]; the angles in
degrees, optional (0), named with or without the suffix ``_deg``. Columns stand in any order, others are ignored, and so
are empty lines and those starting with #. Commas, semicolons or tabs divide them.
"""
import datetime
import re

import numpy as np

from .. import units
from ..sonar.track import Track
from . import tables

ANGLES = ("roll", "pitch", "heading")
STEEPEST_DEG = {"roll": 180, "pitch": 90}
INSTANT = re.compile(r"(\d{4}-\d\d-\d\d)[T ](\d\d:\d\d:\d\d)([.,]\d+)?\s*(Z|[+-]\d\d:?\d\d)?", re.IGNORECASE)


def read(path):
    """Read a recorded track.

    Parameters
    ----------
    path : str or path
        A CSV file with the columns named above.

    Returns
    -------
    Track
        Coordinates as in the file (no local origin removed), angles in radians.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If a column is missing or doubled, a field is not a finite number (the line is named), time does not increase,
        a position lies above the sea surface, or nothing is there.
    """
    numbers, columns = _columns(path)
    time = _times(path, numbers, columns["time"])
    values = {name: tables.floats(path, numbers, name, column) for name, column in columns.items() if name != "time"}
    late = np.flatnonzero(np.diff(time) <= 0)
    if late.size:
        line = late[0] + 1
        raise ValueError(f"{path}, line {numbers[line]}: time {columns['time'][line]} is not later than "
                         f"{columns['time'][line - 1]} before it; sort the lines and drop repeated times.")
    height = "z" if "z" in values else "depth"
    z = values["z"] if height == "z" else -values["depth"]
    above = np.flatnonzero(z > 0)
    if above.size:
        raise ValueError(f"{path}, line {numbers[above[0]]}: {height} = {columns[height][above[0]]} m is above the sea "
                         "surface; z is positive up, and a column of positive depths must be named depth.")
    for name, limit in STEEPEST_DEG.items():
        steep = np.flatnonzero(np.abs(values.get(name, np.zeros(1))) > limit)
        if steep.size:
            raise ValueError(f"{path}, line {numbers[steep[0]]}: {name} is {columns[name][steep[0]]} degrees, beyond "
                             f"+-{limit}; check the columns and units.")
    angles = {name: units.radians_from_deg(values.get(name, 0.0)) for name in ANGLES}
    return Track(time=time, position=np.stack([values["x"], values["y"], z], axis=-1), **angles)


def _columns(path):
    """Give the line numbers of the records and the needed columns as lists of text."""
    names, numbers, records = tables.records(path, "track")
    names = [name[:-4] if name.removesuffix("_deg") in ANGLES and name.endswith("_deg") else name for name in names]
    wanted = ["time", "x", "y", "depth" if "depth" in names and "z" not in names else "z"]
    for name in (*wanted, *ANGLES, "depth"):
        count = names.count(name)
        if count > 1 or (name in wanted and count == 0):
            raise ValueError(f"cannot read the track {path}: the column {name} is "
                             f"{'given twice' if count else 'missing'}; the header has {', '.join(names)} and needs "
                             "time, x, y and z (or depth).")
    if "z" in names and "depth" in names:
        raise ValueError(f"cannot read the track {path}: it has both z and depth; keep one of the two.")
    wanted += [name for name in ANGLES if name in names]
    return numbers, {name: [record[names.index(name)].strip() for record in records] for name in wanted}


def _times(path, numbers, column):
    """Give seconds; what the first record holds, seconds or ISO 8601, all must hold."""
    if not INSTANT.fullmatch(column[0]):
        return tables.floats(path, numbers, "time", column)
    seconds = np.empty(len(column))
    for k, (number, text) in enumerate(zip(numbers, column, strict=True)):
        try:
            day, clock, fraction, offset = INSTANT.fullmatch(text).groups()
            offset = "+00:00" if offset in (None, "Z", "z") else f"{offset[:3]}:{offset[-2:]}"
            whole = datetime.datetime.fromisoformat(f"{day}T{clock}{offset}").timestamp()
        except (AttributeError, ValueError):
            raise ValueError(f"{path}, line {number}: time is {text!r}, but the first record has an ISO 8601 time "
                             f"({column[0]}); write all alike, such as 2012-08-21T10:11:12.5Z.") from None
        seconds[k] = whole + float((fraction or ".0").replace(",", "."))
    return seconds
