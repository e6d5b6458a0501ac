"""The pictures themselves, a function each, named in the table `PLOTS`.

Levels are averaged as intensities and only then turned to decibels again, so that the brightness of a picture does not
depend on its size.

Views of what an interferometric sidescan measures: phase, coherence, angle, and how far depths are off.
"""
from __future__ import annotations

from collections import Counter

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mitsonar.device.files import FilePath
from mitsonar.device.sentences import shortened
from mitsonar.device.spelling import meant
from mitsonar.imaging.gain import Tvg
from mitsonar.units import HARDLY_DB, db_from_power, power_from_db

from .. import canvas
from ..canvas import subtitle, title
from ..fans.fan_objects import fan_labels, fan_objects
from ..fans.fans import fan_picture, is_scan, turn_of
from ..lines.line_views import LINE_VIEWS, draw_line, is_line
from ..onto import moved, sheets_for
from .focused import FOCUSED_VIEWS, draw_focused, is_focused
from .grid import PlotGrid, make_grid, stretches, with_sides
from .label_key import label_key
from .levels import in_the_water, shown_levels
from .truth import TRUTH

WIDEST = 98.0                      # per cent of errors that the colours tell apart


def _phase(dataset: xr.Dataset, grid: PlotGrid) -> Figure:
    cosine = grid.mean(dataset, lambda part: np.cos(part["phase"].values))
    sine = grid.mean(dataset, lambda part: np.sin(part["phase"].values))
    return _map(dataset, grid, np.arctan2(sine, cosine), "phase between the outer rows", "phase [rad]", "twilight",
                (-np.pi, np.pi))


def _coherence(dataset: xr.Dataset, grid: PlotGrid) -> Figure:
    image = grid.mean(dataset, lambda part: part["coherence"].values)
    return _map(dataset, grid, image, "coherence of the rows", "coherence", "inferno", (0.0, 1.0))


def _angle(dataset: xr.Dataset, grid: PlotGrid) -> Figure:
    image = np.rad2deg(grid.mean(dataset, lambda part: part["angle"].values))
    return _map(dataset, grid, image, "angle of the echoes", "below the horizontal [degrees]", "viridis", (0.0, 90.0))


def _error(dataset: xr.Dataset, grid: PlotGrid) -> Figure:
    image = grid.mean(dataset, lambda part: np.where(part["valid"].values, part["error"].values, np.nan))
    known = np.abs(image[np.isfinite(image)])
    most = max(float(np.percentile(known, WIDEST)) if known.size else 0.0, 1e-3)
    return _map(dataset, grid, image, "error of the depth", "measured less true [m]", "RdBu_r", (-most, most))


def _map(dataset: xr.Dataset, grid: PlotGrid, image: np.ndarray, what: str, bar: str, colours: str,
         limits: tuple[float, float]) -> Figure:
    return canvas.picture(grid, image, f"{title(dataset)}: {what}", subtitle=subtitle(dataset, grid),
                          colours=colormaps[colours].with_extremes(bad="#000000"), limits=limits, bar=bar)[0]


PHASES = {"phase": (_phase, "phase"), "coherence": (_coherence, "coherence"), "angle": (_angle, "angle"),
          "depth_error": (_error, "uncertainty")}


FANS = {"waterfall": fan_picture, "objects": fan_objects, "labels": fan_labels}  # the plots of an array's beams


def preview(dataset: xr.Dataset, path: FilePath | None = None, *, tvg: Tvg = "recorder",
            axes: Axes | None = None) -> Axes:
    """Draw the waterfall of a sidescan, or of a row a ping, the fan of an array's first ping, or a line's overview.

    Parameters
    ----------
    dataset : xarray.Dataset
        As made by ``mitsonar.render``: level over (ping, side, range), (ping, beam, range) or (ping, range); or a line
        of soundings.
    path : str or path
        A .png (or .pdf, .svg) to write; None: no file.
    tvg : {'seabed', 'target', 'recorder', None}
        Gain for display (see `mitsonar.plots.images.gain`); the data are not changed.
    axes : matplotlib.axes.Axes, optional
        To draw into; without it, and without a path, the figure is one of pyplot's, and notebooks show it.

    Returns
    -------
    matplotlib.axes.Axes
        In metres, degrees or dB, as they are labelled; the sheet is its ``figure``.

    Raises
    ------
    ValueError
        If the dataset has other dimensions, or ``path`` or ``tvg`` is not as above.
    FileNotFoundError, PermissionError, OSError
        If the file cannot be written.
    """
    return plot(dataset, None, path, tvg=tvg, axes=axes)


