"""A fan of beams seen across its plane: what a forward-looking, sector or multibeam sonar puts on its screen.

A sample at time t of the beam at angle α lies r = c t / 2 from the array, r sin α aside and r cos α along the fan's
middle: to starboard and ahead for a level fan, whose α is the azimuth; to starboard and below for one that looks down.
"""
import os
from collections.abc import Iterable, Sequence

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.colors import to_rgb
from matplotlib.patheffects import withStroke
from matplotlib.typing import ColorType

from ..io.files import FilePath, check_writable
from . import canvas

__all__ = ["fan", "fan_picture", "looks_down"]

SIZE = 900                         # picture elements of the larger side of the fan
DARKEST, BRIGHTEST = 5.0, 99.7     # percentiles of the first and the last colour
WAYS = (("aft", "forward"), ("port", "starboard"), ("up", "down"))               # against and along the body's axes
TOWARDS = {"forward": "ahead", "aft": "astern", "starboard": "to starboard", "port": "to port", "down": "below",
           "up": "above"}


def fan(beams: xr.DataArray, path: FilePath, *, ping: int = 0, tvg: bool = True,
        limits: tuple[float, float] | None = None, title: str = "", subtitle: str = "") -> None:
    """Draw the levels of a fan of beams: from above where they are level, from the end where they look down.

    Parameters
    ----------
    beams : xarray.DataArray (ping, beam, sample)
        As beamformers give them [µPa]; with ``azimuth`` [rad] over the beams, rising or falling. Where ``beam_z`` says
        that they look down, the angles from below replace the azimuths.
    path : str or path
        A .png, .pdf or .svg to write.
    ping : int
        By position.
    tvg : bool
        Add 30 log r [dB], so that a level bed looks even over range.
    limits : pair of float, optional [dB]
        Levels of the first and the last colour; by default what the picture needs.
    title, subtitle : str

    Raises
    ------
    ValueError
        If there are fewer than two beams, or no azimuths or only one, or no such ping, or the file is of another
        kind.
    FileNotFoundError, PermissionError, OSError
        If the file cannot be written.
    """
    angle, slant_range, level, facing, right = _levels(beams, ping)
    _draw(angle, slant_range, level, path, tvg=tvg, limits=limits, title=title or "fan of beams", subtitle=subtitle,
          facing=facing, right=right)


def fan_picture(dataset: xr.Dataset, path: FilePath, *, ping: int = 0, tvg: bool = True, what: str = "",
                marks: Iterable[tuple[np.ndarray, ColorType]] = (), keys: Sequence[Artist] = ()) -> None:
    """Draw one ping of what `mitsonar.render` gives of an array: its `fan`, or the levels of a single beam over range.

    Parameters
    ----------
    dataset : xarray.Dataset
        ``level`` (ping, beam, range) [dB re 1 µPa].
    path, ping, tvg
        As of `fan`.
    what : str
        What is marked, for the title; empty: nothing is, and levels are in colour.
    marks : iterable of (bool array (beam, range), colour)
        Samples to be outlined on grey levels.
    keys : sequence of matplotlib artists
        Of the legend of what is marked.

    Raises
    ------
    ValueError
        If there is no such ping, something is to be marked in a single beam, or the file is of another kind.
    FileNotFoundError, PermissionError, OSError
        If the file cannot be written.
    """
    _check_ping(ping, dataset.sizes["ping"])
    if dataset.sizes["beam"] == 1:
        if what:
            raise ValueError(f"the {what} are outlined on a fan; this array has a single beam.")
        _draw_beam(dataset, path, ping)
        return
    direction = _directions(dataset)
    facing = _way(direction.mean(0))
    attrs = dataset.attrs
    words = f"ping {int(dataset['ping'][ping])}, {attrs['frequency'] / 1000:g} kHz, {dataset.sizes['beam']} beams"
    _draw(dataset["beam"].values, dataset["range"].values, dataset["level"].values[ping], path, tvg=tvg,
          facing=facing, right=_way(direction[-1] - direction[0], facing),
          title=os.path.splitext(attrs.get("file") or "array_sonar")[0] + f": {what}" * bool(what), subtitle=words,
          marks=marks if what else None, keys=keys)


def looks_down(dataset: xr.Dataset) -> bool:
    """Tell whether a dataset of beams is drawn from the end, ranges growing downwards."""
    return "beam_z" in dataset.coords and _way(_directions(dataset).mean(0)) == "down"


def _directions(dataset):
    """Of the beams (B, 3), body frame."""
    return np.stack([dataset[f"beam_{axis}"].values for axis in "xyz"], axis=-1)


def _draw_beam(dataset, path, ping):
    canvas.file_format(path)
    check_writable(path)
    figure = canvas.sheet(1100, 500)
    axes = figure.subplots()
    axes.plot(dataset["range"].values, dataset["level"].values[ping, 0], color="#1f4e79", linewidth=0.8)
    axes.set_xlabel("slant range [m]", fontsize=11)
    axes.set_ylabel("level [dB re 1 µPa]", fontsize=11)
    axes.grid(alpha=0.25)
    axes.set_title(f"{os.path.splitext(dataset.attrs.get('file') or 'array_sonar')[0]}, "
                   f"ping {int(dataset['ping'][ping])}, one beam", fontsize=13)
    figure.tight_layout()
    canvas.save(figure, path)


