"""Sheets of all plots: figures without pyplot's global state, colours, titles, axes in metres, scale bars and files."""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.colorbar import Colorbar
from matplotlib.colors import Colormap, LinearSegmentedColormap, to_hex, to_rgb, to_rgba, to_rgba_array
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter, MaxNLocator
from matplotlib.typing import ColorType

from mitsonar.device.files import FilePath, check_writable, checked_suffix, replacing
from mitsonar.units import khz_from_hertz

from .images.grid import ONLY_SIDE, PlotGrid

if TYPE_CHECKING:
    import xarray as xr


def title(dataset: xr.Dataset) -> str:
    """Return the name of the sonar and its frequency."""
    frequency = dataset.attrs.get("frequency")
    return dataset.attrs.get("sonar", "sonar") + (f" {khz_from_hertz(float(frequency)):g} kHz" if frequency else "")


def subtitle(
        dataset: xr.Dataset, grid: PlotGrid,
        more_db: Mapping[str, float] | None = None,    # extra gains of parts of the picture, by their names
) -> str:
    """Return a line with the number of pings, the distances covered, the bin width, the altitude and extra gains."""
    pings = dataset.sizes["ping"]
    parts = [f"{pings} ping{'s' * (pings != 1)}" + f" over {in_metres(grid.along[-1] - grid.along[0])}" * grid.moving,
             in_metres(grid.across[-1]) + (" to each side" if grid.across[0] < 0 else " range")]
    if "bin_width" in dataset.attrs:
        parts.append(f"bins of {in_metres(float(dataset.attrs['bin_width']))}")
    if "altitude" in dataset.coords and np.isfinite(dataset["altitude"].values).any():
        parts.append(f"altitude {in_metres(float(np.nanmean(dataset['altitude'].values)))}")
    parts += [f"{name} + {gain:g} dB" for name, gain in (more_db or {}).items()]
    return "   ·   ".join(parts)


def in_metres(length: float) -> str:
    """Return a length to three digits in cm or m, without a power of ten."""
    return f"{100 * length:.3g} cm" if length < 1 else f"{length:.3g} m" if length < 999.5 else f"{length:.0f} m"


DPI = 110
EDGE = 12                # pixels between text and the edge of the sheet
BAND = 0.25              # least opacity of bands behind curves on the dark sheet
VISIBLE = 0.45           # least luminance of lines and text on the dark sheet
PAPER, INK, FAINT = "#14110e", "#f2e8d5", "#8c7b66"    # colours of the dark sheet
KEY_HEIGHT = 24          # pixels of a line of the legend
BAR_FOOT, BAR_RISE = 18, 40    # pixels: height of the scale bars above the sheet's edge; longest bar along the track
SIDES = {"port": "#b3261e", "starboard": "#1b7a3d", ONLY_SIDE: "#1f4e79"}    # colours of a ship's side lights
COPPER = LinearSegmentedColormap.from_list("sonar_copper", [
    (0.0, "#050302"), (0.18, "#2b1306"), (0.4, "#7a3c10"), (0.6, "#b86f22"), (0.78, "#e0a548"), (0.92, "#f6dc94"),
    (1.0, "#fffdf0")]).with_extremes(bad=PAPER)
GREY = LinearSegmentedColormap.from_list("sonar_grey", ["#000000", "#ffffff"]).with_extremes(bad=PAPER)
COLOURS = {"copper": COPPER, "grey": GREY}
FORMATS = (".png", ".pdf", ".svg")
MANAGED: ContextVar[list[Figure] | None] = ContextVar("managed", default=None)     # sheets that pyplot shows


def file_format(path: FilePath) -> str:
    """Return the format that the suffix of a file name stands for; raise ValueError if plots have no such format."""
    return checked_suffix(path, FORMATS).removeprefix(".")


def check_path(path: FilePath | None) -> None:
    """Check that a plot can be written to a path, before any work is spent on it; None stands for no file."""
    if path is not None:
        file_format(path)
        check_writable(path)


