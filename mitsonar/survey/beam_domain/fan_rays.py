"""Random directions of points of the water for beams of a receiving line, each with its solid angle.

Rays that are drawn from the beams of single elements are too few for the narrow beams of a line, in which the water
would consist of a few strong points. About the line's axis b, with u the sine along it and φ the angle around it,
dΩ = du dφ, and directions are drawn with

    density(φ | u) ~ B(u, φ) W(u, φ)           density(u) ~ max √B(u, φ) over φ

B -> two-way intensity of the elements within limits, W -> share of the ranges at which a direction is in the water:
cells of range and sine then have similarly many points near and far. The solid angle of a direction is the reciprocal
of its density, so levels are unbiased for every choice of density. Directions are numbered by u: within a cell, their
angles and distances are even (`bounces.volume.plane_lattice`).
"""
from __future__ import annotations

from collections.abc import Callable

import mitsuba as mi
import numpy as np

from mitsonar.scene.tracing.launch import quantiles

from .lobe_rays import AROUND, FAINTEST, MOST, directions

STRIPS = 32                        # of u, with a density of φ each
FULL = 0.25                        # share of the maximum of B above which the weight of a direction is the same
LEAST_WATER = 0.05                 # W, least that the density follows
LEAST_THROUGHOUT = 0.25            # share of directions in the water at all ranges that more of them make up for


class FanRays:
    """Random directions for beams of a line."""
    # axis, normal (3,); window: nearest and farthest range [m]; number of points of a ping at each range

    def __init__(self, axis: np.ndarray, normal: np.ndarray, *, pattern: Callable, window: tuple[float, float],
                 number: float):
        ahead = normal - (normal @ axis) * axis
        self._frame = np.stack([axis, ahead := ahead / np.linalg.norm(ahead), np.cross(axis, ahead)])
        self._pattern, self._window, self._number = pattern, window, number

    def draw(self, rotation: np.ndarray, above: float, below: float,
             key: int) -> tuple[mi.Vector3f, mi.Float, mi.Float]:
        """Draw the directions of a ping with so much water `above` and `below` the sonar; see `directions`."""
        # rotation (3, 3); above, below [m]
        frame = self._frame @ rotation.T
        u, turns = (np.linspace(-end, end, count + 1) for end, count in ((1, STRIPS), (np.pi, AROUND)))
        along, angle = (0.5 * (edges[1:] + edges[:-1]) for edges in (u, turns))
        around = np.cos(angle)[:, None] * frame[1] + np.sin(angle)[:, None] * frame[2]
        sight = along[:, None, None] * frame[0] + np.sqrt(1 - along ** 2)[:, None, None] * around
        beam = self._pattern(sight, rotation)
        beam = np.clip(beam / max(beam.max(), 1e-30), FAINTEST, FULL)
        (near, far), rise = self._window, sight[..., 2]
        room = np.where(rise > 0, above, below) / np.maximum(np.abs(rise), 1e-6)
        density = beam * np.clip((room - near) / (far - near), LEAST_WATER, 1)
        throughout = np.sum(density, where=room >= far) / np.sum(density)
        number = min(self._number / max(throughout, LEAST_THROUGHOUT), MOST)
        return directions((frame[0], frame[1], frame[2]), quantiles(u, np.sqrt(beam.max(1))[None])[0],
                          quantiles(turns, density), round(number), key, around_slow=False)
