"""Windows of samples about an echo in every beam, of different lengths, laid end to end.

Sums over each window run over one flat array, so that the cost is that of the samples, not of the longest window.
"""
from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import ndimage


@dataclass(frozen=True, kw_only=True)
class Windows:
    """One window of samples for each of B beams, W samples in all."""

    begin: np.ndarray  # (B,), first sample
    end: np.ndarray  # (B,), sample after the last
    start: np.ndarray  # (B,), begin of each window among the W

    @cached_property
    def beam(self) -> np.ndarray:
        """Return the beam of each sample (W,), increasing."""
        return np.repeat(np.arange(len(self.begin)), self.end - self.begin)

    @cached_property
    def sample(self) -> np.ndarray:
        """Return each sample's number in the record (W,)."""
        return np.arange(len(self.beam)) - (self.start - self.begin)[self.beam]

    def taken(self, record: np.ndarray) -> np.ndarray:
        """Return the samples (W,) of a record (B, T)."""
        ends = zip(self.begin.tolist(), self.end.tolist())
        return np.concatenate([row[begin:end] for row, (begin, end) in zip(record, ends)])

    def summed(self, values: np.ndarray) -> np.ndarray:
        """Sum values (W,) over each window: (B,)."""
        return np.add.reduceat(values, self.start)

    def spans(self, time: np.ndarray, centre: np.ndarray, half: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return where among the W the samples |t - centre| <= half of each window begin and end (B,)."""
        # time (T,) [s]; centre, half (B,) [s]
        rate = 1 / (time[1] - time[0])
        first = np.clip(np.ceil((centre - half - time[0]) * rate), self.begin, self.end).astype(np.int64)
        last = np.clip(np.floor((centre + half - time[0]) * rate) + 1, first, self.end).astype(np.int64)
        return first - self.begin + self.start, last - self.begin + self.start

    def place_of_greatest(self, values: np.ndarray) -> np.ndarray:
        """Return the sample number (B,) of the first maximum of values (W,) in each window."""
        found = np.flatnonzero(values >= np.maximum.reduceat(values, self.start)[self.beam])
        return self.sample[found[np.searchsorted(self.beam[found], np.arange(len(self.begin)))]]

    def smoothed(self, values: np.ndarray, length: np.ndarray) -> np.ndarray:
        """Return the running sum of values (W,) over ``length`` samples (B,) of each beam, within its window."""
        total = np.concatenate([[0.0], np.cumsum(values)])
        sums = np.empty(len(values))
        last = np.append(self.start[1:], len(values))
        # beam by beam, in slices: a window is cut at its beam's ends
        for start, end, half in zip(self.start.tolist(), last.tolist(), (length // 2).tolist()):
            before, after = min(start + half, end), max(end - half - 1, start)
            sums[start:after] = total[start + half + 1:end]
            sums[after:end] = total[end]
            sums[start:before] -= total[start]
            sums[before:end] -= total[start:max(end - half, start)]
        return sums


def over_spans(reduction: np.ufunc, values: np.ndarray, spans: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Return a reduction of values (W + 1,), whose last is no sample, over spans (B,) in order; 0 over empty ones."""
    first, last = spans
    return np.where(last > first, reduction.reduceat(values, np.stack([first, last], 1).ravel())[::2], 0.0)


def among_neighbours(values: np.ndarray, good: np.ndarray, aside: int = 2) -> np.ndarray:
    """Return means of values (B,) over the good ones of each beam and ``aside`` to either side; NaN without any."""
    size = 2 * aside + 1
    # not by running sums, in which one huge value leaves its rounding to all that follow
    total, count = (ndimage.convolve1d(one, np.ones(size), mode="constant")
                    for one in (np.where(good, values, 0.0), good.astype(float)))
    return np.where(count > 0.5, total / np.maximum(count, 1.0), np.nan)


def windows_about(time: np.ndarray, centre: np.ndarray, half: np.ndarray) -> Windows:
    """Lay a window about a time of every beam, cut at the record's ends."""
    # time (T,) [s]; centre, half (B,) [s]
    rate = 1 / (time[1] - time[0])
    begin = np.clip(np.floor((centre - half - time[0]) * rate), 0, len(time) - 2).astype(np.int64)
    end = np.clip(np.ceil((centre + half - time[0]) * rate) + 1, begin + 2, len(time)).astype(np.int64)
    return Windows(begin=begin, end=end, start=np.concatenate([[0], np.cumsum(end - begin)[:-1]]))
