"""Thinned cells in the side lobes of beams: the cells that are left carry the energy of all.

A cell s of a facet exists for a ping if

    t < p,     p = min(1, b / b₀),     t = (Φ₂(s mod M ⊕ h) + u) / M,     M = 2¹²

and its echo then has 1/p of its energy. b is the bound of the beams there (`element_beams`), b₀ -> ``below``. Φ₂
reverses the bits of a number (van der Corput 1935). h and u are hashed from the facet and s div M, and from the cell. t
is therefore as good as uniform, the mean energy is that of all cells, and no echo is stronger than that of a cell at b₀
could be. As the sonar moves on, single cells come or go while the others stay, because t belongs to the cell.

Where p is below 2^-L in all of a piece, only cells whose last L bits are those of h can exist; only they are listed.
"""
from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, compressed, upload
from mitsonar.device.chance import Salt, hashed, uniform

from .pieces import Pieces
from .scatterers import Scatterers

BITS = 12                          # log2 M
MOST_LEVEL = 6                     # largest L: a run rarely has more than 2^L cells
ROUNDED = 1.001                    # allowance for the rounding of bounds


@dataclass(frozen=True, kw_only=True)
class SideLobes:
    """Thinning of the cells of a scene's scatterers."""

    scatterers: Scatterers
    below: float  # b₀

    def listed(self, pieces: Pieces, bound: np.ndarray, most: int) -> Iterator[tuple[mi.UInt32, mi.UInt32]]:
        """Yield the cells that may exist, in pieces with bounds (P,) [-], as (facet, s), at most `most` at a time."""
        level = np.floor(np.log2(self.below / np.maximum(ROUNDED * bound, 1e-30))).clip(0, MOST_LEVEL).astype(np.int64)
        piece, first, count = pieces.rows()
        shift = level[piece]
        begin = first >> shift
        groups = ((first + count - 1) >> shift) - begin + 1
        lib = arrays_of(mi.Float)
        runs = upload(mi.UInt32, np.stack([pieces.facet[piece], first, count, shift], 1).astype(np.uint32))
        for run, group in self.scatterers.listed((np.arange(len(piece), dtype=np.uint32), begin, groups), most):
            row = dr.gather(lib.Array4u, runs, run)
            s = group << row[3]
            s |= self._hashed(row[0], s >> BITS, Salt.SIDE_LOBES) & ((mi.UInt32(1) << row[3]) - 1)
            facet, place = row[0], s - row[1]
            dr.eval(facet, s, place, row[2])
            # unsigned: a cell before the run becomes a large number
            index = compressed(place < row[2])
            if dr.width(index):
                yield dr.gather(mi.UInt32, facet, index), dr.gather(mi.UInt32, s, index)

    def share(self, bound: mi.Float) -> mi.Float:
        """Return p of cells from the bounds of the beams there, Float (R,)."""
        return dr.minimum(bound * dr.opaque(mi.Float, 1 / self.below), 1)

    def exist(self, facet: mi.UInt32, s: mi.UInt32, share: mi.Float) -> mi.Bool:
        """Return True for cells that exist for a ping whose beams give them the share p, Bool (R,)."""
        turned = dr.brev((s ^ self._hashed(facet, s >> BITS, Salt.SIDE_LOBES)) << (32 - BITS))
        within = uniform(arrays_of(mi.Float), self._hashed(facet, s, Salt.BESIDE_SIDE_LOBES))
        return (mi.Float(turned) + within) * 2.0 ** -BITS < share

    def _hashed(self, facet: mi.UInt32, number: mi.UInt32, salt: int) -> mi.UInt32:
        """Return hashes of numbers within facets."""
        facts = self.scatterers.facts(facet)
        return hashed(arrays_of(mi.Float), facts[2], facts[1], number, mi.UInt32(salt))
