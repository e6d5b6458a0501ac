"""Position and attitude of a vessel at any time of the line, from the records of its sensors.

Positions are those of the reference point: the antenna's position less its lever arm. Samples are interpolated
linearly. Before the first and after the last sample, positions continue straight for a few seconds and attitudes stay.
"""
from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from mitsonar.device.earth import Frame

from .places import across_and_along, from_sensor, levelled

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

DEEPEST = 1e3                      # [m] of an array on a vessel
ANGLES = ("roll", "pitch", "heading")
CLEARLY = 0.5                      # share of the other rule's residual, below which a rule is chosen
BEYOND = 5.0                       # [s] that a course is continued without a position
STIFFNESS = 1e-6                   # of splines where there are no samples, relative to that of samples


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionSamples:
    """Motion of a vessel in the frame of its line, in the UTM zone (UPS beyond 84 degrees) of its first position."""

    frame: Frame
    convergence: float  # [rad]: from true to grid north at the first position, clockwise
    streams: dict[str, np.ndarray]  # (M,): time, x, y, depth, roll, pitch, heading
    fixes: np.ndarray  # (P, 3) [s], [m], [m]: time, x and y of the position sensor
    antenna: np.ndarray  # (3,) [m]: its lever arm

    def at(self, time: float) -> dict[str, float]:
        """Return time, x, y, depth, roll, pitch and heading at a time [s] of the line."""
        streams = self.streams
        values = {name: float(np.interp(time, streams["time"], values)) for name, values in streams.items()}
        if not streams["time"][0] <= time <= streams["time"][-1]:          # positions may go on without attitudes
            x, y = _carried(np.array([time]), self.fixes, self.antenna, *(np.array([values[name]]) for name in ANGLES))
            values |= {"x": float(x[0]), "y": float(y[0])}
        return values | {"time": float(time)}

    def sunk(self, time: np.ndarray,       # (P,) [s] of the pings
             depth: np.ndarray,            # (P,) [m] of the transmit array
             offset: np.ndarray,           # (3,) [m] of the transmit array
             ) -> MotionSamples:
        """Return the motion corrected so that the transmit array has the depths stated with the soundings."""
        streams = self.streams
        known = np.flatnonzero(np.isfinite(depth) & (np.abs(depth) < DEEPEST))
        known = known[np.unique(time[known], return_index=True)[1]]
        if not known.size:
            return self
        time, depth = time[known], depth[known]
        arm = levelled(offset, streams["roll"], streams["pitch"])[:, 2]
        ways = (streams["depth"], streams["depth"] + offset[2] - arm)          # heave is the ship's, or the array's
        off = [depth - np.interp(time, streams["time"], way + arm) for way in ways]
        best = int(np.std(off[1]) < CLEARLY * np.std(off[0]))
        return replace(self, streams=streams | {"depth": ways[best] + np.interp(streams["time"], time, off[best])})


def motion_of(attitude: np.ndarray,        # (M, 5): time [s], roll, pitch, heading [rad], heave [m, down]
              positions: np.ndarray,       # (P, 3): time [s], longitude, latitude [degrees]
              start: float, *,             # [s] of time 0
              waterline: float,            # [m] of the still surface below the reference point
              mounting: np.ndarray | None = None,          # (3,) [rad] of the attitude sensor
              antenna: np.ndarray | None = None,           # (3,) [m], its lever arm
              ) -> MotionSamples:
    """Return the motion of the reference point from the samples of the sensors; times of samples are since 1970."""
    positions = positions[(np.abs(positions[:, 2]) <= 90) & (np.abs(positions[:, 1]) <= 360)]
    positions = positions[np.unique(positions[:, 0], return_index=True)[1]] if len(positions) else positions
    if not len(positions):
        raise ValueError("it has no position of the vessel.")
    longitude, latitude = positions[:, 1], positions[:, 2]
    frame = Frame.in_zone(latitude[0], longitude[0])
    convergence = float(frame.convergence(latitude[0], longitude[0]))
    fixes = np.column_stack([positions[:, 0], frame.places(latitude, longitude)])
    return motion_in(frame, attitude, fixes, start, waterline=waterline, convergence=convergence, mounting=mounting,
                     antenna=antenna)


