"""Sheet of a comparison of sidescans: pictures of the same gain, mean over range, strongest clues, statistics."""
from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..canvas import GREY
from ..lines.line_sheet import LABEL_SIZE, curve_axes
from .comparison_paper import APART, REAL, SIMULATED, paper

HEIGHT, CLUES = 1250, 16
WHITE = 4.0                        # amplitude over the median that is drawn white


def sidescan_figure(dataset: xr.Dataset) -> Figure:
    """Draw a comparison of sidescans."""
    figure, low, high = paper(dataset, HEIGHT)
    grid = figure.add_gridspec(2, 2, left=0.055, right=0.985, top=high, bottom=low, hspace=0.2, wspace=0.16,
                               height_ratios=(1.15, 1))
    for number, name in enumerate(("real", "simulated")):
        _picture(figure.add_subplot(grid[0, number]), dataset, name)
    lower = grid[1, :].subgridspec(1, 3, width_ratios=(0.85, 1, 0.85), wspace=0.75)
    _over_range(figure.add_subplot(lower[0]), dataset)
    if "auc" in dataset:
        _clues(figure.add_subplot(lower[1]), dataset)
    _statistics(figure.add_subplot(lower[2]), dataset)
    return figure


def _picture(axes: Axes, dataset: xr.Dataset, name: str) -> None:
    across = dataset["column"].values
    shown = np.sqrt(np.clip(dataset["picture"].sel(line=name).values / WHITE, 0, 1))
    axes.imshow(shown, cmap=GREY, vmin=0, vmax=1, aspect="auto", interpolation="nearest", origin="lower",
                extent=(float(across[0]), float(across[-1]), 0, 100))
    axes.set_title(f"{name}: root of the amplitude over its median", fontsize=LABEL_SIZE)
    axes.set_xlabel("port   ←   slant range [m]   →   starboard", fontsize=LABEL_SIZE)
    axes.set_ylabel("share of the line [%]", fontsize=LABEL_SIZE)


def _over_range(axes: Axes, dataset: xr.Dataset) -> None:
    distance = dataset["distance"].values
    for values, colour in zip(dataset["mean_db"].values, (REAL, SIMULATED)):
        for side, style in zip(values, ("-", ":")):
            axes.plot(distance, side, style, color=colour, linewidth=1.4)
    curve_axes(axes, "slant range [m]", "mean intensity over the bed's [dB]")
    axes.set_title("mean over range: port; dotted: starboard", fontsize=LABEL_SIZE)


def _clues(axes: Axes, dataset: xr.Dataset) -> None:
    """Draw the strongest clues: AUC with its error, and the control."""
    order = _strongest(dataset)[::-1]
    rows = np.arange(order.size)
    axes.errorbar(dataset["auc"].values[order], rows, xerr=dataset["auc_error"].values[order], fmt="o", color=APART,
                  capsize=3)
    axes.plot(dataset["auc_control"].values[order], rows, "|", color=REAL, markersize=11)
    axes.axvline(0.5, color="#777777", linewidth=0.8)
    axes.set_yticks(rows, [_short(str(name)) for name in dataset["clue"].values[order]], fontsize=8)
    axes.set_xlim(-0.03, 1.03)
    curve_axes(axes, "AUC: chance that a real item has the larger value", "")
    axes.tick_params(axis="y", labelsize=8)
    axes.set_title("strongest clues; bar: real port against starboard", fontsize=LABEL_SIZE)


def _strongest(dataset: xr.Dataset) -> np.ndarray:
    """Return the numbers of the clues that tell the records apart most beyond the control."""
    away, control = (np.abs(dataset[name].values - 0.5) for name in ("auc", "auc_control"))
    return np.argsort(-np.where(np.isfinite(away), away - np.nan_to_num(control), -1.0), kind="stable")[:CLUES]


def _short(name: str) -> str:
    return name if len(name) <= 34 else f"{name[:33]}…"


def _statistics(axes: Axes, dataset: xr.Dataset) -> None:
    """Write the statistics, means of both sides."""
    axes.set_axis_off()
    lines = [f"{'statistics, mean of both sides':37}{'real':>9}{'simulated':>11}"]
    for name, (real, simulated) in zip(dataset["statistic"].values, dataset["value"].values.mean(1).T):
        lines.append(f"{name!s:37}{real:9.3g}{simulated:11.3g}")
    if "auc" in dataset:
        lines += ["", f"{'clue, median':37}{'real':>9}{'simulated':>11}"]
        for number in _strongest(dataset)[:CLUES // 2]:
            real, simulated = dataset["clue_median"].values[:, number]
            lines.append(f"{_short(str(dataset['clue'].values[number])):37}{real:9.3g}{simulated:11.3g}")
    axes.text(-0.45, 1, "\n".join(lines), family="monospace", fontsize=7.6, va="top", transform=axes.transAxes,
              linespacing=1.5)
