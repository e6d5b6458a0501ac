"""Motion of the ship in the terms of file formats: positions on Earth, true headings, heave, velocities and rates.

    draught = mean depth of the reference point over the line        heave = draught - depth      (positive upwards)
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .assembly import POSE
from .lines import LineToWrite
from .motion import smoothed

WINDOW = 2.0                               # [s] between the knots of the track whose derivative is the speed


@dataclass(frozen=True, kw_only=True, eq=False)
class LinePassage:
    """Samples of the motion sensors, each an array (M,)."""

    time: np.ndarray  # [s]: since 1970
    latitude: np.ndarray  # [degrees]
    longitude: np.ndarray  # [degrees]
    depth: np.ndarray  # [m]: of the reference point
    roll: np.ndarray  # [rad]
    pitch: np.ndarray  # [rad]
    heading: np.ndarray  # [rad]: from true north
    heave: np.ndarray  # [m]: upwards
    velocity: np.ndarray  # (M, 3) [m/s]: north, east, down
    draught: float  # [m]

    def rate(self, values: np.ndarray) -> np.ndarray:
        """Return the time derivative of samples (M, ...)."""
        return np.gradient(values, self.time, axis=0) if self.time.size > 1 else np.zeros_like(values)

    def way(self, since: float) -> tuple[float, float]:
        """Return course [rad] and speed [m/s] over ground at a time [s since 1970]."""
        north, east = (np.interp(since, self.time, component) for component in self.velocity.T[:2])
        return float(np.arctan2(east, north) % (2 * np.pi)), float(np.hypot(north, east))


def passage_of(line: LineToWrite) -> LinePassage:
    """Return the passage of a line from 1970 on, since formats cannot hold earlier times."""
    early = line.start + line.array("motion_time") < 0
    kept = ~early if not early.all() else np.arange(early.size) == early.size - 1
    time, x, y, depth, roll, pitch, heading = (line.array(f"motion_{name}")[kept] for name in POSE)
    latitude, longitude, convergence = line.frame.on_globe(np.stack([x, y], -1))
    turn = np.cos(convergence), np.sin(convergence)
    north, east = y * turn[0] - x * turn[1], x * turn[0] + y * turn[1]
    draught = float(line.array("motion_depth").mean())
    velocity = np.zeros((time.size, 3))
    if time.size > 1:                  # differences of noisy positions would exaggerate the speed
        velocity[:, :2] = smoothed(time, np.stack([north, east], -1), WINDOW).derivative()(time)
        velocity[:, 2] = np.gradient(depth, time)
    return LinePassage(time=np.maximum(line.start + time, 0.0), latitude=latitude, longitude=longitude, depth=depth,
                       roll=roll, pitch=pitch, heading=heading + convergence, heave=draught - depth,
                       velocity=velocity, draught=draught)
