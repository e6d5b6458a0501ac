"""Where the body is, and how it is held, while the echoes of a ping come in.

    place C(t), attitude R(t):   cubic splines through the record's trajectory; polynomials in time over a ping's window

The window runs over the delays that a ping's record holds; the polynomial's degree is the least that errs by less than
`ENOUGH`, found once for a strip. Axes are x east, y north, depth down; R takes the body's axes forward, starboard, down
to them.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.polynomial import chebyshev, polynomial
from scipy.interpolate import CubicSpline

from mitsonar.sonar.motion.track import rotation_matrix

NAMES = "x", "y", "depth", "roll", "pitch", "heading"
ENOUGH = 1e-8                      # [m], and of a rotation's entries
MOST = 12                          # powers
PROBES = 48                        # windows that the degree is found with
FARTHEST = 1e8                     # [m] and [rad] that a trajectory may hold: no numbers of a sound file
DOWN = np.array([1.0, 1.0, -1.0])


@dataclass(frozen=True, kw_only=True, eq=False)
class Moving:
    """A point of the body over a window of time."""

    middle: float  # [s]: of the window, after the transmission
    half: float  # [s]: of the window, after the transmission
    place: np.ndarray  # (3,) [m]: in the middle
    rotation: np.ndarray  # (3, 3): in the middle
    velocity: np.ndarray  # (3,) [m/s]: in the middle
    coefficients: np.ndarray  # of the changes of place (3) and rotation (9) in powers of (t - middle) / half


class ApertureMotion:
    """The trajectory of a record."""

    def __init__(self, record: xr.Dataset):
        for name in ("time", *NAMES):
            if f"motion_{name}" not in record.variables:
                raise ValueError(f"the trajectory has no variable motion_{name}; give motion_time and motion_"
                                 f"{', motion_'.join(NAMES)}, as raw echoes have them")
        time = np.asarray(record["motion_time"].values, float)
        values = np.stack([np.asarray(record[f"motion_{name}"].values, float) for name in NAMES], -1)
        if time.ndim != 1 or len(time) < 4 or not np.all(np.isfinite(time)) or np.any(np.diff(time) <= 0):
            raise ValueError("motion_time must hold four or more finite times that increase; sort or repair it")
        bad = np.flatnonzero(~np.isfinite(values).all(0))
        if len(bad):
            raise ValueError(f"motion_{NAMES[bad[0]]} holds numbers that are not finite; repair the trajectory")
        most = np.abs(values).max(0)
        if np.any(most > FARTHEST):
            name = NAMES[int(np.argmax(most > FARTHEST))]
            raise ValueError(f"motion_{name} reaches {most.max():.3g}, beyond {FARTHEST:g}; repair the trajectory")
        self.first, self.last = float(time[0]), float(time[-1])
        self._spline = CubicSpline(time, values)
        self._slope = self._spline.derivative()

    def check_covers(self, first: float, last: float) -> None:
        """Refuse times [s] beyond the trajectory; raises `ValueError`."""
        if first < self.first - 1e-9 or last > self.last + 1e-9:
            raise ValueError(f"pings are heard from {first:g} to {last:g} s, and the trajectory runs from "
                             f"{self.first:g} to {self.last:g} s; give one that covers them")

    def place(self, times: np.ndarray) -> np.ndarray:
        """Return places (..., 3) [m] at times (...) [s]: x, y, depth."""
        return self._spline(times)[..., :3]

    def velocity(self, times: np.ndarray) -> np.ndarray:
        """Return velocities (..., 3) [m/s] at times (...) [s]."""
        return self._slope(times)[..., :3]

    def rotation(self, times: np.ndarray) -> np.ndarray:
        """Return rotations (..., 3, 3) at times (...) [s]."""
        return rotation_matrix(*np.moveaxis(self._spline(times)[..., 3:], -1, 0)) * DOWN[:, None]

    def of_point(self, times: np.ndarray, point: np.ndarray) -> np.ndarray:
        """Return places (..., 3) [m] of a point (3,) of the body at times (...) [s]."""
        return self.place(times) + self.rotation(times) @ point

    def moving(self, start: float, window: tuple[float, float], point: np.ndarray, degree: int) -> Moving:
        """Return how a point (3,) of the body moves over a window [s] after `start` [s]."""
        middle, half = 0.5 * (window[0] + window[1]), max(0.5 * (window[1] - window[0]), 1e-6)
        nodes = np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
        times = start + middle + half * np.append(nodes, 0.0)
        place, rotation = self.of_point(times, point), self.rotation(times)
        values = np.concatenate([place - place[-1], (rotation - rotation[-1]).reshape(-1, 9)], -1)[:-1]
        fitted = chebyshev.chebfit(nodes, values, degree)
        powers = np.zeros((degree + 1, 12))
        for k in range(12):
            found = chebyshev.cheb2poly(fitted[:, k])
            powers[:len(found), k] = found
        slope = self.of_point(start + middle + np.array([-1e-4, 1e-4]), point)
        return Moving(middle=middle, half=half, place=place[-1], rotation=rotation[-1],
                      velocity=(slope[1] - slope[0]) / 2e-4, coefficients=powers)

    def degree(self, window: tuple[float, float], point: np.ndarray) -> int:
        """Return the least degree that errs by less than `ENOUGH` over windows anywhere on the way."""
        last = max(self.last - window[1], self.first)
        probes = np.linspace(-1, 1, 21)
        needed = 1
        for start in np.linspace(self.first, last, PROBES):
            while needed < MOST:
                found = self.moving(start, window, point, needed)
                times = start + found.middle + found.half * probes
                wanted = np.concatenate([self.of_point(times, point) - found.place,
                                         (self.rotation(times) - found.rotation).reshape(-1, 9)], -1)
                if np.abs(polynomial.polyval(probes, found.coefficients).T - wanted).max() < ENOUGH:
                    break
                needed += 1
        return needed
