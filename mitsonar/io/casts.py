"""Sound-speed casts as instruments and survey software write them, recognised by content and not by suffix.

`FORMATS` lists what is known. A new format is one reader, taking the lines and the number of the section asked for and
giving a `Cast`, one test of the first lines, and its row in the list.

Instruments measure on the way down and up and at rest: their samples are sorted by depth and those at one depth are
merged into their mean. A plain table is somebody's word for it: there a depth that does not increase is an error.
"""
import datetime
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..water import SoundSpeedProfile
from ..water.profile import FASTEST, SLOWEST


@dataclass(frozen=True, kw_only=True, eq=False)
class Cast:
    """Hold one cast.

    Parameters
    ----------
    profile : SoundSpeedProfile
    format : str
        The name of the format it was read from.
    temperature : array (K,) [deg C] or None
        At the nodes of the profile.
    salinity : array (K,) [-] or None
        Practical salinity at the nodes of the profile.
    latitude, longitude : float [deg] or None
    time : datetime or None
        Aware, in UTC.
    sections : int
        How many casts the file holds; this is one of them.
    """

    profile: SoundSpeedProfile
    format: str
    temperature: np.ndarray | None = None
    salinity: np.ndarray | None = None
    latitude: float | None = None
    longitude: float | None = None
    time: datetime.datetime | None = None
    sections: int = 1


class Format(NamedTuple):
    """One format: its name, a test of the lines that carry content, and the reader."""

    name: str
    recognises: Callable
    reads: Callable


