"""The water column drawn on axes: a ping's fan with its soundings, and the curtain along the track."""
from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import Colormap

from mitsonar.hydrography.record import BY_AMPLITUDE
from mitsonar.hydrography.reduction.ray_paths import head_of, launches, receiving_axes
from mitsonar.imaging.gain import Tvg

from .. import canvas
from .line_sheet import LABEL_SIZE, bar_beside, curve_axes, key_above
from .water_column import column_window, curtain, fan_of_ping

PHASE, AMPLITUDE = "#56b4e9", "#cc79a7"      # visible on the white sheet and on the dark column


def draw_column(axes: Axes, line: xr.Dataset, ping: int, *, bend: bool = True, tvg: Tvg = "recorder",
                colours: Colormap = canvas.COPPER) -> float:
    """Draw the fan of a ping with its soundings; return its width over its height."""
    fan = fan_of_ping(line, ping, bend=bend, tvg=tvg)
    low, high = column_window(fan.image)
    axes.set_facecolor(canvas.PAPER)
    drawn = axes.imshow(fan.image, origin="upper", extent=fan.extent, cmap=colours, vmin=low, vmax=high,
                        interpolation="nearest", aspect="equal")
    _draw_soundings(axes, line, ping, bend)
    axes.set(xlim=fan.extent[:2], ylim=fan.extent[2:])
    curve_axes(axes, "port   ←   across track [m]   →   starboard", "depth [m]")
    axes.grid(False)
    bar_beside(axes, drawn, f"level{fan.gain}  [dB]", extend="both")
    key_above(axes, markers=3)
    return (fan.extent[1] - fan.extent[0]) / (fan.extent[2] - fan.extent[3])


def _draw_soundings(axes: Axes, line: xr.Dataset, ping: int, bend: bool) -> None:
    across, depth, there, amplitude = soundings_of(line, ping, bend)
    by = (", by phase", ", by amplitude") if "detection" in line else ("", "")
    for where, colour, marker, words in ((there & ~amplitude, PHASE, ".", by[0]),
                                         (there & amplitude, AMPLITUDE, "^", by[1])):
        if where.any():
            axes.plot(across[where], depth[where], marker, color=colour, markersize=2.2, markeredgewidth=0,
                      label=f"soundings{words}")


def soundings_of(line: xr.Dataset, ping: int, bend: bool = True) -> tuple[np.ndarray, ...]:
    """Return the places of a ping's soundings on its fan, and which are valid and detected by amplitude."""
    # -> across, depth [m], valid, amplitude, each (beam,)
    record = line.isel(ping=ping)
    across, depth = (record[name].values.astype(float) for name in ("across_track", "depth"))
    if not bend:
        head = head_of(line, ping)
        time = record["travel_time"].values
        away = 0.5 * head.sound_speed * time[:, None] * launches(
            head, record["angle"].values, record["transmit_angle"].values, receiving_axes(line, ping, head, time))
        across, depth = head.across + away[:, 1], head.depth + away[:, 2]
    there = record["valid"].values.astype(bool) & np.isfinite(across) & np.isfinite(depth)
    amplitude = record["detection"].values == BY_AMPLITUDE if "detection" in record else np.zeros(there.shape, bool)
    return across, depth, there, amplitude


def draw_curtain(panels: Sequence[Axes], line: xr.Dataset, *, tvg: Tvg = "recorder",
                 colours: Colormap = canvas.COPPER) -> None:
    """Draw the level of the beam nearest to the vertical and the largest level of all beams over the pings."""
    pings = curtain(line, tvg)
    pictures = {"the beam nearest to the vertical": pings.nadir, "the largest of all beams": pings.largest}
    low, high = column_window(*pictures.values())
    middle = 0.5 * (pings.edges[1:] + pings.edges[:-1])
    for axes, (words, image) in zip(panels, list(pictures.items())[-len(panels):], strict=True):
        axes.set_facecolor(canvas.PAPER)
        drawn = axes.pcolorfast(pings.edges, pings.slant_range, image, cmap=colours, vmin=low, vmax=high)
        axes.plot(middle, pings.bottom, color=PHASE, linewidth=0.9, marker="." if middle.size < 60 else None,
                  label="sounding nearest to the vertical")
        axes.set(xlim=pings.edges[[0, -1]], ylim=pings.slant_range[[-1, 0]])
        axes.set_title(words, loc="left", fontsize=LABEL_SIZE)
        curve_axes(axes, "", "slant range [m]")
        axes.grid(False)
        bar_beside(axes, drawn, f"level{pings.gain}\n[dB]", extend="both")
    if len(panels) > 1:
        panels[0].legend(fontsize=9.5, loc="lower right", bbox_to_anchor=(1.0, 1.0), frameon=False, borderaxespad=0.2)
    panels[-1].set_xlabel("time [s]" if pings.timed else "ping", fontsize=LABEL_SIZE)
