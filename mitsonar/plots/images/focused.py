"""Plots of focused images and their products, such as levels, phases and heights, in metres of their own grid.

The horizontal axis is ``across_track``, the vertical axis ``along_track``, both to the same scale. A pixel that covers
several grid points shows their mean: of intensities for levels, of unit vectors for phases, else of the values.
"""
from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.colors import Colormap
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from mitsonar.device.files import FilePath
from mitsonar.device.spelling import meant
from mitsonar.imaging.focused import GROUND
from mitsonar.units import db_from_power, power_from_db

from .. import canvas
from ..canvas import in_metres, title
from .grid import WIDEST, PlotGrid, edges_around, stretches
from .label_key import counted, label_key

OF_THE_TRUTH = "labels", "shadow", "depth"
NARROWEST, LOWEST, TALLEST = 560, 120, 4000            # pixels: least width, least and largest height
RANGE_DB = 50.0                    # from the first to the last colour
BRIGHTEST, LEAST_DB, MOST_DB = 99.9, 18.0, 28.0        # percentile of the last colour, and its limits above the median


@dataclass(frozen=True, kw_only=True)
class Sheet:
    """A view of an image: the grid of its pixels, and its variables as `PlotGrid.mean` takes them."""

    grid: PlotGrid
    rows: xr.Dataset
    image: xr.Dataset
    words: str
    colours: Colormap

    def mean(self, values: Callable[[xr.Dataset], np.ndarray]) -> np.ndarray:
        """Average values over the pixels, (height, width)."""
        return self.grid.mean(self.rows, values)

    def draw(self, elements: np.ndarray, what: str, *, colours: Colormap, limits: tuple[float, float], bar: str,
             extend: Literal["neither", "both", "min", "max"] = "both") -> Figure:
        """Draw pixels with a colour bar."""
        figure, _ = canvas.picture(self.grid, elements, f"{title(self.image)}{what}", subtitle=self.words,
                                   colours=colours, limits=limits, bar=bar, bar_extend=extend)
        return _named(self, figure)


def draw_focused(image: xr.Dataset, what: str, path: FilePath | None, *, bank: int | None = None,
                 colours: str = "copper") -> Figure:
    """Draw a view of a focused image."""
    shades = canvas.colours_of(colours)
    draw, name = _view(image, what)
    if what != "image" and (colours != "copper" or bank is not None):
        raise ValueError(f"{'a bank is' if bank is not None else 'colours are'} of the view image of a focused image, "
                         f"and the plot is {what!r}; leave {'it' if bank is not None else 'them'} out.")
    canvas.check_path(path)
    banks = image.sizes.get("bank", 1)
    if not 0 <= (bank or 0) < banks:
        raise ValueError(f"there is no bank {bank}; the image has {banks}, the first is 0.")
    if not (image.sizes[GROUND[0]] and image.sizes[GROUND[1]]):
        raise ValueError(f"there is nothing to plot: the image has {dict(image.sizes)}.")
    shown = image.isel(bank=bank or 0) if "bank" in image.dims else image
    rows = shown[[name]].transpose(*GROUND).rename_dims(dict(zip(GROUND, ("ping", "range"), strict=True)))
    rows = rows.drop_vars(list(rows.coords)).expand_dims(side=[""])
    name = f"bank {bank or 0} of {banks}" if banks > 1 and what == "image" else ""
    sheet = Sheet(grid=_grid(image), rows=rows, image=image, words=_words(image, name), colours=shades)
    return canvas.saved(draw(sheet), path)


def _view(image: xr.Dataset, what: str) -> tuple[Callable[[Sheet], Figure], str]:
    """Return the drawing function of a view and the variable that it needs."""
    plain = [str(name) for name, variable in image.data_vars.items()
             if set(variable.dims) == set(GROUND) and variable.dtype.kind in "biuf"]
    if what in FOCUSED_VIEWS:
        draw, name = FOCUSED_VIEWS[what]
        if name in image.data_vars:
            return draw, name
        there = [view for view, (_, needed) in FOCUSED_VIEWS.items() if needed in image.data_vars]
        raise ValueError(f"the plot {what!r} needs the variable {name!r}; of this image there are "
                         f"{', '.join(dict.fromkeys([*there, *plain]))}."
                         + (" An image of raw echoes has no ground truth; render the scene, or focus the scene itself."
                            if what in OF_THE_TRUTH else ""))
    if what in plain:
        return partial(_values, name=what), what
    known = dict.fromkeys([*FOCUSED_VIEWS, *plain])
    raise ValueError(f"there is no plot {what!r} of a focused image{meant(what, known)}; choose one of "
                     f"{', '.join(known)}.")


def _grid(image: xr.Dataset) -> PlotGrid:
    """Return square pixels, as small as the sheet allows; a whole number of them to a point if points are few."""
    along, across = (edges_around(image[dim].values if dim in image.coords else np.arange(image.sizes[dim]), 1.0)
                     for dim in GROUND)
    long, wide = abs(along[-1] - along[0]), abs(across[-1] - across[0])
    scale = max(min(WIDEST / wide, WIDEST / long), NARROWEST / wide)
    point = wide / image.sizes[GROUND[1]]
    if scale * point > 1:
        scale = np.floor(scale * point) / point
    return PlotGrid(across=across, along=along, moving=True, width=max(round(scale * wide), 1),
                height=int(np.clip(round(scale * long), LOWEST, TALLEST)))


