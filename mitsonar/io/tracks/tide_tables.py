"""Tide tables of survey software and of authorities, recognised by their content.

- CARIS TID: lines of dashes, then ``yyyy/mm/dd hh:mm[:ss] height`` a line; COWLIS and NOS tables are such, with more
  columns, a station before the date, and headers that name zone and unit (CARIS HIPS and SIPS, Tide File Formats)
- CO-OPS CSV: ``Date Time, Water Level, ...`` of the data service, and ``"Date","Time (GMT)","Verified (m)"`` of the
  site (NOAA, CO-OPS)

Times are UTC: a table that names another zone is refused, as are units that are neither metres nor feet. A table that
names none is taken to be in metres and UTC. Readings that are missing are left out.
"""
from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from datetime import datetime, timezone
from typing import NamedTuple

DASHES = re.compile(r"-{8,}")
READING = re.compile(r"(?:\d{5,8}\s+)?(\d{4}/\d{1,2}/\d{1,2})[\s,]+(\d{1,2}:\d\d(?::\d\d(?:\.\d+)?)?)[\s,]+(\S+)"
                     r"(?:\s.*)?")                        # a station, date, time of day, height
ZONE = re.compile(r"time zone:?\s*(.+?)\s*-*$|times are (?:on|in)\s+(.+?)\s*$", re.IGNORECASE)
UNIT = re.compile(r"data are in\s+(\w+)", re.IGNORECASE)
FACTORS = {**dict.fromkeys(("m", "meter", "meters", "metre", "metres"), 1.0),
           **dict.fromkeys(("ft", "foot", "feet"), 0.3048)}
UTC = ("utc", "gmt", "z")
LEVELS = ("verified", "preliminary", "water level", "prediction", "predicted")        # the first that is there
MISSING = ("", "-", "nan", "null")


class Readings(NamedTuple):
    """Readings of a table: numbers of lines, times [s] since 1970, and heights as text with their factor to metres."""

    lines: list[int]
    time: list[float]
    height: list[str]
    factor: float


def read(lines: Sequence[str]) -> Readings | None:
    """Return the readings of a table; None if it is none of these.

    Raises
    ------
    ValueError
        If the table names a zone other than UTC or an unknown unit, or a line is none of a table.
    """
    content = [(number, line.strip()) for number, line in enumerate(lines, 1) if line.strip()]
    if not content:
        return None
    first = content[0][1].lower().replace('"', "")
    if first.startswith(("date time,", "date,")) and any(level in first for level in LEVELS):
        return _coops(content)
    if any(DASHES.search(line) for _, line in content[:40]) and any(READING.fullmatch(line) for _, line in content):
        return _caris(content)
    return None


def _caris(content: Sequence[tuple[int, str]]) -> Readings:
    """Return the readings of a table with lines of dashes."""
    rows: list[tuple[int, float, str]] = []
    factor, begun = 1.0, False
    for number, line in content:
        if found := READING.fullmatch(line):
            begun = True
            day, clock, height = found.groups()
            if height.lower() not in MISSING:
                rows.append((number, _time(number, day.replace("/", "-"), clock), height))
        elif begun and not DASHES.search(line):
            raise ValueError(f"line {number} is {line[:40]!r}, neither a reading nor a line of dashes; repair or "
                             "remove it.")
        elif zone := ZONE.search(line):
            _check_zone(zone.group(1) or zone.group(2))
        elif unit := UNIT.search(line):
            factor = _factor(unit.group(1))
    return _readings(rows, factor)


def _readings(rows: Sequence[tuple[int, float, str]], factor: float) -> Readings:
    return Readings([row[0] for row in rows], [row[1] for row in rows], [row[2] for row in rows], factor)


def _coops(content: Sequence[tuple[int, str]]) -> Readings:
    """Return the readings of a table of the Center for Operational Oceanographic Products and Services."""
    _, *numbers = (number for number, _ in content)
    header, *table = csv.reader([line for _, line in content], skipinitialspace=True)
    if len(table) != len(numbers):
        raise ValueError("a quotation mark is not closed; repair the table.")
    titles = [title.strip().lower() for title in header]
    joined = titles[0] == "date time"
    if not joined:
        clock = next((k for k, title in enumerate(titles) if title.startswith("time")), None)
        if clock != 1:
            raise ValueError("the header has no column of times after that of dates; give the table as it was loaded.")
        if zone := re.search(r"\((.*)\)", titles[1]):
            _check_zone(zone.group(1))
    kept = [k for level in LEVELS for k, title in enumerate(titles) if title.startswith(level)]
    if not kept:
        raise ValueError(f"no column of the header begins with {', '.join(LEVELS[:-1])} or {LEVELS[-1]}; give the "
                         "table as it was loaded.")
    found = next((k for k in kept if any(len(row) > k and row[k].strip().lower() not in MISSING for row in table)),
                 kept[0])
    unit = re.search(r"\((.*)\)", titles[found])
    rows = []
    for number, row in zip(numbers, table):
        if len(row) <= found:
            raise ValueError(f"line {number} has {len(row)} fields, and the header names {len(titles)}; complete it.")
        if row[found].strip().lower() not in MISSING:
            day, at = row[0].strip().split(maxsplit=1) if joined and " " in row[0].strip() else (row[0].strip(), row[1])
            rows.append((number, _time(number, day.replace("/", "-"), at.strip()), row[found].strip()))
    return _readings(rows, _factor(unit.group(1)) if unit else 1.0)


def _time(number: int, day: str, clock: str) -> float:
    """Return the time [s] since 1970 of a date and a time of day."""
    try:
        year, month, of_month = map(int, day.split("-"))
        hour, minute, *second = clock.split(":")
        start = datetime(year, month, of_month, int(hour), int(minute), tzinfo=timezone.utc).timestamp()
        seconds = float(second[0]) if second else 0.0
        if not 0 <= seconds < 61:
            raise ValueError
        return start + seconds
    except ValueError:
        raise ValueError(f"line {number} has the time {day} {clock}, which is none; repair the line.") from None


def _check_zone(text: str) -> None:
    """Refuse a zone that is not UTC, such as "LST" or "GMT ( -4.0)"."""
    words = text.replace("(", " ").replace(")", " ").lower().split()
    if not words or words[0] not in UTC or any(_hours(word) for word in words[1:]):
        raise ValueError(f"its times are in the zone {text.strip()[:30]!r}; give a table in UTC.")


def _hours(word: str) -> float:
    """Return the number in a word; 0 if it is none."""
    try:
        return float(word)
    except ValueError:
        return 0.0


def _factor(unit: str) -> float:
    """Return the factor to metres of a unit."""
    if unit.lower() not in FACTORS:
        raise ValueError(f"its heights are in {unit[:20]!r}; give a table in metres.")
    return FACTORS[unit.lower()]
