"""The published table and figures of the method, computed anew: each result is a module, named in `RESULTS`.

``mitsonar published RESULT`` runs them in a checkout; the wheel leaves them out.

Every one has ``compute()`` that gives an `xarray.Dataset`, ``table(dataset)`` that says it in text, ``rows(dataset)``
that gives header and records of a CSV file, and ``plot(dataset)`` that draws a matplotlib figure.
"""
import csv
from pathlib import Path

from mitsonar.device.files import FilePath, check_writable, replacing
from mitsonar.device.spelling import meant

from . import effective_speed, figure_2, figure_3, table_1

__all__ = ["RESULTS", "text", "write"]

RESULTS = {"table_1": table_1, "effective_speed": effective_speed, "figure_2": figure_2, "figure_3": figure_3}


def text(name: str) -> str:
    """Compute a result and say it in text."""
    result = _known(name)
    return result.table(result.compute())


def write(name: str, path: FilePath) -> None:
    """Compute a result and write it: its numbers to a .csv, its figure to a .png, .pdf or .svg."""
    from mitsonar.plots import canvas

    result, as_table = _known(name), Path(path).suffix.lower() == ".csv"
    if not as_table and Path(path).suffix.lower() not in canvas.FORMATS:
        raise ValueError(f"cannot write {path}: its name must end in .csv for the numbers, or in "
                         f"{', '.join(canvas.FORMATS)} for the figure.")
    check_writable(path)
    dataset = result.compute()
    if not as_table:
        canvas.save(result.plot(dataset), path)
        return
    header, records = result.rows(dataset)
    with replacing(path) as temporary, open(temporary, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(records)


def _known(name):
    if name not in RESULTS:
        raise ValueError(f"there is no published result {name!r}{meant(name, RESULTS)}; give one of "
                         f"{', '.join(RESULTS)}")
    return RESULTS[name]
