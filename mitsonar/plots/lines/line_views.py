"""Views of a line of soundings, one function each, listed in `LINE_VIEWS`."""
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mitsonar.device.files import FilePath
from mitsonar.device.spelling import meant
from mitsonar.hydrography.record import check
from mitsonar.imaging.gain import Tvg
from mitsonar.water.profile import SoundSpeedProfile

from .. import canvas
from . import angle_curves
from .column_plot import draw_column, draw_curtain
from .line_maps import draw_map, map_shape
from .line_sheet import CAUSES, curve_axes, headed, key_above, line_title, line_words, sounded
from .ray_plot import draw_profiles, draw_rays
from .water_column import COLUMN, has_column

MOTIONS = {"motion_roll": "roll [deg]\nstarboard down", "motion_pitch": "pitch [deg]\nbow up",
           "motion_depth": "heave [m]\nup", "motion_heading": "heading [deg]\nfrom north"}
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#000000")
MOST_TICKS = 400                   # more pings are not marked


def draw_motion(panels: Sequence[Axes], line: xr.Dataset, names: Sequence[str] = tuple(MOTIONS)) -> None:
    """Draw samples of the motion sensors over time, one panel each, and mark the pings at the bottom."""
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
    """Return headings [rad] without jumps at north; NaN stays."""
    known = np.isfinite(heading)
    smooth = heading.astype(float).copy()
    smooth[known] = np.unwrap(heading[known])
    return smooth


def _since(line: xr.Dataset) -> str:
    start = str(line.attrs.get("start") or "")
    return f" after {start}" if start and not start.startswith("1970-01-01T00:00:00") else ""


