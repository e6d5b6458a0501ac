"""Plots of fans of beams in the plane of the beams, as forward-looking, sector and multibeam sonars display them.

A sample at time t in the beam at angle α lies at the slant range r = c t / 2, r sin α to the side and r cos α along the
middle of the fan. For a level fan α is the azimuth, and these directions are starboard and ahead; for a fan that looks
down they are starboard and below.

A turn of a rotating head is drawn as a fan, with its steps as beams. As on the head's own screen, each step lies at its
bearing from the platform, which is assumed to stand still during a turn. Ahead is up; if the head is mounted to the
front, up is up.
"""
import numbers
import os
from collections.abc import Iterable, Sequence

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.typing import ColorType

from mitsonar.device.files import FilePath
from mitsonar.imaging.gain import Tvg, display_gain
from mitsonar.imaging.maps.raster import bearings
from mitsonar.units import khz_from_hertz

from .. import canvas
from ..images.gain import heard_to
from ..onto import moved, sheets_for
from .fan_sheet import WAYS, FanSheet, FanView, view_of


def is_scan(dataset: xr.Dataset) -> bool:
    """Return True for a record of a rotating head: levels over (ping, range), and a bearing for each of its pings."""
    level, bearing = dataset.get("level"), dataset.coords.get("bearing")
    return level is not None and bearing is not None and set(level.dims) == {"ping", "range"} and (
        bearing.dims == ("ping",)) and bearing.size > 1


def turn_of(dataset: xr.Dataset, ping: int = 0) -> xr.Dataset:
    """Return the turn, or the pass across a sector, that a ping belongs to, as one ping of a fan."""
    canvas.check_ping(ping, dataset.sizes["ping"])
    _, turns = bearings(dataset)
    steps = dataset.isel(ping=next(turn for turn in turns if turn.start <= ping < turn.stop))
    if steps.sizes["ping"] < 2:
        raise ValueError(f"the turn of ping {ping} has no other ping, so it makes no picture; choose another ping.")
    angle = steps["bearing"].values.astype(float)
    variables = {name: (tuple("beam" if dim == "ping" else dim for dim in variable.dims), variable.values,
                        variable.attrs) for name, variable in steps.data_vars.items()}
    kept = {name: coord for name, coord in steps.coords.items() if "ping" not in coord.dims}
    upright = steps.attrs.get("mount") == "forward"
    towards = (0 * angle, np.sin(angle), -np.cos(angle)) if upright else (np.cos(angle), np.sin(angle), 0 * angle)
    fan = xr.Dataset(variables, kept, steps.attrs).expand_dims("ping").assign_coords(
        beam=angle, **{f"beam_{axis}": ("beam", column) for axis, column in zip("xyz", towards)})
    first = {name: ("ping", steps[name].values[:1]) for name in ("ping", "turn", "ping_time") if name in steps.coords}
    if "altitude" in steps.coords:
        first["altitude"] = ("ping", [float(np.nanmean(steps["altitude"].values))])
    return fan.assign_coords(first)


FAINT, BRIGHT = 3.0, 99.8          # percentiles of the levels of the first and the last colour
# Side lobes and shadows may be far darker than the bed's echo, and targets far brighter. The first colour therefore is
# at most 16 dB below one percentile of the levels, and the last colour at most 10 dB above another.
BED, BED_DB = 75.0, 16.0
BRIGHT_BED, TARGET_DB = 90.0, 10.0


def fan(beams: xr.DataArray, path: FilePath | None = None, *, ping: int = 0, tvg: bool = True,
        limits: tuple[float, float] | None = None, title: str = "", subtitle: str = "",
        colours: str = "copper", axes: Axes | None = None) -> Axes:
    """Draw the levels of a fan of beams: seen from above for level beams, from the end for beams that look down.

    Parameters
    ----------
    beams : xarray.DataArray (ping, beam, sample)
        Output of a beamformer [µPa], with ``azimuth`` [rad] over the beams, rising or falling. For beams that look down
        according to ``beam_z``, angles from the vertical replace the azimuths.
    path : str or path, optional
        File to write, ending in .png, .pdf or .svg.
    ping : int
        Index of the ping.
    tvg : bool
        If True, 30 log r [dB] is added, so that a level bed looks even over range.
    limits : pair of float, optional [dB]
        Levels of the first and the last colour; by default percentiles of the picture.
    title, subtitle : str
    colours : {'copper', 'grey'}
    axes : matplotlib.axes.Axes, optional
        As for `mitsonar.plots.plot`.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If there are fewer than two beams or fewer than two different azimuths, or an argument is not as above.
    OSError
        If the file cannot be written.
    """
    shades = canvas.colours_of(colours)
    angle, slant_range, level, facing, right = _levels(beams, ping)
    canvas.check_path(path)
    gain, words = display_gain(xr.Dataset(coords={"range": slant_range}), "seabed" if tvg else None)
    view = view_of(angle, slant_range, facing, right)
    image = view.map.levels(level + gain)
    with sheets_for(path, axes):
        sheet = FanSheet(view, title=title or "fan of beams", subtitle=subtitle, colours=shades,
                         limits=limits or fan_window(image), bar=f"level{words}  [dB re 1 µPa]")
        sheet.show(image)
        return moved(canvas.saved(sheet.figure, path), axes)


