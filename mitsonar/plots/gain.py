"""Time-varied gain for display: what a sonar adds so that an even seabed looks even. The data are never changed.

    target   40 log R + 2 a R                         two-way spherical spreading and absorption
    seabed   30 log R + 2 a R - 20 log sin(grazing)   the ensonified area grows with R; Lambert's law falls with sin²

R -> ``range`` [m], a -> ``absorption_db`` [dB/m]; sin(grazing) = altitude / R, the bed taken as level, where the
altitude is known. The pattern of the beam is not divided out.
"""
from typing import Literal

import numpy as np
import xarray as xr

Tvg = Literal["seabed", "target"] | None      # which gain a picture has
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