def motion_in(frame: Frame,
              attitude: np.ndarray,        # as `motion_of`
              fixes: np.ndarray,           # (P, 3): time [s], x, y [m] in the frame
              start: float, *,
              waterline: float, convergence: float = 0.0,
              mounting: np.ndarray | None = None, antenna: np.ndarray | None = None) -> MotionSamples:
    """Return the motion of the reference point from positions in a frame; other arguments are those of `motion_of`."""
    attitude = attitude[np.unique(attitude[:, 0], return_index=True)[1]] if len(attitude) else attitude
    attitude = attitude[np.isfinite(attitude).all(1)]
    if not len(attitude):
        attitude = np.column_stack([fixes[:, 0], np.zeros((len(fixes), 4))])
    roll, pitch, heading = from_sensor(attitude[:, 1], attitude[:, 2], attitude[:, 3],
                                       np.zeros(3) if mounting is None else mounting)
    time, heading = attitude[:, 0] - start, np.unwrap(heading - convergence)
    fixes, antenna = fixes - [start, 0.0, 0.0], np.zeros(3) if antenna is None else antenna
    x, y = _carried(time, fixes, antenna, roll, pitch, heading)
    return MotionSamples(frame=frame, convergence=convergence, fixes=fixes, antenna=antenna, streams={
        "time": time, "x": x, "y": y, "roll": roll, "pitch": pitch, "heading": heading,
        "depth": attitude[:, 4] - waterline})


def _carried(time, fixes, antenna, roll, pitch, heading):
    """Return x and y (T,) of the reference point at times, from positions of the antenna."""
    x, y = _followed(time, fixes[:, 0], fixes[:, 1:]).T
    arm = levelled(antenna, roll, pitch)
    return across_and_along(x, y, heading, -arm[:, 1], -arm[:, 0])


def _followed(time, times, places):
    """Return places (T, 2) at times; the track continues straight for a few seconds at either end."""
    values = np.column_stack([np.interp(time, times, places[:, axis]) for axis in (0, 1)])
    if times.size > 1:
        for near, end in ((1, 0), (-2, -1)):
            velocity = (places[end] - places[near]) / (times[end] - times[near])
            past = time - times[end]
            past = np.clip(past, -BEYOND, 0) if end == 0 else np.clip(past, 0, BEYOND)
            values += past[:, None] * velocity
    return values


def smoothed(time: np.ndarray,             # (N,) [s], increasing
             values: np.ndarray,           # (N, C)
             step: float,                  # [s] between knots
             until: float | None = None,   # [s], end of the spline where it is later than the last sample
             ) -> BSpline:
    """Return the least-squares cubic spline through samples, with a knot every ``step``.

    Records of motion have steps, of their last digit and of the sensor's own rate, which a spline through every sample
    would follow. This spline removes changes faster than two knots. Between samples far apart it is nearly straight.
    """
    from scipy.interpolate import BSpline
    from scipy.sparse import csr_array, diags_array
    from scipy.sparse.linalg import spsolve

    end = time[-1] if until is None else max(time[-1], until)
    count = max(int(np.ceil((end - time[0]) / step)), 1)
    step = (end - time[0]) / count
    knots = time[0] + step * np.arange(-3, count + 4)
    knots[count + 3] = end                             # exactly, without the rounding of the sum
    sums = csr_array(BSpline.design_matrix(time, knots, 3))
    bends = diags_array([1.0, -2.0, 1.0], offsets=[0, 1, 2], shape=(count + 1, count + 3))
    normal = sums.T @ sums + STIFFNESS * max(time.size / count, 1.0) * (bends.T @ bends)
    coefficients = spsolve(normal.tocsc(), sums.T @ values)
    return BSpline(knots, np.reshape(coefficients, (count + 3, -1)), 3)
