"""Random directions of points of the water in the lobe of a transmitting line, each with its solid angle.

Few rays that are drawn from the beams of single elements lie in the narrow lobe of a long line, so that the water would
consist of a few strong points. About the line's axis b, with u the sine along it and φ the angle around it,
dΩ = du dφ, and directions are drawn with

    density(u) = (1 - w) |F(u - u_0)|² / ∫ + w / 2          density(φ) ~ √B(u_0, φ) |ds/dφ|

F -> far-field sum (`patterns`), u_0 -> sine to which the line is steered, B -> two-way intensity of the elements within
limits, s -> sine along the receiving line: its cells have equally many points wherever B is large. The solid angle of a
direction is the reciprocal of its density, so levels are unbiased for every choice of density. Directions are numbered
strip by strip of φ: their distances are even within a cell (`bounces.volume.lattice`).
"""
from __future__ import annotations

from collections.abc import Callable

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, opaque_vector, upload
from mitsonar.device.chance import pair, stratified, uniform
from mitsonar.scene.tracing.launch import CELLS, draw, quantiles

WIDE_SHARE = 0.1                   # w
FAINTEST, FULL = 1e-3, 0.04        # shares of the maximum of B, between which the weight of a direction grows
LEAST_TURN = 0.1                   # |ds/dφ|, least that the density follows
ALONG = 64                         # strata of u
AROUND = 720                       # cells of φ in the table of B
FINER = 8                          # cells of u in a main lobe
MOST = 1 << 21                     # largest number of directions of a ping


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
        parts = np.array_split(self._gap, -(-len(self._gap) // 1024))
        self._lobe = np.concatenate([np.abs(np.exp(2j * np.pi * np.multiply.outer(part, place)) @ weight) ** 2
                                     for part in parts])
        self._edges = np.linspace(-1, 1, int(np.ceil(2 / cell)) + 1)

    def draw(self, rotation: np.ndarray, sine: float, key: int) -> tuple[mi.Vector3f, mi.Float]:
        """Draw the directions of a ping, for a line steered to a sine."""
        # rotation (3, 3) -> unit vectors (R,), solid angles (R,) [sr]
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
        lib, rows = arrays_of(mi.Float), max(4, round(wanted / ALONG))
        index = dr.arange(mi.UInt32, ALONG * rows)
        i, j = index % ALONG, index // ALONG
        x, y = pair(index, dr.opaque(mi.UInt32, key))
        tables = (upload(mi.Float, table.astype(np.float32)) for table in (first, second))
        (along, width, _), (angle, span, _) = (
            draw(table, mi.UInt32(0), stratified(lib, stratum, uniform(lib, share), dr.opaque(mi.UInt32, count)), CELLS)
            for table, stratum, share, count in zip(tables, (i, j), (x, y), (ALONG, rows)))
        level = dr.sqrt(dr.maximum(1 - along * along, 0))
        sine_of, cosine_of = dr.sincos(angle)
        b, n, e = (opaque_vector(mi.Vector3f, vector) for vector in (axis, ahead, aside))
        direction = along * b + level * (cosine_of * n + sine_of * e)
        return direction, width * span / dr.opaque(mi.Float, ALONG * rows)
