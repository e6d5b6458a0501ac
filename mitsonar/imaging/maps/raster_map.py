"""Map of a fan's bins to a picture of square elements [m], made once and used for every frame.

In bins, the middle of an element at x aside and y along the fan's middle lies at

    u = beam(atan2(x, y))        p = max(cell / (r s(u)), 1)         beams
    v = (r - r0) / dr            q = max(cell / dr, 1)               ranges

where r = |(x, y)|, s is the angle between beams and dr the length of a bin. It shows the mean power over the box of p
beams by q ranges around (u, v), with every bin weighted by its share of the box. An element that covers several bins
therefore averages them, and an element smaller than a bin interpolates between the two nearest. Labels are those of the
bin at the middle.
"""
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from mitsonar.hydrography.map_grid import MapGrid
from mitsonar.units import NOTHING_DB

TURN = 2 * np.pi
CLOSED = 1.5                       # largest gap of a full circle, relative to the median step
EVEN = 1e-3                        # of a bin: tolerance of even ranges
ALIKE = 1e-6                       # [rad]: closer beams count as one
AT_ONCE = 1 << 16                  # elements at a time, to stay within caches
MOST_KEPT = 1 << 23                # shares of bins in a map that is kept for the next image
AXES = 0.5 * np.pi * np.arange(-8, 9)      # [rad]: angles at which a rim may be extreme


@dataclass(frozen=True, kw_only=True)
class FanGrid:
    """Middles of the elements of a picture."""

    x: np.ndarray  # (X,) [m]: to the right, rising
    y: np.ndarray  # (Y,) [m]: along the fan's middle, in the order of rows
    cell: float  # [m]: side of an element

    @property
    def shape(self) -> tuple[int, int]:
        """Return the numbers of rows and columns."""
        return self.y.size, self.x.size


@dataclass(frozen=True, kw_only=True)
class FanMap:
    """Map of bins (beam, range) to elements of a picture."""

    shape: tuple[int, int]  # rows and columns of the picture
    inside: np.ndarray  # (M,): flat indices of elements within the fan
    nearest: np.ndarray  # (M,): flat index of the bin at the middle of each
    weights: csr_array  # (M, bins): share of every bin in each element

    def levels(self, level: np.ndarray) -> np.ndarray:
        """Return levels [dB] as drawn, averaged as powers; NaN outside the fan."""
        power = np.exp(np.float32(np.log(10) / 10) * np.asarray(level, np.float32).ravel())
        mean = np.maximum(self.weights @ power, np.float32(10 ** (NOTHING_DB / 10)))
        drawn = np.full(self.shape, np.nan, np.float32)
        drawn.ravel()[self.inside] = 10 * np.log10(mean)
        return drawn

    def labels(self, values: np.ndarray) -> np.ndarray:
        """Return values (..., beam, range) as drawn (..., row, column), each from the bin at the middle."""
        values = np.asarray(values)
        outside = np.nan if values.dtype.kind == "f" else 0
        drawn = np.full((*values.shape[:-2], self.shape[0] * self.shape[1]), outside, values.dtype)
        drawn[..., self.inside] = values.reshape(*values.shape[:-2], -1)[..., self.nearest]
        return drawn.reshape(*values.shape[:-2], *self.shape)


def in_order(bearing: np.ndarray) -> tuple[np.ndarray, np.ndarray, bool]:
    """Return the order of bearings (B,) [rad], the sorted bearings, and True if they form a full circle.

    The order starts after the largest gap, or astern on a full circle.
    """
    turned = np.mod(np.asarray(bearing, float), TURN)
    order = np.argsort(turned, kind="stable")
    apart = np.diff(turned[order], prepend=turned[order[-1]] - TURN) > ALIKE
    order = order[apart] if apart.any() else order[:1]
    turned = turned[order]
    if turned.size < 2:
        raise ValueError(f"all beams have the bearing {np.rad2deg(turned[0]):.4g} degrees; a picture needs "
                         "two or more.")
    gaps = np.diff(turned, append=turned[0] + TURN)
    closed = turned.size > 2 and bool(gaps.max() <= CLOSED * np.median(gaps))
    last = np.searchsorted(turned, np.pi) - 1 if closed else gaps.argmax()
    order, turned = np.roll(order, -last - 1), np.roll(turned, -last - 1)
    rising = np.unwrap(turned)
    return order, rising - TURN * np.round(rising.mean() / TURN), closed