def usual_plot(dataset: xr.Dataset) -> str:
    """Return the plot that a dataset has where none is asked for."""
    return "overview" if is_line(dataset) else "image" if is_focused(dataset) else "waterfall"


def plot(dataset: xr.Dataset, what: str | None = None, path: FilePath | None = None, *, tvg: Tvg = "recorder",
         ping: int | None = None, colours: str = "copper", bank: int | None = None, axes: Axes | None = None) -> Axes:
    """Draw one of `PLOTS`, or of `LINE_VIEWS` for a line of soundings, or of `FOCUSED_VIEWS` for a focused image.

    Parameters
    ----------
    dataset : xarray.Dataset
    what : str, optional
        By default the `usual_plot`. ``waterfall``, of an array the fan of one ping, of a rotating head a turn;
        ``ping``: the levels of one ping;
        ``mean``: levels against range over all pings; ``labels``, ``depth``, ``shadow``, ``rays``, ``class``,
        ``share``, ``hidden``, ``layover``: the truth behind every bin; ``objects``: the waterfall or the fan with
        objects and their shadows outlined. Of a line of soundings as `line_figure`, of a focused image as
        `focused.draw_focused`.
    path : str or path
        A .png, .pdf or .svg to write; None: no file.
    tvg : {'seabed', 'target', 'recorder', None}
        Gain of the waterfall, and under ``objects``.
    ping : int, optional
        For ``ping``, the middle one by default; for a fan, the first; of a rotating head, whose turn is drawn.
    colours : str
        Of the waterfall, the fan, or a focused image: ``copper`` or ``grey``.
    bank : int, optional
        Of a focused image, the first by default.
    axes : matplotlib.axes.Axes, optional
        To draw into; without it, and without a path, the figure is one of pyplot's, and notebooks show it.

    Returns
    -------
    matplotlib.axes.Axes
        In metres, degrees or dB, as they are labelled; the sheet is its ``figure``.

    Raises
    ------
    ValueError
        If the dataset lacks sides, beams or the variable, an argument is not as above, or a plot of several panels is
        to be drawn into axes.
    TypeError
        If ``dataset`` is no `xarray.Dataset`, such as the path of one, or ``axes`` are none.
    FileNotFoundError, PermissionError, OSError
        If the file cannot be written.
    """
    if not isinstance(dataset, xr.Dataset):
        raise TypeError("a plot is of an image or a line, an xarray.Dataset such as mitsonar.read returns, and this is "
                        f"{shortened(repr(dataset))}.")
    if not isinstance(axes, Axes | None):
        raise TypeError(f"axes are of matplotlib, and this is {axes!r}; give Axes, such as pyplot.subplots returns.")
    with sheets_for(path, axes):
        return moved(_figure(dataset, what or usual_plot(dataset), path, tvg, ping, colours, bank), axes)


