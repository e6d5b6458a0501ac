"""Levels as pictures of 8 bits: a gain over range that makes an even seabed look even, black and white in dB.

    grey = 255 (level + gain - low) / (high - low), cut off at 0 and 255
"""
import numpy as np
import xarray as xr

from ...io.files import FilePath
from ...plots.gain import Tvg, display_gain, display_window

__all__ = ["grey", "write_png"]

NOTHING_DB = -199.0                # at or below: the level of a bin with no echo and no noise


def grey(dataset: xr.Dataset, *, tvg: Tvg = "seabed",
         window: tuple[float, float] | None = None) -> tuple[np.ndarray, tuple[float, float], str]:
    """Turn the levels of a dataset to grey.

    Parameters
    ----------
    dataset : xarray.Dataset
        With ``level`` over (ping, ..., range).
    tvg : {'seabed', 'target', None}
        See `mitsonar.plots.gain`.
    window : (float, float) or None [dB]
        Levels, with their gain, of black and white; None finds them in this dataset.

    Returns
    -------
    grey : uint8 array
        Over the dimensions of ``level``; 0 also where no echo arrives.
    window : (float, float) [dB]
    words : str
        What was added to the level, for people.

    Raises
    ------
    ValueError
        If the window is empty or ``tvg`` unknown.
    """
    level = dataset["level"].values.astype(float)
    gain, words = display_gain(dataset, tvg)
    gain = gain.reshape(len(gain), *[1] * (level.ndim - 2), -1)
    shown = np.where(level > NOTHING_DB, level + gain, np.nan)
    if window is None:
        mean = dataset["mean_level"].values > NOTHING_DB if "mean_level" in dataset else np.isfinite(shown)
        window = display_window(shown[mean] if mean.any() else shown)
    low, high = window
    if not low < high:
        raise ValueError(f"black is {low:g} dB and white {high:g} dB; white must be above black.")
    scaled = np.nan_to_num(255 * (shown - low) / (high - low), nan=0.0)
    return np.clip(np.rint(scaled), 0, 255).astype(np.uint8), (float(low), float(high)), f"level{words}"


def write_png(image: np.ndarray, path: FilePath) -> None:
    """Write a picture (H, W) of uint8 or uint16 as PNG.

    Parameters
    ----------
    image : uint8 or uint16 array (H, W)
    path : str or path
    """
    from PIL import Image

    Image.fromarray(np.ascontiguousarray(image)).save(path, format="PNG")
