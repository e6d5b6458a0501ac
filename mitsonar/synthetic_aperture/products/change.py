"""Changes between two passes over the same ground.

    coherent     |γ̂| < t,      P(|γ̂| < t | γ₀) = p                                     t by `coherence_statistics`
    incoherent   R = <|I₂|²> / <|I₁|²>,      R / R₀ ~ F(2L, 2L);      R < F⁻¹(p/2) or R > F⁻¹(1 - p/2)

I₁, I₂ -> focused images of both passes on one grid; γ₀ -> ``coherence`` of an unchanged bed; p -> ``false_alarm``; L ->
looks of a window. The coherent test finds moved grains, the incoherent one a changed level. Noise and a changed view
lower the coherence of both passes everywhere; the default γ₀ is therefore the median of the measured coherence.

Both images are first registered to a fraction of a point:

    I(a, g) = J(a, g) e^(iΦ(a, g))          Φ: the carrier, the sum of a phase along rows and a phase along columns
    shift   = argmax |Σ J₂ J₁*|             in patches; a plane through the consistent patches by least squares

The points of a focused image sample its band densely enough, but not its carrier. The carrier is therefore removed
before interpolation and restored afterwards. It is estimated from neighbours: arg Σ I(g + 1) I*(g) along both axes.

References
----------
Lyons and Brown (2013), IEEE J. Oceanic Eng. 38, 91: coherence that seabeds lose with time.
Midtgaard and others (2011), Proc. OCEANS: both kinds of change in images of one sonar.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy import fft, ndimage, stats

from ..focusing.compression import window_samples
from ..record import check_image
from .coherence_statistics import coherence_at, independent_looks, unbiased_coherence, windowed_coherence

__all__ = ["Shift", "change_map", "laid_on", "registered", "shift_between"]


FINER = 16                         # steps per point of the peak search, before a parabola
PATCH = 64                         # points a side
LEAST_PEAK = 0.15                  # least coherence of a patch that counts
SURE_ROUNDS, APART = 5, 0.3        # rounds of the fit; largest residual of a consistent patch, in points
HIGHEST = 0.995


@dataclass(frozen=True, kw_only=True)
class Shift:
    """Shift of the second image in points, linear over the image.

    Attributes
    ----------
    along, across : (3,)
        Constant, change per row, change per column; counted from the first point.
    patches : int
        Number of patches that agree with it.
    deviation : float
        Standard deviation of those patches from it, in points.
    """

    along: np.ndarray
    across: np.ndarray
    patches: int
    deviation: float

    def at(self, rows: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the shifts at points, along and across."""
        along, across = (part[0] + part[1] * rows + part[2] * columns for part in (self.along, self.across))
        return along, across