WIDE = 1200                        # pixels
LONGER, SHORTER = 1000, 330        # pixels: longer side of a map, and least shorter side
LEAST_WIDE = 800                   # least width of a map, for its title
FLAT = 1.6                         # largest ratio of a panel's sides [m] with equal scales
HEAD_ROOM = 62                     # pixels for the title
OF_A_PING, OF_LEVELS = ("column", "rays", "overview"), ("column", "curtain", "overview")


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of a view; see `line_figure`."""

    ping: int
    tvg: Tvg
    colours: str
    bend: bool
    theory: tuple[np.ndarray, np.ndarray] | None
    water: SoundSpeedProfile | None


@dataclass(frozen=True, kw_only=True)
class LineView:
    """View of a line."""

    words: str  # content, for the title
    needs: tuple[str, ...] = ()  # needed variables that not every line has
    size: tuple[int, int] | None = (WIDE, 720)  # of the sheet [pixels]; None: as the map needs
    draw: Callable[[Figure, xr.Dataset, Options], None]


def is_line(dataset: xr.Dataset) -> bool:
    """Return True if a dataset is a line of soundings."""
    return {"travel_time", "angle"} <= set(map(str, dataset.variables))


def draw_line(line: xr.Dataset, what: str, path: FilePath | None, *, ping: int | None = None, tvg: Tvg = "recorder",
              colours: str = "copper") -> Figure:
    """Draw a view of a line of soundings, to a file if there is a path; arguments and errors as of `plot`."""
    canvas.check_path(path)
    return canvas.saved(line_figure(line, what, ping=ping, tvg=tvg, colours=colours), path)


def line_figure(line: xr.Dataset, what: str = "overview", *, ping: int | None = None, tvg: Tvg = "recorder",
                colours: str = "copper", bend: bool = True, theory: tuple[np.ndarray, np.ndarray] | None = None,
                water: SoundSpeedProfile | None = None) -> Figure:
    """Draw a view of a line of soundings.

    Parameters
    ----------
    line : xarray.Dataset
        Line from `mitsonar.soundings` or from a file of an instrument.
    what : str
        ``overview``: several views; ``column``: water column of a ping with its soundings; ``curtain``: water column of
        all pings against time; ``swath``: soundings on the map by depth; ``error``, ``error_detection``,
        ``error_refraction``, ``error_motion``: by error; ``backscatter``: a mosaic and the mean by angle; ``smile``:
        errors by angle; ``rays``: ray paths of a ping over the bed; ``quality``: quality, uncertainty and methods
        of detection by angle; ``motion``: samples of the motion sensors.
    ping : int, optional
        Position of the ping in ``column``, ``rays`` and the overview. The default is the middle ping.
    tvg : {'seabed', 'target', 'recorder', None}
        Gain over range of the water column (see `mitsonar.plots.images.gain`).
    colours : str
        Colours of the water column: ``copper`` or ``grey``.
    bend : bool
        True draws the water column along rays of the profile in use, False along straight lines.
    theory : pair of arrays, optional
        Angles from the vertical [rad] and errors [m] of a curve beside the smile. The default is ray theory on a level
        bed, if the line has the true profile of the water.
    water : SoundSpeedProfile, optional
        True profile of the water for ``rays``. The default is that of the line.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ValueError
        If the dataset is not a line of soundings, if the view or ping is unknown, or if there is nothing to draw.
    """
    check(line)
    if what not in LINE_VIEWS:
        raise ValueError(f"there is no plot {what!r} of a line of soundings{meant(what, LINE_VIEWS)}; choose one of "
                         f"{', '.join(LINE_VIEWS)}.")
    if not line.sizes["ping"] or not line.sizes["beam"]:
        raise ValueError(f"the line has {line.sizes['ping']} pings of {line.sizes['beam']} beams, so there is nothing "
                         "to draw.")
    canvas.colours_of(colours)
    _refuse_idle(what, ping is not None, OF_A_PING, "a ping is", "leave it out")
    _refuse_idle(what, colours != "copper" or tvg != "recorder", OF_LEVELS, "colours and the gain are",
                 "leave them out")
    view = LINE_VIEWS[what]
    missing = [name for name in view.needs if name not in line]
    if missing:
        simulated = "; only simulated lines have it" if missing[0].startswith(("error", "true_")) else ""
        raise ValueError(f"the plot {what!r} needs the variable {missing[0]!r}, which this line has not{simulated}.")
    options = Options(ping=_ping(line, ping), tvg=tvg, colours=colours, bend=bend, theory=theory, water=water)
    figure = canvas.sheet(*(view.size or _map_size(line)))
    view.draw(figure, line, options)
    figure.set_layout_engine("constrained", rect=(0.005, 0.005, 0.99, 0.99 - HEAD_ROOM / figure.bbox.height),
                             hspace=0.06, wspace=0.04)
    words = f", ping {options.ping}" if what in OF_A_PING[:2] else ""
    headed(figure, f"{line_title(line)}: {view.words}{words}", line_words(line))
    return canvas.darkened(figure)


def _refuse_idle(what: str, given: bool, of: tuple[str, ...], name: str, remedy: str) -> None:
    if given and what not in of:
        raise ValueError(f"{name} of the plots {', '.join(of)}, and the plot is {what!r}; {remedy}.")


def _ping(line: xr.Dataset, ping: int | None) -> int:
    pings = line.sizes["ping"]
    if ping is None:
        return pings // 2
    if not 0 <= ping < pings:
        raise ValueError(f"there is no ping {ping}; there are {pings}, the first is 0.")
    return ping


def _map_size(line: xr.Dataset) -> tuple[int, int]:
    shape = map_shape(line)
    across, up = (LONGER, LONGER / shape) if shape > 1 else (LONGER * shape, LONGER)
    return round(max(across + 190, LEAST_WIDE)), round(max(up, SHORTER) + 120)


def _column(figure: Figure, line: xr.Dataset, options: Options) -> None:
    shape = draw_column(figure.subplots(), line, options.ping, bend=options.bend, tvg=options.tvg,
                        colours=canvas.colours_of(options.colours))
    high = np.clip((WIDE - 190) / shape, 0.5 * SHORTER, LONGER) + HEAD_ROOM + 90
    figure.set_size_inches(WIDE / canvas.DPI, round(high) / canvas.DPI)


def _curtain(figure: Figure, line: xr.Dataset, options: Options) -> None:
    draw_curtain(figure.subplots(2, 1, sharex=True), line, tvg=options.tvg, colours=canvas.colours_of(options.colours))


def _map(figure: Figure, line: xr.Dataset, options: Options, *, what: str) -> None:
    draw_map(figure.subplots(), line, what)


def _backscatter(figure: Figure, line: xr.Dataset, options: Options) -> None:
    above, below = figure.subplots(2, 1, height_ratios=(3, 2))
    draw_map(above, line, "backscatter")
    angle_curves.draw_response(below, line)


def _smile(figure: Figure, line: xr.Dataset, options: Options) -> None:
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    angle_curves.draw_smile(above, line, options.theory)
    angle_curves.draw_exceeded(below, line)
    above.set_xlabel("")


def _rays(figure: Figure, line: xr.Dataset, options: Options) -> None:
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(1, 4))
    draw_rays(right, line, options.ping, options.water)
    draw_profiles(left, line, options.ping, max(right.get_ylim()), options.water)
    right.set_ylabel("")


def _quality(figure: Figure, line: xr.Dataset, options: Options) -> None:
    there = sounded(line)
    drawn = [draw for draw, names in (
        (angle_curves.draw_uncertainty, ("uncertainty", "horizontal_uncertainty")),
        (angle_curves.draw_quality, ("quality",)), (angle_curves.draw_methods, ("detection",)))
        if any(name in line and np.isfinite(line[name].values[there]).any() for name in names)]
    if not drawn:
        raise ValueError("the plot 'quality' needs one of quality, uncertainty, horizontal_uncertainty and detection, "
                         "and no sounding of this line has any.")
    panels = np.atleast_1d(figure.subplots(len(drawn), 1, sharex=True))
    for draw, axes in zip(drawn, panels, strict=True):
        draw(axes, line)
    for axes in panels[:-1]:
        axes.set_xlabel("")


def _motion(figure: Figure, line: xr.Dataset, options: Options) -> None:
    if not line.sizes["motion"]:
        raise ValueError("the line has no sample of the motion sensors, so there is nothing to draw.")
    draw_motion(list(figure.subplots(len(MOTIONS), 1, sharex=True)), line)


def _overview(figure: Figure, line: xr.Dataset, options: Options) -> None:
    """Draw the first six (or four) panels for which the line has data."""
    colours = canvas.colours_of(options.colours)
    panels: list[Callable[[Axes], object]] = [draw for draw, needed in (
        (lambda axes: draw_map(axes, line, "swath"), True),
        (lambda axes: draw_column(axes, line, options.ping, bend=options.bend, tvg=options.tvg,
                                  colours=colours), has_column(line)),
        (lambda axes: draw_map(axes, line, "error"), "error" in line),
        (lambda axes: angle_curves.draw_smile(axes, line, options.theory), "error" in line),
        (lambda axes: draw_rays(axes, line, options.ping, options.water), True),
        (lambda axes: draw_curtain([axes], line, tvg=options.tvg, colours=colours),
         has_column(line) and "error" not in line),
        (lambda axes: draw_map(axes, line, "backscatter"), "backscatter_db" in line and "error" not in line),
        (lambda axes: angle_curves.draw_response(axes, line), "backscatter_db" in line),
        (lambda axes: angle_curves.draw_uncertainty(axes, line), "uncertainty" in line and "error" not in line),
        (lambda axes: draw_attitude(axes, line), line.sizes["motion"] > 0)) if needed]
    columns = 3 if len(panels) > 4 else 2
    places = figure.add_gridspec(2, columns)
    drawn, reason = 0, ""
    for draw in panels:
        if drawn == 2 * columns:
            break
        axes = figure.add_subplot(places[divmod(drawn, columns)])
        try:
            draw(axes)
        except ValueError as error:                    # the line has no data for this panel
            axes.remove()
            reason = reason or str(error)
        else:
            _fill(axes)
            drawn += 1
    if not drawn:
        raise ValueError(reason)


def _fill(axes: Axes) -> None:
    """Let a flat or narrow panel of equal scales fill its room with different scales."""
    across, up = (abs(end - start) for start, end in (axes.get_xlim(), axes.get_ylim()))
    if axes.get_aspect() != "auto" and not 1 / FLAT < across / up < FLAT:
        axes.set_aspect("auto")
        axes.text(0.02, 0.02, "scales differ across and up", transform=axes.transAxes, fontsize=9)


LINE_VIEWS = {
    "overview": LineView(words="overview", size=(1900, 1150), draw=_overview),
    "column": LineView(words="water column", needs=COLUMN, size=(WIDE, 760), draw=_column),
    "curtain": LineView(words="water column along the track", needs=COLUMN, size=(WIDE, 900), draw=_curtain),
    "swath": LineView(words="depth", size=None, draw=partial(_map, what="swath")),
    **{name: LineView(words="error of depth" if name == "error" else f"error of depth by {words}", needs=(name,),
                      size=None, draw=partial(_map, what=name)) for name, (words, _, _) in CAUSES.items()},
    "backscatter": LineView(words="backscatter", needs=("backscatter_db",), size=(WIDE, 1100), draw=_backscatter),
    "smile": LineView(words="error across the swath", needs=("error",), size=(WIDE, 860), draw=_smile),
    "rays": LineView(words="ray paths", size=(1400, 720), draw=_rays),
    "quality": LineView(words="quality and uncertainty", size=(WIDE, 980), draw=_quality),
    "motion": LineView(words="motion", size=(WIDE, 980), draw=_motion),
}
