"""Pull values to known classes, and classify the answer.

    p(x) = Σ_k share_k N(x; value_k, spread²),      P(k | x) ∝ share_k N(x; value_k, spread² + deviation²)

A step weighs by 1 / spread², which is above the curvature of -ln p everywhere (expectation and maximisation; Dempster,
Laird and Rubin, 1977), so that no step overshoots. The pull begins wide and narrows, so that the data choose the class.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .likelihood import Terms

NARROWING = 0.6                    # of the spread, an iteration


@dataclass(frozen=True, kw_only=True)
class Classes:
    """Classes that a parameter's numbers belong to.

    Parameters
    ----------
    values : tuple of float
        Value of each class in the parameter's unit; two at least.
    spread : float
        Deviation within a class.
    shares : tuple of float, optional
        Frequency of each class; default: all alike.

    Raises
    ------
    ValueError
        If there are fewer than two values, two are the same, or spread or shares are not above zero.
    """

    values: tuple[float, ...]
    spread: float
    shares: tuple[float, ...] | None = None

    def __post_init__(self):
        if len(self.values) < 2 or len(set(self.values)) < len(self.values) or not np.isfinite(self.values).all():
            raise ValueError(f"classes have the values {self.values}; give two or more different numbers")
        if not (np.isfinite(self.spread) and self.spread > 0):
            raise ValueError(f"the spread of classes is {self.spread:g}; give a number above zero")
        if self.shares is not None and (len(self.shares) != len(self.values) or not min(self.shares) > 0):
            raise ValueError(f"classes have {len(self.values)} values and the shares {self.shares}; give one above "
                             "zero for each")

    def spread_at(self, iteration: int) -> float:
        """Return the spread of the pull at an iteration: from the widest gap down to `spread`."""
        gap = float(np.diff(np.sort(self.values)).max())
        return max(self.spread, gap * NARROWING ** iteration)

    def terms(self, numbers: np.ndarray, spread: float) -> Terms:
        """Return -2 ln p of numbers (n,), with its slope and the weight of a step."""
        logs = self._logs(numbers, spread ** 2)
        most = logs.max(1)
        middle = self._probabilities(logs) @ np.array(self.values)
        deviance = -2 * (most + np.log(np.exp(logs - most[:, None]).sum(1)))
        return Terms(deviance=deviance, slope=(numbers - middle) / spread ** 2,
                     weight=np.full(numbers.shape, spread ** -2))

    def probabilities(self, numbers: np.ndarray, deviation: np.ndarray) -> np.ndarray:
        """Return the probability of each class, (n, K), for numbers with deviations (n,)."""
        return self._probabilities(self._logs(numbers, self.spread ** 2 + deviation[:, None] ** 2))

    def _logs(self, numbers: np.ndarray, variance: float | np.ndarray) -> np.ndarray:
        """Return logarithms of shares times densities, (n, K), without their common part."""
        shares = np.ones(len(self.values)) if self.shares is None else np.array(self.shares)
        apart = numbers[:, None] - np.array(self.values)
        return np.log(shares / shares.sum()) - 0.5 * apart ** 2 / variance

    @staticmethod
    def _probabilities(logs: np.ndarray) -> np.ndarray:
        odds = np.exp(logs - logs.max(1, keepdims=True))
        return odds / odds.sum(1, keepdims=True)
