"""Maps of a line: soundings coloured by a variable, or a grid of means where they lie close.

Relief is shaded by the slope of the grid, lit from the north-west and 45 degrees above:

    light = (1 - e_x ∂d/∂x k - e_y ∂d/∂y k) / |...|        k: vertical exaggeration, d depth, e towards the light
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, Normalize
from matplotlib.ticker import MaxNLocator
from scipy import ndimage

from mitsonar.units import db_from_power, power_from_db

from .line_sheet import CAUSES, LABEL_SIZE, bar_beside, sounded

FINEST = 700                       # cells of the longer side of a grid
CLOSE = 1.5                        # mean number of soundings in a filled cell, so that a grid has few holes
FEW = 4000                         # fewer soundings are always drawn as points
GAP = 2                            # half the widest gap that is filled, in cells
EDGE = 0.02                        # margin around the soundings, as a share of the longer side
STEEP = 0.35                       # slope times exaggeration with strong shading
MOST_EXAGGERATED = 30.0


@dataclass(frozen=True, kw_only=True)
class Mapped:
    """Content of a map."""

    name: str  # variable
    words: str  # label of the colour bar
    colours: str  # colour map of matplotlib
    around_zero: bool = False  # True centres the colours on 0
    falls: bool = False  # True puts large values at the bottom of the bar
    decibel: bool = False  # True averages intensities


MAPPED = {
    "swath": Mapped(name="depth", words="depth [m]", colours="viridis_r", falls=True),
    **{name: Mapped(name=name, words="depth - true depth [m]" if name == "error" else f"error by {words} [m]",
                    colours="coolwarm", around_zero=True) for name, (words, _, _) in CAUSES.items()},
    "backscatter": Mapped(name="backscatter_db", words="backscattering strength [dB]", colours="gray", decibel=True),
}


def draw_map(axes: Axes, line: xr.Dataset, what: str) -> None:
    """Draw soundings on a map, coloured by one of `MAPPED`, and the ship's track."""
    about = MAPPED[what]
    there = sounded(line) & np.isfinite(line[about.name].values)
    if not there.any():
        raise ValueError(f"no valid sounding has a finite {about.name}, so there is no map {what!r} to draw.")
    x, y, values = (line[name].values[there].astype(float) for name in ("x", "y", about.name))
    norm = Normalize(*_limits(values, about.around_zero))
    colours = colormaps[about.colours]
    cell = _cell(x, y)
    box = _box(x, y, line)
    if cell is None:
        size = float(np.clip(300 / np.sqrt(x.size), 2, 30))
        axes.scatter(x, y, s=size, c=values, cmap=colours, norm=norm, linewidths=0, rasterized=x.size > 2000)
    else:
        grid, extent = mean_grid(x, y, values, cell, decibel=about.decibel)
        picture = (shaded(grid, cell, colours, norm) if what == "swath" else colours(norm(grid)))
        picture[~np.isfinite(grid)] = 0                                                     # transparent
        axes.imshow(picture, origin="lower", extent=extent, interpolation="nearest", aspect="equal")
    _draw_track(axes, line)
    bar_beside(axes, ScalarMappable(norm, colours), about.words, falls=about.falls, extend="both")
    axes.set_aspect("equal")
    axes.set(xlim=box[:2], ylim=box[2:])
    _name_axes(axes, line)


def _cell(x: np.ndarray, y: np.ndarray) -> float | None:
    """Return the side of cells that soundings fill without holes, or None if they are few or far apart."""
    if x.size <= FEW:
        return None
    size = max(float(np.ptp(x)), float(np.ptp(y)))
    if not size > 0:
        return None
    cell = size / FINEST
    while size / cell > 60:
        numbers = np.floor((x - x.min()) / cell).astype(np.int64) * (FINEST + 2) + np.floor((y - y.min()) / cell)
        if x.size >= CLOSE * np.unique(numbers).size:
            return cell
        cell *= 1.25
    return None


