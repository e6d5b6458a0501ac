"""Tables of parameters in CSV files: rows that are rendered one by one, and rows that are drawn at random."""
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from mitsonar.device.spelling import meant
from mitsonar.io.scene_files import tables

from ..values import fraction, shortened, value, weighted

LARGEST_TABLE = 200_000_000        # bytes


@dataclass(frozen=True, kw_only=True)
class DrawnRows:
    """Table of which every draw takes a row at random, so that the values of a row stay together."""

    name: str  # of the file, as the plan has it
    columns: dict[str, tuple]
    chosen: Callable[[float], int]  # number of a row for a fraction between 0 and 1

    def row(self, bits: int) -> dict[str, Any]:
        """Return the values of a row for an integer of 256 random bits."""
        number = self.chosen(fraction(bits))
        return {name: column[number] for name, column in self.columns.items()}


def drawn_rows(given: Mapping[str, Any], where: str, place: str, known: Iterable[str]) -> DrawnRows:
    """Return a table to draw rows from, as ``rows = { table = "measured.csv", weights = "count" }`` gives it."""
    unknown = next((key for key in given if key not in ("table", "weights")), None)
    if unknown is not None:
        raise ValueError(f"{where} has the unknown key {shortened(unknown)}"
                         f"{meant(unknown, ('table', 'weights'))}; give table, and weights if wanted")
    name, weights = given.get("table"), given.get("weights")
    if not isinstance(name, str) or not name or not name.isprintable():
        raise ValueError(f"{where}: table is {shortened(name)}; give the name of a CSV file")
    columns = columns_of(os.path.join(place, name), known)
    numbers = range(len(next(iter(columns.values()))))
    if weights is None:
        return DrawnRows(name=name, columns=columns, chosen=lambda share: int(share * len(numbers)))
    column = next((column for column in columns if isinstance(weights, str) and column.lower() == weights.lower()), "")
    if not column:
        raise ValueError(f"{where}: weights is {shortened(weights)}{meant(str(weights), columns)}; give a column of "
                         f"{name}: {', '.join(columns)}")
    given_weights = [_weight(item) for item in columns.pop(column)]
    return DrawnRows(name=name, columns=columns, chosen=weighted(numbers, given_weights, f"{where}: {column}"))


def columns_of(path: str, known: Iterable[str]) -> dict[str, tuple]:
    """Return the columns of a CSV file by name, spelt as in the scene, with numbers where values read as such."""
    check_file(path, "table", LARGEST_TABLE, "a CSV file")
    names, lines, rows = tables.records(path, "table")
    if len(set(names)) < len(names) or not all(names):
        raise ValueError(f"the table {path} has the columns {shortened(names)}; give each a name of its own")
    spelt = {name.lower(): name for name in known}
    for line, row in zip(lines, rows, strict=True):
        if len(row) > len(names):
            raise ValueError(f"{path}, line {line}: {len(row)} fields, but the header names {len(names)}; name the "
                             "rest or remove it")
    return {spelt.get(name, name): tuple(number_or_text(row[k], f"{path}, line {line}: {name}")
                                         for line, row in zip(lines, rows, strict=True))
            for k, name in enumerate(names)}


def check_file(path: str, role: str, largest: int, wanted: str, otherwise: str = "") -> None:
    """Raise an error if a file that a plan needs is not there, no file, or too large."""
    if not os.path.exists(path):
        raise FileNotFoundError(f"the {role} {path} does not exist; give the path of {wanted}{otherwise}")
    if not os.path.isfile(path):
        raise ValueError(f"the {role} {path} is no file; give the path of {wanted}")
    if os.path.getsize(path) > largest:
        raise ValueError(f"the {role} {path} has {os.path.getsize(path):,} bytes; give {wanted} of at most {largest:,}")


def number_or_text(text: str, where: str) -> Any:
    """Return a number if its usual spelling is the text, so that "007" stays text, or a boolean, or the text."""
    text = text.strip()
    for kind in (int, float):
        try:
            read = kind(text)
        except ValueError:
            continue
        return value(read, where) if str(read) == text else text
    return value({"true": True, "false": False}.get(text, text), where)


def _weight(given):
    """Return a weight, also of a text such as 1.50; another text as it is."""
    try:
        return float(given)
    except (ValueError, TypeError):
        return given
