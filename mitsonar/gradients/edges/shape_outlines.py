"""Draw points on the outlines of spheres, cylinders, disks and rectangles, as seen from each ping.

    n·d = 0                             n_o·A⁻¹d = 0 on the unit shape: where its side turns away
    z_o = 0 and 1, the rim of a disk, the sides of a rectangle: where the shape ends

d -> the direction in which a bent ray arrives there. Cylinders have no lids. On a sphere x_o = cos α e(φ) - sin α a,
with a from the sonar to the centre and e(φ) around it: tan α = e·A⁻¹d / a·A⁻¹d. On a cylinder
n_o = ±(-d_y, d_x, 0) / |d_xy| of A⁻¹d, at every z_o. d hardly depends on the point, so that a few iterations suffice.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import upload
from mitsonar.device.chance import Salt
from mitsonar.scene.tracing.tracer import Tracer
from mitsonar.survey.energy.rows import Rows
from mitsonar.survey.motion.places import Place

from ..attached.shapes import CYLINDER, DISK, RECTANGLE, SPHERE, AttachedShapes
from .sight import EdgeSight, drawn_pieces

PIECES = 64                        # of every line
TURNS = 4                          # by which points on outlines of sight are found
TOGETHER = 1 << 18                 # pieces of one kernel
APART = 1e-3                       # of a line: what its direction is taken between
CLEAR = 1 + 1e-4                   # times the shape's half-width: a sonar that is nearer sees no outline


@dataclass(frozen=True, kw_only=True)
class OutlinePoints:
    """Hold points on outlines, NumPy arrays (N,)."""

    ping: np.ndarray  # number within the block
    shape: np.ndarray  # registry index
    point: np.ndarray  # (N, 3) [m]
    along: np.ndarray  # (N, 3) [m]: direction of the line, times its length
    worth: np.ndarray  # share of a line that each stands for


@dataclass(frozen=True, kw_only=True)
class _Lines:
    """Hold lines of shapes: ``rim`` is -1 for an outline of sight, ``side`` selects one of a cylinder's two."""

    shape: np.ndarray
    kind: np.ndarray
    rim: np.ndarray
    side: np.ndarray
    matrix: np.ndarray                 # (L, 3, 4)

    def chosen(self, index: np.ndarray) -> _Lines:
        return _Lines(**{name: value[index] for name, value in vars(self).items()})


