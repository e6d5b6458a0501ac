"""Report of comparisons: lines on the terminal, and a folder with report.md and a picture for every case.

The folder is written under another name beside its place, and renamed when it is complete. The picture of a case has
its panels side by side, with lines for expected and points for computed values.
"""
import os
import secrets
import shutil
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from mitsonar.device.files import FilePath, check_writable
from mitsonar.plots import canvas
from mitsonar.version import __version__

from .case import Case, Table

COLOURS = ("#1f4e79", "#b86f22", "#1b7a3d", "#b3261e", "#6a4c93", "#3a3a3a", "#0f8b8d", "#c05299")
IN_A_ROW, WIDTH, HEIGHT = 3, 520, 400      # panels; width and height of a panel in pixels


def draw(case: Case, table: Table) -> Figure:
    """Draw the panels of a case."""
    panels = table.panels
    rows = -(-len(panels) // IN_A_ROW)
    columns = -(-len(panels) // rows)
    figure = canvas.sheet(max(WIDTH * columns, 700), HEIGHT * rows + 60)
    grid = figure.subplots(rows, columns, squeeze=False)
    colours = {}
    for axes, panel in zip(grid.flat, panels):
        _fill(axes, panel, colours)
    for axes in grid.flat[len(panels):]:
        axes.set_visible(False)
    figure.suptitle(case.title, fontsize=13, fontweight="bold")
    figure.tight_layout()
    return figure


def _fill(axes, panel, colours):
    """Draw the lines of one panel; lines of the same label share a colour in all panels of the figure."""
    named = set()
    for line in panel.lines:
        known = line.label in named
        named.add(line.label)
        colour = colours.setdefault(line.label, COLOURS[len(colours) % len(COLOURS)])
        style = {"linestyle": "none", "marker": ".", "markersize": 4} if line.style == "." else {
            "linestyle": line.style, "linewidth": 1.2}
        axes.plot(np.asarray(line.x), np.asarray(line.y), color=colour, label=None if known else line.label, **style)
    if "x" in panel.logarithmic:
        axes.set_xscale("log")
    if "y" in panel.logarithmic:
        axes.set_yscale("log")
    axes.set_title(panel.title, fontsize=10.5)
    axes.set_xlabel(panel.x_label, fontsize=9.5)
    axes.set_ylabel(panel.y_label, fontsize=9.5)
    axes.tick_params(labelsize=9)
    axes.grid(alpha=0.25)
    if named != {""}:
        axes.legend(fontsize=7.5)


REPORT = "report.md"
LABEL = 68                         # characters of a row's label on the terminal
MOST_DECIMALS = 7                  # numbers with more are written with a power of ten


def lines(name: str, case: Case, table: Table, seconds: float) -> str:
    """Return the results of a case as text for the terminal."""
    # seconds [s]
    text = [f"{name}: {case.title}",
            f"  {'':{LABEL}}{'got':>16}{'expected':>16}{'error':>11}{'allowed':>10}"]
    for row in table.rows:
        got, expected, error, allowed = _numbers(row)
        mark = "" if row.holds else "   TOO MUCH"
        text.append(f"  {row.label:{LABEL}}{got:>16}{expected:>16}{error:>11}{allowed:>10} {row.unit}{mark}")
    text += [f"  {note}" for note in table.notes]
    return "\n".join([*text, f"  {_verdict(table)} ({seconds:.1f} s)", ""])


def _verdict(table):
    beyond = sum(not row.holds for row in table.rows)
    if beyond:
        return f"{beyond} of {len(table.rows)} beyond what is allowed"
    return f"all {len(table.rows)} within what is allowed; the worst takes {100 * table.share:.0f} % of it"


def _numbers(row):
    """Return got, expected, error and allowed as text, with decimals to a tenth of the allowed error."""
    decimals = max(0, 1 - int(np.floor(np.log10(row.allowed))))
    if decimals > MOST_DECIMALS:
        return f"{row.got:.10g}", f"{row.expected:.10g}", f"{row.error:.1e}", f"{row.allowed:.1e}"
    return f"{row.got:.{decimals}f}", f"{row.expected:.{decimals}f}", f"{row.error:+.{decimals}f}", f"{row.allowed:.3g}"


def check_folder(folder: FilePath) -> Path:
    """Check that a report can be written to ``folder``, before the comparisons begin; return its real path."""
    if os.fspath(folder) == "":
        raise ValueError("cannot write '': it names no folder; give the name of one for the report.")
    target = Path(os.path.realpath(folder))
    if target.exists() and not target.is_dir():
        raise ValueError(f"cannot write {folder}: it is a file; give the name of a folder for the report.")
    check_writable(target.parent / f".{target.name}")
    if target.is_dir():
        others = sorted(entry.name for entry in target.iterdir() if not _is_ours(entry, target))
        if others:
            raise ValueError(f"cannot write {folder}: the folder holds {others[0]}, which is no part of a report; give "
                             "the name of a new or an empty folder.")
    return target


def _is_ours(entry, folder):
    """Return True if a file may belong to an older report: report.md, or a picture beside it."""
    return entry.is_file() and (entry.name == REPORT or entry.suffix == ".png" and (folder / REPORT).is_file())


def write(folder: FilePath, tables: Mapping[str, Table], cases: Mapping[str, Case], quick: bool) -> None:
    """Write the report and its pictures, or no file at all after an error."""
    target = check_folder(folder)
    mark = secrets.token_hex(4)
    fresh, stale = (target.with_name(f".{target.name[:100]}.{mark}.{age}") for age in ("new", "old"))
    fresh.mkdir()
    try:
        for name, table in tables.items():
            canvas.save(draw(cases[name], table), fresh / f"{name}.png")
        (fresh / REPORT).write_text(_markdown(tables, cases, quick), encoding="utf-8")
        if target.exists():
            os.replace(target, stale)
        os.replace(fresh, target)
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
        if stale.exists() and not target.exists():
            os.replace(stale, target)
        shutil.rmtree(stale, ignore_errors=True)


def _markdown(tables, cases, quick):
    rows = [row for table in tables.values() for row in table.rows]
    beyond = sum(not row.holds for row in rows)
    all_in_all = f"{beyond} of them beyond" if beyond else "all within"
    text = [f"# How exact mitsonar {__version__} is", "",
            f"Written by `mitsonar validate{' --quick' if quick else ''}`: {len(rows)} numbers, "
            f"{all_in_all} what is allowed. An error is got minus expected; *of allowed* is the largest error of a "
            "case over what is allowed there.", "",
            "| case | what | numbers | of allowed | verdict |", "|---|---|---|---|---|"]
    text += [f"| [{name}](#{name}) | {cases[name].title} | {len(table.rows)} | {100 * table.share:.0f} % | "
             f"{_word(table.holds)} |" for name, table in tables.items()]
    for name, table in tables.items():
        text += ["", f"## {name}", "", f"**{cases[name].title}.** {cases[name].text}", "",
                 "| what | got | expected | error | allowed | unit | verdict |", "|---|---|---|---|---|---|---|"]
        text += [f"| {row.label.replace('|', chr(92) + '|')} | {' | '.join(_numbers(row))} | {row.unit} | "
                 f"{_word(row.holds)} |" for row in table.rows]
        text += [line for note in table.notes for line in ("", note)]
        text += ["", f"![{cases[name].title}]({name}.png)"]
    return "\n".join([*text, ""])


def _word(holds):
    return "within" if holds else "**beyond**"
