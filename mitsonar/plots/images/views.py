"""Plots of sonar images by name, one function for each entry of `PLOTS`, interferometric sidescans included.

Levels are averaged as intensities and converted to decibels afterwards, so that the brightness of a picture does not
depend on its size.
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
from mitsonar.imaging.focused import is_focused
from mitsonar.imaging.gain import Tvg
from mitsonar.imaging.recording import shown
from mitsonar.io.sidescan_lines.picture import as_image
from mitsonar.io.sidescan_lines.record import is_recorded
from mitsonar.units import HARDLY_DB, db_from_power, power_from_db

from .. import canvas
from ..canvas import subtitle, title
from ..fans.fan_objects import fan_labels, fan_objects
from ..fans.fans import fan_picture, is_scan, turn_of
from ..lines.line_views import LINE_VIEWS, draw_line, is_line
from ..onto import moved, sheets_for
from .focused import FOCUSED_VIEWS, draw_focused
from .grid import PlotGrid, make_grid, stretches, with_sides
from .label_key import counted, label_key
from .levels import in_the_water, shown_levels
from .truth import TRUTH

WIDEST = 98.0                      # percentile of the errors at the ends of the colours


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


def _measured_depth(dataset: xr.Dataset, grid: PlotGrid) -> Figure:
    image = grid.mean(dataset, lambda part: part["measured_depth"].values)
    return _depth_map(dataset, grid, image, "depth as measured")


def _depth_map(dataset: xr.Dataset, grid: PlotGrid, image: np.ndarray, what: str) -> Figure:
    known = image[np.isfinite(image)]
    low, high = np.percentile(known, [0.5, 99.5]) if known.size else (0.0, 0.0)
    limits = (float(low), float(high)) if high > low else (low - 0.5, high + 0.5)
    figure = _map(dataset, grid, image, what, "depth [m]", "viridis_r", limits)
    figure.axes[-1].invert_yaxis()
    return figure


def _map(dataset: xr.Dataset, grid: PlotGrid, image: np.ndarray, what: str, bar: str, colours: str,
         limits: tuple[float, float]) -> Figure:
    return canvas.named_picture(dataset, grid, image, what, colours=colormaps[colours].with_extremes(bad="#000000"),
                                limits=limits, bar=bar)


PHASES = {"phase": (_phase, "phase"), "coherence": (_coherence, "coherence"), "angle": (_angle, "angle"),
          "measured_depth": (_measured_depth, "measured_depth"), "depth_error": (_error, "error")}
FANS = {"waterfall": fan_picture, "objects": fan_objects, "labels": fan_labels}        # plots of an array's beams


def preview(dataset: xr.Dataset, path: FilePath | None = None, *, tvg: Tvg = "recorder",
            axes: Axes | None = None) -> Axes:
    """Draw the usual plot of a dataset: a waterfall, the fan of the first ping, or the overview of a line of soundings.

    Parameters
    ----------
    dataset : xarray.Dataset
        Image with level over (ping, side, range), (ping, beam, range) or (ping, range), or a line of soundings.
    path, tvg, axes
        As for `plot`, whose return value and errors these are, too.
    """
    return plot(dataset, None, path, tvg=tvg, axes=axes)


def usual_plot(dataset: xr.Dataset) -> str:
    """Return the name of the plot that `plot` draws by default."""
    return "overview" if is_line(dataset) else "image" if is_focused(dataset) else "waterfall"


def plot(dataset: xr.Dataset, what: str | None = None, path: FilePath | None = None, *, tvg: Tvg = "recorder",
         ping: int | None = None, colours: str = "copper", bank: int | None = None, axes: Axes | None = None) -> Axes:
    """Draw one of `PLOTS`, or of `LINE_VIEWS` for a line of soundings, or of `FOCUSED_VIEWS` for a focused image.

    Parameters
    ----------
    dataset : xarray.Dataset
    what : str, optional
        Name of the plot; by default the `usual_plot`. ``waterfall``: the image, the fan of one ping of an array, or one
        turn of a rotating head; ``ping``: levels of one ping; ``mean``: levels against range over all pings;
        ``labels``, ``depth``, ``shadow``, ``rays``, ``class``, ``share``, ``hidden``, ``layover``: ground truth of
        every bin; ``objects``: the waterfall or the fan with outlines of objects and their shadows; ``phase``,
        ``coherence``, ``angle``, ``measured_depth``, ``depth_error``: results of an interferometric sidescan. A line of
        soundings has the plots of `line_figure`, a focused image those of `FOCUSED_VIEWS`.
    path : str or path, optional
        File to write, ending in .png, .pdf or .svg.
    tvg : {'seabed', 'target', 'recorder', 'counts', None}
        Gain over range for display (see `mitsonar.imaging.gain`); the data are not changed. ``counts`` draws what the
        recorder wrote.
    ping : int, optional
        Index of the ping to draw. The default is the middle ping for ``ping``, and the first ping or turn for a fan.
    colours : {'copper', 'grey'}
        Colours of a waterfall, a fan or a focused image.
    bank : int, optional
        Bank of a focused image; by default the first.
    axes : matplotlib.axes.Axes, optional
        Axes to draw into. Without axes and without a path, pyplot makes the figure, and notebooks show it.

    Returns
    -------
    matplotlib.axes.Axes
        The first axes, in metres, degrees or dB as labelled; the sheet is their ``figure``.

    Raises
    ------
    ValueError
        If the dataset lacks sides, beams or the variable, an argument is not as above, or ``axes`` are given for a plot
        of several panels.
    TypeError
        If ``dataset`` is no `xarray.Dataset`, but for example a path, or ``axes`` are no matplotlib axes.
    OSError
        If the file cannot be written.
    """
    if not isinstance(dataset, xr.Dataset):
        raise TypeError("a plot needs an image or a line, an xarray.Dataset such as mitsonar.read returns; got "
                        f"{shortened(repr(dataset))}.")
    if not isinstance(axes, Axes | None):
        raise TypeError(f"axes must be matplotlib Axes, such as pyplot.subplots returns; got {axes!r}.")
    with sheets_for(path, axes):
        return moved(_figure(dataset, what or usual_plot(dataset), path, tvg, ping, colours, bank), axes)


def _figure(dataset: xr.Dataset, what: str, path: FilePath | None, tvg: Tvg, ping: int | None, colours: str,
            bank: int | None) -> Figure:
    """Draw a plot, write it if there is a path, and return its sheet; the arguments are those of `plot`."""
    if bank is not None and not is_focused(dataset):
        raise ValueError("only focused images have banks, and this dataset is no such image; leave the bank out.")
    if is_line(dataset):
        return draw_line(dataset, what, path, ping=ping, tvg=tvg, colours=colours)
    dataset, tvg = (as_image(dataset), None) if is_recorded(dataset) else shown(dataset, tvg)
    if is_focused(dataset):
        if ping is not None:
            raise ValueError("a focused image contains all its pings; leave the ping out.")
        if tvg != "recorder":
            raise ValueError("a focused image takes no gain over range, since its levels are those of the ground; "
                             "leave the gain out.")
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
        raise ValueError(f"colours apply to a waterfall or a fan, and the plot is {what!r}; leave them out.")
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
                         f"{', '.join(map(str, dataset.data_vars)) or 'none'}.")
    dataset = with_sides(dataset)
    options = {"waterfall": {"tvg": tvg, "shades": shades}, "objects": {"tvg": tvg}, "ping": {"ping": ping}}
    return canvas.saved(draw(dataset, make_grid(dataset), **options.get(what, {})), path)


def _waterfall(dataset, grid, *, tvg, shades):
    image, limits, words, more_db = shown_levels(dataset, grid, tvg)
    return canvas.picture(grid, image, title(dataset), subtitle=subtitle(dataset, grid, more_db), limits=limits,
                          colours=shades, bar=f"level{words}  [{_unit(dataset)}]")[0]


def _labels(dataset, grid):
    counts = sum((counted(part["label"].values) for _, part in stretches(dataset)), Counter[int]())
    key = label_key(counts, dataset.attrs.get("labels", {}))
    image = grid.largest(dataset, lambda part: key.rank(part["label"].values))
    return canvas.named_picture(dataset, grid, image, "labels", colours=key.colours, limits=key.limits, keys=key.keys)


def _depth(dataset, grid):
    return _depth_map(dataset, grid, grid.mean(dataset, _depth_seen), "depth of the hits")


def _depth_seen(part):
    """Return depths, but NaN in the water column and in shadows, where side lobes bring echoes from anywhere."""
    hidden = in_the_water(part) if "seabed_depth" in part else np.zeros(part["depth"].shape, bool)
    if "shadow" in part:
        hidden = hidden | (part["shadow"].values > 0)
    return np.where(hidden, np.nan, part["depth"].values)


def _shadow(dataset, grid):
    image = grid.mean(dataset, lambda part: part["shadow"].values)
    return canvas.named_picture(dataset, grid, image, "shadow", limits=(0, 1), bar="share of the pixel in shadow",
                                bar_extend="neither", colours=colormaps["gray"].with_extremes(bad=canvas.PAPER))


def _rays(dataset, grid):
    image = grid.mean(dataset, lambda part: part["rays"].values)
    known = image[image > 0]
    top = float(np.percentile(known, 99.5)) if known.size else 1.0
    return canvas.named_picture(dataset, grid, image, "rays", limits=(0, top), bar="rays per bin", bar_extend="max",
                                colours=colormaps["magma"].with_extremes(bad=canvas.PAPER))


def _ping(dataset, grid, *, ping):
    pings = dataset.sizes["ping"]
    ping = pings // 2 if ping is None else ping
    canvas.check_ping(ping, pings)
    figure = canvas.sheet(1200, 720)
    sides = dataset["side"].values.tolist()
    panels = figure.subplots(len(sides), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    image = dataset.isel(ping=ping)
    slant_range = dataset["range"].values
    for axes, side in zip(panels, sides, strict=True):
        colour = canvas.SIDES[side]
        axes.plot(slant_range, _with_gaps(image["level"].sel(side=side).values), color=colour, linewidth=0.7, alpha=0.7,
                  label="level")
        if "mean_level" in dataset:
            axes.plot(slant_range, _with_gaps(image["mean_level"].sel(side=side).values), color="black", linewidth=1.4,
                      label="without speckle and noise")
        if "altitude" in image.coords and np.isfinite(image["altitude"]):
            axes.axvline(float(image["altitude"]), color="gray", linewidth=1, linestyle=":", label="altitude")
        axes.set_title(side, loc="left", color=colour, fontsize=12, fontweight="bold")
        _line_axes(axes, slant_range, _unit(dataset))
    panels[0].legend(loc="upper right", fontsize=10, ncols=3)
    panels[-1].set_xlabel("slant range [m]", fontsize=11)
    when = f" at {float(image['ping_time']):.3f} s" if "ping_time" in image.coords else ""
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
    _line_axes(axes, slant_range, _unit(dataset))
    axes.set_xlabel("slant range [m]", fontsize=11)
    axes.legend(fontsize=10)
    axes.set_title(f"{title(dataset)}: mean over {dataset.sizes['ping']} pings", fontsize=14, fontweight="bold")
    figure.tight_layout()
    return figure


def _line_axes(axes, slant_range, unit):
    axes.set_ylabel(f"level [{unit}]", fontsize=11)
    axes.set_xlim(slant_range[0], max(slant_range[-1], slant_range[0] + 1e-6))
    axes.tick_params(labelsize=10)
    axes.grid(alpha=0.25)


def _unit(dataset):
    return dataset["level"].attrs.get("units", "dB re 1 µPa")


def _with_gaps(level):
    """Return levels with NaN in bins without an echo."""
    return np.where(level > HARDLY_DB, level, np.nan)


PLOTS = {"waterfall": (_waterfall, "level"), "ping": (_ping, "level"), "mean": (_mean, "level"),
         "labels": (_labels, "label"), "depth": (_depth, "depth"), "shadow": (_shadow, "shadow"),
         "rays": (_rays, "rays"), **TRUTH, **PHASES}
