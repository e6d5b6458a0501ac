"""Turns of several things that share a sequence: exactly in their shares, in random order, without an end.

Turn j of a thing of share w lies at a random place of the interval from (j - 1) / w to j / w, and all turns follow in
the order of places. Hence a thing has exactly n w of the first n turns wherever all n w are whole, and is at most a few
turns from that elsewhere; longer sequences begin with the shorter ones. With the middles of the intervals, this is
Webster's method of apportionment (Balinski and Young, 1982, Fair Representation).
"""
from collections.abc import Sequence

import numpy as np

from ..values import random_bits

FEWEST = 1 << 10                   # turns that are made at once, so that few are made anew


class SharedTurns:
    """Endless sequence of turns."""

    def __init__(self, shares: Sequence[float], *salt: object, all_first: bool = False):
        total = sum(shares)
        self._shares, self._salt, self._all_first = [share / total for share in shares], salt, all_first
        self._which = self._number = np.empty(0, np.int64)

    def __getitem__(self, turn: int) -> tuple[int, int]:
        """Return which thing has a turn, and how many it had before."""
        if turn >= len(self._which):
            self._make(max(turn + 1, FEWEST, 2 * len(self._which)))
        return int(self._which[turn]), int(self._number[turn])

    def which(self, count: int) -> np.ndarray:
        """Return which things have the first turns (count,)."""
        if count > len(self._which):
            self._make(count)
        return self._which[:count]

    def counts(self, count: int) -> list[int]:
        """Return how many of the first turns each thing has."""
        return np.bincount(self.which(count), minlength=len(self._shares)).tolist()

    def _make(self, count):
        places, which, number = [], [], []
        for thing, share in enumerate(self._shares):
            turns = np.arange(int((count + len(self._shares) + 1) * share) + 2)
            place = (turns + _fractions(len(turns), random_bits(*self._salt, thing))) / share
            if self._all_first:                        # everybody has a turn before anybody has a second
                place[0] = thing - len(self._shares)
            places.append(place)
            which.append(np.full(len(turns), thing, np.int32))
            number.append(turns)
        order = np.argsort(np.concatenate(places), kind="stable")[:count]
        self._which, self._number = np.concatenate(which)[order], np.concatenate(number)[order]


def _fractions(count, bits):
    """Return that many random numbers above 0 and below 1; more of them begin with the same ones."""
    words = np.random.Philox(key=bits & (1 << 128) - 1).random_raw(count)
    return ((words >> np.uint64(13)).astype(np.float64) + 0.5) / (1 << 51)
