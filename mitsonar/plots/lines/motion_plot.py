"""What the motion sensors said along a line, against time."""
from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from .line_sheet import curve_axes, key_above

__all__ = ["MOTIONS", "draw_attitude", "draw_motion"]

MOTIONS = {"motion_roll": "roll [deg]\nstarboard down", "motion_pitch": "pitch [deg]\nbow up",
           "motion_depth": "heave [m]\nup", "motion_heading": "heading [deg]\nfrom north"}
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#000000")
MOST_TICKS = 400                   # pings that are marked


def draw_motion(panels: Sequence[Axes], line: xr.Dataset, names: Sequence[str] = tuple(MOTIONS)) -> None:
    """Draw motions, a panel each, and mark the pings below.

    Parameters
    ----------
    panels : sequence of Axes
        As many as names.
    line : xarray.Dataset
    names : sequence of str
        Of `MOTIONS`. Heave is the way up from the mean depth of the reference point.
    """
    time = line["motion_time"].values
    for axes, name in zip(panels, names, strict=True):
        values = line[name].values
        if name == "motion_depth":
            known = values[np.isfinite(values)]
            values = (known.mean() if known.size else 0.0) - values
        elif name == "motion_heading":
            values = np.rad2deg(_unwrapped(values))
        else:
            values = np.rad2deg(values)
        axes.plot(time, values, color=COLOURS[list(MOTIONS).index(name)], linewidth=0.9,
                  marker="o" if time.size < 2 else None)
        curve_axes(axes, "", MOTIONS[name])
        axes.ticklabel_format(useOffset=False, style="plain")
    pings = line["ping_time"].values
    pings = pings[np.isfinite(pings)]
    if 0 < pings.size <= MOST_TICKS:
        panels[-1].plot(pings, np.full(pings.size, 0.03), "|", color="#777777", markersize=6,
                        transform=panels[-1].get_xaxis_transform(), label=f"{pings.size} pings")
    panels[-1].set_xlabel(f"time [s]{_since(line)}", fontsize=10.5)


def draw_attitude(axes: Axes, line: xr.Dataset) -> None:
    """Draw roll and pitch in one panel."""
    for name, colour, words in (("motion_roll", COLOURS[0], "roll"), ("motion_pitch", COLOURS[1], "pitch")):
        axes.plot(line["motion_time"].values, np.rad2deg(line[name].values), color=colour, linewidth=0.9, label=words)
    curve_axes(axes, f"time [s]{_since(line)}", "attitude [deg]")
    key_above(axes)


def _unwrapped(heading: np.ndarray) -> np.ndarray:
    """Headings [rad] without jumps at north, near 0 to 360 degrees; NaN stays."""
    known = np.isfinite(heading)
    smooth = heading.astype(float).copy()
    smooth[known] = np.unwrap(heading[known])
    return smooth


def _since(line: xr.Dataset) -> str:
    start = str(line.attrs.get("start") or "")
    return f" after {start}" if start and not start.startswith("1970-01-01T00:00:00") else ""
