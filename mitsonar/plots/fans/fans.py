"""A fan of beams seen across its plane: what a forward-looking, sector or multibeam sonar puts on its screen.

A sample at time t of the beam at angle α lies r = c t / 2 from the array, r sin α aside and r cos α along the fan's
middle: to starboard and ahead for a level fan, whose α is the azimuth; to starboard and below for one that looks down.

A turn of a rotating head as a fan: its steps in the place of beams, so that all that draws fans draws it.

The picture is the one on the head's screen: every step at its bearing from the platform, which is taken to stand still
for a turn; ahead is up, or what is straight up where the head points forward.
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
    """Tell whether a dataset is of a rotating head: levels over (ping, range), a bearing for each of several pings."""
    level, bearing = dataset.get("level"), dataset.coords.get("bearing")
    return level is not None and bearing is not None and set(level.dims) == {"ping", "range"} and (
        bearing.dims == ("ping",)) and bearing.size > 1


def turn_of(dataset: xr.Dataset, ping: int = 0) -> xr.Dataset:
    """Return the turn that a ping belongs to, or the way across the sector, as one ping of a fan."""
    if not 0 <= ping < dataset.sizes["ping"]:
        raise ValueError(f"there is no ping {ping}; there are {dataset.sizes['ping']}, the first is 0.")
    _, turns = bearings(dataset)
    where = next(one for one in turns if one.start <= ping < one.stop)
    steps = dataset.isel(ping=where)
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


FAINT, BRIGHT = 3.0, 99.8          # percentiles of the first and the last colour
BED, BED_DB = 75.0, 16.0           # the first is at most so far below this percentile, which the bed's echo is: beams'
BRIGHT_BED, TARGET_DB = 90.0, 10.0             # skirts and shadows may be far darker; likewise, targets far brighter


def fan(beams: xr.DataArray, path: FilePath | None = None, *, ping: int = 0, tvg: bool = True,
        limits: tuple[float, float] | None = None, title: str = "", subtitle: str = "",
        colours: str = "copper", axes: Axes | None = None) -> Axes:
    """Draw the levels of a fan of beams: from above where they are level, from the end where they look down.

    Parameters
    ----------
    beams : xarray.DataArray (ping, beam, sample)
        As beamformers give them [µPa]; with ``azimuth`` [rad] over the beams, rising or falling. Where ``beam_z`` says
        that they look down, the angles from below replace the azimuths.
    path : str or path
        A .png, .pdf or .svg to write; None: no file.
    ping : int
        By position.
    tvg : bool
        Add 30 log r [dB], so that a level bed looks even over range.
    limits : pair of float, optional [dB]
        Levels of the first and the last colour; by default what the picture needs.
    title, subtitle : str
    colours : str
        One of `canvas.COLOURS`.
    axes : matplotlib.axes.Axes, optional
        To draw into; without it, and without a path, the figure is one of pyplot's, and notebooks show it.

    Returns
    -------
    matplotlib.axes.Axes
        In metres, degrees or dB, as they are labelled; the sheet is its ``figure``.

    Raises
    ------
    ValueError
        If there are fewer than two beams, or no azimuths or only one, or no such ping or colours, or the file is of
        another kind.
    FileNotFoundError, PermissionError, OSError
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
    """Draw one ping of what `mitsonar.render` gives of an array: its `fan`, or the levels of a single beam over range.
    """
    shades = canvas.colours_of(colours)
    check_ping(ping, dataset.sizes["ping"])
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
    """Lay the fan of a dataset (ping, beam, range) out over the sheet; all pings have the same."""
    direction = _directions(dataset)
    if "turn" in dataset.coords:                             # a head's steps may go all around
        facing, right = "up" if np.any(direction[:, 2]) else "forward", "starboard"
    else:
        facing = _way(direction.mean(0))
        right = _way(direction[-1] - direction[0], facing)
    return view_of(dataset["beam"].values, dataset["range"].values, facing, right)


def fan_levels(dataset: xr.Dataset, ping: int, tvg: Tvg, heard: int | None = None) -> tuple[np.ndarray, str]:
    """Return the levels (beam, range) [dB] of a ping with their gain for display, and the gain's formula."""
    level, gain, words = _gained(dataset, ping, tvg)
    heard = heard_to(level, gain) if heard is None else heard
    if heard < gain.size and words:
        gain = np.where(np.arange(gain.size) < heard, gain, gain[heard])
        words += f" to {float(dataset['range'][heard]):.2g} m"
    return level + gain, words


def fan_heard(dataset: xr.Dataset, pings: Iterable[int], tvg: Tvg) -> int:
    """Return the bin from which the gain of all pings is held: where noise hides the bed in the last of these."""
    return max(heard_to(*_gained(dataset, ping, tvg)[:2]) for ping in pings)