def _words(image: xr.Dataset, bank: str) -> str:
    """Return the subtitle of a view: its size, resolution, orientation and bank."""
    steps = [abs(float(np.diff(image[dim].values[:2])[0])) for dim in GROUND
             if dim in image.coords and image.sizes[dim] > 1]
    sizes = [in_metres(step * image.sizes[dim]) for step, dim in zip(steps, GROUND, strict=False)]
    parts = [" x ".join(sizes), f"points {' x '.join(map(in_metres, steps))} apart" if steps else ""]
    if {"x", "y"} <= set(image.variables) and image.sizes[GROUND[0]] > 1 and image["x"].dims == GROUND:
        east, north = (float(image[name].values[-1, 0] - image[name].values[0, 0]) for name in "xy")
        heading = round(np.degrees(np.arctan2(east, north))) % 360
        parts.append(f"up is {heading}°" if np.hypot(east, north) > 0 else "")
    return "   ·   ".join(part for part in (*parts, bank) if part)


def _named(sheet: Sheet, figure: Figure) -> Figure:
    """Label the axes as those of a focused image."""
    slant = sheet.image.attrs.get("grid") == "slant"
    drawn = figure.axes[0]
    drawn.set_xlabel("slant range [m]" if slant else "across track [m]", color=canvas.INK, fontsize=11)
    drawn.set_ylabel("along track [m]", color=canvas.INK, fontsize=11)
    for axis in (drawn.xaxis, drawn.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    return figure


def _image(sheet: Sheet) -> Figure:
    def intensity(part: xr.Dataset) -> np.ndarray:
        level = part["level"].values.astype(float)
        return np.where(np.isneginf(level), 0.0, power_from_db(level))

    with np.errstate(divide="ignore"):
        level = db_from_power(sheet.mean(intensity))
    known = level[np.isfinite(level)]
    middle, bright = np.percentile(known, [50, BRIGHTEST]) if known.size else (0.0, 0.0)
    high = float(np.clip(bright, middle + LEAST_DB, middle + MOST_DB))
    return sheet.draw(level, "", colours=sheet.colours, limits=(high - RANGE_DB, high), bar="level [dB re 1 m²]")


def _phase(sheet: Sheet) -> Figure:
    east, north = (sheet.mean(lambda part, turn=turn: turn(part["phase"].values.astype(float)))
                   for turn in (np.cos, np.sin))
    return sheet.draw(np.arctan2(north, east), ": phase", colours=colormaps["twilight"].with_extremes(bad=canvas.PAPER),
                      limits=(-np.pi, np.pi), bar="phase of one bank against the other [rad]", extend="neither")


def _share(sheet: Sheet, *, name: str, bar: str) -> Figure:
    return sheet.draw(sheet.mean(lambda part: part[name].values), f": {name}",
                      colours=colormaps["gray"].with_extremes(bad=canvas.PAPER), limits=(0, 1), bar=bar,
                      extend="neither")


def _values(sheet: Sheet, *, name: str, down: bool = False) -> Figure:
    elements = sheet.mean(lambda part: part[name].values.astype(float))
    known = elements[np.isfinite(elements)]
    low, high = np.percentile(known, [0.5, 99.5]) if known.size else (0.0, 0.0)
    limits = (float(low), float(high)) if high > low else (float(low) - 0.5, float(low) + 0.5)
    unit = sheet.image[name].attrs.get("units", "1")
    figure = sheet.draw(elements, f": {name.replace('_', ' ')}",
                        colours=colormaps["viridis_r" if down else "viridis"].with_extremes(bad=canvas.PAPER),
                        limits=limits, bar=name.replace("_", " ") + (f" [{unit}]" if unit != "1" else ""))
    if down:
        figure.axes[-1].invert_yaxis()
    return figure


def _labels(sheet: Sheet) -> Figure:
    counts = sum((counted(part["label"].values) for _, part in stretches(sheet.rows)), Counter[int]())
    key = label_key(counts, sheet.image.attrs.get("labels", {}))
    elements = sheet.grid.largest(sheet.rows, lambda part: key.rank(part["label"].values))
    figure, _ = canvas.picture(sheet.grid, elements, f"{title(sheet.image)}: labels", subtitle=sheet.words,
                               colours=key.colours, limits=key.limits, keys=key.keys)
    return _named(sheet, figure)


# drawing function, and the variable that it needs
FOCUSED_VIEWS: dict[str, tuple[Callable[[Sheet], Figure], str]] = {
    "image": (_image, "level"), "phase": (_phase, "phase"),
    "coherence": (partial(_share, name="coherence", bar="coherence of the banks"), "coherence"),
    "height": (partial(_values, name="height"), "height"), "labels": (_labels, "label"),
    "shadow": (partial(_share, name="shadow", bar="share of the bed in shadow"), "shadow"),
    "depth": (partial(_values, name="depth", down=True), "depth")}