def shift_between(first: np.ndarray, second: np.ndarray, search: int = 8) -> Shift:
    """Find the shift of one image against another.

    Parameters
    ----------
    first, second : complex (A, C)
    search : int
        Largest shift, in points.

    Returns
    -------
    Shift

    Raises
    ------
    ValueError
        If shapes differ, images are smaller than a patch of 16 points or the search, or no patch is alike in both.
    """
    if first.ndim != 2 or first.shape != second.shape:
        raise ValueError(f"the images must lie on one grid, and have {first.shape} and {second.shape} points; focus "
                         "both on the same grid")
    if search < 1 or min(first.shape) < max(16, 2 * search + 2):
        raise ValueError(f"images of {first.shape[0]} x {first.shape[1]} points are too small for a search of "
                         f"{search}; give 16 points or more a side, and a search from 1 to less than half of them")
    size = [min(PATCH, count) for count in first.shape]
    carrier = _carrier(first)
    left, right = (_without_carrier(np.nan_to_num(image), carrier) for image in (first, second))
    patches = []
    starts = [np.unique(np.linspace(0, count - part, max(2 * count // part - 1, 1)).astype(int))
              for count, part in zip(first.shape, size)]
    for row in starts[0]:
        for column in starts[1]:
            part = np.s_[row:row + size[0], column:column + size[1]]
            peak, height = _peak(left[part], right[part], search)
            if height > LEAST_PEAK:
                patches.append((row + 0.5 * size[0], column + 0.5 * size[1], *peak, height))
    if not patches:
        raise ValueError("no patch of the two images is alike: they show other ground, or its coherence is lost; give "
                         "a larger search, or images of the same bed")
    return _plane(np.array(patches))


def registered(image: np.ndarray, shift: Shift) -> np.ndarray:
    """Return an image at the points of the first one; NaN outside the image."""
    carrier = _carrier(image)
    flat = _without_carrier(np.nan_to_num(image), carrier)
    rows, columns = np.meshgrid(*(np.arange(count, dtype=float) for count in image.shape), indexing="ij")
    along, across = shift.at(rows, columns)
    place = np.stack([rows + along, columns + across])
    parts = [np.asarray(ndimage.map_coordinates(part, place, order=5, mode="constant", cval=np.nan))
             for part in (np.real(flat), np.imag(flat))]
    moved = parts[0] + 1j * parts[1]
    unknown = ndimage.map_coordinates((~np.isfinite(image)).astype(float), place, order=1, mode="nearest") > 1e-6
    back = np.exp(1j * sum(np.interp(where, np.arange(len(phase)), phase)
                           for where, phase in zip(place, carrier)))
    return np.where(unknown, np.nan, moved * back)


def _carrier(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the phases along rows and along columns, from the mean difference of neighbours."""
    known = np.nan_to_num(image)
    along = np.angle(np.sum(known[1:] * np.conj(known[:-1])))
    flat = known * np.exp(-1j * along * np.arange(len(known)))[:, None]
    steps = np.sum(flat[:, 1:] * np.conj(flat[:, :-1]), 0)
    smooth = ndimage.gaussian_filter1d(steps.real, 8) + 1j * ndimage.gaussian_filter1d(steps.imag, 8)
    return along * np.arange(len(known)), np.concatenate([[0.0], np.cumsum(np.unwrap(np.angle(smooth)))])


def _without_carrier(image: np.ndarray, carrier: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    return image * np.exp(-1j * (carrier[0][:, None] + carrier[1]))


def _peak(first: np.ndarray, second: np.ndarray, search: int) -> tuple[tuple[float, float], float]:
    """Return the shift of the second patch in points, and the coherence there."""
    shape = [fft.next_fast_len(2 * size) for size in first.shape]
    product = fft.fft2(second, shape) * np.conj(fft.fft2(first, shape))
    lags = fft.ifft2(product)
    reach = np.arange(-search, search + 1)
    near = np.abs(lags[np.ix_(reach, reach)])
    best = np.unravel_index(near.argmax(), near.shape)
    fine = [reach[place] + np.arange(-FINER, FINER + 1) / FINER for place in best]
    waves = [np.exp(2j * np.pi * np.multiply.outer(lag, fft.fftfreq(count))) for lag, count in zip(fine, shape)]
    columns = np.einsum("ac,lc->al", product, waves[1])          # too small for threads of BLAS
    surface = np.abs(np.einsum("ka,al->kl", waves[0], columns)) / np.prod(shape)
    top = np.unravel_index(surface.argmax(), surface.shape)
    power = np.sqrt(np.sum(np.abs(first) ** 2) * np.sum(np.abs(second) ** 2))
    place = [fine[axis][top[axis]] + _vertex(np.take(surface, top[1 - axis], 1 - axis), top[axis]) / FINER
             for axis in (0, 1)]
    return (float(place[0]), float(place[1])), float(surface[top] / power) if power > 0 else 0.0


def _vertex(values: np.ndarray, top: int) -> float:
    if not 0 < top < len(values) - 1:
        return 0.0
    below, here, above = values[top - 1:top + 2]
    bent = below - 2 * here + above
    return float(0.5 * (below - above) / bent) if bent < 0 else 0.0


def _plane(patches: np.ndarray) -> Shift:
    """Return the plane through the shifts of the largest consistent set of patches."""
    weight = patches[:, 4].copy()
    middle = np.median(patches[:, 2:4], axis=0)
    weight[np.abs(patches[:, 2:4] - middle).max(1) > 2.0] = 0
    places = np.column_stack([np.ones(len(patches)), patches[:, 0], patches[:, 1]])
    sloped = len(patches) >= 9 and np.linalg.matrix_rank(places) == 3
    design = places if sloped else places[:, :1]
    for _ in range(SURE_ROUNDS):
        sure = weight[:, None]
        fit = np.linalg.lstsq(sure * design, sure * patches[:, 2:4], rcond=None)[0]
        rest = np.abs(patches[:, 2:4] - design @ fit).max(1)
        weight = np.where(rest < max(APART, 2 * np.median(rest)), patches[:, 4], 0)
    kept = weight > 0
    full = np.zeros((3, 2))
    full[:len(fit)] = fit
    return Shift(along=full[:, 0], across=full[:, 1], patches=int(kept.sum()),
                 deviation=float(np.sqrt(np.mean((patches[kept, 2:4] - (design @ fit)[kept]) ** 2))))


def change_map(before: xr.Dataset, after: xr.Dataset, window: tuple[float, float] = (0.5, 0.5), *, bank: int = 0,
               false_alarm: float = 1e-3, coherence: float | None = None, search: int = 8, register: bool = True
               ) -> xr.Dataset:
    """Compare two passes over the same ground.

    Parameters
    ----------
    before, after : Dataset
        Focused images on the same grid.
    window : (float, float) [m]
        Along and across the track.
    bank : int
    false_alarm : float
        Share of unchanged ground that may be marked, for each kind of change.
    coherence : float or None
        Coherence of unchanged ground. None: estimated from the images.
    search : int
        Largest shift of the second pass, in points.
    register : bool
        False: the second image is not shifted.

    Returns
    -------
    Dataset
        Variables over (along_track, across_track): coherence, without its bias; phase [rad] of the second pass minus
        the first; ratio_db [dB] of the second intensity to the first, relative to its median; coherent_change and
        incoherent_change, true for at most the share `false_alarm` of unchanged ground; with x, y and grid_depth.
        Attributes: looks, unchanged_coherence, threshold, ratio_threshold_db, and the shift.

    Raises
    ------
    ValueError
        If the images have other grids or no such bank, or no patch is alike in both.
    """
    first, second = _images(before, after, bank)
    if not 0 < false_alarm < 0.5:
        raise ValueError(f"false_alarm is {false_alarm}; give a share above 0 and below 0.5")
    if coherence is not None and not 0 < coherence < 1:
        raise ValueError(f"the coherence of unchanged ground is {coherence}; give one above 0 and below 1, or None")
    shift = Shift(along=np.zeros(3), across=np.zeros(3), patches=0, deviation=0.0)
    if register:
        shift = shift_between(first, second, search)
        second = registered(second, shift)
    size = window_samples(before, window)
    looks = max(independent_looks(first, size), 1.5)
    estimate = windowed_coherence(first, second, size)
    known = np.isfinite(estimate)
    raw = np.abs(np.where(known, estimate, 0.0))
    alike = unbiased_coherence(raw, looks)
    unchanged = float(np.median(alike[known])) if coherence is None else coherence
    threshold = coherence_at(false_alarm, min(unchanged, HIGHEST), looks)
    ratio = _ratio(first, second, size, known)
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
    """Return the second pass's image, all banks, at the points of the first one; raises as `change_map`."""
    first, second = _images(before, after, bank)
    shift = shift_between(first, second, search)
    moved = np.stack([registered(np.where(image == 0, np.nan, image), shift) for image in after["image"].values])
    with np.errstate(divide="ignore"):
        level = 20 * np.log10(np.abs(moved))
    return after.assign(image=(after["image"].dims, moved.astype(np.complex64), after["image"].attrs),
                        level=(after["level"].dims, level.astype(np.float32), after["level"].attrs))


def _images(before: xr.Dataset, after: xr.Dataset, bank: int) -> tuple[np.ndarray, np.ndarray]:
    """Return both images, NaN where nothing was focused."""
    for image in (before, after):
        check_image(image)
        if not 0 <= bank < image.sizes["bank"]:
            raise ValueError(f"bank {bank} was asked for, and an image has {image.sizes['bank']}, counted from 0")
    for name in ("x", "y"):
        if before[name].shape != after[name].shape or not np.allclose(before[name], after[name], atol=1e-6):
            raise ValueError("the passes are focused on different grids; give `focus` the same grid for both")
    first, second = (image["image"].values[bank].astype(complex) for image in (before, after))
    return np.where(first == 0, np.nan, first), np.where(second == 0, np.nan, second)


def _ratio(before: np.ndarray, after: np.ndarray, size: tuple[int, int], known: np.ndarray) -> np.ndarray:
    """Return the ratio of the second intensity to the first, with a median of 1; NaN where unknown."""
    first, second = (ndimage.uniform_filter(np.abs(np.nan_to_num(image)) ** 2, size, mode="nearest")
                     for image in (before, after))
    ratio = np.where(known, second / np.where(known, first, 1.0), np.nan)
    return ratio / np.nanmedian(ratio)


def _record(image: xr.Dataset, known: np.ndarray, values: dict[str, tuple[str, np.ndarray]]) -> xr.Dataset:
    dims = ("along_track", "across_track")
    if not known.any():
        raise ValueError("no window lies on ground that both passes cover; give a smaller window, or other passes")
    return xr.Dataset({name: (dims, array.astype(bool if array.dtype == bool else np.float32), {"units": unit})
                       for name, (unit, array) in values.items()},
                      coords={name: image[name] for name in (*dims, "x", "y", "grid_depth")})
