"""Places of a fan's bins in a picture of square elements [m]: made once, used for every frame.

The middle of an element at x aside and y along the fan's middle lies, in bins,

    u = beam(atan2(x, y))        p = max(cell / (r s(u)), 1)         beams
    v = (r - r0) / dr            q = max(cell / dr, 1)               ranges

where r = |(x, y)|, s is the angle between beams and dr the length of a bin. It shows the mean power over the box of p
beams by q ranges about (u, v), every bin weighted with the share of the box that it fills. So an element that covers
several bins averages them, and one that is smaller than a bin interpolates between the two nearest. Labels are those of
the bin that the middle lies in.
"""
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from mitsonar.units import NOTHING_DB

TURN = 2 * np.pi
CLOSED = 1.5                       # times the usual step: a gap that a full circle may have
EVEN = 1e-3                        # of a bin: how even ranges must be
ALIKE = 1e-6                       # [rad] between beams that are one
AT_ONCE = 1 << 16                  # elements whose shares are reckoned together, to stay within caches
AXES = 0.5 * np.pi * np.arange(-8, 9)      # angles at which a rim may reach farthest


@dataclass(frozen=True, kw_only=True)
class FanGrid:
    """Middles of a picture's elements."""

    x: np.ndarray  # (X,) [m]: to the right, rising
    y: np.ndarray  # (Y,) [m]: along the fan's middle, in the order of the picture's rows
    cell: float  # [m]: side of an element

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.y.size, self.x.size


@dataclass(frozen=True, kw_only=True)
class FanMap:
    """Assignment of bins (beam, range) to elements of a picture."""

    shape: tuple[int, int]  # rows and columns of the picture
    inside: np.ndarray  # (M,): elements within the fan, counted along rows, in the order of `weights`
    nearest: np.ndarray  # (M,): the bin in which the middle of each lies, counted along ranges
    weights: csr_array  # (M, bins): share of every bin in each

    def levels(self, level: np.ndarray) -> np.ndarray:
        """Draw levels as means of powers."""
        # level [dB] -> [dB]
        power = np.exp(np.float32(np.log(10) / 10) * np.asarray(level, np.float32).ravel())
        mean = np.maximum(self.weights @ power, np.float32(10 ** (NOTHING_DB / 10)))
        drawn = np.full(self.shape, np.nan, np.float32)
        drawn.ravel()[self.inside] = 10 * np.log10(mean)
        return drawn

    def labels(self, values: np.ndarray) -> np.ndarray:
        """Draw what must not be mixed: of every element the bin that its middle lies in."""
        # values (..., beam, range) -> (..., row, column)
        values = np.asarray(values)
        flat = values.reshape(*values.shape[:-2], -1)
        outside = np.nan if values.dtype.kind == "f" else 0
        drawn = np.full((*values.shape[:-2], self.shape[0] * self.shape[1]), outside, values.dtype)
        drawn[..., self.inside] = flat[..., self.nearest]
        return drawn.reshape(*values.shape[:-2], *self.shape)


def in_order(bearing: np.ndarray) -> tuple[np.ndarray, np.ndarray, bool]:
    """Sort bearings along the circle, beginning behind its largest gap, or astern where they go all around."""
    # bearing (B,) [rad] -> rising [rad]
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
    """Lay a grid over a fan; the sonar is on a corner of elements."""
    # bearing (B,) [rad]; slant_range (N,) [m]; cell [m]
    left, right, near, far = reach(bearing, slant_range)
    x, y = (cell * (np.arange(np.floor(low / cell + EVEN), max(np.ceil(high / cell - EVEN), 1 + np.floor(low / cell)))
                    + 0.5) for low, high in ((left, right), (near, far)))
    return FanGrid(x=x, y=y if downwards else y[::-1], cell=cell)


def fan_map(bearing: np.ndarray, slant_range: np.ndarray, grid: FanGrid) -> FanMap:
    """Find which bins make which elements."""
    # bearing (B,) [rad]; slant_range (N,) [m]
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
    """Return how far a fan reaches with its outer beams and bins."""
    # bearing (B,) [rad]; slant_range (N,) [m] -> left, right [m], near, far [m]
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
    """Place of angles among the beams [beams], and the angle between beams there [rad]."""
    margin = 0.5 * (TURN - (rising[-1] - rising[0]))
    start = rising[0] - margin
    angle = start + np.mod(angle - start, TURN)
    if closed:
        known, number = np.r_[rising[-1] - TURN, rising, rising[0] + TURN], np.arange(-1, rising.size + 1)
    else:                                                              # half a beam more on either side
        known = np.r_[2 * rising[0] - rising[1], rising, 2 * rising[-1] - rising[-2]]
        number = np.arange(-1, rising.size + 1)
    beam = np.interp(angle, known, number)
    return beam, np.interp(beam, number[:-1] + 0.5, np.diff(known))


def _shares(beam, wide, along, deep, order, ranges, closed):
    """Shares of bins in elements, and which element each row is: those that cover about as many beams together."""
    beams = order.size
    count = np.where(wide > 1, 1 << np.ceil(np.log2(np.floor(wide) + 2)).astype(np.int64), 2)
    found = [_of_one_width(rows, number, beam[rows], wide[rows], along[rows], deep, order, ranges, closed)
             for number, rows in _by_value(count)]
    rows = np.concatenate([rows for rows, _, _ in found])
    lengths = np.concatenate([np.full(len(rows), index.shape[1]) for rows, index, _ in found])
    indices, shares = (np.concatenate([each[part].ravel() for each in found]) for part in (1, 2))
    return rows, csr_array((shares, indices, np.r_[0, np.cumsum(lengths)].astype(np.int32)),
                           shape=(rows.size, beams * ranges))


def _of_one_width(rows, number, beam, wide, along, deep, order, ranges, closed):
    """Bins of elements that cover at most so many beams, (rows, number x ranges), and their shares."""
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
    """Length that unit cells share with intervals about a middle."""
    low, high = (middle - 0.5 * width)[:, None], (middle + 0.5 * width)[:, None]
    return np.clip(np.minimum(cells + 0.5, high) - np.maximum(cells - 0.5, low), 0, 1)


def _by_value(count) -> Iterator[tuple[int, np.ndarray]]:
    for number in np.unique(count):
        rows = np.flatnonzero(count == number)
        for first in range(0, rows.size, AT_ONCE):
            yield int(number), rows[first:first + AT_ONCE]
