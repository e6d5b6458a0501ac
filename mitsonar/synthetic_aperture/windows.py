"""Windows over an image, in metres and in points."""
from __future__ import annotations

import numpy as np
import xarray as xr

__all__ = ["window_samples"]


def window_samples(image: xr.Dataset, window: tuple[float, float]) -> tuple[int, int]:
    """Give the odd numbers of points along and across that a window [m] holds, the image's at most.

    Raises
    ------
    ValueError
        If a length is not finite and above 0.
    """
    size = []
    for name, length in zip(("along_track", "across_track"), window):
        step = float(np.abs(np.diff(image[name].values)).mean()) if image.sizes[name] > 1 else np.inf
        if not (np.isfinite(length) and length > 0):
            raise ValueError(f"the window's length {name.replace('_', ' ')} is {length} m; give one above 0")
        size.append(min(2 * int(0.5 * length / step) + 1, image.sizes[name]))
    return size[0], size[1]
