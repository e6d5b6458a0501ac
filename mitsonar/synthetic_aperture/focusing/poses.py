"""Place and attitude of the body and of its elements at any time: a recorded trajectory joined by cubic splines.

    P(t) = X(t) + R(t) a,        two-way delay to T:  c τ = |T - P_t(t)| + |T - P_r(t + τ)|

X, R -> ``motion_x`` ... ``motion_heading`` of the record, a -> ``lever`` (body frame). Here z is up, 0 at the surface.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy.interpolate import CubicSpline

from mitsonar.device.rotations import rotation_matrix

MOTION = ("motion_x", "motion_y", "motion_depth", "motion_roll", "motion_pitch", "motion_heading")
TURNS = 4                          # of the fixed point: the receiver moves by 1e-3 of the path of sound
FARTHEST = 1e8                     # [m] and [rad] that a trajectory may hold; more comes from a broken file
UP = np.array([1.0, 1.0, -1.0])    # between depth, positive down, and z, positive up


@dataclass(frozen=True, kw_only=True)
class Poses:
    """A trajectory as a function of time."""

    spline: CubicSpline  # of ``MOTION``, (..., 6)
    first: float  # [s], start of the trajectory
    last: float  # [s], its end

    def position(self, time: np.ndarray) -> np.ndarray:
        """Return the places of the body's origin, (..., 3) [m], z up."""
        return self.spline(time)[..., :3] * UP

    def rotation(self, time: np.ndarray) -> np.ndarray:
        """Return the rotations from body to scene, (..., 3, 3)."""
        return rotation_matrix(*np.moveaxis(self.spline(time)[..., 3:], -1, 0))

    def heading(self, time: np.ndarray) -> np.ndarray:
        """Return the heading (...) [rad]."""
        return self.spline(time)[..., 5]

    def place(self, time: np.ndarray, lever: np.ndarray) -> np.ndarray:
        """Return the places of an element, (..., 3) [m], z up; `lever` (..., 3) in the body frame."""
        pose = self.spline(time)
        turned = rotation_matrix(*np.moveaxis(pose[..., 3:], -1, 0)) @ lever[..., None]
        return pose[..., :3] * UP + turned[..., 0]


def poses_of(trajectory: xr.Dataset) -> Poses:
    """Return the trajectory of raw echoes, or of a dataset of ``motion_time`` and the other motion_* alone."""
    missing = [name for name in ("motion_time", *MOTION) if name not in trajectory.variables]
    if missing:
        raise ValueError(f"the trajectory lacks {', '.join(missing)}; give raw echoes or a dataset of motion_time, "
                         f"{', '.join(MOTION)}")
    time = np.asarray(trajectory["motion_time"].values, float)
    values = np.stack([np.asarray(trajectory[name].values, float) for name in MOTION], -1)
    if time.ndim != 1 or len(time) < 2 or not np.all(np.isfinite(time)) or np.any(np.diff(time) <= 0):
        raise ValueError("motion_time must hold two or more finite times that increase; sort or repair it")
    for name, column in zip(MOTION, values.T, strict=True):
        if not np.all(np.isfinite(column)):
            raise ValueError(f"{name} holds numbers that are not finite; repair the trajectory")
        if np.abs(column).max() > FARTHEST:
            raise ValueError(f"{name} reaches {np.abs(column).max():.3g}, beyond {FARTHEST:g}; repair the trajectory")
    return Poses(spline=CubicSpline(time, values), first=float(time[0]), last=float(time[-1]))


def two_way_delay(poses: Poses,
                  sent: np.ndarray,                             # (...) [s]
                  tx_lever: np.ndarray, rx_lever: np.ndarray,   # (..., 3) [m], body frame
                  target: np.ndarray,                           # (..., 3) [m], z up
                  sound_speed: float) -> np.ndarray:
    """Return two-way delays (...) [s] along straight lines, to the receiver's place at the arrival of the echo."""
    out = np.linalg.norm(target - poses.place(sent, tx_lever), axis=-1)
    delay = 2 * out / sound_speed
    for _ in range(TURNS):
        delay = (out + np.linalg.norm(target - poses.place(sent + delay, rx_lever), axis=-1)) / sound_speed
    return delay