def _figure(dataset: xr.Dataset, what: str, path: FilePath | None, tvg: Tvg, ping: int | None, colours: str,
            bank: int | None) -> Figure:
    """Draw a plot, write it if there is a path, and return its sheet; arguments as of `plot`."""
    if bank is not None and not is_focused(dataset):
        raise ValueError("banks are of focused images, and this dataset is none; leave the bank out.")
    if is_line(dataset):
        return draw_line(dataset, what, path, ping=ping, tvg=tvg, colours=colours)
    if is_focused(dataset):
        if ping is not None:
            raise ValueError("a focused image is of all its pings; leave the ping out.")
        if tvg != "recorder":
            raise ValueError("a focused image has no gain over range: its levels are of what lies there; leave the "
                             "gain out.")
        return draw_focused(dataset, what, path, bank=bank, colours=colours)
    if what in FOCUSED_VIEWS and what not in PLOTS:
        raise ValueError(f"the plot {what!r} is of a focused image, over along_track and across_track; this dataset "
                         f"has {', '.join(map(str, dataset.dims))}.")
    if what in LINE_VIEWS and what not in PLOTS:
        raise ValueError(f"the plot {what!r} is of a line of soundings, with travel_time and angle; this dataset has "
                         f"{', '.join(map(str, dataset.data_vars))}.")
    if what not in PLOTS:
        raise ValueError(f"there is no plot {what!r}{meant(what, PLOTS)}; choose one of {', '.join(PLOTS)}.")
    if what != "waterfall" and colours != "copper":
        raise ValueError(f"colours are those of a waterfall or a fan, and the plot is {what!r}; leave them out.")
    shades = canvas.colours_of(colours)
    canvas.check_path(path)
    if what in FANS and is_scan(dataset):
        dataset, ping = turn_of(dataset, ping or 0), 0
    if "beam" in dataset.dims:
        if what not in FANS:
            raise ValueError(f"the plot {what!r} is of a sidescan; of an array's beams there are waterfall, their fan, "
                             "labels, and objects.")
        options = {"tvg": tvg, "colours": colours} if what == "waterfall" else {"tvg": tvg} if what == "objects" else {}
        return FANS[what](dataset, path, ping=ping or 0, **options)
    draw, needed = PLOTS[what]
    if needed not in dataset.data_vars:
        raise ValueError(f"the plot {what!r} needs the variable {needed!r}; this dataset has "
                         f"{', '.join(map(str, dataset.data_vars))}.")
    dataset = with_sides(dataset)
    options = {"waterfall": {"tvg": tvg, "shades": shades}, "objects": {"tvg": tvg}, "ping": {"ping": ping}}
    return canvas.saved(draw(dataset, make_grid(dataset), **options.get(what, {})), path)


def _waterfall(dataset, grid, *, tvg, shades):
    image, limits, words, more_db = shown_levels(dataset, grid, tvg)
    return canvas.picture(grid, image, title(dataset), subtitle=subtitle(dataset, grid, more_db), limits=limits,
                          colours=shades, bar=f"level{words}  [dB re 1 µPa]")[0]


def _labels(dataset, grid):
    counts = Counter()
    for _, part in stretches(dataset):
        counts.update(dict(zip(*(found.tolist() for found in np.unique(part["label"], return_counts=True)),
                               strict=True)))
    key = label_key(counts, dataset.attrs.get("labels", {}))
    image = grid.largest(dataset, lambda part: key.rank(part["label"].values))
    return canvas.picture(grid, image, f"{title(dataset)}: labels", subtitle=subtitle(dataset, grid),
                          colours=key.colours, limits=key.limits, keys=key.keys)[0]


def _depth(dataset, grid):
    image = grid.mean(dataset, _depth_of_what_is_seen)
    colours = colormaps["viridis_r"].with_extremes(bad="#000000")
    known = image[np.isfinite(image)]
    low, high = np.percentile(known, [0.5, 99.5]) if known.size else (0.0, 0.0)
    limits = (low, high) if high > low else (low - 0.5, high + 0.5)
    figure, _ = canvas.picture(grid, image, f"{title(dataset)}: depth of the hits",
                               subtitle=subtitle(dataset, grid), colours=colours, limits=limits, bar="depth [m]")
    figure.axes[-1].invert_yaxis()
    return figure


def _depth_of_what_is_seen(part):
    """Return depths but those of echoes in the water column and in shadows: side lobes bring these from anywhere."""
    hidden = in_the_water(part) if "seabed_depth" in part else np.zeros(part["depth"].shape, bool)
    if "shadow" in part:
        hidden = hidden | (part["shadow"].values > 0)
    return np.where(hidden, np.nan, part["depth"].values)


def _shadow(dataset, grid):
    image = grid.mean(dataset, lambda part: part["shadow"].values)
    return canvas.picture(grid, image, f"{title(dataset)}: shadow", subtitle=subtitle(dataset, grid),
                          colours=colormaps["gray"].with_extremes(bad=canvas.PAPER), limits=(0, 1),
                          bar="share of the element in shadow", bar_extend="neither")[0]