def _gained(dataset, ping, tvg):
    """Levels (beam, range) of a ping, their gain (range,) [dB] and its formula."""
    one = dataset.isel(ping=[ping])
    gain, words = display_gain(one, tvg)
    return one["level"].transpose("ping", "beam", "range").values[0], gain[0], words


def fan_window(image: np.ndarray) -> tuple[float, float]:
    """Return the levels of the first and the last colour of pictures [dB]; NaN is left out."""
    shown = image[np.isfinite(image)]
    if not shown.size:
        return 0.0, 1.0
    low, bed, bright_bed, high = np.percentile(shown, [FAINT, BED, BRIGHT_BED, BRIGHT])
    low, high = max(low, bed - BED_DB), min(high, bright_bed + TARGET_DB)
    return float(low), float(max(high, low + 1e-3))


def name_of(dataset: xr.Dataset) -> str:
    """Return what a picture is called: its scene's file, or its kind of sonar."""
    return os.path.splitext(dataset.attrs.get("file") or "")[0] or dataset.attrs.get("sonar") or "sonar"


def words_of(dataset: xr.Dataset, ping: int) -> str:
    """Say which ping of what sonar it is."""
    turns = "turn" in dataset.coords
    parts = [f"turn {int(dataset['turn'][ping])}" if turns else f"ping {int(dataset['ping'][ping])}"]
    if "ping_time" in dataset.coords:
        parts.append(f"{float(dataset['ping_time'][ping]):.2f} s")
    if "frequency" in dataset.attrs:
        frequency = dataset.attrs["frequency"]
        if not isinstance(frequency, numbers.Real):
            raise ValueError(f"the attribute frequency is {frequency!r}, not a number [Hz]; mend it.")
        parts.append(f"{khz_from_hertz(float(frequency)):g} kHz")
    return ", ".join([*parts, f"{dataset.sizes['beam']} {'steps' if turns else 'beams'}"])


def looks_down(dataset: xr.Dataset) -> bool:
    """Tell whether a dataset of beams is drawn from the end, ranges growing downwards."""
    return "beam_z" in dataset.coords and _way(_directions(dataset).mean(0)) == "down"


def _directions(dataset):
    """Return the directions of the beams (B, 3), body frame."""
    lacking = [f"beam_{axis}" for axis in "xyz" if f"beam_{axis}" not in dataset.variables]
    if lacking:
        raise ValueError(f"the record has no {lacking[0]}, the direction of its beams: it is neither a whole image of "
                         "a fan nor a whole line of soundings; give what mitsonar render or mitsonar soundings writes.")
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
    """A grey fan (0 to 1, NaN outside) in colours (rows, columns, 3), with outlines around masks of its samples."""
    inside = np.isfinite(grey)
    picture = np.where(inside[..., None], np.nan_to_num(grey)[..., None], to_rgb(canvas.PAPER))
    for mask, colour in marks:
        picture[canvas.outline(view.map.labels(mask)) & inside] = colour
    return picture


def check_ping(ping: int, pings: int) -> None:
    """Refuse a ping that there is not."""
    if not 0 <= ping < pings:
        raise ValueError(f"there is no ping {ping}; there are {pings}, the first is 0.")


def _way(vector, beside=None):
    """The name of the body's direction that is nearest to a vector, on another axis than ``beside``."""
    axis = np.argmax([abs(part) * (beside not in pair) for part, pair in zip(vector, WAYS)])
    return WAYS[axis][int(vector[axis] > 0)]


def _levels(beams, ping):
    """Rising angles [rad], slant ranges [m], levels (beam, sample) [dB]; where the fan looks, and what is right."""
    if set(beams.dims) != {"ping", "beam", "sample"} or beams.sizes["beam"] < 2:
        raise ValueError(f"a fan is drawn of two or more beams (ping, beam, sample); these are {dict(beams.sizes)}.")
    if "azimuth" not in beams.coords:
        raise ValueError("the beams have no azimuth, so they make no fan; give beamformers level directions.")
    check_ping(ping, beams.sizes["ping"])
    angle, facing, right = beams["azimuth"].values, "forward", "starboard"
    if "beam_z" in beams.coords and float(beams["beam_z"].mean()) > 0.5:
        aside = max("yx", key=lambda axis: float(np.ptp(beams[f"beam_{axis}"].values)))
        angle = np.arctan2(beams[f"beam_{aside}"].values, beams["beam_z"].values)
        facing, right = "down", {"x": "forward", "y": "starboard"}[aside]
    if np.ptp(angle) < 1e-6:
        raise ValueError(f"the beams have one azimuth, {np.degrees(angle[0]):.4g} degrees, so they make no fan seen "
                         "from above; give level directions, or such as look down.")
    pressure = np.abs(beams.isel(ping=ping).transpose("beam", "sample").values.astype(complex))
    order = np.argsort(angle, kind="stable")
    slant_range = 0.5 * beams.attrs["sound_speed"] * beams["time"].values
    return angle[order], slant_range, 20 * np.log10(np.maximum(pressure[order], 1e-10)), facing, right
