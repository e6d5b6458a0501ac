"""Paper of sheets of comparisons: title, key of the colours, and the evidence of the terms at the foot."""
from __future__ import annotations

import textwrap

import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..canvas import sheet
from ..lines.line_sheet import LABEL_SIZE, headed

REAL, SIMULATED, APART = "#0072b2", "#d55e00", "#009e73"
KEYS = (("real", REAL), ("simulated", SIMULATED), ("simulated - real", APART))
WIDTH, HEAD, LINE = 1560, 70, 15     # pixels
LETTERS = 118                      # of a line of evidence


def paper(dataset: xr.Dataset, height: float) -> tuple[Figure, float, float]:
    """Return a sheet for panels of a height in pixels, and the shares of its height between which they stand."""
    evidence = _evidence(dataset)
    foot = LINE * (max(len(part) for part in evidence) + 1)
    figure = sheet(WIDTH, HEAD + height + foot)
    high = figure.bbox.height
    headed(figure, f"{dataset.attrs['real']}  and  {dataset.attrs['simulated']}",
           "   ·   ".join(list(dataset.attrs.get("remarks", []))[:1 + (dataset.attrs.get("of") == "sidescan")]))
    figure.legend(handles=[Line2D([], [], color=colour, label=words) for words, colour in KEYS], loc="upper center",
                  bbox_to_anchor=(0.5, 1 - (HEAD - 12) / high), ncols=len(KEYS), frameon=False, fontsize=LABEL_SIZE)
    for number, part in enumerate(evidence):
        figure.text(0.02 + 0.49 * number, foot / high, "\n".join(part), fontsize=8, va="top", color="#444444",
                    linespacing=1.15)
    return figure, (foot + 65) / high, 1 - (HEAD + 55) / high


def _evidence(dataset: xr.Dataset) -> tuple[list[str], list[str]]:
    """Return the evidence of the terms as lines of text, in two columns."""
    said = {str(one.attrs["term"]): str(one.attrs["evidence"]) for one in dataset.data_vars.values()
            if "evidence" in one.attrs}
    lines = [textwrap.wrap(f"{term}: {text}", LETTERS) for term, text in said.items()]
    half = next((number for number in range(len(lines)) if sum(map(len, lines[:number])) >= sum(map(len, lines)) / 2),
                len(lines))
    return sum(lines[:half], []), sum(lines[half:], [])
