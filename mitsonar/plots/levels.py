"""The waterfall's picture elements: intensities averaged, then decibels, and the levels of black and white."""
import numpy as np

from ..units import db_from_power, power_from_db
from .gain import display_gain, display_window

__all__ = ["NOTHING_DB", "shown_levels"]

NOTHING_DB = -199.0  # at or below: the level of a bin with no echo and no noise


def shown_levels(dataset, grid, tvg):
    """Give a sidescan's levels with their gain for display.

    Parameters
    ----------
    dataset : xarray.Dataset
    grid : Grid
        Made for it.
    tvg : {'seabed', 'target', None}

    Returns
    -------
    image : array (grid.height, grid.width) [dB]
    limits : (float, float) [dB]
        Of black and white, from the elements that hold the seabed, if it is known where it is.
    words : str
        The gain's formula.
    """
    words = display_gain(dataset, tvg)[1]

    def intensity(part):
        level = part["level"].values.astype(float)
        return np.where(level > NOTHING_DB, power_from_db(level + display_gain(part, tvg)[0][:, None]), 0)

    image = db_from_power(grid.mean(dataset, intensity))
    shown = np.isfinite(image)
    if "mean_level" in dataset:
        shown &= grid.mean(dataset, lambda part: part["mean_level"].values > NOTHING_DB) > 0.5
    return image, display_window(image[shown] if shown.any() else image), words
