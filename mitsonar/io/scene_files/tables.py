"""Tables in text files: a header names the columns, then a record a line.

Commas, semicolons or tabs divide the fields; empty lines and those starting with # are skipped. Errors name
the file and, if possible, the line.
"""
import csv
import datetime
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mitsonar.device.files import FilePath, check_readable

INSTANT = re.compile(r"(\d{4}-\d\d-\d\d)[T ](\d\d:\d\d:\d\d)([.,]\d+)?\s*(Z|[+-]\d\d:?\d\d)?", re.IGNORECASE)


def records(path: FilePath, what: str) -> tuple[list[str], list[int], list[list[str]]]:
    """Read the header and the records of a table."""
    path = Path(path)
    check_readable(path, f"the {what}", "a CSV file")
    try:
        text = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise ValueError(f"cannot read the {what} {path}: it is not a text file; give a CSV file.") from None
    kept = [(number, line) for number, line in enumerate(text, 1) if line.strip() and not line.startswith("#")]
    if len(kept) < 2:
        raise ValueError(f"cannot read the {what} {path}: it has {'a header but no' if kept else 'no header and no'} "
                         "records; give a header line and a line per record.")
    divider = max(",;\t", key=kept[0][1].count)
    try:
        header, *rows = csv.reader([line for _, line in kept], delimiter=divider, skipinitialspace=True, strict=True)
        if len(rows) != len(kept) - 1:
            raise csv.Error("a field runs over several lines")
    except csv.Error as error:
        raise ValueError(f"cannot read the {what} {path}: {error}; close the quotation marks.") from None
    if all(np.isfinite(_number(name)) for name in header):
        raise ValueError(f"{path}, line {kept[0][0]}: numbers where the names of columns belong; give a header line.")
    names, lines = [name.strip().lower() for name in header], [number for number, _ in kept[1:]]
    for number, row in zip(lines, rows, strict=True):
        if len(row) < len(names):
            raise ValueError(f"{path}, line {number}: {len(row)} fields, but the header names {len(names)}; "
                             "complete the line or remove it.")
    return names, lines, rows


def floats(path: FilePath, lines: Sequence[int], name: str, column: Sequence[str]) -> np.ndarray:
    """Return a column (R,) as numbers; an error names the line of the first that is not finite."""
    try:
        values = np.array(column, dtype=np.float64)
    except ValueError:
        values = np.array([_number(text) for text in column])
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        first = int(bad[0])
        raise ValueError(f"{path}, line {lines[first]}: {name} is {column[first].strip() or 'empty'!r}, which is not "
                         "a finite number; repair the line or remove it.")
    return values


def times(path: FilePath, lines: Sequence[int], name: str, column: Sequence[str]) -> np.ndarray:
    """Return seconds (R,), from a column that holds seconds or ISO 8601 in all records."""
    if not INSTANT.fullmatch(column[0]):
        return floats(path, lines, name, column)
    seconds = np.empty(len(column))
    for k, (number, text) in enumerate(zip(lines, column, strict=True)):
        try:
            found = INSTANT.fullmatch(text)
            if found is None:
                raise ValueError
            day, clock, fraction, offset = found.groups()
            offset = "+00:00" if offset in (None, "Z", "z") else f"{offset[:3]}:{offset[-2:]}"
            whole = datetime.datetime.fromisoformat(f"{day}T{clock}{offset}").timestamp()
        except ValueError:
            raise ValueError(f"{path}, line {number}: {name} is {text!r}, but the first record has an ISO 8601 time "
                             f"({column[0]}); write all alike, such as 2012-08-21T10:11:12.5Z.") from None
        seconds[k] = whole + float((fraction or ".0").replace(",", "."))
    return seconds


def _number(text):
    try:
        return float(text)
    except ValueError:
        return np.nan
