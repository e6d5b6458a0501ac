"""Position and attitude of a platform at any time, from the samples of its motion sensors.

A vector of the body (x forward, y starboard, z down) in the scene (x east, y north, depth down) is `mounted` of
`device.rotations`, with north and east exchanged. Cubic splines join the samples of position and angles. Such a spline
errs by 5/384 d⁴ times the fourth derivative for samples d apart: for a roll of 5 degrees in 6 s by 1.4e-11 rad at 100
Hz and 1.4e-7 rad at 10 Hz, where straight lines err by 1.2e-6 and 1.2e-4 rad. Before the first and after the last
sample, motion continues at constant rates.
"""
from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from mitsonar.device.rotations import mounted
from mitsonar.device.types import Real
from mitsonar.sonar.motion.trajectory import SmoothCurve

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, kw_only=True, eq=False)
class PlatformPose:
    """Position and attitude of a platform.

    Attributes
    ----------
    place : array (..., 3) [m]
        East, north, depth of the reference point.
    roll, pitch, heading : array (...) [rad]
    """

    place: np.ndarray
    roll: np.ndarray
    pitch: np.ndarray
    heading: np.ndarray

    def turned(self, vector: np.ndarray) -> np.ndarray:
        """Return a vector (..., 3) of the body frame in the scene frame: (..., 3)."""
        return turned(vector, self.roll, self.pitch, self.heading)

    def carried(self, offset: np.ndarray) -> np.ndarray:
        """Return the place (..., 3) [m] of a point mounted at `offset` (3,) [m] from the reference point."""
        return self.place + self.turned(offset)


def turned(vector: np.ndarray, roll: Real, pitch: Real, heading: Real) -> np.ndarray:
    """Return vectors (..., 3) of a frame at roll, pitch and heading [rad] in east, north, down (..., 3)."""
    return mounted(vector, roll, pitch, heading)[..., [1, 0, 2]]


@dataclass(frozen=True, kw_only=True, eq=False)
class PlatformMotion:
    """Samples of the motion sensors.

    Parameters
    ----------
    time : array (M,) [s]
        Increasing times.
    x, y, depth : array (M,) [m]
        Reference point: east, north, below the still surface.
    roll, pitch, heading : array (M,) [rad]
        Starboard down, bow up, clockwise from north; the heading may continue past a full turn, or wrap.

    Raises
    ------
    ValueError
        If the arrays differ in length, are empty, have values that are not finite, or times do not increase.
    """

    time: np.ndarray
    x: np.ndarray
    y: np.ndarray
    depth: np.ndarray
    roll: np.ndarray
    pitch: np.ndarray
    heading: np.ndarray

    def __post_init__(self):
        for one in fields(self):
            values = np.atleast_1d(np.asarray(getattr(self, one.name), float))
            object.__setattr__(self, one.name, values)
            if values.shape != self.time.shape or values.ndim != 1 or not values.size:
                raise ValueError(f"motion: {one.name} has the shape {values.shape}; give one number for each of the "
                                 f"{self.time.size} times, and at least one time.")
            bad = np.flatnonzero(~np.isfinite(values))
            if bad.size:
                raise ValueError(f"motion: {one.name}[{bad[0]}] is {values[bad[0]]}; leave out samples that are not "
                                 "finite numbers.")
        back = np.flatnonzero(np.diff(self.time) <= 0)
        if back.size:
            raise ValueError(f"motion: time[{back[0] + 1}] = {self.time[back[0] + 1]:.9g} s does not follow "
                             f"{self.time[back[0]]:.9g} s; sort the samples and drop repeated times.")

    @classmethod
    def of(cls, soundings: xr.Dataset) -> PlatformMotion:
        """Return the motion of a line of soundings."""
        return cls(**{one.name: soundings[f"motion_{one.name}"].values for one in fields(cls)})

    def at(self, time: np.ndarray) -> PlatformPose:
        """Return the pose at times (...) [s]; NaN where the time is NaN."""
        values = self._curve.at(np.asarray(time, float))
        return PlatformPose(place=values[..., :3], roll=values[..., 3], pitch=values[..., 4], heading=values[..., 5])

    @cached_property
    def _curve(self) -> SmoothCurve:
        """Return the curve, which is made once, as a line uses it for every ping."""
        return SmoothCurve(self.time, np.stack([self.x, self.y, self.depth, self.roll, self.pitch,
                                                np.unwrap(self.heading)], -1))
