"""Time-varied gain for display: what a sonar adds so that an even seabed looks even. The data are never changed.

    target   40 log R + 2 a R                         two-way spherical spreading and absorption
    seabed   30 log R + 2 a R - 20 log sin(grazing)   the ensonified area grows with R; Lambert's law falls with sin²

R -> ``range`` [m], a -> ``absorption_db`` [dB/m]; sin(grazing) = altitude / R, the bed taken as level, where the
altitude is known. The pattern of the beam is not divided out. Of a fan the gain is held from where noise hides the bed,
as instruments hold it (`heard_to`).
"""
from typing import Literal

import numpy as np
import xarray as xr
from scipy import ndimage

Tvg = Literal["seabed", "target"] | None      # which gain a picture has
STRETCH = 0.05  # of a record: over which levels are smoothed where noise is looked for
NEAR_NOISE_DB = 3.0
LOWEST_SINE = np.sin(np.deg2rad(1.0))  # below 1 degree there is no echo to restore, only noise to raise


def display_gain(dataset: xr.Dataset, tvg: Tvg) -> tuple[np.ndarray, str]:
    """Give the gain to add to the levels of a picture, and its formula in words.

    Parameters
    ----------
    dataset : xarray.Dataset
        With the coordinate range and, where known, altitude(ping) and the attribute absorption_db.
    tvg : {'seabed', 'target', None}

    Returns
    -------
    gain : array (P or 1, N) [dB]
    words : str
        To be put after 'level'; empty without gain.

    Raises
    ------
    ValueError
        If ``tvg`` is none of these.
    """
    slant_range = np.maximum(np.asarray(dataset["range"].values, float), 1e-3)[None]
    absorption = 2 * float(dataset.attrs.get("absorption_db") or 0) * slant_range
    if tvg is None:
        return np.zeros_like(slant_range), ""
    if tvg == "target":
        return 40 * np.log10(slant_range) + absorption, " + 40 log R + 2αR"
    if tvg != "seabed":
        raise ValueError(f"the display gain is {tvg!r}; use 'seabed', 'target' or None.")
    gain = 30 * np.log10(slant_range) + absorption
    if "altitude" not in dataset.coords:
        return gain, " + 30 log R + 2αR"
    altitude = np.asarray(dataset["altitude"].values, float).reshape(-1, 1)
    sine = np.clip(np.where(np.isfinite(altitude), altitude, np.inf) / slant_range, LOWEST_SINE, 1)
    return gain - 20 * np.log10(sine), " + 30 log R + 2αR − 20 log sin θ"


def heard_to(level: np.ndarray, gain: np.ndarray) -> int:
    """Find where noise hides the bed: where levels no longer fall although the gain of an even bed goes on rising.

    Parameters
    ----------
    level : array (B, N) [dB]
        Without gain.
    gain : array (N,) [dB]

    Returns
    -------
    int
        The first of the bins, in which medians over the beams have come down to within 3 dB of those of the last bins
        for good; N where the bed is heard to the end, or never.
    """
    bins = level.shape[-1]
    stretch = max(round(STRETCH * bins), 1)
    middle = ndimage.uniform_filter1d(np.median(level, axis=0), stretch, mode="nearest")
    above = np.flatnonzero(middle > np.median(middle[-stretch:]) + NEAR_NOISE_DB)
    first = int(above[-1]) + 1 if above.size else bins
    return first if first < bins and gain[-1] - gain[first] > 2 * NEAR_NOISE_DB else bins


def display_window(values: np.ndarray) -> tuple[float, float]:
    """Give the levels of black and white of a picture.

    Parameters
    ----------
    values : float array [dB]
        Levels with their gain where there is a seabed to be shown; NaN is left out.

    Returns
    -------
    (float, float) [dB]
    """
    values = values[np.isfinite(values)]
    if not values.size:
        return 0.0, 1.0
    # Speckle spreads an even bed over some 25 dB. Steep beams, shadows and targets must not widen that much, else the
    # bed loses its contrast; in a smooth record it may shrink.
    low, middle, high = np.percentile(values, [2, 50, 99.8])
    low = np.clip(low, middle - 16, middle - 6)
    return float(low), float(np.clip(high, middle + 0.75 * (middle - low), middle + 16))