def _draw(angle, slant_range, level, path, *, tvg, limits=None, title, subtitle, facing, right, marks=None, keys=()):
    canvas.file_format(path)
    check_writable(path)
    if tvg:
        level = level + 30 * np.log10(np.maximum(slant_range, 1e-3))[None]
    edges, image = _from_above(angle, slant_range, level)
    shown = image[np.isfinite(image)]
    low, high = limits or (np.percentile(shown, DARKEST), np.percentile(shown, BRIGHTEST))
    height, width = image.shape
    before, behind, under, over = 84, 128, 62, 86
    if keys:
        behind = 60 + canvas.legend(canvas.sheet(1, 1).add_subplot(), keys, height).get_window_extent().width
    figure = canvas.sheet(before + width + behind, under + height + over, canvas.PAPER)
    axes = figure.add_axes(canvas.shares_of(figure, before, under, width, height), facecolor=canvas.PAPER)
    if marks is not None:
        image = _marked(angle, slant_range, np.clip((image - low) / max(high - low, 1e-6), 0, 1), marks)
    drawn = axes.imshow(image, origin="lower", extent=edges, cmap=canvas.COPPER, vmin=low, vmax=high,
                        interpolation="nearest")
    if facing == "down":
        axes.invert_yaxis()
    _rings(axes, angle, slant_range)
    left = next(way for pair in WAYS if right in pair for way in pair if way != right)
    axes.set_xlabel(f"{left}        ←        [m]        →        {right}", color=canvas.INK, fontsize=11)
    axes.set_ylabel(f"{TOWARDS[facing]} [m]", color=canvas.INK, fontsize=11)
    axes.tick_params(colors=canvas.INK, labelsize=10)
    for spine in axes.spines.values():
        spine.set_visible(False)
    canvas.headings(figure, before, title, subtitle)
    if keys:
        canvas.legend(axes, keys, height).set_bbox_to_anchor((1 + 30 / width, 1.0))       # beside the rings' lengths
    if marks is not None:
        canvas.save(figure, path)
        return
    canvas.colour_bar(drawn, axes, "level [dB re 1 µPa]" + (" + 30 log R" if tvg else ""), "both")
    canvas.save(figure, path)


def _marked(angle, slant_range, grey, marks):
    """A grey fan (0 to 1, NaN outside) in colours (height, width, 3), with outlines around masks of its samples."""
    inside = np.isfinite(grey)
    picture = np.where(inside[..., None], np.nan_to_num(grey)[..., None], to_rgb(canvas.PAPER))
    for mask, colour in marks:
        marked = np.nan_to_num(_from_above(angle, slant_range, mask.astype(float))[1]) > 0
        picture[canvas.outline(marked) & inside] = colour
    return picture


def _check_ping(ping, pings):
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
    _check_ping(ping, beams.sizes["ping"])
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


def _from_above(azimuth, slant_range, level) -> tuple[tuple[float, float, float, float], np.ndarray]:
    """Edges (left, right, bottom, top) [m] and picture of the fan; NaN outside it."""
    rim = np.stack([np.sin(azimuth), np.cos(azimuth)])
    reach = np.concatenate([rim * slant_range[0], rim * slant_range[-1]], axis=1)
    (left, bottom), (right, top) = reach.min(1), reach.max(1)
    step = max(right - left, top - bottom) / SIZE
    x = np.arange(left + 0.5 * step, right, step)
    y = np.arange(bottom + 0.5 * step, top, step)
    away, towards = np.hypot(x, y[:, None]), np.arctan2(x + 0 * y[:, None], y[:, None] + 0 * x)
    beam = np.interp(towards, azimuth, np.arange(azimuth.size), left=np.nan, right=np.nan)
    sample = np.interp(away, slant_range, np.arange(slant_range.size), left=np.nan, right=np.nan)
    inside = np.isfinite(beam) & np.isfinite(sample)
    image = np.full(away.shape, np.nan)
    image[inside] = level[np.rint(beam[inside]).astype(int), np.rint(sample[inside]).astype(int)]
    return (left, right, bottom, top), image


def _rings(axes, azimuth, slant_range):
    """Mark a few ranges along the fan's rim."""
    step = canvas.round_length(np.ptp(slant_range) / 3)
    angle = np.linspace(azimuth[0], azimuth[-1], 200)
    for ring in np.arange(np.ceil(slant_range[0] / step) * step, slant_range[-1], step):
        axes.plot(ring * np.sin(angle), ring * np.cos(angle), color=canvas.INK, linewidth=0.5, alpha=0.35)
        axes.text(ring * np.sin(angle[-1]), ring * np.cos(angle[-1]), f" {ring:g} m", color=canvas.INK, fontsize=9,
                  va="top", path_effects=[withStroke(linewidth=2, foreground=canvas.PAPER)])
