"""Sheet of pictures of soundings, with curves and maps, drawn on matplotlib axes without pyplot."""
from __future__ import annotations

from typing import Literal

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.figure import Figure
from matplotlib.transforms import ScaledTranslation, blended_transform_factory

from mitsonar.hydrography.record import BY_AMPLITUDE, BY_PHASE, NOT_DETECTED
from mitsonar.units import khz_from_hertz

# Colours that all kinds of colour sight tell apart (Okabe and Ito 2008), and line styles for sheets without colour.
CAUSES = {"error": ("all causes", "#000000", "-"), "error_detection": ("detection", "#0072b2", "--"),
          "error_refraction": ("refraction", "#d55e00", "-."), "error_motion": ("motion", "#009e73", ":")}
METHODS = {BY_AMPLITUDE: ("by amplitude", "#e69f00", "^"), BY_PHASE: ("by phase", "#0072b2", "o"),
           NOT_DETECTED: ("none", "#999999", "x")}
LABEL_SIZE, TITLE_SIZE = 10.5, 13
BAR_GAP, BAR_WIDTH = 0.12, 0.16    # [inch]


def sounded(line: xr.Dataset) -> np.ndarray:
    """Return a mask (ping, beam) of soundings with a depth and a place."""
    there = line["valid"].values.astype(bool) & np.isfinite(line["depth"].values)
    for name in ("across_track", "x", "y"):
        there &= np.isfinite(line[name].values)
    if not there.any():
        raise ValueError(f"none of the {there.size} soundings of {line.sizes['ping']} pings is valid, so there is "
                         "nothing to draw; the view motion needs no soundings.")
    return there


def line_title(line: xr.Dataset) -> str:
    """Return the title of a line: its own, or the name of its sonar."""
    return str(line.attrs.get("title") or line.attrs.get("preset") or line.attrs.get("sonar") or "soundings")


def line_words(line: xr.Dataset) -> str:
    """Return a line of text: number of pings and soundings, depths, and frequencies."""
    valid = line["valid"].values.astype(bool)
    pings = line.sizes["ping"]
    parts = [f"{pings} ping{'s' * (pings != 1)}", f"{int(valid.sum())} of {valid.size} soundings valid"]
    depth = line["depth"].values[valid]
    depth = depth[np.isfinite(depth)]
    if depth.size:
        low, high = f"{depth.min():.4g}", f"{depth.max():.4g}"
        parts.append(f"{low} m deep" if low == high else f"{low} to {high} m deep")
    frequency = line["sector_frequency"].values
    frequency = frequency[np.isfinite(frequency) & (frequency > 0)]
    if frequency.size:
        low, high = (f"{khz_from_hertz(float(end)):.4g}" for end in (frequency.min(), frequency.max()))
        parts.append(f"{low} kHz" if low == high else f"{low} to {high} kHz")
    return "   ·   ".join(parts)


def headed(figure: Figure, title: str, words: str) -> None:
    """Write a title and a line of words at the top of a sheet."""
    high = figure.bbox.height
    figure.suptitle(title, x=0.5, y=1 - 16 / high, va="top", fontsize=TITLE_SIZE, fontweight="bold")
    figure.text(0.5, 1 - 42 / high, words, ha="center", va="top", fontsize=LABEL_SIZE - 1, color="#444444")


def curve_axes(axes: Axes, across: str, up: str) -> None:
    """Label the axes of curves, and add a grid."""
    axes.set_xlabel(across, fontsize=LABEL_SIZE)
    axes.set_ylabel(up, fontsize=LABEL_SIZE)
    axes.tick_params(labelsize=9.5)
    axes.grid(alpha=0.25)


def bar_beside(axes: Axes, drawn: ScalarMappable, label: str, *, falls: bool = False,
               extend: Literal["neither", "both", "min", "max"] = "neither") -> Colorbar:
    """Add a colour bar to the right of axes; `falls` puts large values at the bottom."""
    # as high as the axes, even if their aspect is equal, and of constant width [inch]
    figure = axes.figure
    beside = figure.dpi_scale_trans + ScaledTranslation(
        1, 0, axes.transAxes)                          # pyright: ignore[reportArgumentType]  any transform works
    room = axes.inset_axes((BAR_GAP, 0, BAR_WIDTH, 1), transform=blended_transform_factory(beside, axes.transAxes))
    bar = figure.colorbar(drawn, cax=room, extend=extend, extendfrac=0.02)
    bar.set_label(label, fontsize=LABEL_SIZE)
    bar.ax.tick_params(labelsize=9.5)
    if falls:
        bar.ax.invert_yaxis()
    return bar


def key_above(axes: Axes, markers: float = 1.0) -> None:
    """Add the legend above axes, where it hides no curve; `markers` scales its markers."""
    handles, words = axes.get_legend_handles_labels()
    letters = max(map(len, words), default=1)
    columns = int(np.clip(axes.bbox.width / (7.5 * letters + 50), 1, 5))
    axes.legend(handles, words, fontsize=9.5, ncols=columns, loc="lower center", bbox_to_anchor=(0.5, 1.0),
                frameon=False, borderaxespad=0.3, columnspacing=1.4, markerscale=markers)
