"""A fan of beams seen from above: what a forward-looking or sector sonar puts on its screen.

A sample at time t of the beam at azimuth α lies r = c t / 2 from the array, r sin α to starboard and r cos α ahead.
"""
import os

import numpy as np
from matplotlib.patheffects import withStroke

from ..io.files import check_writable
from . import canvas

__all__ = ["fan", "fan_picture"]

SIZE = 900                         # picture elements of the larger side of the fan
DARKEST, BRIGHTEST = 5.0, 99.7     # percentiles of the first and the last colour


def fan(beams, path, *, ping=0, tvg=True, limits=None, title="", subtitle=""):
    """Draw the levels of a fan of level beams from above.

    Parameters
    ----------
    beams : xarray.DataArray (ping, beam, sample)
        As beamformers give them [µPa]; with ``azimuth`` [rad] over the beams, rising or falling.
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
        If there are fewer than two beams, or no azimuths or no such ping, or the file is of another kind.
    FileNotFoundError, PermissionError, OSError
        If the file cannot be written.
    """
    azimuth, slant_range, level = _levels(beams, ping)
    _draw(azimuth, slant_range, level, path, tvg=tvg, limits=limits, title=title or "fan of beams", subtitle=subtitle)


def fan_picture(dataset, path, *, ping=0, tvg=True):
    """Draw one ping of what `mitsonar.render` gives of an array: see `fan`.

    Parameters
    ----------
    dataset : xarray.Dataset
        ``level`` (ping, beam, range) [dB re 1 µPa].
    path, ping, tvg
        As of `fan`.

    Raises
    ------
    ValueError
        If there are fewer than two beams or no such ping, or the file is of another kind.
    FileNotFoundError, PermissionError, OSError
        If the file cannot be written.
    """
    if dataset.sizes["beam"] < 2:
        raise ValueError("a fan is drawn of two or more beams; this sonar has one.")
    _check_ping(ping, dataset.sizes["ping"])
    down = float(dataset["beam_z"].mean()) > 0.5 if "beam_z" in dataset.coords else False
    attrs = dataset.attrs
    words = f"ping {int(dataset['ping'][ping])}, {attrs['frequency'] / 1000:g} kHz, {dataset.sizes['beam']} beams"
    _draw(dataset["beam"].values, dataset["range"].values, dataset["level"].values[ping], path, tvg=tvg, down=down,
          title=os.path.splitext(attrs.get("file") or "array_sonar")[0], subtitle=words)


def _draw(angle, slant_range, level, path, *, tvg, limits=None, title, subtitle, down=False):
    canvas.file_format(path)
    check_writable(path)
    if tvg:
        level = level + 30 * np.log10(np.maximum(slant_range, 1e-3))[None]
    edges, image = _from_above(angle, slant_range, level)
    shown = image[np.isfinite(image)]
    low, high = limits or (np.percentile(shown, DARKEST), np.percentile(shown, BRIGHTEST))
    height, width = image.shape
    left, right, bottom, top = 84, 128, 62, 86
    figure = canvas.sheet(left + width + right, bottom + height + top, canvas.PAPER)
    box = np.array([left, bottom, width, height]) / np.tile(figure.get_size_inches() * canvas.DPI, 2)
    axes = figure.add_axes(box, facecolor=canvas.PAPER)
    drawn = axes.imshow(image, origin="lower", extent=edges, cmap=canvas.COPPER, vmin=low, vmax=high,
                        interpolation="nearest")
    if down:
        axes.invert_yaxis()
    _rings(axes, angle, slant_range)
    axes.set_xlabel("port        ←        [m]        →        starboard", color=canvas.INK, fontsize=11)
    axes.set_ylabel("below [m]" if down else "ahead [m]", color=canvas.INK, fontsize=11)
    axes.tick_params(colors=canvas.INK, labelsize=10)
    for spine in axes.spines.values():
        spine.set_visible(False)
    figure.text(box[0], 1 - 30 / figure.bbox.height, title, color=canvas.INK, fontsize=14, fontweight="bold",
                va="center")
    figure.text(box[0], 1 - 54 / figure.bbox.height, subtitle, color=canvas.INK, fontsize=10.5, va="center")
    room = figure.add_axes([box[0] + box[2] + 18 / figure.bbox.width, box[1], 16 / figure.bbox.width, box[3]])
    key = figure.colorbar(drawn, cax=room, extend="both", extendfrac=0.02)
    key.set_label("level [dB re 1 µPa]" + (" + 30 log R" if tvg else ""), color=canvas.INK, fontsize=10.5)
    room.tick_params(colors=canvas.INK, labelsize=10)
    canvas.save(figure, path)


def _check_ping(ping, pings):
    if not 0 <= ping < pings:
        raise ValueError(f"there is no ping {ping}; there are {pings}, the first is 0.")


def _levels(beams, ping):
    """Rising azimuths [rad], slant ranges [m] and levels (beam, sample) [dB]."""
    if set(beams.dims) != {"ping", "beam", "sample"} or beams.sizes["beam"] < 2:
        raise ValueError(f"a fan is drawn of two or more beams (ping, beam, sample); these are {dict(beams.sizes)}.")
    if "azimuth" not in beams.coords:
        raise ValueError("the beams have no azimuth, so they make no fan; give beamformers level directions.")
    _check_ping(ping, beams.sizes["ping"])
    pressure = np.abs(beams.isel(ping=ping).transpose("beam", "sample").values.astype(complex))
    order = np.argsort(beams["azimuth"].values, kind="stable")
    slant_range = 0.5 * beams.attrs["sound_speed"] * beams["time"].values
    return beams["azimuth"].values[order], slant_range, 20 * np.log10(np.maximum(pressure[order], 1e-10))


def _from_above(azimuth, slant_range, level):
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