def fan_picture(dataset: xr.Dataset, path: FilePath | None, *, ping: int = 0, tvg: Tvg = "seabed", what: str = "",
                marks: Iterable[tuple[np.ndarray, ColorType]] = (), keys: Sequence[Artist] = (),
                colours: str = "copper") -> Figure:
    """Draw one ping of an array's image: its fan, or for a single beam the levels over range."""
    shades = canvas.colours_of(colours)
    canvas.check_ping(ping, dataset.sizes["ping"])
    if dataset.sizes["beam"] == 1:
        if what:
            raise ValueError(f"the {what} are outlined on a fan; this array has a single beam.")
        return _draw_beam(dataset, path, ping)
    canvas.check_path(path)
    view = fan_view(dataset)
    level, words = fan_levels(dataset, ping, tvg)
    image = view.map.levels(level)
    limits = fan_window(image)
    subtitle = words_of(dataset, ping)
    if what:
        sheet = FanSheet(view, title=f"{name_of(dataset)}: {what}", subtitle=subtitle, keys=keys)
        sheet.show(_marked(view, np.clip((image - limits[0]) / (limits[1] - limits[0]), 0, 1), marks))
    else:
        sheet = FanSheet(view, title=name_of(dataset), subtitle=subtitle, colours=shades, limits=limits,
                         bar=f"level{words}  [dB re 1 µPa]")
        sheet.show(image)
    return canvas.saved(sheet.figure, path)


def fan_view(dataset: xr.Dataset) -> FanView:
    """Return the layout of the fan of a dataset (ping, beam, range), which is the same for all pings."""
    direction = _directions(dataset)
    if "turn" in dataset.coords:                             # directions of a full turn have no mean
        facing, right = "up" if np.any(direction[:, 2]) else "forward", "starboard"
    else:
        facing = _way(direction.mean(0))
        right = _way(direction[-1] - direction[0], facing)
    return view_of(dataset["beam"].values, dataset["range"].values, facing, right)


def fan_levels(dataset: xr.Dataset, ping: int, tvg: Tvg,
               heard: int | None = None) -> tuple[np.ndarray, str]:    # heard: bin from which the gain is constant
    """Return the levels (beam, range) [dB] of a ping with their gain for display, and the gain's formula."""
    level, gain, words = _gained(dataset, ping, tvg)
    heard = heard_to(level, gain) if heard is None else heard
    if heard < gain.size and words:
        gain = np.where(np.arange(gain.size) < heard, gain, gain[heard])
        words += f" to {float(dataset['range'][heard]):.2g} m"
    return level + gain, words


def fan_heard(dataset: xr.Dataset, pings: Iterable[int], tvg: Tvg) -> int:
    """Return the bin from which the gain of all pings is constant: the last at which noise begins to hide the bed."""
    return max(heard_to(*_gained(dataset, ping, tvg)[:2]) for ping in pings)


def _gained(dataset, ping, tvg):
    """Return the levels (beam, range) of a ping, their gain (range,) [dB] and its formula."""
    image = dataset.isel(ping=[ping])
    gain, words = display_gain(image, tvg)
    return image["level"].transpose("ping", "beam", "range").values[0], gain[0], words


def fan_window(image: np.ndarray) -> tuple[float, float]:
    """Return the levels of the first and the last colour of images that may hold NaN [dB]."""
    shown = image[np.isfinite(image)]
    if not shown.size:
        return 0.0, 1.0
    low, bed, bright_bed, high = np.percentile(shown, [FAINT, BED, BRIGHT_BED, BRIGHT])
    low, high = max(low, bed - BED_DB), min(high, bright_bed + TARGET_DB)
    return float(low), float(max(high, low + 1e-3))


def name_of(dataset: xr.Dataset) -> str:
    """Return the title of a plot: the name of the scene's file, or the kind of sonar."""
    return os.path.splitext(dataset.attrs.get("file") or "")[0] or dataset.attrs.get("sonar") or "sonar"


