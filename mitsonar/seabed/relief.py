"""Shapes of the seabed as heights over a horizontal grid, and sums of them.

    height(x, y) = sum of parts;   u = x sin(heading) + y cos(heading)
    plane       -tan(slope) u
    sinusoid    (height / 2) cos(2 pi u / wavelength)

x -> ``x`` [m, east], y -> ``y`` [m, north], heading clockwise from north. Every part stands in absolute coordinates:
what it gives at a place does not depend on how far the grid reaches. Sand ripples are in `ripples`, the rough surface
of a power law in `fractal`.
"""
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np


class Relief(ABC):
    """Something that has a height everywhere; parts are summed by ``+``."""

    @abstractmethod
    def on_grid(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the heights over a regular grid.

        Parameters
        ----------
        x, y : array (X,), (Y,) [m]
            Coordinates of the columns and rows, increasing by a constant step.

        Returns
        -------
        float64 array (Y, X) [m]
            Heights about the mean bed, z up.
        """

    def __add__(self, other: "Relief") -> "Sum":
        return Sum((*_parts(self), *_parts(other)))


@dataclass(frozen=True)
class Sum(Relief):
    """Add the heights of several parts."""

    parts: tuple[Relief, ...]

    def on_grid(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the summed heights (Y, X) [m]."""
        heights = np.zeros((len(y), len(x)))
        for part in self.parts:
            heights += part.on_grid(x, y)
        return heights


@dataclass(frozen=True, kw_only=True)
class Plane(Relief):
    """A plane through the origin, level by default.

    Parameters
    ----------
    slope : float [rad]
        Angle below the horizon, 0 to less than pi/2.
    heading : float [rad]
        Compass heading in which the plane descends.
    """

    slope: float = 0.0
    heading: float = 0.0

    def __post_init__(self):
        check("plane", "slope", self.slope, 0 <= self.slope < np.pi / 2, "from 0 to less than pi/2 rad")

    def on_grid(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the heights (Y, X) [m] of the plane."""
        return -np.tan(self.slope) * along(self.heading, x, y)


@dataclass(frozen=True, kw_only=True)
class Sinusoid(Relief):
    """Long-crested sinusoidal waves, with a crest at the origin where ``phase`` is 0.

    Parameters
    ----------
    wavelength : float [m]
    height : float [m]
        From trough to crest.
    heading : float [rad]
        Compass heading at right angles to the crests.
    phase : float [rad]
    """

    wavelength: float
    height: float
    heading: float = 0.0
    phase: float = 0.0

    def __post_init__(self):
        check("sinusoid", "wavelength", self.wavelength, 0 < self.wavelength < np.inf, "a finite number [m] above 0")
        check("sinusoid", "height", self.height, 0 <= self.height < np.inf, "a finite number [m], at least 0")

    def on_grid(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the heights (Y, X) [m] of the waves."""
        return self.height / 2 * np.cos(2 * np.pi / self.wavelength * along(self.heading, x, y) + self.phase)


def along(heading: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the distance [m] of grid points (Y, X) from the origin in the compass direction ``heading`` [rad]."""
    return np.asarray(x) * np.sin(heading) + np.asarray(y)[:, None] * np.cos(heading)


def step(name: str, coordinates: np.ndarray) -> float:
    """Return the constant step [m] of grid coordinates; raise `ValueError` if they do not increase by one."""
    steps = np.diff(coordinates)
    if steps.size == 0 or not steps[0] > 0 or np.ptp(steps) > 1e-6 * steps[0] + 1e-12 * np.abs(coordinates).max():
        raise ValueError(f"relief: the grid coordinates {name} must be two or more, increasing by a constant step.")
    return (coordinates[-1] - coordinates[0]) / steps.size


def check(kind: str, name: str, value: object, holds: bool, expected: str) -> None:
    """Raise `ValueError` unless a record's number holds what it must."""
    if not holds:
        raise ValueError(f"{kind}: {name} is {value}; it must be {expected}.")


def _parts(relief: Relief) -> tuple[Relief, ...]:
    return relief.parts if isinstance(relief, Sum) else (relief,)
