"""Laying one pass's image on another's, to a fraction of a point.

    I(a, g) = J(a, g) e^(iΦ(a, g))          Φ: the carrier, a phase that runs along rows and columns alike for all rows
    shift   = argmax |Σ J₂ J₁*|             in patches; a plane through them by least squares of what agrees

Points of a focused image stand farther apart than its carrier allows, its band does not: so the carrier is taken out
before an image is interpolated, and put in again. It is told from neighbours: arg Σ I(g + 1) I*(g) along both axes.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import fft, ndimage

__all__ = ["Shift", "registered", "shift_between"]

FINER = 16                         # parts of a point that peaks are told to, before a parabola
PATCH = 64                         # points a side
LEAST_PEAK = 0.15                  # coherence of a patch that counts
SURE_ROUNDS, APART = 5, 0.3        # of the fit; points that a patch may be off its plane


@dataclass(frozen=True, kw_only=True)
class Shift:
    """By how many points the second image lies later, linear over the image.

    Attributes
    ----------
    along, across : (3,)
        Constant, per row, per column; counted from the first point.
    patches : int
        That agree with it.
    deviation : float
        Of those patches from it, in points.
    """

    along: np.ndarray
    across: np.ndarray
    patches: int
    deviation: float

    def at(self, rows: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Give the shifts at points."""
        along, across = (part[0] + part[1] * rows + part[2] * columns for part in (self.along, self.across))
        return along, across


def shift_between(first: np.ndarray, second: np.ndarray, search: int = 8) -> Shift:
    """Find how one image is shifted against another.

    Parameters
    ----------
    first, second : complex (A, C)
    search : int
        Most points of a shift.

    Returns
    -------
    Shift

    Raises
    ------
    ValueError
        If shapes differ, images are smaller than a patch of 16 points or the search, or no patch is alike in both.
    """
    if first.ndim != 2 or first.shape != second.shape:
        raise ValueError(f"two images on one grid are laid on each other, and these have {first.shape} and "
                         f"{second.shape} points; focus both on the same grid")
    if search < 1 or min(first.shape) < max(16, 2 * search + 2):
        raise ValueError(f"images of {first.shape[0]} x {first.shape[1]} points are too small for a search of "
                         f"{search}; give 16 points or more a side, and a search from 1 to less than half of them")
    size = [min(PATCH, count) for count in first.shape]
    one, two = (_without_carrier(np.nan_to_num(image), carrier) for carrier in (_carrier(first),)
                for image in (first, second))
    found = []
    starts = [np.unique(np.linspace(0, count - part, max(2 * count // part - 1, 1)).astype(int))
              for count, part in zip(first.shape, size)]
    for row in starts[0]:
        for column in starts[1]:
            part = np.s_[row:row + size[0], column:column + size[1]]
            peak, height = _peak(one[part], two[part], search)
            if height > LEAST_PEAK:
                found.append((row + 0.5 * size[0], column + 0.5 * size[1], *peak, height))
    if not found:
        raise ValueError("no patch of the two images is alike; they show other ground, or it lost its coherence; give "
                         "a larger search, or images of the same bed")
    return _plane(np.array(found))


def registered(image: np.ndarray, shift: Shift) -> np.ndarray:
    """Give an image as the first one's points see it; NaN where it does not reach."""
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
    """Phases along rows and along columns that neighbours differ by on the mean."""
    known = np.nan_to_num(image)
    along = np.angle(np.sum(known[1:] * np.conj(known[:-1])))
    flat = known * np.exp(-1j * along * np.arange(len(known)))[:, None]
    steps = np.sum(flat[:, 1:] * np.conj(flat[:, :-1]), 0)
    smooth = ndimage.gaussian_filter1d(steps.real, 8) + 1j * ndimage.gaussian_filter1d(steps.imag, 8)
    return along * np.arange(len(known)), np.concatenate([[0.0], np.cumsum(np.unwrap(np.angle(smooth)))])


def _without_carrier(image: np.ndarray, carrier: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    return image * np.exp(-1j * (carrier[0][:, None] + carrier[1]))


def _peak(first: np.ndarray, second: np.ndarray, search: int) -> tuple[tuple[float, float], float]:
    """Shift of the second patch in points, and the coherence there."""
    shape = [fft.next_fast_len(2 * size) for size in first.shape]
    product = fft.fft2(second, shape) * np.conj(fft.fft2(first, shape))
    lags = fft.ifft2(product)
    reach = np.arange(-search, search + 1)
    near = np.abs(lags[np.ix_(reach, reach)])
    best = np.unravel_index(near.argmax(), near.shape)
    fine = [reach[place] + np.arange(-FINER, FINER + 1) / FINER for place in best]
    waves = [np.exp(2j * np.pi * np.multiply.outer(lag, fft.fftfreq(count))) for lag, count in zip(fine, shape)]
    columns = np.einsum("ac,lc->al", product, waves[1])          # small: threads of BLAS would cost more
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


def _plane(found: np.ndarray) -> Shift:
    """The plane through the patches' shifts that most agree with."""
    weight = found[:, 4].copy()
    middle = np.median(found[:, 2:4], axis=0)
    weight[np.abs(found[:, 2:4] - middle).max(1) > 2.0] = 0
    places = np.column_stack([np.ones(len(found)), found[:, 0], found[:, 1]])
    sloped = len(found) >= 9 and np.linalg.matrix_rank(places) == 3
    design = places if sloped else places[:, :1]
    for _ in range(SURE_ROUNDS):
        sure = weight[:, None]
        fit = np.linalg.lstsq(sure * design, sure * found[:, 2:4], rcond=None)[0]
        rest = np.abs(found[:, 2:4] - design @ fit).max(1)
        weight = np.where(rest < max(APART, 2 * np.median(rest)), found[:, 4], 0)
    kept = weight > 0
    full = np.zeros((3, 2))
    full[:len(fit)] = fit
    return Shift(along=full[:, 0], across=full[:, 1], patches=int(kept.sum()),
                 deviation=float(np.sqrt(np.mean((found[kept, 2:4] - (design @ fit)[kept]) ** 2))))
