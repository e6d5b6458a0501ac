"""Place and attitude of the body while the echoes of a ping arrive.

    place C(t), attitude R(t):   cubic splines through the record's trajectory; polynomials in time over a ping's window

The window spans the delays of a ping's record. The polynomial has the least degree whose error is below `ENOUGH`, found
once for a strip. Axes are x east, y north, depth down; R turns the body's axes forward, starboard, down into them.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.polynomial import chebyshev, polynomial

from .poses import UP, poses_of

ENOUGH = 1e-8                      # [m], and of a rotation's entries
MOST = 12                          # powers
PROBES = 48                        # windows over which the degree is tested


@dataclass(frozen=True, kw_only=True, eq=False)
class Moving:
    """Motion of a point of the body over a window of time."""

    middle: float  # [s], of the window, after the transmission
    half: float  # [s], half the window's length
    place: np.ndarray  # (3,) [m], at the middle
    rotation: np.ndarray  # (3, 3), at the middle
    velocity: np.ndarray  # (3,) [m/s], at the middle
    coefficients: np.ndarray  # of the changes of place (3) and rotation (9) in powers of (t - middle) / half


class ApertureMotion:
    """Trajectory of a record, with depths positive down."""

    def __init__(self, record: xr.Dataset):
        self._poses = poses_of(record)
        self.first, self.last = self._poses.first, self._poses.last
        if record["motion_time"].size < 4:
            raise ValueError(f"the trajectory has {record['motion_time'].size} samples; focusing needs four or more")
        self._slope = self._poses.spline.derivative()

    def check_covers(self, first: float, last: float) -> None:
        """Refuse times [s] beyond the trajectory; raises `ValueError`."""
        if first < self.first - 1e-9 or last > self.last + 1e-9:
            raise ValueError(f"the pings are received from {first:g} to {last:g} s, and the trajectory runs from "
                             f"{self.first:g} to {self.last:g} s; give one that covers them")

    def place(self, times: np.ndarray) -> np.ndarray:
        """Return places (..., 3) [m] at times (...) [s]: x, y, depth."""
        return self._poses.spline(times)[..., :3]

    def velocity(self, times: np.ndarray) -> np.ndarray:
        """Return velocities (..., 3) [m/s] at times (...) [s]."""
        return self._slope(times)[..., :3]

    def rotation(self, times: np.ndarray) -> np.ndarray:
        """Return rotations (..., 3, 3) at times (...) [s]."""
        return self._poses.rotation(times) * UP[:, None]

    def of_point(self, times: np.ndarray, point: np.ndarray) -> np.ndarray:
        """Return places (..., 3) [m] of a point (3,) of the body at times (...) [s]."""
        return self.place(times) + self.rotation(times) @ point

    def moving(self, start: float, window: tuple[float, float], point: np.ndarray, degree: int) -> Moving:
        """Return the motion of a point (3,) of the body over a window [s] after `start` [s]."""
        middle, half = 0.5 * (window[0] + window[1]), max(0.5 * (window[1] - window[0]), 1e-6)
        nodes = np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
        times = start + middle + half * np.append(nodes, 0.0)
        place, rotation = self.of_point(times, point), self.rotation(times)
        values = np.concatenate([place - place[-1], (rotation - rotation[-1]).reshape(-1, 9)], -1)[:-1]
        fitted = chebyshev.chebfit(nodes, values, degree)
        powers = np.zeros((degree + 1, 12))
        for k in range(12):
            column = chebyshev.cheb2poly(fitted[:, k])
            powers[:len(column), k] = column
        slope = self.of_point(start + middle + np.array([-1e-4, 1e-4]), point)
        return Moving(middle=middle, half=half, place=place[-1], rotation=rotation[-1],
                      velocity=(slope[1] - slope[0]) / 2e-4, coefficients=powers)

    def degree(self, window: tuple[float, float], point: np.ndarray) -> int:
        """Return the least degree whose error is below `ENOUGH` over windows anywhere on the track."""
        last = max(self.last - window[1], self.first)
        probes = np.linspace(-1, 1, 21)
        needed = 1
        for start in np.linspace(self.first, last, PROBES):
            while needed < MOST:
                motion = self.moving(start, window, point, needed)
                times = start + motion.middle + motion.half * probes
                wanted = np.concatenate([self.of_point(times, point) - motion.place,
                                         (self.rotation(times) - motion.rotation).reshape(-1, 9)], -1)
                if np.abs(polynomial.polyval(probes, motion.coefficients).T - wanted).max() < ENOUGH:
                    break
                needed += 1
        return needed
