"""Sheet of a comparison of a real record with a simulated one: curves over the angle."""
from __future__ import annotations

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mitsonar.units import deg_from_radians

from ..lines.line_sheet import LABEL_SIZE, curve_axes
from .comparison_paper import APART, REAL, SIMULATED, paper
from .sidescan_comparison import sidescan_figure

PANEL, COLUMNS = 330, 3            # pixels of a row, panels of it
ANGLE = "angle from the vertical [deg], starboard positive"
# title, label, scale, variables over both lines with their styles, variables of differences with their spreads
PANELS = (
    ("times along rays after three arms, rms", "one way [mm]", 1e3, {"ray_time_rms_by_angle": "-"}, {}),
    ("detected times at the same places (band: spread)", "one way [mm]", 1e3, {},
     {"echo_time_difference": "echo_time_spread"}),
    ("depths at the same places (band: spread)", "of the depth [%]", 1.0, {}, {"depth_difference": "depth_spread"}),
    ("strengths", "[dB]", 1.0, {"strength": "-"}, {}),
    ("strengths (band: error); blue: less the best constant", "[dB]", 1.0, {},
     {"strength_difference": "strength_error", "strength_shape": ""}),
    ("noise of depths: beams; dotted: pings", "of the depth [%]", 1.0,
     {"depth_noise_beams": "-", "depth_noise_pings": ":"}, {}),
    ("noise of strengths between beams", "[dB]", 1.0, {"strength_noise": "-"}, {}),
    ("beams with a sounding; dotted: by phase", "[%]", 1.0, {"valid_share": "-", "phase_share": ":"}, {}),
    ("stated uncertainty", "[m]", 1.0, {"uncertainty": "-"}, {}),
    ("quality", "log10", 1.0, {"quality": "-"}, {}),
    ("first return's ring over the bed; dotted: water", "[dB]", 1.0, {"column_ring": "-", "column_water": ":"}, {}),
    ("spread of the water's levels", "[dB]", 1.0, {"column_noise": "-"}, {}),
)


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
    if dataset.attrs.get("of") == "sidescan":
        return sidescan_figure(dataset)
    panels = [panel for panel in PANELS if any(name in dataset for name in (*panel[3], *panel[4]))]
    rows = -(-len(panels) // COLUMNS)
    figure, low, high = paper(dataset, PANEL * rows)
    grid = figure.add_gridspec(rows, COLUMNS, left=0.055, right=0.985, top=high, bottom=low, hspace=0.5, wspace=0.22)
    for number, panel in enumerate(panels):
        _draw(figure.add_subplot(grid[number // COLUMNS, number % COLUMNS]), dataset, *panel)
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