def check_ping(ping: int, pings: int) -> None:
    """Check that a record has a ping of that index."""
    if not 0 <= ping < pings:
        raise ValueError(f"there is no ping {ping}; there are {pings}, the first is 0.")


def colours_of(name: str) -> Colormap:
    """Return a colour map of `COLOURS` by its name; raise ValueError if there is none."""
    if name not in COLOURS:
        raise ValueError(f"there are no colours {name!r}; choose one of {', '.join(COLOURS)}.")
    return COLOURS[name]


def darkened(figure: Figure) -> Figure:
    """Change a light sheet to dark paper and light ink, and lighten colours that would be hard to see on it."""
    if to_hex(figure.get_facecolor()) == PAPER:
        return figure
    figure.set_facecolor(PAPER)
    for axes in figure.findobj(Axes):
        if to_hex(axes.get_facecolor()) == "#ffffff":
            axes.set_facecolor(PAPER)
        axes.tick_params(which="both", color=INK, labelcolor=INK)
        for spine in axes.spines.values():
            spine.set_edgecolor(FAINT)
    for text in figure.findobj(Text):
        text.set_color(_lighter(text.get_color()))
    for line in figure.findobj(Line2D):
        line.set_color(_lighter(line.get_color()))
        line.set_markerfacecolor(_lighter(line.get_markerfacecolor()))
        line.set_markeredgecolor(_lighter(line.get_markeredgecolor()))
    for band in [*figure.findobj(PolyCollection), *(part for part in figure.findobj(Patch) if part.get_alpha())]:
        band.set_facecolor([_lighter(colour) for colour in np.atleast_2d(to_rgba_array(band.get_facecolor()))][0])
        if band.get_alpha():
            band.set_alpha(max(band.get_alpha(), BAND))
    for key in figure.findobj(Legend):
        key.get_frame().set(facecolor=PAPER, edgecolor=FAINT)
    return figure


def _lighter(colour: ColorType) -> ColorType:
    """Return a colour that stands out from dark paper: light ink for dark greys, a tint of other dark colours."""
    if isinstance(colour, str) and colour in ("none", "auto", "inherit"):
        return colour
    red, green, blue, alpha = to_rgba(colour)
    bright = 0.2126 * red + 0.7152 * green + 0.0722 * blue
    if bright >= VISIBLE:
        return colour
    if max(red, green, blue) - min(red, green, blue) < 0.1:
        return (*to_rgb(INK), alpha)
    white = (VISIBLE - bright) / (1 - bright)
    red, green, blue = (part + white * (1 - part) for part in (red, green, blue))
    return red, green, blue, alpha


def saved(figure: Figure, path: FilePath | None) -> Figure:
    """Return a figure on dark paper, and write it if a path is given."""
    if path is not None:
        save(figure, path)
    return darkened(figure)


def save(figure: Figure, path: FilePath) -> None:
    """Write a figure on dark paper, completely or not at all, and without a date, so that files can be compared."""
    figure, kind = darkened(figure), file_format(path)
    metadata = {"png": {"Software": None}, "pdf": {"CreationDate": None}, "svg": {"Date": None}}[kind]
    with replacing(path) as temporary:
        figure.savefig(temporary, format=kind, dpi=DPI, metadata=metadata, facecolor=figure.get_facecolor())


def sheet(width: float, height: float, colour: str = "white") -> Figure:
    """Return an empty figure of a size in pixels."""
    managed = MANAGED.get()
    if managed is not None:
        from matplotlib import pyplot

        managed.append(pyplot.figure(figsize=(width / DPI, height / DPI), dpi=DPI, facecolor=colour))
        return managed[-1]
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI, facecolor=colour)
    FigureCanvasAgg(figure)
    return figure


