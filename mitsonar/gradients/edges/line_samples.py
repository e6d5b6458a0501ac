"""Draw points on lines at which the energy of directions jumps, more of them where more energy jumps.

    w = ℓ b j        of a piece of a line, seen from a ping: its length across the view [rad], beam, share that jumps

Points are drawn stratified through the sums of w: each stands for Σw / (N w) of its piece. No choice of w biases their
sum, as long as it is not 0 where something jumps. It is 0 at folds of smooth meshes, whose facets do not show, except
where one of the facets is nearly seen from its edge.
"""
from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.device.chance import Salt
from mitsonar.scene.tracing.tracer import Tracer
from mitsonar.survey.energy.rows import Rows
from mitsonar.survey.motion.places import Place

from .jump_lines import JumpLines
from .mesh_edges import NO_FACE
from .sight import EdgeSight, drawn_pieces

FINE = 1 / 300                     # [rad] of a piece: narrow beams see parts of lines
MOST_PIECES = 64                   # of a line
TOGETHER = 1 << 22                 # pieces and pings of one kernel
GRAZING = 0.03                     # sine below which a facet is seen from its edge, or nearly so
HIDDEN = 0.1                       # of the weight of lines whose facets look away, which closed bodies hide


@dataclass(frozen=True, kw_only=True)
class LineSamples:
    """Hold points on lines, NumPy arrays (N,)."""

    ping: np.ndarray  # number within the block
    line: np.ndarray
    place: np.ndarray  # along the line, 0 to 1
    worth: np.ndarray  # share of a line that each stands for


class LineSampler:
    """Draw points on lines, from positions (P, 3) [m] up to a reach [m]."""

    def __init__(self, lines: JumpLines, tracer: Tracer, rows: Rows, positions: np.ndarray, reach: float, seed: int):
        self.lines, self.tracer = lines, tracer
        self._seed, self._sight = seed, EdgeSight(tracer, rows, reach)
        self._vertices, self._faces = tracer.geometry.vertices, tracer.geometry.faces
        length = np.linalg.norm(lines.ends[:, 1] - lines.ends[:, 0], axis=1)
        away = _distance(lines.ends.mean(1), positions)
        heard = (away - 0.5 * length < reach) & (length > 0)
        pieces = np.clip(np.ceil(length / (FINE * np.maximum(away, 1e-3))), 1, MOST_PIECES)
        number = np.where(heard, pieces, 0).astype(np.int64)
        self._line = np.repeat(np.arange(len(length), dtype=np.uint32), number)
        start = np.cumsum(number) - number
        self._share = 1 / number[self._line]
        self._first = (np.arange(len(self._line)) - start[self._line]) * self._share
        self.count = len(self._line)
        padded = np.concatenate([lines.ends, np.zeros((len(lines.ends), 2, 1), np.float32)], 2)
        self._ends, self._sides = upload(mi.Float, padded), upload(mi.UInt32, lines.faces.astype(np.uint32))
        self._smooth = upload(mi.UInt32, lines.smooth.astype(np.uint32))
        self._pieces = [upload(mi.UInt32, self._line), upload(mi.Float, self._first.astype(np.float32)),
                        upload(mi.Float, self._share.astype(np.float32))]
        self._edges = dr.opaque(mi.UInt32, lines.edges)

    def drawn(self, place: Place, count: int) -> LineSamples:
        """Draw `count` points for every ping of a place."""
        pings, together = len(place.ping), max(1, TOGETHER // max(self.count, 1))
        found = []
        for start in range(0, pings, together):
            number = np.arange(start, min(start + together, pings))
            weights = self._weights(place, number) if self.count else np.zeros((len(number), 0))
            found += [self._chosen(int(ping), int(place.ping[ping]), some, count)
                      for ping, some in zip(number, weights)]
        return LineSamples(**{name: np.concatenate([getattr(one, name) for one in found])
                                   for name in ("ping", "line", "place", "worth")})

    def _chosen(self, ping: int, number: int, weights: np.ndarray, count: int) -> LineSamples:
        """Return the points of one ping, `number` in the survey."""
        if not weights.sum() > 0:
            none = np.zeros(0)
            return LineSamples(ping=none.astype(np.uint32), line=none.astype(np.uint32), place=none, worth=none)
        piece, within, worth = drawn_pieces(weights, count, number, self._seed, Salt.EDGES)
        share = self._share[piece]
        return LineSamples(ping=np.full(count, ping, np.uint32), line=self._line[piece],
                           place=self._first[piece] + within * share, worth=worth * share)

    def _weights(self, place: Place, number: np.ndarray) -> np.ndarray:
        """Return w of all pieces, (B, pieces), from pings with these numbers in the place."""
        index = dr.arange(mi.UInt32, self.count * len(number))
        each = dr.opaque(mi.UInt32, self.count)
        ping = index // each
        line, first, share = (dr.gather(type(values), values, index - ping * each) for values in self._pieces)
        ping += dr.opaque(mi.UInt32, int(number[0]))
        lib = arrays_of(mi.Float)
        ends = [dr.gather(lib.Array4f, self._ends, 2 * line + k) for k in range(2)]
        a, b = (mi.Vector3f(end[0], end[1], end[2]) for end in ends)
        along = (b - a) * share
        middle = a + (b - a) * (first + 0.5 * share)
        _, view = self._sight.ray(place, ping, middle)
        weight = self._sight.weight(place, ping, middle, along, self._jump(line, a, along, view))
        return weight.numpy().astype(float).reshape(len(number), -1)

    def _jump(self, line: mi.UInt32, start: mi.Vector3f, along: mi.Vector3f, view: mi.Vector3f) -> mi.Float:
        """Estimate the share of energy that jumps across lines: all of it at outlines."""
        aside = dr.cross(along, view)
        sines, sides, there = [], [], []
        for k in range(2):
            face = dr.gather(mi.UInt32, self._sides, 2 * line + k)
            there.append(face != NO_FACE)
            normal, middle = self._facet(face, there[k])
            sines.append(-dr.dot(normal, view))
            sides.append(dr.dot(aside, middle - start))
        steep, flat = dr.maximum(abs(sines[0]), abs(sines[1])), dr.minimum(abs(sines[0]), abs(sines[1]))
        fold = (steep - flat) / dr.maximum(steep, 1e-3)
        fold = dr.select((sines[0] < -0.02) & (sines[1] < -0.02), HIDDEN * fold, fold)
        facets = dr.gather(mi.UInt32, self._smooth, line) == 0
        fold = dr.select(facets, fold, dr.select(flat < GRAZING, 1, 0))
        outline = (sides[0] * sides[1] > 0) | ~there[0] | ~there[1] | (line >= self._edges)
        return dr.select(outline, 1, fold)

    def _facet(self, face: mi.UInt32, active: mi.Bool) -> tuple[mi.Vector3f, mi.Vector3f]:
        """Return normals and middles of facets."""
        lib = arrays_of(mi.Float)
        corners = dr.gather(lib.Array4u, self._faces, face, active)
        rows = [dr.gather(lib.Array4f, self._vertices, corners[k], active) for k in range(3)]
        a, b, c = (mi.Vector3f(row[0], row[1], row[2]) for row in rows)
        across = dr.cross(b - a, c - a)
        return across * dr.rsqrt(dr.maximum(dr.squared_norm(across), 1e-30)), (a + b + c) / 3


def _distance(points: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Return the distance of points (L, 3) from the nearest of positions (P, 3)."""
    from scipy.spatial import cKDTree

    return cKDTree(positions).query(points)[0] if len(points) else np.zeros(0)
