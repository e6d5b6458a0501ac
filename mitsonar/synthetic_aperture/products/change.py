"""What has changed between two passes over the same ground.

    coherent     |γ̂| < t,      P(|γ̂| < t | γ₀) = p                                     t by `coherence_statistics`
    incoherent   R = <|I₂|²> / <|I₁|²>,      R / R₀ ~ F(2L, 2L);      R < F⁻¹(p/2) or R > F⁻¹(1 - p/2)

I₁, I₂ -> focused images of both passes on one grid; γ₀ -> ``coherence``, of a bed that nothing happened to; p ->
``false_alarm``; L -> looks of a window. The first sees what moved the bed's grains, the second what made it louder or
fainter; noise and a changed view lower both passes' coherence everywhere, so γ₀ is told from the images, if not given:
the coherence that half of the ground is above.

References
----------
Lyons and Brown (2013), IEEE J. Oceanic Eng. 38, 91: coherence that seabeds lose with time.
Midtgaard and others (2011), Proc. OCEANS: both kinds of change in images of one sonar.
"""
from __future__ import annotations

import numpy as np
import xarray as xr
from scipy import ndimage, stats

from ..focusing.compression import window_samples
from ..record import check_image
from .change_registration import Shift, registered, shift_between
from .coherence_statistics import coherence_at, independent_looks, unbiased_coherence, windowed_coherence

__all__ = ["change_map", "laid_on"]

HIGHEST = 0.995


def change_map(before: xr.Dataset, after: xr.Dataset, window: tuple[float, float] = (0.5, 0.5), *, bank: int = 0,
               false_alarm: float = 1e-3, coherence: float | None = None, search: int = 8, register: bool = True
               ) -> xr.Dataset:
    """Compare two passes.

    Parameters
    ----------
    before, after : Dataset
        Focused images on the same grid.
    window : (float, float) [m]
        Along and across the track.
    bank : int
    false_alarm : float
        Share of unchanged ground that may be marked, of each kind of change.
    coherence : float or None
        Of unchanged ground; None: told from the images.
    search : int
        Most points that the second pass is shifted by.
    register : bool
        False: the second image is taken where it lies.

    Returns
    -------
    Dataset
        Over (along_track, across_track): coherence, with its bias taken out; phase [rad] of the second pass less the
        first; ratio_db [dB] of its intensity to the first's, the median taken out; coherent_change and
        incoherent_change, true where theory says that unchanged ground is so in one of 1 / false_alarm cases at most;
        with x, y and depth. Attributes: looks, unchanged_coherence, threshold, ratio_threshold_db, and the shift.

    Raises
    ------
    ValueError
        If the images have other grids or no such bank, or no patch is alike in both.
    """
    one, two = _images(before, after, bank)
    if not 0 < false_alarm < 0.5:
        raise ValueError(f"false_alarm is {false_alarm}; give a share above 0 and below 0.5")
    if coherence is not None and not 0 < coherence < 1:
        raise ValueError(f"the coherence of unchanged ground is {coherence}; give one above 0 and below 1, or None")
    shift = shift_between(one, two, search) if register else Shift(along=np.zeros(3), across=np.zeros(3), patches=0,
                                                                   deviation=0.0)
    if register:
        two = registered(two, shift)
    size = window_samples(before, window)
    looks = max(independent_looks(one, size), 1.5)
    estimate = windowed_coherence(one, two, size)
    known = np.isfinite(estimate)
    raw = np.abs(np.where(known, estimate, 0.0))
    alike = unbiased_coherence(raw, looks)
    unchanged = float(np.median(alike[known])) if coherence is None else coherence
    threshold = coherence_at(false_alarm, min(unchanged, HIGHEST), looks)
    ratio = _ratio(one, two, size, known)
    limit = float(stats.f.ppf(1 - 0.5 * false_alarm, 2 * looks, 2 * looks))
    return _record(before, known, {
        "coherence": ("1", np.where(known, alike, np.nan)),
        "phase": ("rad", np.where(known, np.angle(estimate), np.nan)),
        "ratio_db": ("dB", 10 * np.log10(ratio)), "coherent_change": ("1", known & (raw < threshold)),
        "incoherent_change": ("1", known & ((ratio > limit) | (ratio < 1 / limit)))}).assign_attrs(
        looks=looks, unchanged_coherence=unchanged, threshold=threshold,
        ratio_threshold_db=float(10 * np.log10(limit)), false_alarm=false_alarm,
        shift_along=[float(part) for part in shift.along], shift_across=[float(part) for part in shift.across],
        shift_deviation=shift.deviation, patches=shift.patches)


def laid_on(before: xr.Dataset, after: xr.Dataset, *, bank: int = 0, search: int = 8) -> xr.Dataset:
    """Give the second pass's image, all banks, as the first one's points see it; raises as `change_map`."""
    one, two = _images(before, after, bank)
    shift = shift_between(one, two, search)
    moved = np.stack([registered(np.where(image == 0, np.nan, image), shift) for image in after["image"].values])
    with np.errstate(divide="ignore"):
        level = 20 * np.log10(np.abs(moved))
    return after.assign(image=(after["image"].dims, moved.astype(np.complex64), after["image"].attrs),
                        level=(after["level"].dims, level.astype(np.float32), after["level"].attrs))


def _images(before: xr.Dataset, after: xr.Dataset, bank: int) -> tuple[np.ndarray, np.ndarray]:
    """Both images, NaN where nothing was focused."""
    for image in (before, after):
        check_image(image)
        if not 0 <= bank < image.sizes["bank"]:
            raise ValueError(f"bank {bank} is asked for, and an image has {image.sizes['bank']}, counted from 0")
    for name in ("x", "y"):
        if before[name].shape != after[name].shape or not np.allclose(before[name], after[name], atol=1e-6):
            raise ValueError("the passes are focused on different grids; give `focus` the same grid for both")
    one, two = (image["image"].values[bank].astype(complex) for image in (before, after))
    return np.where(one == 0, np.nan, one), np.where(two == 0, np.nan, two)


def _ratio(one: np.ndarray, two: np.ndarray, size: tuple[int, int], known: np.ndarray) -> np.ndarray:
    """Intensities of the second over the first's, with the median 1; NaN where there is none."""
    first, second = (ndimage.uniform_filter(np.abs(np.nan_to_num(image)) ** 2, size, mode="nearest")
                     for image in (one, two))
    ratio = np.where(known, second / np.where(known, first, 1.0), np.nan)
    return ratio / np.nanmedian(ratio)


def _record(image: xr.Dataset, known: np.ndarray, values: dict[str, tuple[str, np.ndarray]]) -> xr.Dataset:
    dims = ("along_track", "across_track")
    if not known.any():
        raise ValueError("no window lies on ground that both passes saw whole; give a smaller window, or other passes")
    return xr.Dataset({name: (dims, some.astype(bool if some.dtype == bool else np.float32), {"units": unit})
                       for name, (unit, some) in values.items()},
                      coords={name: image[name] for name in (*dims, "x", "y", "depth")})
