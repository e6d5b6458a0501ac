"""Comparisons of mitsonar with closed forms, published numbers and exact eigenrays, by one command.

Each of the `CASES` is a module of `cases`. Comparisons of the whole chain render scenes of their own.
"""
import time
from collections.abc import Callable, Sequence

from mitsonar.device.files import FilePath
from mitsonar.device.spelling import meant

from . import report
from .case import Case, Compared, Curve, Panel, Table
from .cases import CASES

__all__ = ["CASES", "Case", "Curve", "Panel", "Compared", "Table", "validate"]


def validate(names: Sequence[str] | None = None, *, quick: bool = False, folder: FilePath | None = None,
             say: Callable[[str], object] = print) -> bool:
    """Run comparisons, print each result, and write a report to a folder; return True if all numbers hold."""
    for name in names or ():
        if name not in CASES:
            raise ValueError(f"there is no comparison {name!r}{meant(name, CASES)}; give some of {', '.join(CASES)}")
    if folder is not None:
        report.check_folder(folder)
    tables = {}
    for name, case in CASES.items():
        if names and name not in names:
            continue
        start = time.monotonic()
        tables[name] = case.run(quick)
        say(report.lines(name, case, tables[name], time.monotonic() - start))
    if folder is not None:
        report.write(folder, tables, CASES, quick)
    return all(table.holds for table in tables.values())
