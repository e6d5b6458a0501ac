"""Plot of a fit: start, answer, its standard deviation, the share that the record determines, and the truth."""
from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..canvas import sheet
from ..lines.line_sheet import bar_beside, curve_axes, headed, key_above

ROW, TALL, WIDTH, HEAD = 330, 640, 1300, 70     # pixels
VALUES, ERRORS, DEVIATIONS, SHARES = "viridis", "RdBu_r", "magma", "Greys"
ANSWER, RIVAL, BEFORE = "#0072b2", "#d55e00", "#999999"
MOST_ROWS = 8
LONG = 2.0                         # ratio of sides beyond which a map fills its axes


def fit_figure(answer: xr.Dataset) -> Figure:
    """Draw the answer of a fit.

    Parameters
    ----------
    answer : xarray.Dataset
        Output of `Fit.to_dataset` or `ProfileFit.to_dataset`. ``NAME_truth`` is drawn, too, if it is there. Values with
        ``NAME_east`` and ``NAME_north`` [m] are drawn as a map, values over ``depth`` as a profile.

    Returns
    -------
    Figure

    Raises
    ------
    ValueError
        If the dataset is no answer of a fit.
    """
    names = list(answer.attrs.get("parameters", []))
    if not names or any(name not in answer or f"{name}_deviation" not in answer for name in names):
        raise ValueError("this dataset is no answer of a fit; give the output of Fit.to_dataset.")
    shown = names[:MOST_ROWS]
    row = TALL if "depth" in answer else ROW
    figure = sheet(WIDTH, HEAD + row * len(shown))
    headed(figure, "fit of " + ", ".join(names), str(answer.attrs.get("stopped", "")))
    top = 1 - HEAD / (HEAD + row * len(shown))
    height = top / len(shown)
    for number, name in enumerate(shown):
        low = top - (number + 1) * height
        _draw(figure, answer, name, {"left": 0.08, "right": 0.95, "bottom": low + 0.2 * height,
                                     "top": low + 0.86 * height, "wspace": 0.75})
    return figure


def _draw(figure: Figure, answer: xr.Dataset, name: str, place: dict[str, float]) -> None:
    """Draw the row of one parameter."""
    if f"{name}_east" in answer or answer[name].ndim == 2 and min(answer[name].shape) > 3:
        _maps(figure, answer, name, place)
    elif "depth" in answer and answer["depth"].dims == answer[name].dims:
        _profile(figure, answer, name, place)
    else:
        _curves(figure.add_gridspec(1, 1, **place).subplots(squeeze=False)[0, 0], answer, name)


def _maps(figure: Figure, answer: xr.Dataset, name: str, place: dict[str, float]) -> None:
    unit = answer[name].attrs.get("units", "1")
    columns = [(f"{name}_start", "start", VALUES), (name, "answer", VALUES),
               (f"{name}_deviation", "one deviation", DEVIATIONS), (f"{name}_resolved", "share determined", SHARES)]
    if f"{name}_truth" in answer:
        columns.insert(0, (f"{name}_truth", "truth", VALUES))
    same = np.concatenate([answer[key].values.ravel() for key, _, colours in columns if colours == VALUES])
    limits = {VALUES: tuple(np.percentile(same, (1, 99))), SHARES: (0.0, 1.0),
              DEVIATIONS: (0.0, float(answer[f"{name}_prior_deviation"].values.max()))}
    if f"{name}_truth" in answer:
        columns.insert(3, (f"{name}_error", "answer - truth", ERRORS))
        answer = answer.assign({f"{name}_error": answer[name] - answer[f"{name}_truth"]})
        most = max(float(np.percentile(np.abs(answer[f"{name}_error"].values), 98)), 1e-12)
        limits[ERRORS] = -most, most
    row = figure.add_gridspec(1, len(columns), **place).subplots(squeeze=False)[0]
    for axes, (key, title, colours) in zip(row, columns):
        low, high = limits[colours]
        values = answer[key].values
        if f"{name}_east" in answer:
            east, north = answer[f"{name}_east"].values, answer[f"{name}_north"].values
            drawn = axes.tripcolor(east, north, values.ravel(), shading="gouraud", cmap=colours, vmin=low, vmax=high)
            axes.set_aspect("equal" if 1 / LONG < np.ptp(east) / max(np.ptp(north), 1e-9) < LONG else "auto")
            curve_axes(axes, "east [m]", "north [m]")
        else:
            across, up = answer[name].dims if answer[name].dims[0] == "x" else answer[name].dims[::-1]
            values = answer[key].transpose(up, across).values
            places = [answer[dim].values if dim in answer.coords else np.arange(answer.sizes[dim])
                      for dim in (across, up)]
            drawn = axes.pcolormesh(*places, values, shading="nearest", cmap=colours, vmin=low, vmax=high)
            curve_axes(axes, *(f"{dim} [m]" if dim in answer.coords else "" for dim in (across, up)))
        if title != columns[0][1]:
            axes.set_ylabel("")
            axes.tick_params(labelleft=False)
        axes.set_title(f"{name}: {title}" if title == columns[0][1] else title, fontsize=10.5)
        bar = bar_beside(axes, drawn, "")
        bar.ax.set_title("" if colours == SHARES else f"[{unit}]", fontsize=9.5)
        bar.locator = MaxNLocator(4)
        bar.update_ticks()