def words_of(dataset: xr.Dataset, ping: int) -> str:
    """Return the subtitle of a ping: its number, time, frequency and number of beams."""
    turns = "turn" in dataset.coords
    parts = [f"turn {int(dataset['turn'][ping])}" if turns else f"ping {int(dataset['ping'][ping])}"]
    if "ping_time" in dataset.coords:
        parts.append(f"{float(dataset['ping_time'][ping]):.2f} s")
    if "frequency" in dataset.attrs:
        frequency = dataset.attrs["frequency"]
        if not isinstance(frequency, numbers.Real):
            raise ValueError(f"the attribute frequency is {frequency!r}, not a number [Hz]; correct it.")
        parts.append(f"{khz_from_hertz(float(frequency)):g} kHz")
    return ", ".join([*parts, f"{dataset.sizes['beam']} {'steps' if turns else 'beams'}"])


def looks_down(dataset: xr.Dataset) -> bool:
    """Return True if the fan of a dataset looks down, so that ranges grow downwards in its plot."""
    return "beam_z" in dataset.coords and _way(_directions(dataset).mean(0)) == "down"


def _directions(dataset):
    """Return the directions of the beams (B, 3), body frame."""
    lacking = [f"beam_{axis}" for axis in "xyz" if f"beam_{axis}" not in dataset.variables]
    if lacking:
        raise ValueError(f"the record has no {lacking[0]}, the direction of its beams: it is no complete image of a "
                         "fan and no complete line of soundings; give a file of mitsonar render or mitsonar soundings.")
    return np.stack([dataset[f"beam_{axis}"].values for axis in "xyz"], axis=-1)


def _draw_beam(dataset, path, ping):
    canvas.check_path(path)
    figure = canvas.sheet(1100, 500)
    axes = figure.subplots()
    axes.plot(dataset["range"].values, dataset["level"].values[ping, 0], color="#1f4e79", linewidth=0.8)
    axes.set_xlabel("slant range [m]", fontsize=11)
    axes.set_ylabel("level [dB re 1 µPa]", fontsize=11)
    axes.grid(alpha=0.25)
    axes.set_title(f"{name_of(dataset)}, ping {int(dataset['ping'][ping])}, one beam", fontsize=13)
    figure.tight_layout()
    return canvas.saved(figure, path)


def _marked(view, grey, marks):
    """Return the colours (rows, columns, 3) of a grey fan (0 to 1, NaN outside), with outlines around masks of bins."""
    inside = np.isfinite(grey)
    picture = np.where(inside[..., None], np.nan_to_num(grey)[..., None], to_rgb(canvas.PAPER))
    for mask, colour in marks:
        picture[canvas.outline(view.map.labels(mask)) & inside] = colour
    return picture


def _way(vector, beside=None):
    """Return the name of the body's direction that is nearest to a vector, on another axis than ``beside``."""
    axis = np.argmax([abs(part) * (beside not in pair) for part, pair in zip(vector, WAYS)])
    return WAYS[axis][int(vector[axis] > 0)]


def _levels(beams, ping):
    """Return rising angles [rad], slant ranges [m], levels (beam, sample) [dB], and names of two directions."""
    if set(beams.dims) != {"ping", "beam", "sample"} or beams.sizes["beam"] < 2:
        raise ValueError(f"a fan is drawn of two or more beams (ping, beam, sample); these are {dict(beams.sizes)}.")
    if "azimuth" not in beams.coords:
        raise ValueError("the beams have no azimuth, so they make no fan; give beamformers level directions.")
    canvas.check_ping(ping, beams.sizes["ping"])
    angle, facing, right = beams["azimuth"].values, "forward", "starboard"
    if "beam_z" in beams.coords and float(beams["beam_z"].mean()) > 0.5:
        side = max("yx", key=lambda axis: float(np.ptp(beams[f"beam_{axis}"].values)))
        angle = np.arctan2(beams[f"beam_{side}"].values, beams["beam_z"].values)
        facing, right = "down", {"x": "forward", "y": "starboard"}[side]
    if np.ptp(angle) < 1e-6:
        raise ValueError(f"the beams have one azimuth, {np.degrees(angle[0]):.4g} degrees, so they make no fan seen "
                         "from above; give level directions, or directions that look down.")
    pressure = np.abs(beams.isel(ping=ping).transpose("beam", "sample").values.astype(complex))
    order = np.argsort(angle, kind="stable")
    slant_range = 0.5 * beams.attrs["sound_speed"] * beams["time"].values
    return angle[order], slant_range, 20 * np.log10(np.maximum(pressure[order], 1e-10)), facing, right
