"""Fans of beams and turns of a rotating head as frames in metres, one a ping or a turn."""
from __future__ import annotations

import numpy as np
import xarray as xr

from mitsonar.imaging.gain import Tvg, display_gain
from mitsonar.imaging.maps.raster import LEVELS, bearings, sweeps
from mitsonar.imaging.maps.raster_map import FanGrid, reach
from mitsonar.plots.canvas import round_length
from mitsonar.plots.fans.fans import fan_window
from mitsonar.plots.images.gain import heard_to

from . import layers
from .view_log import ViewLog

SIDE = 640                         # most elements along a side of a frame
RINGS = 3


def log_fan(log: ViewLog, name: str, record: xr.Dataset, tvg: Tvg, cell: float | None) -> None:
    """Log the frames of a record over (ping, beam, range), or of a rotating head."""
    record = record.transpose("shape", "ping", "beam", "range", ..., missing_dims="ignore")
    angle, _ = bearings(record)
    slant_range = np.asarray(record["range"].values, float)
    left, right, near, far = reach(angle, slant_range)
    frames = sweeps(record, cell or max(float(np.diff(slant_range).mean()), max(right - left, far - near) / SIDE))
    heard, words = _heard(record.isel(ping=frames[0].pings), tvg)
    # frames of which the window is taken: the darkest and brightest levels hold for all
    some = sorted({0, len(frames) // 2, len(frames) - 1})
    limits = fan_window(np.stack([_level(record, frames[number], tvg, heard) for number in some]))
    origin, parts = f"{name}/fan", layers.layers_of(record)
    layers.log_names(log, origin, parts, record)
    _log_rings(log, origin, frames[0].grid, angle, slant_range)
    time = record["ping_time"].values if "ping_time" in record.coords else np.arange(record.sizes["ping"], dtype=float)
    for number, frame in enumerate(frames):
        log.at(number, float(time[frame.pings.start]))
        log.shade(f"{origin}/{layers.LEVEL}", _level(record, frame, tvg, heard), limits, "inferno")
        for layer in parts:
            part = layer.values.isel(ping=frame.pings).values
            part = part[0] if part.ndim == 3 else part
            draw = frame.map.levels if layer.name in LEVELS else frame.map.labels
            layers.log_layer(log, origin, layer, draw(part))
    log.view(origin, f"{name}: level{words} [dB re 1 µPa]", layers.hidden(parts))


def _gained(frame: xr.Dataset, tvg: Tvg) -> tuple[np.ndarray, np.ndarray, str]:
    """Return levels (beam or step, range) of a frame, their gain of as many or one row [dB], and its formula."""
    level = frame["level"].values
    gain, words = display_gain(frame, tvg)
    return (level[0] if level.ndim == 3 else level), gain, words


def _heard(frame: xr.Dataset, tvg: Tvg) -> tuple[int, str]:
    """Return the bin from which the gain is constant, and the gain's formula."""
    level, gain, words = _gained(frame, tvg)
    return heard_to(level, gain[0]), words


def _level(record, frame, tvg, heard) -> np.ndarray:
    """Return the levels of a frame as drawn, with their gain."""
    level, gain, _ = _gained(record.isel(ping=frame.pings), tvg)
    flat = np.minimum(np.arange(gain.shape[-1]), min(heard, gain.shape[-1] - 1))
    return frame.map.levels(level + gain[:, flat])


def _log_rings(log: ViewLog, origin: str, grid: FanGrid, angle: np.ndarray, slant_range: np.ndarray) -> None:
    """Log arcs of equal range with their ranges."""
    step = round_length(float(np.ptp(slant_range)) / RINGS)
    rings = np.arange(np.ceil(slant_range[0] / step) * step, slant_range[-1], step)
    around = np.linspace(angle.min(), angle.max(), 100)
    rows = np.sign(grid.y[-1] - grid.y[0])
    strips = [np.stack([(ring * np.sin(around) - grid.x[0]) / grid.cell + 0.5,
                        rows * (ring * np.cos(around) - grid.y[0]) / grid.cell + 0.5], -1) for ring in rings]
    log.marks(f"{origin}/ranges", strips, words=[f"{ring:g} m" for ring in rings])
