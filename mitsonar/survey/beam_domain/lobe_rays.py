"""Random directions of points of the water in the lobe of a transmitting line, each with its solid angle.

Few rays that are drawn from the beams of single elements lie in the narrow lobe of a long line, so that the water would
consist of a few strong points. About the line's axis b, with u the sine along it and φ the angle around it,
dΩ = du dφ, and directions are drawn with

    density(u) = (1 - w) |F(u - u_0)|² / ∫ + w / 2          density(φ) ~ √B(u_0, φ) |ds/dφ|

F -> far-field sum (`patterns`), u_0 -> sine to which the line is steered, B -> two-way intensity of the elements within
limits, s -> sine along the receiving line: its cells have equally many points wherever B is large. The solid angle of a
direction is the reciprocal of its density, so levels are unbiased for every choice of density. Directions are numbered
by φ: within a cell, their sines and distances are even (`bounces.volume.plane_lattice`).
"""
from __future__ import annotations

from collections.abc import Callable

import mitsuba as mi
import numpy as np

from mitsonar.echoes.bounces.fan_rays import AROUND, FAINTEST, MOST, directions
from mitsonar.scene.tracing.launch import quantiles
from mitsonar.sonar.arrays.array_factor import array_factor

WIDE_SHARE = 0.1                   # w
FULL = 0.04                        # share of the maximum of B, up to which the weight of a direction grows
LEAST_TURN = 0.1                   # |ds/dφ|, least that the density follows
FINER = 8                          # cells of u in a main lobe


class LobeRays:
    """Random directions in the lobe of a line."""
    # axis, normal, line (3,), of the receiving line; place (E,) [wavelengths]; weight (E,) [-]; per_sine [-],
    # directions per sine along the receiving line

    def __init__(self, axis: np.ndarray, normal: np.ndarray, *, place: np.ndarray, weight: np.ndarray,
                 pattern: Callable, line: np.ndarray, per_sine: float):
        across = normal - (normal @ axis) * axis
        self.axis, self._ahead = axis, across / np.linalg.norm(across)
        self._pattern, self._line, self._per_sine = pattern, line, float(per_sine)
        cell = 1 / (FINER * max(float(np.ptp(place)), 1.0))
        self._gap = np.linspace(-2, 2, 2 * int(np.ceil(2 / cell)) + 1)
        self._lobe = np.abs(array_factor(place, weight, first=-2, step=4 / (len(self._gap) - 1),
                                         count=len(self._gap))) ** 2
        self._edges = np.linspace(-1, 1, int(np.ceil(2 / cell)) + 1)

    def draw(self, rotation: np.ndarray, sine: float, key: int) -> tuple[mi.Vector3f, mi.Float, mi.Float]:
        """Draw the directions of a ping, for a line steered to a sine; see `directions`."""
        # rotation (3, 3)
        axis, ahead = rotation @ self.axis, rotation @ self._ahead
        aside = np.cross(axis, ahead)
        turns = np.linspace(-np.pi, np.pi, AROUND + 1)
        middle = 0.5 * (turns[1:] + turns[:-1])[:, None]
        level = np.sqrt(max(1 - sine ** 2, 0))
        sight = sine * axis + level * (np.cos(middle) * ahead + np.sin(middle) * aside)
        turn = level * np.abs((np.cos(middle) * aside - np.sin(middle) * ahead) @ (rotation @ self._line))
        beam = self._pattern(sight, rotation)
        beam = np.sqrt(np.clip(beam / max(beam.max(), 1e-30), FAINTEST, FULL))
        wanted = beam / np.sqrt(FULL) * np.maximum(turn, LEAST_TURN)
        second = quantiles(turns, wanted[None])[0]
        u = 0.5 * (self._edges[1:] + self._edges[:-1])
        lobe = np.interp(u - sine, self._gap, self._lobe)
        lobe /= max(float(np.sum(lobe * np.diff(self._edges))), 1e-30)
        first = quantiles(self._edges, ((1 - WIDE_SHARE) * lobe + WIDE_SHARE / 2)[None])[0]
        wanted = min(self._per_sine * float(np.sum(wanted)) * 2 * np.pi / AROUND / (1 - WIDE_SHARE), MOST)
        return directions(np.stack([axis, ahead, aside]), first, second[None], round(wanted), key, around_slow=True)
