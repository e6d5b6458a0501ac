"""Sheet of a comparison of a real record with a simulated one: curves over the angle."""
from __future__ import annotations

import textwrap

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from mitsonar.units import deg_from_radians

from ..canvas import sheet
from ..lines.line_sheet import LABEL_SIZE, curve_axes, headed

REAL, SIMULATED, APART = "#0072b2", "#d55e00", "#009e73"
WIDTH, PANEL, HEAD, LINE = 1560, 330, 70, 15     # pixels
LETTERS = 118                      # of a line of evidence
COLUMNS = 3
ANGLE = "angle from the vertical [deg], starboard positive"
# title, label, scale, variables over both lines with their styles, variables of differences with their spreads
PANELS = (
    ("times along rays after three arms, rms", "one way [mm]", 1e3, {"ray_time_rms_by_angle": "-"}, {}),
    ("detected times at the same places (band: spread)", "one way [mm]", 1e3, {},
     {"echo_time_difference": "echo_time_spread"}),
    ("depths at the same places (band: spread)", "of the depth [%]", 1.0, {}, {"depth_difference": "depth_spread"}),
    ("strengths", "[dB]", 1.0, {"strength": "-"}, {}),
    ("strengths; blue: less the best constant", "[dB]", 1.0, {}, {"strength_difference": "", "strength_shape": ""}),
    ("noise of depths: beams; dotted: pings", "of the depth [%]", 1.0,
     {"depth_noise_beams": "-", "depth_noise_pings": ":"}, {}),
    ("noise of strengths between beams", "[dB]", 1.0, {"strength_noise": "-"}, {}),
    ("beams with a sounding; dotted: by phase", "[%]", 1.0, {"valid_share": "-", "phase_share": ":"}, {}),
    ("stated uncertainty", "[m]", 1.0, {"uncertainty": "-"}, {}),
    ("quality", "log10", 1.0, {"quality": "-"}, {}),
    ("first return's ring over the bed; dotted: water", "[dB]", 1.0, {"column_ring": "-", "column_water": ":"}, {}),
    ("spread of the water's levels", "[dB]", 1.0, {"column_noise": "-"}, {}),
)
KEYS = (("real", REAL), ("simulated", SIMULATED), ("simulated - real", APART))


def comparison_figure(dataset: xr.Dataset) -> Figure:
    """Draw a comparison.

    Parameters
    ----------
    dataset : xarray.Dataset
        Output of `mitsonar.compare`.

    Returns
    -------
    Figure

    Raises
    ------
    ValueError
        If the dataset is no comparison.
    """
    if dataset.attrs.get("kind") != "comparison":
        raise ValueError("this dataset is no comparison; give the output of mitsonar.compare.")
    panels = [panel for panel in PANELS if any(name in dataset for name in (*panel[3], *panel[4]))]
    rows = -(-len(panels) // COLUMNS)
    evidence = _evidence(dataset)
    foot = LINE * (max(len(part) for part in evidence) + 1)
    figure = sheet(WIDTH, HEAD + PANEL * rows + foot)
    high = figure.bbox.height
    headed(figure, f"{dataset.attrs['real']}  and  {dataset.attrs['simulated']}",
           str((list(dataset.attrs.get("remarks", [])) or [""])[0]))
    grid = figure.add_gridspec(rows, COLUMNS, left=0.055, right=0.985, top=1 - (HEAD + 55) / high,
                               bottom=(foot + 65) / high, hspace=0.5, wspace=0.22)
    handles = [Line2D([], [], color=colour, label=words) for words, colour in KEYS]
    figure.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, 1 - (HEAD - 12) / high), ncols=len(KEYS),
                  frameon=False, fontsize=LABEL_SIZE)
    for number, panel in enumerate(panels):
        _draw(figure.add_subplot(grid[number // COLUMNS, number % COLUMNS]), dataset, *panel)
    for number, part in enumerate(evidence):
        figure.text(0.02 + 0.49 * number, foot / high, "\n".join(part), fontsize=8, va="top", color="#444444",
                    linespacing=1.15)
    return figure


def _draw(axes: Axes, dataset: xr.Dataset, title: str, label: str, scale: float,
          both: dict[str, str], apart: dict[str, str]) -> None:
    """Draw one panel over the angle."""
    angle = deg_from_radians(dataset["angle"].values)
    wide = angle[1] - angle[0] if angle.size > 1 else 2.0
    for name in both.keys() & set(dataset):
        for values, colour in zip(scale * dataset[name].values, (REAL, SIMULATED)):
            axes.plot(angle, values, both[name], color=colour, linewidth=1.5)
    for (name, spread), colour in zip(apart.items(), (APART, REAL)):
        values = scale * dataset[name].values
        if spread:
            around = scale * dataset[spread].values
            axes.fill_between(angle, values - around, values + around, color=colour, alpha=0.2, linewidth=0)
        axes.plot(angle, values, "-", color=colour, linewidth=1.5)
        axes.axhline(0, color="#777777", linewidth=0.8)
    for middle in angle[dataset["silent"].values > 0]:
        axes.axvspan(middle - wide / 2, middle + wide / 2, color="#999999", alpha=0.25, linewidth=0)
    curve_axes(axes, ANGLE, label)
    axes.set_title(title, fontsize=LABEL_SIZE)


def _evidence(dataset: xr.Dataset) -> tuple[list[str], list[str]]:
    """Return the evidence of the terms as lines of text, in two columns."""
    said = {str(one.attrs["term"]): str(one.attrs["evidence"]) for one in dataset.data_vars.values()
            if "evidence" in one.attrs}
    lines = [textwrap.wrap(f"{term}: {text}", LETTERS) for term, text in said.items()]
    half = next((number for number in range(len(lines)) if sum(map(len, lines[:number])) >= sum(map(len, lines)) / 2),
                len(lines))
    return sum(lines[:half], []), sum(lines[half:], [])
