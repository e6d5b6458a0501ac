"""Pixels of a waterfall: mean intensities in decibels, gains of the water column and of the strip below the sonar.

Echoes of the sea surface and of the water are some 40 dB weaker than the bed's. If they would be dark, everything
before the bed's first return is raised by a gain of its own, in steps of 5 dB. This gain is left out if a record does
not hold the place of the bed or the levels without noise, and with the gain ``recorder``, as on recorders.

Arrays of a sidescan look to the side. Just below the sonar their lobes leave the bed some 10 dB weaker than farther
out, behind a first return that is the strongest echo of all. With the gain ``recorder`` this strip would be black. Up
to twice the altitude, medians over the record are therefore raised to the middle of the window, in steps of range that
are wider than the first return.
"""
import numpy as np
import xarray as xr
from scipy import ndimage

from mitsonar.imaging.gain import Tvg, display_gain
from mitsonar.units import HARDLY_DB, db_from_power, power_from_db

from .gain import display_window
from .grid import PlotGrid

ABOVE_NOISE_DB = 6.0                 # least mean echo in the water column above the noise
STEP_DB, MOST_DB = 5.0, 100.0        # step and largest value of the water column's gain
WHOLLY = 0.999                       # share of the water in a pixel of the water column; other pixels count as bed
STEPS, MOST_STEEP_DB = 10, 15.0      # steps of the strip below the sonar, each 7 % of its range, and the largest gain
DARK, BRIGHT = 0.5, 0.8              # shares from black to white: echoes below the first are raised to the second


def shown_levels(dataset: xr.Dataset, grid: PlotGrid, tvg: Tvg
                 ) -> tuple[np.ndarray, tuple[float, float], str, dict[str, float]]:
    """Return a sidescan's levels with gain, the levels of black and white, the gain's formula, and extra gains [dB]."""
    words = display_gain(dataset, tvg)[1]

    def intensity(part: xr.Dataset) -> np.ndarray:
        level = part["level"].values.astype(float)
        return np.where(level > HARDLY_DB, power_from_db(level + display_gain(part, tvg)[0][:, None]), 0)

    image = db_from_power(grid.mean(dataset, intensity))
    shown = np.isfinite(image)
    column = np.zeros_like(shown)
    if "mean_level" in dataset:
        shown &= grid.mean(dataset, lambda part: part["mean_level"].values > HARDLY_DB) > 0.5
    if "seabed_depth" in dataset:
        # a pixel beside the bed holds side lobes of the first return
        water = grid.mean(dataset, in_the_water) > WHOLLY
        column = np.asarray(ndimage.binary_erosion(water, np.ones((1, 3))), bool)
    bed = shown & ~column
    limits = display_window(image[bed if bed.any() else shown if shown.any() else ...])
    raised = tvg != "recorder" and "mean_level" in dataset and column.any() and bed.any()
    more_db = {"water column": _column_gain(dataset, grid, image, column, limits) if raised else 0.0}
    image[column] += more_db["water column"]
    if tvg == "recorder" and "altitude" in dataset.coords and not grid.down:
        gain = _steep_gain(image, bed, np.nan_to_num(grid.mean(dataset, _steepness)), limits)
        image += gain
        more_db["bed below the sonar up to"] = float(np.round(gain.max(initial=0.0)))
        limits = display_window(image[bed if bed.any() else ...])
    return image, limits, words, {name: gain for name, gain in more_db.items() if gain}


def _steep_gain(image, bed, steep, limits):
    """Return the gain [dB] that raises the bed's strip below the sonar to the middle of the window."""
    gains = np.zeros(STEPS)
    number = np.minimum((steep * STEPS).astype(int), STEPS - 1)
    for step in range(STEPS):
        pixels = bed & (steep > 0) & (steep < 1) & (number == step)
        if pixels.any():
            gains[step] = np.clip(0.5 * sum(limits) - np.median(image[pixels]), 0, MOST_STEEP_DB)
    return np.interp(steep, [0, *(np.arange(STEPS) + 0.5) / STEPS], [0, *gains])


def _steepness(part):
    """Return 1 at ranges up to the altitude, 0 beyond twice the altitude, and values by log range between them."""
    altitude = np.nan_to_num(np.asarray(part["altitude"].values, float))[:, None]
    slant_range = np.maximum(np.asarray(part["range"].values, float), 1e-3)
    steep = np.clip(np.log2(np.maximum(2 * altitude, 1e-6) / slant_range), 0, 1)
    return np.broadcast_to(steep[:, None], part["level"].shape)


def in_the_water(part: xr.Dataset) -> np.ndarray:
    """Return a mask of the bins before the first return of the bed, per ping and side."""
    return ~np.logical_or.accumulate(np.isfinite(part["seabed_depth"].values), axis=-1)


def _column_gain(dataset, grid, image, column, limits):
    """Return the gain [dB] that makes the strongest echoes of the water column bright."""
    noise = dataset.attrs.get("noise_db")
    faintest = HARDLY_DB if noise is None else noise + ABOVE_NOISE_DB
    known = grid.mean(dataset, lambda part: part["mean_level"].values > faintest) > 0.5
    echoes = image[column & known & np.isfinite(image)]
    if not echoes.size:
        return 0.0
    (low, high), strongest = limits, np.percentile(echoes, 99)
    if strongest > low + DARK * (high - low):
        return 0.0
    gain = STEP_DB * np.floor((low + BRIGHT * (high - low) - strongest) / STEP_DB)
    return float(gain) if gain <= MOST_DB else 0.0