def fan_grid(bearing: np.ndarray, slant_range: np.ndarray, cell: float, downwards: bool = False) -> FanGrid:
    """Return the grid over a fan with elements of a ``cell`` [m]; the sonar lies on a corner of elements."""
    left, right, near, far = reach(bearing, slant_range)
    grid = MapGrid.over((left, near, right, far), cell, tolerance=EVEN)
    return FanGrid(x=grid.x, y=grid.y[::-1] if downwards else grid.y, cell=cell)


_kept: dict[tuple[bytes | float, ...], FanMap] = {}    # the last map: images of one sonar share it


def fan_map(bearing: np.ndarray, slant_range: np.ndarray, grid: FanGrid) -> FanMap:
    """Return the map of bins, at bearings (B,) [rad] and ranges (N,) [m], to the elements of a grid."""
    asked = *(values.tobytes() for values in (bearing, slant_range, grid.x, grid.y)), grid.cell
    if (known := _kept.get(asked)) is not None:
        return known
    made = _made_map(bearing, slant_range, grid)
    _kept.clear()
    if made.weights.nnz <= MOST_KEPT:
        _kept[asked] = made
    return made


def _made_map(bearing: np.ndarray, slant_range: np.ndarray, grid: FanGrid) -> FanMap:
    order, rising, closed = in_order(bearing)
    step = _even_step(slant_range)
    away = np.hypot(grid.x, grid.y[:, None]).ravel()
    along = (away - slant_range[0]) / step
    beam, spacing = _beam_of(np.arctan2(grid.x, grid.y[:, None] + 0 * grid.x).ravel(), rising, closed)
    within = (along >= -0.5) & (along < slant_range.size - 0.5) & (beam >= -0.5) & (beam < rising.size - 0.5)
    within |= closed & (along >= -0.5) & (along < slant_range.size - 0.5)
    inside = np.flatnonzero(within)
    beam, along = beam[inside], along[inside]
    wide = np.minimum(np.maximum(grid.cell / (np.maximum(away[inside], 0.5 * grid.cell) * spacing[inside]), 1),
                      rising.size)
    middle = np.clip(np.rint(beam), *((-1, rising.size) if closed else (0, rising.size - 1))).astype(np.int64)
    nearest = (order[middle % rising.size] * slant_range.size
               + np.clip(np.rint(along), 0, slant_range.size - 1).astype(np.int64))
    rows, parts = _shares(beam, wide, along, max(grid.cell / step, 1), order, slant_range.size, closed)
    return FanMap(shape=grid.shape, inside=inside[rows], nearest=nearest[rows], weights=parts)


def reach(bearing: np.ndarray, slant_range: np.ndarray) -> tuple[float, float, float, float]:
    """Return the extent of a fan with its outer beams and bins: left, right, near and far [m]."""
    _, rising, closed = in_order(bearing)
    half = 0.5 * np.array([rising[1] - rising[0], rising[-1] - rising[-2]])
    first, last = (-np.pi, np.pi) if closed else (rising[0] - half[0], rising[-1] + half[1])
    angle = np.r_[first, last, AXES[(AXES > first) & (AXES < last)]]
    step = _even_step(slant_range)
    ends = np.array([max(slant_range[0] - 0.5 * step, 0), slant_range[-1] + 0.5 * step])[:, None]
    x, y = ends * np.sin(angle), ends * np.cos(angle)
    return float(x.min()), float(x.max()), float(y.min()), float(y.max())


