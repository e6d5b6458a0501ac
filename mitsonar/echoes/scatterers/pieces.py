"""Pieces of facets within reach of a ping and in the beams of an array.

A small facet is one piece. A large one is cut into blocks of k rows and k columns of its cells (`cells`), about `SHARE`
of the reach long. With e and f the sides of a facet of n rows, the block that starts at row i and column j is the
parallelogram

    a + (i/n) e + (j/n) f + x e + y f,     0 <= x, y <= k/n

as far as it lies in the facet. A ball about its middle contains it.

A piece of radius r whose middle is d away fills an angle of r / (d - r). Because water bends rays, rays to its cells
leave within WIDER times that angle of the ray to its middle. b is the bound of `ElementBeams.bound` at the middle, with
that angle added to (+) or taken from (-) the angle that the bound allows for:

    b(+) negligible       no cell counts
    b(-) large enough     all cells count
    else                  each cell is evaluated
"""
from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.scene.tracing.connection import Connector
from mitsonar.scene.tracing.tracer import Sources

from .element_beams import ElementBeams
from .scatterers import Scatterers

SHARE = 0.01                       # length of a block relative to the reach,
FEWEST = 8                         # but no fewer rows of cells
LARGE = 0.04                       # relative to the reach: facets of a larger radius are cut


@dataclass(frozen=True, kw_only=True)
class Pieces:
    """Pieces of facets, (P,) each."""

    facet: np.ndarray  # (P,)
    cuts: np.ndarray  # (P,): n of the facet
    row: np.ndarray  # (P,): first row and column of the piece
    column: np.ndarray
    side: np.ndarray  # (P,): k
    centre: np.ndarray  # (P, 3) [m]
    radius: np.ndarray  # (P,) [m]: of a ball that holds the piece

    def chosen(self, index: np.ndarray) -> Pieces:
        """Return the pieces with these numbers, or under this mask."""
        return Pieces(**{name: value[index] for name, value in vars(self).items()})

    @property
    def cells(self) -> np.ndarray:
        """Return the number of cells of each piece, int64 (P,)."""
        piece, _, count = self.rows()
        return np.bincount(piece, weights=count, minlength=len(self.facet)).astype(np.int64)

    def runs(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return runs of cells, piece after piece: facet, first number s, count, each (S,)."""
        piece, first, count = self.rows()
        return self.facet[piece], first, count

    def rows(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the runs of cells as (piece, first s, count); a block has one run for each of its rows."""
        whole = self.side == self.cuts
        rows = np.where(whole, 1, np.minimum(self.side, self.cuts - self.row))
        piece = np.repeat(np.arange(len(rows)), rows)
        n, k, j = self.cuts[piece], self.side[piece], self.column[piece]
        i = self.row[piece] + np.arange(len(piece)) - np.repeat(np.cumsum(rows) - rows, rows)
        # the last column of a row has one cell, the others two
        count = np.where(whole[piece], n * n, np.minimum(2 * (j + k), 2 * (n - i) - 1) - 2 * j)
        filled = count > 0
        return piece[filled], (i * (2 * n - i) + 2 * j)[filled], count[filled]


def pieces_in_reach(scatterers: Scatterers, facets: np.ndarray, origin: np.ndarray, nearest: float,
                    farthest: float) -> Pieces:
    """Cut facets (K,) and keep the pieces that reach from `nearest` to `farthest` [m] from `origin` (3,).

    Small facets come first, then the blocks of large ones.
    """
    large = scatterers.radius[facets] > LARGE * farthest
    whole = facets[~large]
    cuts = scatterers.cuts[whole].astype(np.int64)
    start = np.zeros(len(whole), np.int64)
    parts = [Pieces(facet=whole, cuts=cuts, row=start, column=start, side=cuts, centre=scatterers.centre[whole],
                    radius=scatterers.radius[whole])]
    parts += [_blocks(scatterers, facet, origin, farthest) for facet in facets[large]]
    pieces = Pieces(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in vars(parts[0])})
    distance = np.linalg.norm(pieces.centre - origin, axis=1)
    return pieces.chosen((distance - pieces.radius < farthest) & (distance + pieces.radius > nearest))


