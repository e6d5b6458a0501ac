"""A comparison: a case with rows of computed and expected numbers, and panels of curves.

A row holds if |got - expected| is at most what is allowed; its ``share`` is the error over that.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class Compared:
    """Hold one number that was computed, and the number it should be."""

    label: str
    got: float  # [unit]
    expected: float  # [unit]
    allowed: float  # [unit]: the largest error, either way, that passes
    unit: str  # "-" for pure numbers

    @property
    def error(self) -> float:
        """Got minus expected [unit]."""
        return self.got - self.expected

    @property
    def share(self) -> float:
        """The error over what is allowed [-]; infinite where nothing was got."""
        return abs(self.error) / self.allowed if np.isfinite(self.error) else np.inf

    @property
    def holds(self) -> bool:
        """Tell whether the error is within what is allowed."""
        return self.share <= 1


@dataclass(frozen=True)
class Curve:
    """Hold a curve of a panel; ``style`` is "-" for what is expected and "." for what was got."""

    label: str
    x: npt.ArrayLike
    y: npt.ArrayLike
    style: str = "-"


@dataclass(frozen=True)
class Panel:
    """Hold a set of axes: their words, their lines, and whether x or y is logarithmic ("x", "y", "xy" or "")."""

    title: str
    x_label: str
    y_label: str
    lines: tuple[Curve, ...]
    logarithmic: str = ""


@dataclass(frozen=True)
class Table:
    """Hold the result of a case: rows, panels that show them (at least one of each), and notes on what is missing."""

    rows: tuple[Compared, ...]
    panels: tuple[Panel, ...]
    notes: tuple[str, ...] = ()

    @property
    def holds(self) -> bool:
        """Tell whether every row holds."""
        return all(row.holds for row in self.rows)

    @property
    def share(self) -> float:
        """The largest error over what is allowed [-]."""
        return max(row.share for row in self.rows)


@dataclass(frozen=True, kw_only=True)
class Case:
    """Hold a comparison."""

    title: str  # what is compared, in a line
    text: str  # geometry, equation, source, and why that much error is allowed
    run: Callable[[bool], Table]  # with ``quick`` fewer rays, angles or sediments


def root_of(function: Callable[[float], float], low: float, high: float) -> float:
    """Return the place between two others at which a function passes through 0."""
    from scipy.optimize import brentq

    return float(cast(float, brentq(function, low, high)))


def worst(label: str, got: npt.ArrayLike, expected: npt.ArrayLike, allowed: float, unit: str) -> Compared:
    """Make the row of the number that errs most among arrays of them, told with how many they are."""
    # got, expected [unit]; allowed [unit]
    got, expected = (np.ravel(one) for one in np.broadcast_arrays(np.asarray(got, float), expected))
    error = np.abs(got - expected)
    k = int(np.argmax(np.where(np.isfinite(error), error, np.inf)))
    return Compared(f"{label} (worst of {got.size})" if got.size > 1 else label, float(got[k]), float(expected[k]),
                    allowed,
               unit)
