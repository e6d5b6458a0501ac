"""Random directions of points of the water for beams of a receiving array, each with its solid angle.

Rays that are drawn from the beams of single elements are too few for the narrow beams of a line, in which the water
would consist of a few strong points. About the array's longest axis b, with u the sine along it and φ the angle around
it, dΩ = du dφ, and directions are drawn with

    density(φ | u) ~ B(u, φ) W(u, φ)           density(u) ~ max √B(u, φ) over φ

B -> two-way intensity of the elements within limits, W -> share of the ranges at which a direction is in the water:
cells of range and sine then have similarly many points near and far. The solid angle of a direction is the reciprocal
of its density, so levels are unbiased for every choice of density. Directions are numbered by u: within a cell, their
angles and distances are even (`volume.plane_lattice`).
"""
from __future__ import annotations

from collections.abc import Callable

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, held, opaque_vector, upload
from mitsonar.device.chance import pair, stratified, uniform
from mitsonar.scene.tracing.launch import draw, quantiles

from .volume import plane_lattice

STRIPS = 32                        # of u, with a density of φ each
AROUND = 720                       # cells of φ in the table of B
FAINTEST, FULL = 1e-3, 0.25        # shares of the maximum of B, between which the weight of a direction grows
LEAST_WATER = 0.05                 # W, least that the density follows
LEAST_THROUGHOUT = 0.25            # share of directions in the water at all ranges that more of them make up for
MOST = 1 << 21                     # directions of a ping, unless more are asked for


class FanRays:
    """Random directions for beams of a line."""
    # axis, normal (3,); window: nearest and farthest range [m]; number of points at each range, `least` of a ping

    def __init__(self, axis: np.ndarray, normal: np.ndarray, *, window: tuple[float, float], number: float, least: int):
        ahead = normal - (normal @ axis) * axis
        if np.linalg.norm(ahead) < 1e-3:           # elements look along the array, or all around: any will do
            ahead = np.cross(axis, np.roll(np.eye(3)[np.abs(axis).argmax()], 1))
        self._frame = np.stack([axis, ahead := ahead / np.linalg.norm(ahead), np.cross(axis, ahead)])
        self._window, self._number, self._least = window, number, least

    def draw(self, rotation: np.ndarray, above: float, below: float, pattern: Callable | None,
             key: int) -> tuple[mi.Vector3f, mi.Float, mi.Float]:
        """Draw the directions of a ping with so much water `above` and `below` the sonar; see `directions`."""
        # rotation (3, 3); above, below [m]; pattern, two-way intensity of directions at a rotation
        frame = self._frame @ rotation.T
        u, turns = (np.linspace(-end, end, count + 1) for end, count in ((1, STRIPS), (np.pi, AROUND)))
        along, angle = (0.5 * (edges[1:] + edges[:-1]) for edges in (u, turns))
        around = np.cos(angle)[:, None] * frame[1] + np.sin(angle)[:, None] * frame[2]
        sight = along[:, None, None] * frame[0] + np.sqrt(1 - along ** 2)[:, None, None] * around
        beam = np.ones(sight.shape[:2]) if pattern is None else pattern(sight, rotation)
        beam = np.clip(beam / max(beam.max(), 1e-30), FAINTEST, FULL)
        (near, far), rise = self._window, sight[..., 2]
        room = np.where(rise > 0, above, below) / np.maximum(np.abs(rise), 1e-6)
        density = beam * np.clip((room - near) / (far - near), LEAST_WATER, 1)
        throughout = np.sum(density, where=room >= far) / np.sum(density)
        number = max(self._least, round(min(self._number / max(throughout, LEAST_THROUGHOUT), MOST)))
        return directions(frame, quantiles(u, np.sqrt(beam.max(1))[None])[0], quantiles(turns, density), number, key,
                          around_slow=False)


def directions(frame: np.ndarray, along: np.ndarray, around: np.ndarray, number: int, key: int, *,
               around_slow: bool) -> tuple[mi.Vector3f, mi.Float, mi.Float]:
    """Draw directions about an axis from quantile tables of u, and of φ in equal strips of u.

    Their numbers follow φ if it is `around_slow`, u otherwise; the other and the places are even in any run of numbers.
    """
    # frame: axis, φ = 0 and φ = π/2, unit vectors (3, 3); along (CELLS + 1,) [-]; around (S, CELLS + 1) [rad]
    # -> unit vectors (R,), solid angles (R,) [sr], places (R,) in the window of distances
    lib, index = arrays_of(mi.Float), dr.arange(mi.UInt32, number)
    count, row_key = dr.opaque(mi.UInt32, number), dr.opaque(mi.UInt32, key)
    slow = stratified(lib, index, uniform(lib, pair(index, row_key)[0]), count)
    fast, place = plane_lattice(index, row_key)
    first_table, second_table = (upload(mi.Float, table.astype(np.float32).ravel()) for table in (along, around))
    u, width, _ = draw(first_table, mi.UInt32(0), fast if around_slow else slow)
    strip = mi.UInt32(held((u + 1) * dr.opaque(mi.Float, 0.5 * len(around)), 0.0,
                           dr.opaque(mi.Float, len(around) - 0.5)))
    angle, span, _ = draw(second_table, strip, slow if around_slow else fast)
    level = dr.sqrt(dr.maximum(1 - u * u, 0))
    sine_of, cosine_of = dr.sincos(angle)
    b, n, e = (opaque_vector(mi.Vector3f, vector) for vector in frame)
    direction = u * b + level * (cosine_of * n + sine_of * e)
    return direction, width * span / mi.Float(count), place
