"""A sonar's image as intensities that a scene's model can be fitted to."""
from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from ..units import power_from_db

__all__ = ["image_intensities"]

RANGES = 0.02                      # share of a range that two sonars' ranges may differ by


def image_intensities(image: xr.Dataset, kind: str, shape: Sequence[int], farthest: float | None = None) -> np.ndarray:
    """Give the intensities of an image, (ping, row, bin) [µPa²]; NaN where there is no level.

    Parameters
    ----------
    image : xarray.Dataset
        With ``level`` [dB re 1 µPa] over ping, side or beam, and range.
    kind : str
        Of the sonar that the model is of.
    shape : (int, int, int)
        Of the model's record.
    farthest : float [m], optional
        Slant range that the model's record ends at, where it is known.

    Raises
    ------
    ValueError
        If it is the record of another sonar, or another number of pings, rows or bins.
    """
    if "level" not in image or image["level"].ndim != 3:
        raise ValueError("the record has no levels over pings, sides or beams, and ranges; give an image that mitsonar "
                         "rendered, or one with the variable level (ping, side, range)")
    recorded = image.attrs.get("sonar")
    if recorded is not None and recorded != kind:
        raise ValueError(f"the record is of a sonar of the kind {recorded}, and the scene's is {kind}; give a "
                         "record of the scene's own sonar")
    level = image["level"].values.astype(float)
    if level.shape != tuple(shape):
        said = [" x ".join(str(count) for count in one) for one in (level.shape, shape)]
        raise ValueError(f"the record has {said[0]} pings, rows and bins, and the scene's sonar makes {said[1]}; give "
                         "a record of the scene's own sonar")
    ranges = image["range"].values.astype(float) if "range" in image.coords else np.zeros(0)
    if ranges.size > 1 and farthest is not None and abs(ranges[-1] - farthest) > RANGES * farthest:
        raise ValueError(f"the record ends at {ranges[-1]:.1f} m, and that of the scene's sonar at {farthest:.1f} m; "
                         "give a record of the scene's own sonar")
    seen = np.full(level.shape, np.nan)
    finite = np.isfinite(level)
    seen[finite] = power_from_db(level[finite])
    return seen
