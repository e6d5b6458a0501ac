"""Records of a comparison: rows of computed and expected numbers, and panels of curves.

A row holds if |got - expected| <= allowed; its ``share`` is the error over the allowed error.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class Compared:
    """Computed and expected value of one number."""

    label: str
    got: float  # [unit]
    expected: float  # [unit]
    allowed: float  # [unit]: largest error of either sign
    unit: str  # "-" for pure numbers

    @property
    def error(self) -> float:
        """Return got minus expected [unit]."""
        return self.got - self.expected

    @property
    def share(self) -> float:
        """Return the error over the allowed error [-], infinite if the computed number is not finite."""
        return abs(self.error) / self.allowed if np.isfinite(self.error) else np.inf

    @property
    def holds(self) -> bool:
        """Return True if the error is at most the allowed error."""
        return self.share <= 1


@dataclass(frozen=True)
class Curve:
    """Curve of a panel; ``style`` is "-" for expected and "." for computed values."""

    label: str
    x: npt.ArrayLike
    y: npt.ArrayLike
    style: str = "-"


@dataclass(frozen=True)
class Panel:
    """Axes of a picture: labels, lines, and the logarithmic axes ("x", "y", "xy" or "")."""

    title: str
    x_label: str
    y_label: str
    lines: tuple[Curve, ...]
    logarithmic: str = ""


@dataclass(frozen=True)
class Table:
    """Result of a case: rows, panels that show them (at least one of each), and notes on left-out comparisons."""

    rows: tuple[Compared, ...]
    panels: tuple[Panel, ...]
    notes: tuple[str, ...] = ()

    @property
    def holds(self) -> bool:
        """Return True if every row holds."""
        return all(row.holds for row in self.rows)

    @property
    def share(self) -> float:
        """Return the largest error over the allowed error [-]."""
        return max(row.share for row in self.rows)


@dataclass(frozen=True, kw_only=True)
class Case:
    """Comparison."""

    title: str  # subject, in one line
    text: str  # geometry, equation, source, and reason for the allowed error
    run: Callable[[bool], Table]  # with ``quick`` fewer rays, angles or sediments


def root_of(function: Callable[[float], float], low: float, high: float) -> float:
    """Return the zero of a function between `low` and `high`."""
    from scipy.optimize import brentq

    return float(cast(float, brentq(function, low, high)))


def worst(label: str, got: npt.ArrayLike, expected: npt.ArrayLike, allowed: float, unit: str) -> Compared:
    """Return the row of the number with the largest error in arrays; its label says how many numbers there are."""
    # got, expected [unit]; allowed [unit]
    got, expected = (np.ravel(values) for values in np.broadcast_arrays(np.asarray(got, float), expected))
    error = np.abs(got - expected)
    k = int(np.argmax(np.where(np.isfinite(error), error, np.inf)))
    return Compared(f"{label} (worst of {got.size})" if got.size > 1 else label, float(got[k]), float(expected[k]),
                    allowed, unit)
