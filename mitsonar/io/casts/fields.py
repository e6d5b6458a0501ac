"""Fields that the formats share: numbers, column titles, positions and times."""
import datetime
import math
import re
from collections.abc import Collection, Mapping, Sequence
from typing import Any, Literal

import numpy as np

from mitsonar.water.ranges import RANGES

from .records import Samples

# quantity -> its names in titles, in lower case
QUANTITIES = {
    "depth": {"depth", "z", "d"},
    "pressure": {"pressure", "pres", "press", "p"},
    "sound speed": {"sound speed", "soundspeed", "speed", "speed of sound", "sound velocity", "velocity", "sv", "c"},
    "temperature": {"temperature", "temp", "t"},
    "salinity": {"salinity", "sal", "s"},
    "conductivity": {"conductivity", "cond"},
}
# quantity -> its units and the factors to the first one, which mitsonar uses
UNITS = {
    "depth": dict.fromkeys(("m", "meter", "meters", "metre", "metres"), 1),
    "pressure": dict.fromkeys(("dbar", "db", "decibar", "decibars"), 1),
    "sound speed": dict.fromkeys(("m/s", "ms-1", "m s-1", "mps", "meters per second", "metres per second"), 1),
    "temperature": dict.fromkeys(("deg C", "deg c", "degc", "c", "\N{DEGREE SIGN}c", "celsius"), 1),
    "salinity": dict.fromkeys(("practical salinity", "psu", "ppt", "pss", "pss-78", "g/kg"), 1),
    "conductivity": {"mS/cm": 1, "ms/cm": 1, "mmho/cm": 1, "s/m": 10, "us/cm": 1e-3, "\N{MICRO SIGN}s/cm": 1e-3,
                     "\N{GREEK SMALL LETTER MU}s/cm": 1e-3},
}
POSITION = re.compile(r"([+-]?\d+(?:\.\d+)?)(?:[\s:d\N{DEGREE SIGN}]+(\d+(?:\.\d+)?))?(?:[\s:'m]+(\d+(?:\.\d+)?))?"
                      r"[\s\"'\N{DEGREE SIGN}]*([NSEWnsew]?)")


def shown(text: str) -> str:
    """Return a field as errors show it: short, on one line."""
    text = "".join(character if character.isprintable() else "?" for character in text[:31])
    return f"{text[:30]}..." if len(text) > 30 else text


def number(text: str) -> float:
    """Return the number in a field, NaN if there is none."""
    try:
        return math.nan if "_" in text else float(text)    # Python alone reads 1_500 as a number
    except ValueError:
        return math.nan


def samples(rows: Sequence[tuple[int, Sequence[str]]], columns: Mapping[str, int | tuple[int, float]],
            state: Literal["recorded", "processed", "ordered"], **more: Any) -> Samples:
    """Return the samples of rows (line number, fields); a column is an index, or an index and a factor."""
    if not rows:
        raise ValueError("it holds no samples; give at least one depth with its sound speed.")
    table = {what: np.empty(len(rows)) for what in columns}
    columns = {what: where if isinstance(where, tuple) else (where, 1) for what, where in columns.items()}
    for k, (line, fields) in enumerate(rows):
        for what, (column, factor) in columns.items():
            text = fields[column].strip() if column < len(fields) else ""
            value = number(text) * factor
            if not math.isfinite(value):
                raise ValueError(f"line {line}: {what} is {shown(text) or 'missing'}, not a finite number; "
                                 "repair or remove the line.")
            table[what][k] = value
    return Samples(lines=np.array([line for line, _ in rows]), columns=table, state=state, **more)


def rows_of(lines: Sequence[str]) -> list[tuple[int, str]]:
    """Return the rows with content as (line number, text), without comments after #."""
    rows = ((number, line.partition("#")[0].strip()) for number, line in enumerate(lines, 1))
    return [(number, row) for number, row in rows if row]


def title(text: str) -> tuple[str | None, str]:
    """Return the quantity and the unit in the title of a column, or None and the whole title."""
    words = re.sub(r"[_()\[\]\"']+", " ", text.lower()).split()
    for end in range(min(len(words), 4), 0, -1):
        for what, names in QUANTITIES.items():
            if " ".join(words[:end]) in names:
                return what, " ".join(words[end:])
    return None, text


def titled(line: int, header: Sequence[str]) -> dict[str, tuple[int, float]]:
    """Return the index and the factor of every column that a header names."""
    columns, titles = {}, [title(text) for text in header]
    named = {what for what, _ in titles}
    for k, (what, unit) in enumerate(titles):
        if what is None:
            continue
        unit = unit or ("" if what == "conductivity" else next(iter(UNITS[what])))
        if unit not in UNITS[what]:
            if (what == "pressure" and "depth" in named) or (what == "conductivity" and "sound speed" in named):
                continue
            given = f"in {shown(unit)!r}" if unit else "without its unit"
            raise ValueError(f"line {line}: {what} is given {given}; convert it to {next(iter(UNITS[what]))}.")
        if what in columns:
            raise ValueError(f"line {line}: the header names {what} twice; keep one of the columns.")
        columns[what] = k, UNITS[what][unit]
    if not suffices(columns):
        raise ValueError(f"line {line}: the header names {shown(', '.join(header))}; it must name depth and "
                         "sound_speed (or pressure, or temperature with salinity or conductivity).")
    return columns


def suffices(quantities: Collection[str | None]) -> bool:
    """Return True if quantities of these names determine sound speed against depth."""
    named = set(quantities)
    salted = "temperature" in named and not named.isdisjoint(("salinity", "conductivity"))
    return not named.isdisjoint(("depth", "pressure")) and ("sound speed" in named or salted)


def position(text: str, name: str) -> float | None:
    """Return a latitude or longitude in degrees, from decimals or minutes and seconds; None if it cannot be read.

    A sign before the degrees, or a letter before or after them, holds for the whole angle.

    Examples
    --------
    >>> position("43 04.5 N", "latitude"), position("-122:27:54", "longitude"), position("No-Lock", "latitude")
    (43.075, -122.465, None)
    """
    text = re.sub(r"^([NSEWnsew])\s*(.+)$", r"\2 \1", text.strip())
    match = POSITION.fullmatch(text)
    if not match:
        return None
    degrees, minutes, seconds, side = match.groups()
    minutes, seconds = float(minutes or 0), float(seconds or 0)
    value = abs(float(degrees)) + minutes / 60 + seconds / 3600
    low, high, _ = RANGES[name]
    if not low <= value <= high or minutes >= 60 or seconds >= 60:
        return None
    return -value if degrees.startswith("-") or side.upper() in ("S", "W") else value


def instant(text: str, *layouts: str) -> datetime.datetime | None:
    """Return the time in a text, by the first fitting layout of ``strptime``, in UTC; None if none fits."""
    for layout in layouts:
        try:
            return datetime.datetime.strptime(" ".join(text.split()), layout).replace(tzinfo=datetime.timezone.utc)
        except ValueError:
            continue
    return None
