"""Random directions of points of the water in the lobe of a transmitting line, each with its solid angle.

Few rays that are drawn from the beams of single elements lie in the narrow lobe of a long line, so that the water would
consist of a few strong points. About the line's axis b, with u the sine along it and φ the angle around it,
dΩ = du dφ, and directions are drawn with

    density(u) = (1 - w) |F(u - u_0)|² / ∫ + w / 2          density(φ) ~ √B(u_0, φ)

F -> far-field sum (`patterns`), u_0 -> sine to which the line is steered, B -> two-way intensity of the elements.
The solid angle of a direction is the reciprocal of its density, so levels are unbiased for every choice of density.
"""
from __future__ import annotations

from collections.abc import Callable
from math import gcd

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, opaque_vector, upload
from mitsonar.device.chance import pair, stratified, uniform
from mitsonar.echoes.bounces.volume import GOLDEN
from mitsonar.scene.tracing.launch import CELLS, Strata, draw, quantiles

WIDE_SHARE = 0.1                   # w
FAINTEST = 1e-3                    # share of the maximum of B, least weight of a direction
ALONG = 80                         # strata of u, in whole tiles. They are consecutive, and 80 times the golden share is
                                   # far from simple fractions, so that distances do not cluster (`bounces.volume`)
AROUND = 720                       # cells of φ in the table of B
FINER = 8                          # cells of u in a main lobe
MOST = 1 << 21                     # largest number of directions of a ping


class LobeRays:
    """Random directions in the lobe of a line."""
    # axis, normal (3,); place (E,) [wavelengths]; weight (E,) [-]; around [1/rad], directions per angle φ

    def __init__(self, axis: np.ndarray, normal: np.ndarray, *, place: np.ndarray, weight: np.ndarray,
                 pattern: Callable, around: float):
        across = normal - (normal @ axis) * axis
        self.axis, self._ahead = axis, across / np.linalg.norm(across)
        self._pattern, self._per_radian = pattern, float(around)
        cell = 1 / (FINER * max(float(np.ptp(place)), 1.0))
        self._gap = np.linspace(-2, 2, 2 * int(np.ceil(2 / cell)) + 1)
        parts = np.array_split(self._gap, -(-len(self._gap) // 1024))
        self._lobe = np.concatenate([np.abs(np.exp(2j * np.pi * np.multiply.outer(part, place)) @ weight) ** 2
                                     for part in parts])
        self._edges = np.linspace(-1, 1, int(np.ceil(2 / cell)) + 1)

    def draw(self, rotation: np.ndarray, sine: float, key: int) -> tuple[mi.Vector3f, mi.Float, Strata]:
        """Draw the directions of a ping, for a line steered to a sine."""
        # rotation (3, 3) -> unit vectors (R,), solid angles (R,) [sr], strata
        axis, ahead = rotation @ self.axis, rotation @ self._ahead
        aside = np.cross(axis, ahead)
        turns = np.linspace(-np.pi, np.pi, AROUND + 1)
        middle = 0.5 * (turns[1:] + turns[:-1])[:, None]
        sight = sine * axis + np.sqrt(max(1 - sine ** 2, 0)) * (np.cos(middle) * ahead + np.sin(middle) * aside)
        beam = self._pattern(sight, rotation)
        beam = np.sqrt(np.maximum(beam / max(beam.max(), 1e-30), FAINTEST))
        second = quantiles(turns, beam[None])[0]
        u = 0.5 * (self._edges[1:] + self._edges[:-1])
        lobe = np.interp(u - sine, self._gap, self._lobe)
        lobe /= max(float(np.sum(lobe * np.diff(self._edges))), 1e-30)
        first = quantiles(self._edges, ((1 - WIDE_SHARE) * lobe + WIDE_SHARE / 2)[None])[0]
        wanted = min(self._per_radian * float(np.sum(beam)) * 2 * np.pi / AROUND / (1 - WIDE_SHARE), MOST)
        lib = arrays_of(mi.Float)
        strata = Strata(lib, 1, ALONG, _rows(wanted), tall=True)
        index = dr.arange(mi.UInt32, strata.rays)
        _, _, i, j = strata.split(index)
        x, y = pair(index, dr.opaque(mi.UInt32, key))
        tables = (upload(mi.Float, table.astype(np.float32)) for table in (first, second))
        (along, width, _), (angle, span, _) = (
            draw(table, mi.UInt32(0), stratified(lib, stratum, uniform(lib, share), dr.opaque(mi.UInt32, count)), CELLS)
            for table, stratum, share, count in zip(tables, (i, j), (x, y), strata.shape))
        level = dr.sqrt(dr.maximum(1 - along * along, 0))
        sine_of, cosine_of = dr.sincos(angle)
        b, n, e = (opaque_vector(mi.Vector3f, vector) for vector in (axis, ahead, aside))
        direction = along * b + level * (cosine_of * n + sine_of * e)
        return direction, width * span / dr.opaque(mi.Float, strata.rays), strata


def _rows(wanted: float) -> int:
    """Return the number of strata of φ for a number of directions.

    With it, `bounces.volume` spreads their distances by exactly the golden share: a share that must be changed to be
    coprime differs from it, and distances cluster.
    """
    rows = max(4, round(wanted / ALONG))
    while gcd(round(GOLDEN * ALONG * rows), ALONG * rows) > 1:
        rows += 1
    return rows