def _profile(figure: Figure, answer: xr.Dataset, name: str, place: dict[str, float]) -> None:
    """Draw a parameter over depth, and beside it the singular values of its patterns."""
    grid = figure.add_gridspec(1, 2, width_ratios=(3, 2), **{**place, "wspace": 0.3})
    left, right = grid.subplots(squeeze=False)[0]
    depth, values, deviation = (answer[key].values for key in ("depth", name, f"{name}_deviation"))
    determined = answer["told"].values.astype(bool)
    for kind, style, colour, label in (("truth", "-", "black", "truth"), ("start", ":", BEFORE, "start"),
                                       ("rival", "--", RIVAL, "fits the times as well")):
        if f"{name}_{kind}" in answer:
            left.plot(answer[f"{name}_{kind}"], depth, style, color=colour, label=label)
    left.fill_betweenx(depth, values - deviation, values + deviation, color=ANSWER, alpha=0.2, linewidth=0,
                       label="one deviation")
    left.plot(values, depth, "-", color=ANSWER, linewidth=0.8)
    for mask, fill, label in ((determined, ANSWER, "determined"), (~determined, "white", "not determined")):
        left.plot(values[mask], depth[mask], "o", color=fill, markeredgecolor=ANSWER, label=label)
    left.invert_yaxis()
    curve_axes(left, f"{name.replace('_', ' ')} [{answer[name].attrs['units']}]", "depth [m]")
    key_above(left)
    singular = np.maximum(answer["singular_value"].values, 1e-4)
    right.semilogy(1 + np.arange(singular.size), singular, "o", color=ANSWER, label="singular values")
    right.axhline(1, color=BEFORE, label="above: known better than before")
    right.xaxis.set_major_locator(MaxNLocator(integer=True))
    curve_axes(right, "pattern", "")
    key_above(right)


def _curves(axes: Axes, answer: xr.Dataset, name: str) -> None:
    """Draw a few numbers with their deviations."""
    values = answer[name].values.ravel()
    number = np.arange(values.size)
    axes.errorbar(number, values, answer[f"{name}_deviation"].values.ravel(), fmt="o", color=ANSWER, capsize=3,
                  label="answer, and one deviation")
    axes.plot(number, answer[f"{name}_start"].values.ravel(), "x", color=BEFORE, label="start")
    if f"{name}_truth" in answer:
        axes.plot(number, answer[f"{name}_truth"].values.ravel(), "+", color="black", markersize=12, label="truth")
    unit = answer[name].attrs.get("units", "1")
    curve_axes(axes, f"number of {name}", f"[{unit}]")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    key_above(axes)
