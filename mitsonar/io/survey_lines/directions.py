"""Beam directions from the angles at the transmit and the receive array.

They are those of `sonar.arrays.cones`. The turn of the ship during the travel time, about 0.1 degrees, is neglected:
angles from the vertical in files are of one attitude a ping.
"""
from __future__ import annotations

import numpy as np

from mitsonar.device.rotations import mounting_matrix
from mitsonar.sonar.arrays.cones import cone_directions

from .lines import LineToWrite, Ping


def array_axes(line: LineToWrite, head: int | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return unit vectors (3,) along the transmit array and a head's receive array, body frame."""
    receive = line.receivers[1][head or 0]
    return mounting_matrix(*line.array("transmit_mounting"))[:, 0], mounting_matrix(*receive)[:, 1]


def level(line: LineToWrite, ping: Ping) -> np.ndarray:
    """Return the unit vectors (B, 3) of a ping's beams: forward, starboard, down of the levelled ship."""
    along, across = array_axes(line, int(ping["head"]) if "head" in ping else None)
    away = cone_directions(along, across, np.sin(ping["transmit_angle"]), np.sin(ping["angle"]), least=0.0)
    return away @ mounting_matrix(float(ping["ping_roll"]), float(ping["ping_pitch"])).T


def from_vertical(line: LineToWrite, ping: Ping, angle: np.ndarray) -> np.ndarray:
    """Return receive beam angles from the vertical, positive to port, for angles [rad] relative to the array."""
    _, across = array_axes(line, int(ping["head"]) if "head" in ping else None)
    tilt = np.arcsin((mounting_matrix(float(ping["ping_roll"]), float(ping["ping_pitch"])) @ across)[2])
    return tilt - angle
