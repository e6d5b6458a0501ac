"""The waterfall's picture elements: intensities averaged, then decibels, and the levels of black and white.

The sea surface, and what the water itself sends back, are some 40 dB weaker than the bed. What comes before the bed's
first return is therefore raised by a gain of its own, in steps of 5 dB, where an echo there would else be
dark. Records that do not say where the bed is seen, or what is noise, are shown without, and so is all that has the
gain of recorders, which do not raise it either.

Faces look aside: below the sonar their lobes leave the bed some 10 dB weaker than it is abreast, behind a first return
that is the strongest of any. With the gain of recorders that strip would be black. Up to twice the altitude, medians
over the record are raised to the middle of the window, in steps of range that are wider than the first return is.
"""
import numpy as np
import xarray as xr
from scipy import ndimage

from mitsonar.imaging.gain import Tvg, display_gain
from mitsonar.units import HARDLY_DB, db_from_power, power_from_db

from .gain import display_window
from .grid import PlotGrid

ABOVE_NOISE_DB = 6.0  # above the noise: of a mean echo in the water column
STEP_DB, MOST_DB = 5.0, 100.0  # of the water column's gain
WHOLLY = 0.999  # of an element: one that the bed has a part in is the bed's
STEPS, MOST_STEEP_DB = 10, 15.0  # of the bed's strip below the sonar, each 7 % of its range; gain there at most
DARK, BRIGHT = 0.5, 0.8  # shares of the way from black to white: raised from below the first to the second


def shown_levels(dataset: xr.Dataset, grid: PlotGrid, tvg: Tvg
                 ) -> tuple[np.ndarray, tuple[float, float], str, dict[str, float]]:
    """Return a sidescan's levels with their gain for display."""
    # -> image [dB], limits [dB], more_db [dB]
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
        # one beside the bed's holds the skirts of its first return
        water = grid.mean(dataset, in_the_water) > WHOLLY
        column = np.asarray(ndimage.binary_erosion(water, np.ones((1, 3))), bool)
    bed = shown & ~column
    limits = display_window(image[bed if bed.any() else shown if shown.any() else ...])
    raised = tvg != "recorder" and "mean_level" in dataset and column.any() and bed.any()
    more_db = {"water column": _column_gain(dataset, grid, image, column, limits) if raised else 0.0}
    image[column] += more_db["water column"]
    if tvg == "recorder" and "altitude" in dataset.coords:
        gain = _steep_gain(image, bed, np.nan_to_num(grid.mean(dataset, _steepness)), limits)
        image += gain
        more_db["bed below the sonar up to"] = float(np.round(gain.max(initial=0.0)))
        limits = display_window(image[bed if bed.any() else ...])
    return image, limits, words, {name: gain for name, gain in more_db.items() if gain}


def _steep_gain(image, bed, steep, limits):
    """Return what raises the bed's strip below the sonar to the middle of the window, [dB]."""
    lacks = np.zeros(STEPS)
    number = np.minimum((steep * STEPS).astype(int), STEPS - 1)
    for step in range(STEPS):
        mine = bed & (steep > 0) & (steep < 1) & (number == step)
        if mine.any():
            lacks[step] = np.clip(0.5 * sum(limits) - np.median(image[mine]), 0, MOST_STEEP_DB)
    return np.interp(steep, [0, *(np.arange(STEPS) + 0.5) / STEPS], [0, *lacks])


def _steepness(part):
    """Return 1 up to the altitude, 0 from twice that on, and the logarithm of the range between, per ping and side."""
    altitude = np.nan_to_num(np.asarray(part["altitude"].values, float))[:, None]
    slant_range = np.maximum(np.asarray(part["range"].values, float), 1e-3)
    steep = np.clip(np.log2(np.maximum(2 * altitude, 1e-6) / slant_range), 0, 1)
    return np.broadcast_to(steep[:, None], part["level"].shape)


def in_the_water(part: xr.Dataset) -> np.ndarray:
    """Return where the bed has not been seen yet, per ping and side."""
    return ~np.logical_or.accumulate(np.isfinite(part["seabed_depth"].values), axis=-1)


def _column_gain(dataset, grid, image, column, limits):
    """Return the gain that makes the strongest echoes of the water column bright [dB]."""
    noise = dataset.attrs.get("noise_db")
    faintest = HARDLY_DB if noise is None else noise + ABOVE_NOISE_DB
    audible = grid.mean(dataset, lambda part: part["mean_level"].values > faintest) > 0.5
    echoes = image[column & audible & np.isfinite(image)]
    if not echoes.size:
        return 0.0
    (low, high), strongest = limits, np.percentile(echoes, 99)
    if strongest > low + DARK * (high - low):
        return 0.0
    gain = STEP_DB * np.floor((low + BRIGHT * (high - low) - strongest) / STEP_DB)
    return float(gain) if gain <= MOST_DB else 0.0
