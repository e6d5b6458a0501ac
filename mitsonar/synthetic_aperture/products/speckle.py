"""Speckle of a focused image: statistics of its intensity, which depend on the bed.

    SI  = <I²> / <I>² - 1                        scintillation index: 1 for fully developed speckle
    SI  = 1 + 2 / ν                              for a K distribution of shape ν; infinite ν: Rayleigh's envelope
    CV  = std(A) / <A>                           A = √I; 0.523 for Rayleigh's
    C   = std(I) / <I> in windows                contrast, whose windows follow slow changes of level

I -> ``image`` squared over its slow trend, a Gaussian mean of ``trend`` metres. In a trend of n looks, a look has the
share 1 / n, which reduces the fluctuations by about that share; the index is corrected for it.

References
----------
Jakeman and Pusey (1976), IEEE Trans. Antennas Propag. 24, 806: the K distribution.
Abraham and Lyons (2002), IEEE J. Oceanic Eng. 27, 800: its shape as a number of scatterers.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy import ndimage

from ..focusing.compression import window_samples
from ..record import check_image
from .coherence_statistics import independent_looks

LEAST = 64                         # looks, fewer give no statistics


@dataclass(frozen=True, kw_only=True)
class Speckle:
    """Statistics of speckle.

    Attributes
    ----------
    scintillation : float [-]
    shape : float [-]
        Shape of the K distribution from its second moment; infinite if the fluctuation does not exceed Rayleigh's.
    variation : float [-]
        Coefficient of variation of amplitudes.
    contrast : float [-]
        Median over windows.
    deviation : float [-]
        Theoretical standard deviation of the scintillation index for pure speckle: √(20 / looks).
    looks : float
        Number of independent looks in the image.
    """

    scintillation: float
    shape: float
    variation: float
    contrast: float
    deviation: float
    looks: float


def speckle(image: xr.Dataset, *, bank: int = 0, trend: float = 1.0, keep: np.ndarray | None = None) -> Speckle:
    """Measure the speckle of a focused image.

    Parameters
    ----------
    image : Dataset
    bank : int
    trend : float [m]
        Standard deviation of the Gaussian mean that levels are divided by.
    keep : (A, C) bool or None
        Ground to use. None: all focused points.

    Returns
    -------
    Speckle

    Raises
    ------
    ValueError
        If it is no focused image, has no such bank, or fewer than 64 looks count.
    """
    check_image(image)
    if not 0 <= bank < image.sizes["bank"]:
        raise ValueError(f"bank {bank} was asked for, and the image has {image.sizes['bank']}, counted from 0")
    field = image["image"].values[bank].astype(complex)
    known = np.isfinite(field) & (field != 0)
    if keep is not None:
        if keep.shape != known.shape:
            raise ValueError(f"keep has the shape {keep.shape}, and the image {known.shape}; give one for every point")
        known = known & keep
    size = window_samples(image, (trend, trend))
    field = np.where(known, field, 0)
    # looks per point, from a window of 33 points a side at most
    sample = min(size[0], 33), min(size[1], 33)
    correlated = 1 / (float(np.prod(sample)) / independent_looks(field, sample))
    count = known.sum() * correlated
    if count < LEAST:
        raise ValueError(f"the image has {count:.0f} looks of speckle, and {LEAST} are needed; give a larger one")
    level = np.abs(field) ** 2
    steps = [float(np.abs(np.diff(image[name].values)).mean()) for name in ("along_track", "across_track")]
    width = [trend / step for step in steps]
    share = np.maximum(ndimage.gaussian_filter(known.astype(float), width), 1e-6)
    mean = ndimage.gaussian_filter(level, width) / share
    ratio = (level / np.maximum(mean, 1e-300))[known]
    # A Gaussian mean of standard deviation w [points] averages 4π w² points.
    own = 1 / (4 * np.pi * width[0] * width[1] * correlated)
    index = (np.mean(ratio ** 2) / np.mean(ratio) ** 2 - 1) * (1 + 2 * own)
    amplitude = np.sqrt(ratio)
    return Speckle(scintillation=float(index), shape=float(2 / (index - 1)) if index > 1 else np.inf,
                   variation=float(amplitude.std() / amplitude.mean()), contrast=_contrast(level, known, size),
                   deviation=float(np.sqrt(20 / count)), looks=float(count))


def _contrast(level: np.ndarray, known: np.ndarray, size: tuple[int, int]) -> float:
    complete = ndimage.minimum_filter(known, size, mode="constant", cval=0)
    mean, square = (ndimage.uniform_filter(part, size, mode="nearest") for part in (level, level ** 2))
    if not complete.any():
        return float("nan")
    return float(np.median(np.sqrt(np.maximum(square[complete] / mean[complete] ** 2 - 1, 0.0))))
