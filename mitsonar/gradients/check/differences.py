"""Differences of a record along a direction, at steps that suit it.

    D(h) = [f(-2h) - 8 f(-h) + 8 f(h) - f(2h)] / 12h = f' - h⁴ f⁽⁵⁾ / 30 + ...

f -> weighted sums of the record, h -> the step. A large step bends, a small one drowns in rounding, and shadows or
edges leave no step that is good. So the step is halved from a large one on, and the one taken is that at which D(h) and
D(h/2) agree best. No gradient takes part in the choice.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

HALVINGS = 14
AGREED = 1e-5                      # that no smaller step is tried for
BENT = 0.3                         # change of a record, as a share of its size, of which the step is too large
STILL = 1e-6                       # change of weighted sums, as a share, below which rounding is all there is
FIRST = {"1 and m": 0.05, "dB/m": 0.01, "m": 0.05, "m/s": 2.0, "rad": 0.02, "dB": 1.0, "s": 1e-4, "degC": 0.5}
SHARE = 0.1                        # of a parameter's size: the first step where its unit tells none


@dataclass(frozen=True, kw_only=True)
class Difference:
    """Slopes of weighted sums of a record along one direction."""

    coarse: np.ndarray  # (W,): D(h) and D(h/2)
    fine: np.ndarray  # (W,): D(h) and D(h/2)
    moved: float  # how far the sums moved from -2h to 2h, as a share of their size
    bent: float  # how far the record moved by 2h, as a share of its size

    @property
    def best(self) -> np.ndarray:
        """Their mean: what one of them is off, it halves at least."""
        return 0.5 * (self.coarse + self.fine)

    @property
    def disagreement(self) -> float:
        """How far the two steps differ, as a share."""
        size = np.linalg.norm(self.fine)
        return float(np.linalg.norm(self.coarse - self.fine) / size) if size > 0 else 0.0


class Line:
    """A record along one direction."""
    # base (N,); weights (W, N)

    def __init__(self, record: Callable[[float], np.ndarray], base: np.ndarray, weights: np.ndarray):
        self._record, self._weights = record, weights
        self._used = np.any(weights != 0, axis=0)
        self._base = np.where(self._used, base, 0.0)
        size = np.abs(weights) @ np.abs(self._base)
        self.size = np.where(size > 0, size, 1.0)                      # of the weighted sums, (W,)
        self._found: dict[float, tuple[np.ndarray, float]] = {}

    def sums(self, distance: float) -> np.ndarray:
        """Return the weighted sums at a distance, (W,)."""
        return self._at(distance)[0]

    def bent(self, distance: float) -> float:
        """Return how far the record there is from that at 0, as a share of its size."""
        return self._at(distance)[1]

    def _at(self, distance):
        if distance not in self._found:
            record = np.where(self._used, self._record(distance), 0.0)
            size = np.linalg.norm(self._base)
            change = np.linalg.norm(record - self._base) / size if size > 0 else 0.0
            self._found[distance] = self._weights @ record, float(change)
        return self._found[distance]


def first_step(start: np.ndarray, unit: str) -> float:
    """Return the largest step to try, of a parameter of this unit and these values."""
    size = float(np.abs(start).max(initial=0.0))
    if unit in FIRST:
        return FIRST[unit]
    return SHARE * size if size > 0 else SHARE


def difference_at(line: Line, step: float) -> Difference:
    """Return the differences at a step and at half of it."""
    moved = np.abs(line.sums(2 * step) - line.sums(-2 * step)) / line.size
    return Difference(coarse=_central(line, step), fine=_central(line, step / 2), moved=float(moved.max(initial=0.0)),
                      bent=max(line.bent(2 * step), line.bent(-2 * step)))


def settled_step(line: Line, first: float) -> float:
    """Return the step whose differences agree best with those of half of it."""
    best, found, refused = None, np.inf, None
    for step in (first * 0.5 ** np.arange(HALVINGS)).tolist():
        try:
            difference = difference_at(line, step)
        except ValueError as error:                                    # moved to where no record can be made
            refused = error
            continue
        disagreement = difference.disagreement + (1.0 if difference.bent > BENT else 0.0)
        if best is None or disagreement < found:                       # NaN is never smaller
            best, found = step, disagreement
        if found < AGREED or difference.moved < STILL:
            break
    if best is None:
        raise ValueError(f"no record can be made beside the start: {refused}")
    return best


def _central(line, step):
    return (line.sums(-2 * step) - 8 * line.sums(-step) + 8 * line.sums(step) - line.sums(2 * step)) / (12 * step)
