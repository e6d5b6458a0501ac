"""Sidescans and echograms as one picture of all pings, in metres, with a line at the ping of the time."""
from __future__ import annotations

import numpy as np
import xarray as xr

from mitsonar.imaging.gain import Tvg
from mitsonar.plots import canvas
from mitsonar.plots.images.grid import PlotGrid, make_grid, with_sides
from mitsonar.plots.images.levels import shown_levels

from . import layers
from .view_log import ViewLog

TICKS = 3                          # of range on a side


def log_waterfall(log: ViewLog, name: str, record: xr.Dataset, tvg: Tvg) -> None:
    """Log a record over (ping, side, range) or (ping, range)."""
    record = with_sides(record)
    grid, origin = make_grid(record), f"{name}/waterfall"
    level, limits, words, more_db = shown_levels(record, grid, tvg)
    log.shade(f"{origin}/{layers.LEVEL}", _upright(level, grid), limits, "inferno", still=True)
    parts = layers.layers_of(record)
    layers.log_names(log, origin, parts, record)
    for layer in parts:
        values = record[["level"]].assign(shown=layer.values.transpose(*record["level"].dims))
        draw = grid.largest if layer.numbers else grid.mean
        layers.log_layer(log, origin, layer, _upright(draw(values, lambda part: part["shown"].values), grid),
                         still=True)
    _log_ranges(log, origin, grid)
    time = record["ping_time"].values if "ping_time" in record.coords else np.arange(record.sizes["ping"], dtype=float)
    middle = 0.5 * (grid.along[1:] + grid.along[:-1])
    ends = np.array([grid.across[0], grid.across[-1]])
    for ping, at in enumerate(time):
        log.at(ping, float(at))
        log.marks(f"{origin}/ping", [_pixels(grid, np.full(2, middle[ping]), ends)], still=False,
                  colour=(90, 220, 255, 255))
    extra = "".join(f", {part} + {gain:g} dB" for part, gain in more_db.items())
    log.view(origin, f"{name}: level{words} [dB re 1 µPa]{extra}", layers.hidden(parts))


def _upright(picture: np.ndarray, grid: PlotGrid) -> np.ndarray:
    """Return a picture with the newest ping on top, or of an echogram on the right and the range downwards."""
    return picture.T if grid.down else picture[::-1]


def _pixels(grid: PlotGrid, along: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Return the pixels (P, 2), column and row, of places [m] of a picture."""
    row = (along - grid.along[0]) / (grid.along[-1] - grid.along[0]) * grid.height
    column = (across - grid.across[0]) / (grid.across[-1] - grid.across[0]) * grid.width
    return np.stack([row, column] if grid.down else [column, grid.height - row], -1)


def _log_ranges(log: ViewLog, origin: str, grid: PlotGrid) -> None:
    """Log lines of equal range with their ranges."""
    step = canvas.round_length(float(grid.across[-1]) / TICKS)
    ranges = np.arange(np.ceil(grid.across[0] / step) * step, grid.across[-1], step)
    ends = grid.along[[0, -1]]
    log.marks(f"{origin}/ranges", [_pixels(grid, ends, np.full(2, at)) for at in ranges],
              words=[f"{abs(at):g} m" for at in ranges])
