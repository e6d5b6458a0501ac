"""Shapes of the seabed as heights over a horizontal grid, and their sums.

    height(x, y) = sum of parts;   u = x sin(heading) + y cos(heading)
    plane       -tan(slope) u
    sinusoid    (height / 2) cos(2 pi u / wavelength)

x -> ``x`` [m, east], y -> ``y`` [m, north], heading clockwise from north. Every part uses absolute coordinates:
its height at a point does not depend on the extent of the grid. Sand ripples are in `ripples`, power-law roughness in
`fractal`.
"""
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np


class Relief(ABC):
    """Relief with a height at every point; ``+`` sums reliefs."""

    @abstractmethod
    def on_grid(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the heights (Y, X) [m], z up, over the columns x and rows y of an even grid [m]."""

    def __add__(self, other: "Relief") -> "Sum":
        return Sum((*_parts(self), *_parts(other)))


@dataclass(frozen=True)
class Sum(Relief):
    """Sum of several reliefs."""

    parts: tuple[Relief, ...]

    def on_grid(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        heights = np.zeros((len(y), len(x)))
        for part in self.parts:
            heights += part.on_grid(x, y)
        return heights


@dataclass(frozen=True, kw_only=True)
class Plane(Relief):
    """Plane through the origin, level by default."""

    slope: float = 0.0  # [rad]: angle below the horizon, 0 to less than pi/2
    heading: float = 0.0  # [rad]: compass heading in which the plane descends

    def __post_init__(self):
        check("plane", "slope", self.slope, 0 <= self.slope < np.pi / 2, "from 0 to less than pi/2 rad")

    def on_grid(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return -np.tan(self.slope) * along(self.heading, x, y)


@dataclass(frozen=True, kw_only=True)
class Sinusoid(Relief):
    """Long-crested sinusoidal waves; with ``phase`` 0, a crest is at the origin."""

    wavelength: float  # [m]
    height: float  # [m]: from trough to crest
    heading: float = 0.0  # [rad]: compass heading normal to the crests
    phase: float = 0.0  # [rad]: at the origin

    def __post_init__(self):
        check("sinusoid", "wavelength", self.wavelength, 0 < self.wavelength < np.inf, "a finite number [m] above 0")
        check("sinusoid", "height", self.height, 0 <= self.height < np.inf, "a finite number [m], at least 0")

    def on_grid(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.height / 2 * np.cos(2 * np.pi / self.wavelength * along(self.heading, x, y) + self.phase)


def along(heading: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the distance [m] of grid points (Y, X) from the origin along the compass heading [rad]."""
    return np.asarray(x) * np.sin(heading) + np.asarray(y)[:, None] * np.cos(heading)


def step(name: str, coordinates: np.ndarray) -> float:
    """Return the constant step [m] of grid coordinates; `ValueError` if the step varies."""
    steps = np.diff(coordinates)
    if steps.size == 0 or not steps[0] > 0 or np.ptp(steps) > 1e-6 * steps[0] + 1e-12 * np.abs(coordinates).max():
        raise ValueError(f"relief: the grid coordinates {name} must be two or more, increasing by a constant step.")
    return (coordinates[-1] - coordinates[0]) / steps.size


def check(kind: str, name: str, value: object, holds: bool, expected: str) -> None:
    """Raise `ValueError` unless a condition on a value holds."""
    if not holds:
        raise ValueError(f"{kind}: {name} is {value}; it must be {expected}.")


def _parts(relief: Relief) -> tuple[Relief, ...]:
    return relief.parts if isinstance(relief, Sum) else (relief,)