class OutlineSampler:
    """Draw points on outlines of shapes without facets, up to a reach [m]."""

    def __init__(self, shapes: AttachedShapes, numbers: Sequence[int], tracer: Tracer, rows: Rows, reach: float,
                 seed: int):
        self.tracer, self._seed, self._reach = tracer, seed, reach
        self._sight = EdgeSight(tracer, rows, reach)
        self._lines = _lines(shapes, numbers)
        self._size = np.linalg.norm(self._lines.matrix[:, :, :3], axis=(1, 2))

    def drawn(self, place: Place, count: int) -> OutlinePoints | None:
        """Draw `count` points for every ping of a place; return None where no outline is seen."""
        pings = max(1, TOGETHER // max(PIECES * len(self._size), 1))
        found = [self._of(place, np.arange(first, min(first + pings, len(place.ping))), count)
                 for first in range(0, len(place.ping), pings)]
        there = [one for one in found if one is not None]
        if not there:
            return None
        return OutlinePoints(**{name: np.concatenate([getattr(one, name) for one in there])
                                for name in ("ping", "shape", "point", "along", "worth")})

    def _of(self, place: Place, pings: np.ndarray, count: int) -> OutlinePoints | None:
        """Return points for some pings of a place."""
        origin = np.asarray(place.position, float)
        away = np.linalg.norm(self._lines.matrix[None, :, :, 3] - origin[pings, None], axis=-1)
        which, line = np.nonzero(away - self._size < self._reach)
        if not len(line):
            return None
        ping, line = np.repeat(pings[which], PIECES), np.repeat(line, PIECES)
        share = np.tile(np.arange(PIECES) / PIECES, len(which))
        ends = [self._points(place, ping, line, share + step) for step in (0.0, 1 / PIECES)]
        middle, along = (ends[0] + ends[1]) / 2, ends[1] - ends[0]
        seen = np.asarray(np.isfinite(middle).all(axis=1))
        middle, along = (_vectors(np.where(seen[:, None], one, 0)) for one in (middle, along))
        weight = self._sight.weight(place, upload(mi.UInt32, ping.astype(np.uint32)), middle, along).numpy()
        weight = np.where(seen, weight.astype(float), 0.0)
        chosen, worth = [], []
        for one in pings:
            own = np.nonzero(np.isin(ping, one))[0]
            if not weight[own].sum() > 0:
                continue
            piece, within, value = drawn_pieces(weight[own], count, int(place.ping[one]), self._seed, Salt.OUTLINES)
            chosen.append((own[piece], within))
            worth.append(value / PIECES)
        if not chosen:
            return None
        piece, within = (np.concatenate(one) for one in zip(*chosen))
        ping, line, share = ping[piece], line[piece], share[piece] + within / PIECES
        point, ahead, back = (self._points(place, ping, line, share + step) for step in (0.0, APART, -APART))
        return OutlinePoints(ping=ping.astype(np.uint32), shape=self._lines.shape[line].astype(np.uint32), point=point,
                             along=(ahead - back) / (2 * APART), worth=np.concatenate(worth))

    def _points(self, place: Place, ping: np.ndarray, line: np.ndarray, share: np.ndarray) -> np.ndarray:
        """Return points (N, 3) [m] at shares of lines; NaN where there is no outline."""
        lines = self._lines.chosen(line)
        matrix, inner = lines.matrix, np.linalg.inv(self._lines.matrix[:, :, :3])[line]
        origin = np.asarray(place.position, float)[ping]
        start = np.einsum("nik,nk->ni", inner, origin - matrix[:, :, 3])
        on_unit = _straight(lines, start, share)
        bent, numbers = lines.rim < 0, upload(mi.UInt32, ping.astype(np.uint32))
        for _ in range(TURNS if bent.any() else 0):
            there = np.einsum("nik,nk->ni", matrix[:, :, :3], on_unit) + matrix[:, :, 3]
            view = self._sight.ray(place, numbers, _vectors(np.nan_to_num(there)))[1].numpy().T.astype(float)
            turned = _turned(lines, start, share, np.einsum("nik,nk->ni", inner, view), on_unit)
            on_unit = np.where(bent[:, None] & np.isfinite(on_unit), turned, on_unit)
        return np.einsum("nik,nk->ni", matrix[:, :, :3], on_unit) + matrix[:, :, 3]


def _vectors(rows: np.ndarray) -> mi.Vector3f:
    return mi.Vector3f(*(upload(mi.Float, rows[:, k].astype(np.float32)) for k in range(3)))


def _lines(shapes: AttachedShapes, numbers: Sequence[int]) -> _Lines:
    found = []
    for number in numbers:
        kind = shapes.kinds[number]
        which = {SPHERE: [(-1, 1.0)], CYLINDER: [(-1, 1.0), (-1, -1.0), (0, 1.0), (1, 1.0)]}.get(kind, [(0, 1.0)])
        found += [(number, kind, rim, side) for rim, side in which]
    shape, kind, rim, side = np.array(found, float).reshape(-1, 4).T
    return _Lines(shape=shape.astype(int), kind=kind.astype(int), rim=rim, side=side,
                  matrix=np.array([shapes.matrices[int(one)][:3] for one in shape]).reshape(-1, 3, 4))


def _around(start: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a and e(φ) (N, 3) of a unit sphere."""
    a = -start / np.maximum(np.linalg.norm(start, axis=1, keepdims=True), 1e-12)
    first = np.cross(a, np.eye(3)[np.argmin(np.abs(a), axis=1)])
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-12)
    turn = 2 * np.pi * share[:, None]
    return a, np.cos(turn) * first + np.sin(turn) * np.cross(a, first)


def _straight(lines: _Lines, start: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return points on unit shapes (N, 3) where they end, or where straight rays from `start` see them turn away."""
    found, turn = np.full((len(share), 3), np.nan), 2 * np.pi * share
    circle = (lines.rim >= 0) & ((lines.kind == CYLINDER) | (lines.kind == DISK))
    found[circle] = np.stack([np.cos(turn), np.sin(turn), lines.rim], 1)[circle]
    flat = lines.kind == RECTANGLE
    found[flat] = _square(share[flat])
    ball = lines.kind == SPHERE
    a, e = _around(start[ball], share[ball])
    sine = _sine(np.linalg.norm(start[ball], axis=1))
    found[ball] = np.sqrt(1 - sine ** 2) * e - sine * a
    side = (lines.kind == CYLINDER) & (lines.rim < 0)
    away = np.hypot(start[side, 0], start[side, 1])
    sine, towards = _sine(away), start[side, :2] / np.maximum(away, 1e-12)[:, None]
    aside = lines.side[side, None] * np.sqrt(1 - sine ** 2) * np.stack([-towards[:, 1], towards[:, 0]], 1)
    found[side] = np.concatenate([sine * towards + aside, share[side, None]], 1)
    return found


def _sine(away: np.ndarray) -> np.ndarray:
    """Return one over distances, (N, 1); NaN inside the shape."""
    return np.where(away < CLEAR, np.nan, 1 / np.maximum(away, CLEAR))[:, None]


def _square(share: np.ndarray) -> np.ndarray:
    """Return points on the sides of the unit rectangle, (N, 3)."""
    corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [-1, -1, 0]])
    side, along = np.divmod(4 * np.mod(share, 1.0), 1.0)
    first = np.minimum(side.astype(int), 3)
    return corners[first] + (corners[first + 1] - corners[first]) * along[:, None]


def _turned(lines: _Lines, start: np.ndarray, share: np.ndarray, view: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Return points of outlines of sight for rays that arrive along `view` (N, 3), on the side of `before`."""
    a, e = _around(start, share)
    angle = np.arctan2(np.einsum("nk,nk->n", e, view), np.einsum("nk,nk->n", a, view))[:, None]
    flat = np.stack([-view[:, 1], view[:, 0]], 1)
    flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-12)
    flat *= np.where(np.einsum("nk,nk->n", flat, before[:, :2]) < 0, -1.0, 1.0)[:, None]
    aside = np.concatenate([flat, share[:, None]], 1)
    return np.where((lines.kind == SPHERE)[:, None], np.cos(angle) * e - np.sin(angle) * a, aside)