def _rays(dataset, grid):
    image = grid.mean(dataset, lambda part: part["rays"].values)
    known = image[image > 0]
    top = float(np.percentile(known, 99.5)) if known.size else 1.0
    return canvas.picture(grid, image, f"{title(dataset)}: rays", subtitle=subtitle(dataset, grid),
                          colours=colormaps["magma"].with_extremes(bad=canvas.PAPER), limits=(0, top),
                          bar="rays per bin", bar_extend="max")[0]


def _ping(dataset, grid, *, ping):
    pings = dataset.sizes["ping"]
    ping = pings // 2 if ping is None else ping
    if not 0 <= ping < pings:
        raise ValueError(f"there is no ping {ping}; the dataset has {pings}, the first is 0.")
    figure = canvas.sheet(1200, 720)
    sides = dataset["side"].values.tolist()
    panels = figure.subplots(len(sides), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    one = dataset.isel(ping=ping)
    slant_range = dataset["range"].values
    for axes, side in zip(panels, sides, strict=True):
        colour = canvas.SIDES[side]
        axes.plot(slant_range, _with_gaps(one["level"].sel(side=side).values), color=colour, linewidth=0.7, alpha=0.7,
                  label="level")
        if "mean_level" in dataset:
            axes.plot(slant_range, _with_gaps(one["mean_level"].sel(side=side).values), color="black", linewidth=1.4,
                      label="without speckle and noise")
        if "altitude" in one.coords and np.isfinite(one["altitude"]):
            axes.axvline(float(one["altitude"]), color="gray", linewidth=1, linestyle=":", label="altitude")
        axes.set_title(side, loc="left", color=colour, fontsize=12, fontweight="bold")
        _line_axes(axes, slant_range)
    panels[0].legend(loc="upper right", fontsize=10, ncols=3)
    panels[-1].set_xlabel("slant range [m]", fontsize=11)
    when = f" at {float(one['ping_time']):.3f} s" if "ping_time" in one.coords else ""
    figure.suptitle(f"{title(dataset)}: ping {ping}{when}", fontsize=14, fontweight="bold")
    figure.tight_layout()
    return figure


def _mean(dataset, grid):
    figure = canvas.sheet(1200, 640)
    axes = figure.subplots()
    slant_range = dataset["range"].values
    for index, side in enumerate(dataset["side"].values.tolist()):
        colour, of_side = canvas.SIDES[side], f"{side}: " * bool(side)
        level = dataset["level"].sel(side=side).transpose("ping", "range").values
        power = np.where(level > HARDLY_DB, power_from_db(level), 0).mean(axis=0)
        low, high = np.percentile(level, [10, 90], axis=0)
        axes.fill_between(slant_range, _with_gaps(low), _with_gaps(high), color=colour, alpha=0.15, linewidth=0,
                          label=f"{of_side}10 to 90 % of the pings")
        axes.plot(slant_range, _with_gaps(db_from_power(power)), color=colour, linewidth=1.4,
                  linestyle="-" if index == 0 else "--", label=f"{of_side}mean intensity")
    _line_axes(axes, slant_range)
    axes.set_xlabel("slant range [m]", fontsize=11)
    axes.legend(fontsize=10)
    axes.set_title(f"{title(dataset)}: mean over {dataset.sizes['ping']} pings", fontsize=14, fontweight="bold")
    figure.tight_layout()
    return figure


def _line_axes(axes, slant_range):
    axes.set_ylabel("level [dB re 1 µPa]", fontsize=11)
    axes.set_xlim(slant_range[0], max(slant_range[-1], slant_range[0] + 1e-6))
    axes.tick_params(labelsize=10)
    axes.grid(alpha=0.25)


def _with_gaps(level):
    """Return levels with gaps where there is nothing."""
    return np.where(level > HARDLY_DB, level, np.nan)


PLOTS = {"waterfall": (_waterfall, "level"), "ping": (_ping, "level"), "mean": (_mean, "level"),
         "labels": (_labels, "label"), "depth": (_depth, "depth"), "shadow": (_shadow, "shadow"),
         "rays": (_rays, "rays"), **TRUTH, **PHASES}