def mean_grid(x: np.ndarray, y: np.ndarray, values: np.ndarray, cell: float, *,
              decibel: bool = False) -> tuple[np.ndarray, tuple[float, float, float, float]]:
    """Return means of values (N,) at places (N,) [m] in square cells [m], and the extent of the grid [m]."""
    columns, rows = (np.floor((place - place.min()) / cell).astype(np.int64) for place in (x, y))
    shape = int(rows.max()) + 1, int(columns.max()) + 1
    place = rows * shape[1] + columns
    count = np.bincount(place, minlength=shape[0] * shape[1]).reshape(shape)
    total = np.bincount(place, power_from_db(values) if decibel else values, shape[0] * shape[1]).reshape(shape)
    around = [ndimage.uniform_filter(part.astype(float), 2 * GAP + 1, mode="constant") for part in (total, count)]
    closed = ndimage.binary_closing(np.pad(count > 0, GAP), np.ones((3, 3)), GAP)[GAP:-GAP, GAP:-GAP]
    with np.errstate(invalid="ignore", divide="ignore"):
        grid = np.where(closed & (count == 0), around[0] / around[1], total / count)
    west, south = float(x.min()), float(y.min())
    return db_from_power(grid) if decibel else grid, (west, west + cell * shape[1], south, south + cell * shape[0])


def shaded(depth: np.ndarray, cell: float, colours: Colormap, norm: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Return the colours (rows, columns, 4) of a grid of depths [m], southern row first, darker away from the light."""
    known = np.isfinite(depth)
    nearest = ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True)
    filled = ndimage.gaussian_filter(depth[tuple(nearest)], 0.7)
    north, east = np.gradient(filled, cell) if min(depth.shape) > 1 else (np.zeros(depth.shape),) * 2
    slope = np.hypot(north, east)[known]
    steep = float(np.percentile(slope, 90)) if slope.size else 0.0
    exaggeration = min(STEEP / steep, MOST_EXAGGERATED) if steep > 0 else 1.0
    # Depth grows downwards: a bed that deepens to the south-east falls away from a light in the north-west.
    light = (1 - exaggeration * (east - north) * np.sqrt(0.5)) / np.sqrt(1 + (exaggeration * np.hypot(north, east))**2)
    picture = colours(norm(depth))
    picture[..., :3] *= np.clip(0.25 + 0.75 * light, 0.35, 1.15)[..., None]
    return np.clip(picture, 0, 1)


def _limits(values: np.ndarray, around_zero: bool) -> tuple[float, float]:
    """Return the values of the first and the last colour: without the outermost hundredths."""
    low, high = np.percentile(values, [0.5, 99.5])
    if around_zero:
        high = max(abs(low), abs(high), 1e-9)
        low = -high
    if not high > low:
        low, high = low - 0.5, high + 0.5
    return float(low), float(high)


def _box(x: np.ndarray, y: np.ndarray, line: xr.Dataset) -> tuple[float, float, float, float]:
    """Return west, east, south and north of the map."""
    ends = []
    for place, ship in ((x, line["ping_x"].values), (y, line["ping_y"].values)):
        known = np.concatenate([place, ship[np.isfinite(ship)]])
        ends.append((float(known.min()), float(known.max())))
    room = max(EDGE * max(high - low for low, high in ends), 0.5)
    (west, east), (south, north) = ends
    return west - room, east + room, south - room, north + room


def map_shape(line: xr.Dataset) -> float:
    """Return the width of a line's map over its height."""
    there = sounded(line)
    west, east, south, north = _box(line["x"].values[there], line["y"].values[there], line)
    return (east - west) / (north - south)


def _draw_track(axes: Axes, line: xr.Dataset) -> None:
    x, y = line["ping_x"].values, line["ping_y"].values
    axes.plot(x, y, color="#000000", linewidth=0.9, alpha=0.7)
    if np.isfinite([x[0], y[0]]).all():
        axes.plot(x[:1], y[:1], color="#000000", marker="o", markersize=4, linestyle="none")


def _name_axes(axes: Axes, line: xr.Dataset) -> None:
    crs, origin = line.attrs.get("crs"), line.attrs.get("origin")
    words = "east [m]", "north [m]"
    if crs is not None and origin is not None and np.size(origin) == 2:
        words = f"east of {float(origin[0]):.0f} m [m], {crs}", f"north of {float(origin[1]):.0f} m [m]"
    axes.set_xlabel(words[0], fontsize=LABEL_SIZE)
    axes.set_ylabel(words[1], fontsize=LABEL_SIZE)
    across, up = (abs(float(np.diff(ends)[0])) for ends in (axes.get_xlim(), axes.get_ylim()))
    for axis, share in ((axes.xaxis, across / up), (axes.yaxis, up / across)):           # a narrow map has few numbers
        axis.set_major_locator(MaxNLocator(int(np.clip(9 * share, 2, 9)), steps=[1, 2, 5, 10], min_n_ticks=1))
    axes.ticklabel_format(useOffset=False, style="plain")
    axes.tick_params(labelsize=9.5)
