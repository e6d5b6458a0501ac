"""The picture of a case: its panels side by side, what is expected as lines, what was got as points."""
import numpy as np
from matplotlib.figure import Figure

from ..plots import canvas
from .case import Case, Table

__all__ = ["draw"]

COLOURS = ("#1f4e79", "#b86f22", "#1b7a3d", "#b3261e", "#6a4c93", "#3a3a3a", "#0f8b8d", "#c05299")
IN_A_ROW, WIDTH, HEIGHT = 3, 520, 400      # panels, and picture elements of one


def draw(case: Case, table: Table) -> Figure:
    """Draw the panels of a case.

    Parameters
    ----------
    case : Case
    table : Table

    Returns
    -------
    matplotlib.figure.Figure
    """
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
