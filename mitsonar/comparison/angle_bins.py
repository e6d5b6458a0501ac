"""Bins of the angle from the vertical that two lines share, and statistics in them."""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import stats

from mitsonar.units import deg_from_radians

WIDTHS = 2.0, 5.0, 10.0            # [deg]: the first that gives most bins enough values
FEWEST = 5                         # values of a bin


@dataclass(frozen=True, kw_only=True, eq=False)
class AngleBins:
    """Bins of equal width over the real line's swath."""

    edges: np.ndarray  # (B + 1,) [rad]

    @classmethod
    def of(cls, angle: np.ndarray) -> AngleBins:
        """Return the bins that cover angles (N,) [rad]."""
        known = deg_from_radians(angle[np.isfinite(angle)])
        for width in WIDTHS:
            edges = width * np.arange(np.floor(known.min() / width), np.floor(known.max() / width) + 2)
            count = np.histogram(known, edges)[0]
            if np.median(count[count > 0]) >= FEWEST:
                break
        return cls(edges=np.radians(edges))

    @property
    def middle(self) -> np.ndarray:
        """Return the middles (B,) [rad]."""
        return 0.5 * (self.edges[1:] + self.edges[:-1])

    def count(self, angle: np.ndarray) -> np.ndarray:
        """Return the number of values in each bin."""
        return np.histogram(angle[np.isfinite(angle)], self.edges)[0]

    def over(self, angle: np.ndarray, values: np.ndarray, statistic: str | Callable = "median",
             fewest: int = FEWEST) -> np.ndarray:
        """Return a statistic (B,) of finite values in bins; NaN in bins of fewer than ``fewest``."""
        known = np.isfinite(values) & np.isfinite(angle)
        if not known.any():
            return np.full(self.edges.size - 1, np.nan)
        found = stats.binned_statistic(angle[known], values[known], statistic, self.edges)[0]
        return np.where(self.count(angle[known]) >= fewest, found, np.nan)


def spread(values: np.ndarray) -> float:
    """Return the standard deviation of a Gaussian with the values' median absolute deviation."""
    return float(stats.median_abs_deviation(values, scale="normal")) if values.size else np.nan


def root_mean_square(values: np.ndarray) -> float:
    """Return the root of the mean square of finite values; NaN without any."""
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known ** 2))) if known.size else np.nan