def read(path, section=0):
    """Read a cast.

    Parameters
    ----------
    path : str or path
        A file in one of `FORMATS`: CARIS SVP, CastAway CSV, or a plain table of depth [m] and sound speed [m/s]
        divided by commas, semicolons, tabs or spaces, with or without a header, comments after #.
    section : int
        Which cast of a file that holds several, from 0.

    Returns
    -------
    Cast

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the content is none of the known formats, a value is not a number or out of range, depths do not increase
        in a plain table (the line is named), or there is no such section.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"cannot read the cast {path}: there is no such file; check the name.")
    if not path.is_file():
        raise ValueError(f"cannot read the cast {path}: it is not a file; give the file of one cast.")
    lines = path.read_bytes().decode("utf-8-sig", errors="replace").splitlines()
    content = [line for line in lines if line.partition("#")[0].strip()]
    for known in FORMATS:
        if content and known.recognises(content):
            try:
                return known.reads(known.name, lines, section)
            except ValueError as error:
                raise ValueError(f"cannot read the cast {path}: {error}") from None
    what = "its content" if content else "it is empty, which"
    raise ValueError(f"cannot read the cast {path}: {what} is none of the formats known "
                     f"({', '.join(known.name for known in FORMATS)}); convert it to a plain table of depth [m] and "
                     "sound speed [m/s].")


# ---------------------------------------------------------------------------------------------------- CARIS SVP

def _is_caris(content):
    return content[0].strip().upper().startswith("[SVP_VERSION")


def _read_caris(name, lines, section):
    starts = [k for k, line in enumerate(lines) if line.lower().startswith("section")]
    if not 0 <= section < len(starts):
        raise ValueError(f"section {section} was asked for, but the file holds {len(starts)}; count from 0.")
    start, end = starts[section], (*starts, len(lines))[section + 1]
    samples = [(number, line.split()) for number, line in enumerate(lines[start + 1:end], start + 2) if line.strip()]
    header = re.match(r"section\s+(\d{4}-\d{3}\s+\d+:\d+:\d+)\s+(\S+)\s+(\S+)", lines[start], re.IGNORECASE)
    where = {}
    if header:
        day_of_year = datetime.datetime.strptime(" ".join(header[1].split()), "%Y-%j %H:%M:%S")
        where = {"time": day_of_year.replace(tzinfo=datetime.timezone.utc), "latitude": _sexagesimal(header[2]),
                 "longitude": _sexagesimal(header[3])}
    return _merged(name, samples, {"depth": 0, "sound speed": 1}, sections=len(starts), **where)


def _sexagesimal(text):
    """Give the degrees of dd:mm:ss; the sign before the degrees is that of the whole."""
    parts = [float(part) for part in text.lstrip("+-").split(":")]
    value = sum(part / 60**k for k, part in enumerate(parts))
    return -value if text.startswith("-") else value


# ------------------------------------------------------------------------------------------------- CastAway CSV

CASTAWAY_COLUMNS = {"depth": "Depth (Meter)", "sound speed": "Sound velocity (Meters per Second)",
                    "temperature": "Temperature (Celsius)", "salinity": "Salinity (Practical Salinity Scale)"}


def _is_castaway(content):
    return re.match(r"%\s*device\s*,", content[0], re.IGNORECASE) is not None


def _read_castaway(name, lines, section):
    _only_section(section)
    notes, rows = {}, []
    for number, line in enumerate(lines, 1):
        if line.startswith("%"):
            key, _, value = line[1:].partition(",")
            notes[key.strip().lower()] = value.strip()
        elif line.strip():
            rows.append((number, line.split(",")))
    header = [column.strip() for column in rows[0][1]] if rows else []
    columns = {what: header.index(title) for what, title in CASTAWAY_COLUMNS.items() if title in header}
    for what in ("depth", "sound speed"):
        if what not in columns:
            raise ValueError(f"there is no column {CASTAWAY_COLUMNS[what]!r}; export the processed cast in metric "
                             "units.")
    time = notes.get("cast time (utc)")
    where = {key: float(notes[f"start {key}"]) for key in ("latitude", "longitude") if notes.get(f"start {key}")}
    if time:
        where["time"] = datetime.datetime.fromisoformat(time).replace(tzinfo=datetime.timezone.utc)
    return _merged(name, rows[1:], columns, **where)


# ------------------------------------------------------------------------------------------------- plain table

TABLE_NAMES = {
    "depth": {"depth", "z", "d"},
    "sound speed": {"sound speed", "soundspeed", "speed", "speed of sound", "sound velocity", "velocity", "sv", "c"},
    "temperature": {"temperature", "temp", "t"},
    "salinity": {"salinity", "sal", "s"},
}
TABLE_UNITS = {
    "depth": ("m", "meter", "meters", "metre", "metres"),
    "sound speed": ("m/s", "ms-1", "m s-1", "mps", "meters per second", "metres per second"),
    "temperature": ("deg C", "deg c", "degc", "c", "\N{DEGREE SIGN}c", "celsius"),
    "salinity": ("practical salinity", "psu", "ppt", "pss", "pss-78", "g/kg"),
}


def _is_table(content):
    first, second = (_split(line) for line in (*content, "")[:2])
    named = {what for what, _ in map(_title, first)}
    return _numeric(first) or (_numeric(second) and len(first) == len(second)) or {"depth", "sound speed"} <= named


def _read_table(name, lines, section):
    _only_section(section)
    rows = [(number, _split(line)) for number, line in enumerate(lines, 1) if line.partition("#")[0].strip()]
    (number, first), columns = rows[0], {"depth": 0, "sound speed": 1}
    if not _numeric(first):
        rows, columns = rows[1:], _table_columns(number, first)
    elif len(first) > 2:
        raise ValueError(f"line {number} has {len(first)} columns and no header names them; give a header with the "
                         "names depth and sound_speed.")
    samples = _samples(rows, columns)
    depth = samples["depth"]
    bad = np.flatnonzero(np.diff(depth) <= 0)
    if bad.size:
        k = bad[0] + 1
        raise ValueError(f"line {rows[k][0]}: depth {depth[k]:g} m follows {depth[k - 1]:g} m; depths are positive "
                         "down and must increase from row to row: sort the rows and merge repeated depths.")
    return _cast(name, samples)


def _split(line):
    """Cut a row at semicolons (then a comma is a decimal point), else commas, else tabs or spaces."""
    line = line.partition("#")[0].strip().rstrip(",;")
    if ";" in line:
        return [field.strip() for field in line.replace(",", ".").split(";")]
    return [field.strip() for field in line.split(",")] if "," in line else line.split()


def _table_columns(number, header):
    """Give the columns a header names: ``depth``, ``Depth (m)``, ``depth_m`` and the like."""
    columns = {}
    for k, (what, unit) in enumerate(map(_title, header)):
        if what and unit and unit not in TABLE_UNITS[what]:
            raise ValueError(f"line {number}: {what} is given in {unit!r}; convert it to {TABLE_UNITS[what][0]}.")
        columns.setdefault(what, k)
    columns.pop(None, None)
    if not {"depth", "sound speed"} <= set(columns):
        raise ValueError(f"line {number}: the header names {', '.join(header)}; it must name depth and sound_speed.")
    return columns


def _title(title):
    """Give the quantity and the unit that the title of a column names, or None and all of it."""
    words = re.sub(r"[_()\[\]\"']+", " ", title.lower()).split()
    for end in range(len(words), 0, -1):
        for what, names in TABLE_NAMES.items():
            if " ".join(words[:end]) in names:
                return what, " ".join(words[end:])
    return None, title


def _numeric(fields):
    try:
        return len([float(field) for field in fields]) >= 2
    except ValueError:
        return False


# -------------------------------------------------------------------------------------------------- shared parts

def _only_section(section):
    if section != 0:
        raise ValueError(f"section {section} was asked for, but the format holds one cast a file; leave section out.")


def _samples(rows, columns):
    """Give each column as an array, or raise a ValueError naming the first line that will not do."""
    if not rows:
        raise ValueError("it holds no samples; give at least one depth with its sound speed.")
    table = {what: np.empty(len(rows)) for what in columns}
    for k, (number, fields) in enumerate(rows):
        for what, column in columns.items():
            text = fields[column] if column < len(fields) else ""
            try:
                table[what][k] = float(text)
            except ValueError:
                table[what][k] = np.nan
            if not np.isfinite(table[what][k]):
                raise ValueError(f"line {number}: {what} is {text or 'missing'}, not a finite number; "
                                 "repair or remove the line.")
        speed = table["sound speed"][k]
        if not SLOWEST < speed < FASTEST:
            raise ValueError(f"line {number}: sound speed {speed:g} m/s is outside {SLOWEST:g}..{FASTEST:g} m/s; "
                             "check columns and units.")
    return table


def _merged(name, rows, columns, **more):
    """Make a cast of measured rows: sorted by depth, samples at one depth merged into their mean."""
    samples = _samples(rows, columns)
    depth, position = np.unique(samples["depth"], return_inverse=True)
    count = np.bincount(position)
    samples = {what: np.bincount(position, values) / count for what, values in samples.items()}
    return _cast(name, {**samples, "depth": depth}, **more)


def _cast(name, samples, **more):
    profile = SoundSpeedProfile(samples["depth"], samples["sound speed"])
    return Cast(profile=profile, format=name, temperature=samples.get("temperature"), salinity=samples.get("salinity"),
                **more)


# The table comes last: it is the least particular.
FORMATS = (
    Format("CARIS SVP", _is_caris, _read_caris),
    Format("CastAway CSV", _is_castaway, _read_castaway),
    Format("table of depth and sound speed", _is_table, _read_table),
)
