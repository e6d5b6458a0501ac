"""Where elements are at any time: a recorded trajectory joined by cubic splines.

    P(t) = X(t) + R(t) a,        two-way delay to T:  c τ = |T - P_t(t)| + |T - P_r(t + τ)|

X, R -> ``motion_x`` ... ``motion_heading`` of the record, a -> ``lever`` (body frame). z is up here, 0 at the surface.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy.interpolate import CubicSpline

from mitsonar.sonar.motion.track import rotation_matrix

MOTION = ("motion_x", "motion_y", "motion_depth", "motion_roll", "motion_pitch", "motion_heading")
TURNS = 4                          # of the fixed point: the receiver moves by 1e-3 of the way of sound


@dataclass(frozen=True, kw_only=True)
class Poses:
    """A trajectory as a function of time."""

    spline: CubicSpline  # of ``MOTION``, (..., 6)
    first: float  # [s]: of what was recorded
    last: float  # [s]: of what was recorded

    def position(self, time: np.ndarray) -> np.ndarray:
        """Return where the body's origin is, (..., 3) [m], z up."""
        return self.spline(time)[..., :3] * np.array([1.0, 1.0, -1.0])

    def rotation(self, time: np.ndarray) -> np.ndarray:
        """Return the rotations from body to scene, (..., 3, 3)."""
        roll, pitch, heading = np.moveaxis(self.spline(time)[..., 3:], -1, 0)
        return rotation_matrix(roll, pitch, heading)

    def heading(self, time: np.ndarray) -> np.ndarray:
        """Return the heading (...) [rad]."""
        return self.spline(time)[..., 5]

    def place(self, time: np.ndarray, lever: np.ndarray) -> np.ndarray:
        """Return where an element is, (..., 3) [m], z up; `lever` (..., 3) in the body frame."""
        pose = self.spline(time)
        turned = rotation_matrix(*np.moveaxis(pose[..., 3:], -1, 0)) @ lever[..., None]
        return pose[..., :3] * np.array([1.0, 1.0, -1.0]) + turned[..., 0]


def poses_of(trajectory: xr.Dataset) -> Poses:
    """Take the trajectory out of raw echoes, or out of a dataset of ``motion_time`` and the other motion_* alone."""
    missing = [name for name in ("motion_time", *MOTION) if name not in trajectory.variables]
    if missing:
        raise ValueError(f"a trajectory was wanted, and {', '.join(missing)} are missing; give raw echoes or a dataset "
                         f"of motion_time, {', '.join(MOTION)}")
    time = np.asarray(trajectory["motion_time"].values, float)
    values = np.stack([np.asarray(trajectory[name].values, float) for name in MOTION], -1)
    if len(time) < 2 or not np.all(np.diff(time) > 0) or not np.isfinite(values).all():
        raise ValueError("a trajectory has two samples or more at increasing times, all of them finite; this one has "
                         f"{len(time)}")
    return Poses(spline=CubicSpline(time, values), first=float(time[0]), last=float(time[-1]))


def two_way_delay(poses: Poses, sent: np.ndarray, tx_lever: np.ndarray, rx_lever: np.ndarray, target: np.ndarray,
                  sound_speed: float) -> np.ndarray:
    """Return two-way delays (...) [s] along straight lines; the receiver is where it is when the echo comes in."""
    # sent (...) [s]; tx_lever, rx_lever (..., 3) [m]; target (..., 3) [m]; sound_speed [m/s]
    out = np.linalg.norm(target - poses.place(sent, tx_lever), axis=-1)
    delay = 2 * out / sound_speed
    for _ in range(TURNS):
        delay = (out + np.linalg.norm(target - poses.place(sent + delay, rx_lever), axis=-1)) / sound_speed
    return delay
