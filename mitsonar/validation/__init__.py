"""Every comparison of mitsonar with closed forms, published numbers and exact eigenrays, by one command.

Each of the `CASES` is a module of `cases`; it renders scenes of its own where the whole chain is compared.
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
    """Run comparisons, report each as it ends, and write a report of all to a folder."""
    for name in names or ():
        if name not in CASES:
            raise ValueError(f"there is no comparison {name!r}{meant(name, CASES)}; give some of {', '.join(CASES)}")
    if folder is not None:
        report.check_folder(folder)
    found = {}
    for name, case in CASES.items():
        if names and name not in names:
            continue
        start = time.monotonic()
        found[name] = case.run(quick)
        say(report.lines(name, case, found[name], time.monotonic() - start))
    if folder is not None:
        report.write(folder, found, CASES, quick)
    return all(table.holds for table in found.values())
