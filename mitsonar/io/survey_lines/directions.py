"""Beam directions from the angles at the transmit and the receive array.

    l = (u a_t + v a_r) + w n      n = a_t x a_r / |a_t x a_r|      a_t·l = sin(transmit_angle)      a_r·l = sin(angle)

with a_t along the transmit array (forward), a_r along the receive array (starboard) and n down. With k = a_t·a_r:
u = (sin t - k sin r)/(1 - k^2), v = (sin r - k sin t)/(1 - k^2), w = sqrt(1 - |u a_t + v a_r|^2). The turn of the ship
during the travel time, about 0.1 degrees, is neglected: angles from the vertical in files are of one attitude a ping.
"""
from __future__ import annotations

import numpy as np

from mitsonar.device.rotations import mounting_matrix

from .lines import LineToWrite, Ping


def array_axes(line: LineToWrite, head: int | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return unit vectors (3,) along the transmit array and a head's receive array, body frame."""
    receive = line.receivers[1][head or 0]
    return mounting_matrix(*line.array("transmit_mounting"))[:, 0], mounting_matrix(*receive)[:, 1]


def level(line: LineToWrite, ping: Ping) -> np.ndarray:
    """Return the unit vectors (B, 3) of a ping's beams: forward, starboard, down of the levelled ship."""
    along, across = array_axes(line, int(ping["head"]) if "head" in ping else None)
    skew = float(along @ across)
    sent, received = np.sin(ping["transmit_angle"])[:, None], np.sin(ping["angle"])[:, None]
    flat = ((sent - skew * received) * along + (received - skew * sent) * across) / (1 - skew**2)
    down = np.cross(along, across) / np.sqrt(1 - skew**2)
    away = flat + np.sqrt(np.maximum(1 - np.sum(flat**2, axis=1, keepdims=True), 0)) * down
    return away @ mounting_matrix(float(ping["ping_roll"]), float(ping["ping_pitch"])).T


def from_vertical(line: LineToWrite, ping: Ping, angle: np.ndarray) -> np.ndarray:
    """Return receive beam angles from the vertical, positive to port, for angles [rad] relative to the array."""
    _, across = array_axes(line, int(ping["head"]) if "head" in ping else None)
    tilt = np.arcsin((mounting_matrix(float(ping["ping_roll"]), float(ping["ping_pitch"])) @ across)[2])
    return tilt - angle