def _blocks(scatterers: Scatterers, facet: np.uint32, origin: np.ndarray, farthest: float) -> Pieces:
    """Return the blocks of a facet: all that come nearer than `farthest`, and some more."""
    n = int(scatterers.cuts[facet])
    a, b, c = scatterers.corners(np.array([facet]))[0].astype(float)
    e, f = (b - a) / n, (c - a) / n
    k = min(max(FEWEST, int(SHARE * farthest * n / scatterers.longest_side[facet])), n)
    row = np.arange(0, n, k)
    # the middle of a row of blocks is the line q + f v; no point of a block is farther from it than a block is long
    q = a + (row + 0.5 * k)[:, None] * e - origin
    reach = farthest + k * max(map(np.linalg.norm, (e, f, f - e)))
    ff = max(f @ f, 1e-30)
    foot = -(q @ f) / ff
    half = np.sqrt(np.maximum(reach ** 2 - np.sum(q ** 2, axis=1) + ff * foot ** 2, 0) / ff)
    first, last = (np.clip(np.floor(end / k), -1, (n - row - 1) // k).astype(np.int64)
                   for end in (foot - half, foot + half))
    first = np.maximum(first, 0)
    count = np.where(half > 0, np.maximum(last - first + 1, 0), 0)
    row = np.repeat(row, count)
    column = k * (np.arange(len(row)) - np.repeat(np.cumsum(count) - count - first, count))
    centre = a + (row + 0.5 * k)[:, None] * e + (column + 0.5 * k)[:, None] * f
    radius = 0.5 * k * max(np.linalg.norm(e + f), np.linalg.norm(e - f))
    size = len(row)
    return Pieces(facet=np.full(size, facet, np.uint32), cuts=np.full(size, n), row=row, column=column,
                  side=np.full(size, k), centre=centre, radius=np.full(size, radius))


NEGLIGIBLE = 1e-8                  # two-way intensity of the beams below which a cell is ignored
WIDER = 2.0
LARGEST = 0.1                      # [rad] pieces that fill more are evaluated cell by cell,
FEWEST_CELLS = 4                   # and all pieces if they have fewer cells on average


def pieces_in_beams(pieces: Pieces, connector: Connector, beams: ElementBeams, sources: Sources, origin: dr.ArrayBase,
                    rotation: np.ndarray, enough: float = NEGLIGIBLE) -> tuple[np.ndarray, np.ndarray]:
    """Return 1 for pieces whose cells all count, -1 for none, 0 for undecided, (P,); and bounds of their beams (P,)."""
    # origin (1,) [m]; rotation (3, 3)
    if not len(pieces.facet) or pieces.cells.sum() < FEWEST_CELLS * len(pieces.facet):
        return np.zeros(len(pieces.facet), int), np.ones(len(pieces.facet))
    lib = arrays_of(mi.Float)
    point = lib.Array3f64(*(upload(mi.Float64, column) for column in pieces.centre.T))
    distance = dr.norm(point - origin)
    radius = upload(mi.Float64, pieces.radius)
    angle = mi.Float(WIDER * radius / dr.maximum(distance - radius, 1e-9))
    direction = connector.launch_direction(sources, origin, mi.UInt32(0), point)
    most, least = (beams.bound(direction, mi.Float(distance), rotation, wider) for wider in (angle, -angle))
    small = angle < WIDER * LARGEST
    dr.eval(small, most, least)
    inside, outside = ((small & decided).numpy() for decided in (least > enough, most <= NEGLIGIBLE))
    return inside.astype(int) - outside, np.where(small.numpy(), most.numpy(), 1.0)