def picture(grid: PlotGrid, image: np.ndarray, title: str, *, subtitle: str = "", colours: Colormap = COPPER,
            limits: tuple[float, float] | None = None, bar: str = "",
            bar_extend: Literal["neither", "both", "min", "max"] = "both",
            keys: Sequence[Artist] = ()) -> tuple[Figure, Axes]:
    """Draw an image over the ground that it covers, one pixel of the sheet for each pixel of the image.

    Parameters
    ----------
    grid : PlotGrid
    image : array (grid.height, grid.width)
        Values with the oldest ping in row 0, which is drawn at the bottom, or on the left of an echogram.
    title, subtitle : str
    colours : matplotlib colormap
    limits : pair of float, optional
        Values of the first and the last colour.
    bar : str
        Label of the colour bar; without a label there is no bar.
    bar_extend : {'neither', 'both', 'min', 'max'}
        Ends of the colour bar that are pointed.
    keys : sequence of matplotlib artists
        Entries of the legend, which stands beside the picture.

    Returns
    -------
    matplotlib.figure.Figure, Axes
    """
    left, right, bottom, top = 84, 128 if bar else 30, 90, 86
    width, height = (grid.height, grid.width) if grid.down else (grid.width, grid.height)
    if keys:
        right += legend(sheet(1, 1).add_subplot(), keys, height).get_window_extent().width
    # titles may be wider than a narrow picture
    right = max(right, _words_width(title, subtitle) + EDGE - width)
    figure = sheet(left + width + right, bottom + height + top, PAPER)
    axes = figure.add_axes(shares_of(figure, left, bottom, width, height), facecolor=PAPER)
    low, high = limits or (None, None)
    across, along = ((edges[0], edges[-1]) for edges in (grid.across, grid.along))
    turned = {"X": image.swapaxes(0, 1), "origin": "upper", "extent": (*along, *across[::-1])} if grid.down else {
        "X": image, "origin": "lower", "extent": (*across, *along)}
    drawn = axes.imshow(**turned, aspect="auto", interpolation="nearest", cmap=colours, vmin=low, vmax=high)
    headings(figure, left, title, subtitle)
    _metres(grid, axes)
    scale_bar(grid, axes)
    if keys:
        legend(axes, keys, height)
    if bar:
        key = colour_bar(drawn, axes, bar, bar_extend)
        key.outline.set_edgecolor(FAINT)               # pyright: ignore[reportCallIssue]  declared as any artist
    return figure, axes


def named_picture(dataset: xr.Dataset, grid: PlotGrid, image: np.ndarray, name: str, **options: Any) -> Figure:
    """Draw a picture with the titles of a dataset and the name of a plot; the options are those of `picture`."""
    return picture(grid, image, f"{title(dataset)}: {name}", subtitle=subtitle(dataset, grid), **options)[0]


def _words_width(title: str, subtitle: str) -> float:
    """Return the width of the wider of both titles [pixels]."""
    paper = sheet(1, 1, PAPER)
    second = headings(paper, 0, title, subtitle)
    return max(text.get_window_extent().width for text in (second, *paper.texts))


def shares_of(figure: Figure, left: float, bottom: float, width: float,
              height: float) -> tuple[float, float, float, float]:
    """Return a box in pixels as shares of the sheet, as `Figure.add_axes` takes it."""
    across, up = figure.bbox.width, figure.bbox.height
    return left / across, bottom / up, width / across, height / up


def headings(figure: Figure, left: float, title: str, subtitle: str) -> Text:
    """Write both titles at the top of a sheet, ``left`` pixels from its edge, and return the second."""
    x, top = left / figure.bbox.width, figure.bbox.height
    figure.text(x, 1 - 30 / top, title, color=INK, fontsize=14, fontweight="bold", va="center")
    return figure.text(x, 1 - 54 / top, subtitle, color=INK, fontsize=10.5, va="center")


def colour_bar(drawn: AxesImage, axes: Axes, label: str, extend: Literal["neither", "both", "min", "max"],
               gap: float = 18) -> Colorbar:
    """Draw the colour bar of an image beside its axes, ``gap`` pixels away."""
    figure, box = cast(Figure, axes.figure), axes.get_position(original=True)
    across = figure.bbox.width
    room = figure.add_axes((box.x1 + gap / across, box.y0, 16 / across, box.height))
    bar = figure.colorbar(drawn, cax=room, extend=extend, extendfrac=0.02)
    bar.set_label(label, color=INK, fontsize=10.5)
    room.tick_params(colors=INK, labelsize=10)
    return bar


