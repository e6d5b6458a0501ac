"""Motion of the ship in the terms of file formats: positions on Earth, true headings, heave, velocities and rates.

    draught = mean depth of the reference point over the line, below the surface at the first ping
    heave = draught - depth - water level above the datum      (positive upwards)
"""
from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .assembly import POSE
from .lines import LineToWrite, Ping
from .motion import smoothed

WINDOW = 2.0                               # [s] between the knots of the track whose derivative is the speed
KEPT = 30.0                                # [s] of pings, back from the last one, whose water level is kept


@dataclass(frozen=True, kw_only=True, eq=False)
class LinePassage:
    """Samples of the motion sensors, each an array (M,)."""

    time: np.ndarray  # [s]: since 1970
    latitude: np.ndarray  # [degrees]
    longitude: np.ndarray  # [degrees]
    depth: np.ndarray  # [m]: of the reference point, below the datum
    roll: np.ndarray  # [rad]
    pitch: np.ndarray  # [rad]
    heading: np.ndarray  # [rad]: from true north
    velocity: np.ndarray  # (M, 3) [m/s]: north, east, down
    draught: float  # [m]
    levels: list[tuple[float, float, float]] = field(default_factory=list)  # of the last pings, see `note`

    def note(self, ping: Ping) -> None:
        """Keep time [s since 1970], water level and height of the datum above the ellipsoid [m] at a ping."""
        height = float(ping.get("ping_height", np.nan)) + float(ping["ping_depth"])
        since = float(ping["since"])
        while len(self.levels) > 1 and self.levels[1][0] < since - KEPT:
            del self.levels[0]
        self.levels.append((since, ping["level"], height))

    def heave(self, part: int | slice) -> np.ndarray:
        """Return the heave [m] of samples between the last pings, upwards."""
        return self.draught - self.depth[part] - self._at(part, 1)

    def height(self, part: int | slice) -> np.ndarray:
        """Return heights [m] of the reference point above the ellipsoid likewise, NaN where they are unknown."""
        return self._at(part, 2) - self.depth[part]

    def _at(self, part, column):
        known = np.array(self.levels or [(0.0, 0.0, np.nan)])
        return np.interp(self.time[part], known[:, 0], known[:, column])

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
    if "tide" in line.first:
        draught += float(np.nan_to_num(line.first["tide"].values[0]))
    velocity = np.zeros((time.size, 3))
    if time.size > 1:                  # differences of noisy positions would exaggerate the speed
        velocity[:, :2] = smoothed(time, np.stack([north, east], -1), WINDOW).derivative()(time)
        velocity[:, 2] = np.gradient(depth, time)
    return LinePassage(time=np.maximum(line.start + time, 0.0), latitude=latitude, longitude=longitude, depth=depth,
                       roll=roll, pitch=pitch, heading=heading + convergence, velocity=velocity, draught=draught)
