"""The picture of a sound-speed profile from soundings: what was believed, what came out, how sure, what was seen."""
from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mitsonar.water.profile import SoundSpeedProfile

from ..canvas import sheet
from ..lines.line_sheet import curve_axes, key_above

ANSWER, RIVAL, BEFORE = "#0072b2", "#d55e00", "#999999"
NEEDED = ("depth", "sound_speed", "start_sound_speed", "deviation", "told", "singular_value")


def profile_fit_figure(answer: xr.Dataset, truth: SoundSpeedProfile | None = None) -> Figure:
    """Draw an answer of `mitsonar.inversion.profile.profile`.

    Parameters
    ----------
    answer : xarray.Dataset
        As `ProfileFit.to_dataset` makes it.
    truth : SoundSpeedProfile or None
        Where it is known.

    Returns
    -------
    Figure

    Raises
    ------
    ValueError
        If the dataset is no such answer.
    """
    missing = [name for name in NEEDED if name not in answer]
    if missing:
        raise ValueError(f"the picture of a profile's fit needs {missing[0]}, which the dataset has not; give what "
                         "ProfileFit.to_dataset makes.")
    figure = sheet(1000, 640)
    left, right = figure.subplots(1, 2, width_ratios=(3, 2), gridspec_kw={"wspace": 0.3})
    depth, speed, deviation = (answer[name].values for name in ("depth", "sound_speed", "deviation"))
    told = answer["told"].values.astype(bool)
    if truth is not None:
        fine = np.linspace(depth[0], depth[-1], 400)
        left.plot(truth.at(fine), fine, color="black", label="truth")
    left.plot(answer["start_sound_speed"], depth, ":", color=BEFORE, label="before")
    left.fill_betweenx(depth, speed - deviation, speed + deviation, color=ANSWER, alpha=0.2, linewidth=0,
                       label="one deviation")
    left.plot(speed, depth, "-", color=ANSWER, linewidth=0.8)
    left.plot(speed[told], depth[told], "o", color=ANSWER, label="told")
    left.plot(speed[~told], depth[~told], "o", color="white", markeredgecolor=ANSWER, label="not told")
    if "rival_sound_speed" in answer:
        left.plot(answer["rival_sound_speed"], depth, "--", color=RIVAL, label="meets the times as well")
    left.invert_yaxis()
    curve_axes(left, "sound speed [m/s]", "depth [m]")
    key_above(left)
    values = np.maximum(answer["singular_value"].values, 1e-4)
    right.semilogy(1 + np.arange(values.size), values, "o", color=ANSWER, label="singular values")
    right.axhline(1, color=BEFORE, label="above: known better than before")
    right.xaxis.set_major_locator(MaxNLocator(integer=True))
    curve_axes(right, "pattern", "of the times by the speeds")
    key_above(right)
    return figure