def outline(mask: np.ndarray) -> np.ndarray:
    """Return a mask of the outline around a mask; the masked pixels themselves stay visible."""
    from scipy import ndimage

    return np.asarray(ndimage.binary_dilation(mask, iterations=2), bool) & ~mask


def legend(axes: Axes, keys: Sequence[Artist], height: float) -> Legend:
    """Draw a legend to the right of the axes, in as many columns as a height [pixels] requires."""
    columns = -(-len(keys) * KEY_HEIGHT // height)
    return axes.legend(handles=list(keys), loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=1.0, fontsize=10,
                       ncols=columns, facecolor=PAPER, edgecolor=FAINT, labelcolor=INK)


def _metres(grid, axes):
    """Label slant range on both sides and distance along the track, newest ping on top or on the right."""
    across, along = (axes.yaxis, axes.xaxis) if grid.down else (axes.xaxis, axes.yaxis)
    across.set_major_locator(MaxNLocator(16, steps=[1, 2, 5, 10]))
    across.set_major_formatter(FuncFormatter(lambda value, _: f"{abs(value):g}"))
    along.set_major_locator(MaxNLocator(10, steps=[1, 2, 5, 10], integer=not grid.moving))
    sides = grid.across[0] < 0
    across.set_label_text("port        ←        slant range [m]        →        starboard" if sides
                          else "slant range [m]", color=INK, fontsize=11)
    along.set_label_text(f"{'along track [m]' if grid.moving else 'ping'}        newest →", color=INK, fontsize=11)
    axes.tick_params(colors=INK, labelsize=10, top=True, direction="out")
    for spine in axes.spines.values():
        spine.set_edgecolor(FAINT)
    if sides:
        axes.axvline(0, color=INK, linewidth=0.5, alpha=0.35)


def scale_bar(grid: PlotGrid, axes: Axes) -> None:
    """Draw scale bars of round lengths across and along the track, and write how both scales differ.

    An echogram has none: its scales differ by much, and the axes are labelled in metres.
    """
    if grid.down:
        return
    figure = axes.figure
    pixel_x, pixel_y = ((edges[-1] - edges[0]) / size
                        for edges, size in ((grid.across, grid.width), (grid.along, grid.height)))
    length = round_length(grid.width / 7 * pixel_x)
    right, low = axes.bbox.x1, BAR_FOOT
    left, high = right - length / pixel_x, low
    text = {"color": INK, "fontsize": 10.5, "va": "center", "ha": "right"}
    if grid.moving:
        rise = round_length(BAR_RISE * pixel_y)
        high = low + rise / pixel_y
        _write(figure, right + 9, 0.5 * (low + high), f"{rise:g} m", **text | {"ha": "left"})
    figure.add_artist(Line2D(*_on_sheet(figure, [left, right, right], [low, low, high]), color=INK, linewidth=2.5,
                             solid_joinstyle="miter", solid_capstyle="butt"))
    _write(figure, left - 9, low, f"{length:g} m", **text)
    if grid.moving:
        same = abs(grid.stretch - 1) < 0.005
        words = "same scale along and across track" if same else f"scale along track {grid.stretch:.3g} × that across"
        _write(figure, axes.bbox.x0, low, words, **text | {"ha": "left"})


def _on_sheet(figure, x, y):
    """Return pixels from the lower left corner as shares of the sheet."""
    return np.asarray(x) / figure.bbox.width, np.asarray(y) / figure.bbox.height


def _write(figure, x, y, words, **style):
    figure.text(*_on_sheet(figure, x, y), words, **style)


def round_length(length: float) -> float:
    """Return the largest of 1, 2 or 5 x 10^n that is no longer than ``length``."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(max(step * power for step in (1, 2, 5) if step * power <= length * (1 + 1e-9)))
