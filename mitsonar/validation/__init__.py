"""Every comparison of mitsonar with closed forms, published numbers and exact eigenrays, by one command.

Each member of `CASES` is a module with a `Case`; it stands on everything below, renders scenes of its own where the
whole chain is compared, and gives rows of got, expected and allowed.
"""
import time
from collections.abc import Callable, Sequence

from mitsonar.device.files import FilePath
from mitsonar.device.spelling import meant

from . import (
    beams,
    closure,
    crossover,
    elements,
    ghosts,
    rays,
    report,
    sediments,
    statistics,
    surface,
    targets,
    vectors,
    volume,
    water,
)
from .case import Case, Compared, Curve, Panel, Table

__all__ = ["CASES", "Case", "Curve", "Panel", "Compared", "Table", "validate"]

CASES = {
    "water": water.CASE,
    "rays": rays.CASE,
    "vectors": vectors.CASE,
    "sediments": sediments.CASE,
    "beams": beams.CASE,
    "closure": closure.CASE,
    "elements": elements.CASE,
    "statistics": statistics.CASE,
    "targets": targets.CASE,
    "crossover": crossover.CASE,
    "surface": surface.CASE,
    "volume": volume.CASE,
    "ghosts": ghosts.CASE,
}


def validate(names: Sequence[str] | None = None, *, quick: bool = False, folder: FilePath | None = None,
             say: Callable[[str], object] = print) -> bool:
    """Run comparisons, say what they find as they go, and write a report."""
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
