"""Focused images as one picture a bank, a pixel a point, with the layers of their truth."""
from __future__ import annotations

import numpy as np
import xarray as xr

from mitsonar.imaging.focused import BANK, GROUND
from mitsonar.plots.images.focused import BRIGHTEST, LEAST_DB, MOST_DB, RANGE_DB
from mitsonar.units import db_from_power, power_from_db

from . import layers
from .view_log import ViewLog

MOST = 4096                        # pixels of a side; of more points, those of a block are averaged, or one is taken


def log_focused(log: ViewLog, name: str, image: xr.Dataset) -> None:
    """Log a focused image."""
    image = image.transpose("shape", BANK, *GROUND, ..., missing_dims="ignore")
    step = -(-max(image.sizes[dim] for dim in GROUND) // MOST)
    parts, origin = layers.layers_of(image), f"{name}/focused"
    layers.log_names(log, origin, parts, image)
    banks = image["level"].values.astype(float)
    banks = banks if banks.ndim == 3 else banks[None]
    names = [layers.LEVEL if number == 0 else f"{layers.LEVEL}_{number}" for number in range(len(banks))]
    for entity, level in zip(names, banks):
        level = _averaged(level, step)
        known = level[np.isfinite(level)]
        middle, bright = np.percentile(known, [50, BRIGHTEST]) if known.size else (0.0, 0.0)
        high = float(np.clip(bright, middle + LEAST_DB, middle + MOST_DB))
        log.shade(f"{origin}/{entity}", level[::-1], (high - RANGE_DB, high), "inferno", still=True)
    for layer in parts:
        layers.log_layer(log, origin, layer, layer.values.transpose(*GROUND).values[::-step, ::step], still=True)
    log.view(origin, f"{name}: level [dB re 1 m²], along track upwards", [*names[1:], *layers.hidden(parts)])


def _averaged(level: np.ndarray, step: int) -> np.ndarray:
    """Return the mean level [dB] of blocks of points."""
    if step == 1:
        return level
    rows, columns = (size // step for size in level.shape)
    power = power_from_db(level[:rows * step, :columns * step]).reshape(rows, step, columns, step)
    return db_from_power(power.mean((1, 3)))