def _even_step(slant_range):
    steps = np.diff(slant_range)
    if not steps.size or steps.min() <= 0 or np.ptp(steps) > EVEN * steps.mean():
        raise ValueError(f"the ranges of the picture are {slant_range.size} in uneven steps; a Cartesian picture needs "
                         "two or more that rise evenly.")
    return float(np.mean(steps))


def _beam_of(angle, rising, closed):
    """Return the fractional beam of angles, and the spacing of beams there [rad]."""
    margin = 0.5 * (TURN - (rising[-1] - rising[0]))
    start = rising[0] - margin
    angle = start + np.mod(angle - start, TURN)
    if closed:
        known, number = np.r_[rising[-1] - TURN, rising, rising[0] + TURN], np.arange(-1, rising.size + 1)
    else:                                                              # half a beam beyond either side
        known = np.r_[2 * rising[0] - rising[1], rising, 2 * rising[-1] - rising[-2]]
        number = np.arange(-1, rising.size + 1)
    beam = np.interp(angle, known, number)
    return beam, np.interp(beam, number[:-1] + 0.5, np.diff(known))


def _shares(beam, wide, along, deep, order, ranges, closed):
    """Return the element of each row and the shares of bins in it, grouped by the number of beams covered."""
    beams = order.size
    count = np.where(wide > 1, 1 << np.ceil(np.log2(np.floor(wide) + 2)).astype(np.int64), 2)
    groups = [_of_one_width(rows, number, beam[rows], wide[rows], along[rows], deep, order, ranges, closed)
              for number, rows in _by_value(count)]
    rows = np.concatenate([rows for rows, _, _ in groups])
    lengths = np.concatenate([np.full(len(rows), index.shape[1]) for rows, index, _ in groups])
    indices, shares = (np.concatenate([group[part].ravel() for group in groups]) for part in (1, 2))
    return rows, csr_array((shares, indices, np.r_[0, np.cumsum(lengths)].astype(np.int32)),
                           shape=(rows.size, beams * ranges))


def _of_one_width(rows, number, beam, wide, along, deep, order, ranges, closed):
    """Return the bins (rows, number x ranges) of elements that cover at most ``number`` beams, and their shares."""
    left, near = np.floor(beam - 0.5 * wide + 0.5), np.floor(along - 0.5 * deep + 0.5)
    beams = left[:, None] + np.arange(number)
    samples = near[:, None] + np.arange(int(np.floor(deep)) + 2 - (deep == 1))
    aside = _overlap(beams, beam, wide) * (closed | (beams >= 0) & (beams < order.size))
    towards = _overlap(samples, along, deep) * ((samples >= 0) & (samples < ranges))
    aside, towards = (share / share.sum(1, keepdims=True) for share in (aside, towards))
    bins = order[np.mod(beams, order.size).astype(np.int64)].astype(np.int32) * ranges
    index = bins[:, :, None] + np.clip(samples, 0, ranges - 1).astype(np.int32)[:, None]
    share = aside.astype(np.float32)[:, :, None] * towards.astype(np.float32)[:, None]
    return rows, index.reshape(len(rows), -1), share.reshape(len(rows), -1)


def _overlap(cells, middle, width):
    """Return the overlap of unit cells with intervals around a middle."""
    low, high = (middle - 0.5 * width)[:, None], (middle + 0.5 * width)[:, None]
    return np.clip(np.minimum(cells + 0.5, high) - np.maximum(cells - 0.5, low), 0, 1)


def _by_value(count) -> Iterator[tuple[int, np.ndarray]]:
    """Yield each value with blocks of the indices that have it."""
    for number in np.unique(count):
        rows = np.flatnonzero(count == number)
        for first in range(0, rows.size, AT_ONCE):
            yield int(number), rows[first:first + AT_ONCE]
