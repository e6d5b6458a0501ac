"""The bins of a frame on the device: in which beam and bin each echo lies, and sums over them.

Beams part the sines halfway between them. Cell b T + t is bin t of beam b.
"""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, held, upload
from mitsonar.echoes.sums.energy_sums import sum_size
from mitsonar.echoes.sums.origin_sums import SECTORS, sector
from mitsonar.signal.beam_grid.stripes import cell_sums

from .ping_echoes import GridEchoes

__all__ = ["FrameBins"]

PER_BEAM = 8                       # places of the table that beams are looked up in, a beam
FEWER_SECTORS = SECTORS // 64      # that make one here: scatterers are too few for more
CELL = 1                           # bins and beams to either side over which scatterers are counted
HARDLY = 1e-6                      # of the strongest bin's energy: a bed that brings less has no place


class FrameBins:
    """Beams and bins.

    Parameters
    ----------
    edges : (B + 1,) [-]
        Sines that part the beams, rising.
    lead, bins : int
        Samples of the record before the picture's; T.
    per_bin : int
        Samples of a bin.
    """

    def __init__(self, edges: np.ndarray, *, lead: int, bins: int, per_bin: int = 1):
        self.beams, self.bins, self._lead, self._per_bin = len(edges) - 1, bins, lead, per_bin
        places = PER_BEAM * self.beams
        first, last = float(edges[0]), float(edges[-1])
        # the beam in which each place of the table begins: a few steps from there lead to the right one
        begin = np.linspace(first, last, places + 1)[:-1]
        self._table = upload(mi.UInt32, np.clip(np.searchsorted(edges, begin, side="right") - 1, 0,
                                                self.beams - 1).astype(np.uint32))
        self._edges = upload(mi.Float, np.append(edges[1:-1], np.inf).astype(np.float32))
        self._ends = [dr.opaque(mi.Float, value) for value in (first, last, places / (last - first))]
        self._places = dr.opaque(mi.Float, places - 1)
        dr.eval(self._table, self._edges)

    @property
    def cells(self) -> int:
        """How many bins of all beams."""
        return self.beams * self.bins

    def cell_of(self, echoes: GridEchoes) -> tuple[mi.UInt32, mi.Bool]:
        """Give the cells of echoes, computed, and which echoes lie in the picture and bring something."""
        first, last, per_sine = self._ends
        sine = held(echoes.sine, first, last)
        beam = _beam(self._table, self._edges, mi.UInt32(held((sine - first) * per_sine, 0.0, self._places)), sine)
        bin = dr.round(echoes.column) - dr.opaque(mi.Float, self._lead)
        if self._per_bin > 1:
            bin = dr.floor((bin + 0.5) * dr.opaque(mi.Float, 1 / self._per_bin))
        inside = (echoes.sine >= first) & (echoes.sine < last) & (bin >= 0) & (
            bin < dr.opaque(mi.Float, self.bins)) & (echoes.energy > 0)
        cell = beam * dr.opaque(mi.UInt32, self.bins) + mi.UInt32(dr.select(inside, bin, 0))
        dr.eval(cell, inside)
        return cell, inside

    def ground(self, echoes: GridEchoes, cell: mi.UInt32, active: mi.Bool,
               origin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Give energies and mean places of echoes of the ground.

        Parameters
        ----------
        echoes : GridEchoes
        cell, active : UInt32, Bool (R,)
        origin : (3,) [m]
            Of the echoes' places.

        Returns
        -------
        energy : (B, T)
        place : (B, T, 3) float32 [m]
            x, y and depth, weighted by energy; NaN where there is hardly any.
        """
        energy = echoes.energy
        sums = cell_sums(cell, active, [energy, energy * echoes.x, energy * echoes.y, energy * echoes.depth],
                         rows=self.beams, columns=self.bins)
        index, packet = dr.arange(mi.UInt32, self.cells), arrays_of(mi.Float).Array4f
        own = dr.gather(packet, sums, index)
        total = own[0]
        dr.eval(total)
        least = dr.opaque(mi.Float, HARDLY * float(dr.max(total)[0]))
        # where a bin between others has no scatterer by chance, the places are those beside it
        empty, column = ~(total > least), index % dr.opaque(mi.UInt32, self.bins)
        last = dr.opaque(mi.UInt32, self.bins - 1)
        whole = own + dr.gather(packet, sums, index - 1, empty & (column > 0)) + dr.gather(
            packet, sums, index + 1, empty & (column < last))
        there = whole[0] > least
        per_energy = dr.rcp(dr.select(there, whole[0], 1))
        place = dr.empty(mi.Float, 3 * self.cells)
        for axis, (moment, zero) in enumerate(zip((whole[1], whole[2], whole[3]), (origin[0], origin[1], 0.0))):
            mean = dr.fma(moment, per_energy, dr.opaque(mi.Float, float(zero)))
            dr.scatter(place, dr.select(there, mean, dr.nan), 3 * index + axis)
        return (total.numpy().reshape(self.beams, self.bins),
                place.numpy().reshape(self.beams, self.bins, 3))

    def counted(self, echoes: GridEchoes, cell: mi.UInt32, active: mi.Bool, depth_below: float,
                farthest: float) -> tuple[np.ndarray, np.ndarray]:
        """Count separate runs of sectors in every bin, and echoes of the bins and beams around it.

        Returns
        -------
        layover : (B, T) uint8
        rays : (B, T) uint32
        """
        number = sector(echoes.launch_sine, dr.opaque(mi.Float, depth_below), dr.opaque(mi.Float, farthest))
        mask, count = dr.zeros(mi.UInt64, sum_size(self.cells)), dr.zeros(mi.UInt32, sum_size(self.cells))
        dr.scatter_reduce(dr.ReduceOp.Or, mask, mi.UInt64(1) << mi.UInt64(number // FEWER_SECTORS), cell, active)
        dr.scatter_add(count, mi.UInt32(1), cell, active)
        dr.eval(mask, count)
        bins, beams = (dr.opaque(mi.Int32, n) for n in (self.bins, self.beams))
        index = dr.arange(mi.UInt32, self.cells)
        row = mi.Int32(index) // bins
        column, around, seen = mi.Int32(index) - row * bins, mi.UInt32(0), mi.UInt64(0)
        for down in range(-CELL, CELL + 1):
            for along in range(-CELL, CELL + 1):
                there = (row + down >= 0) & (row + down < beams) & (column + along >= 0) & (column + along < bins)
                beside = mi.UInt32(mi.Int32(index) + down * bins + along)
                around += dr.gather(mi.UInt32, count, beside, there)
                # a bin shows what its neighbours hear: the few scatterers of each may miss a sector
                seen |= dr.gather(mi.UInt64, mask, beside, there & (abs(down) + abs(along) <= CELL))
        # a single sector without an echo lies between others by chance
        seen = seen | (seen << 1) & (seen >> 1)
        runs = dr.select(dr.gather(mi.UInt32, count, index) > 0, mi.UInt32(dr.popcnt(seen & ~(seen << 1))), 0)
        dr.eval(runs, around)
        shape = self.beams, self.bins
        return runs.numpy().astype(np.uint8).reshape(shape), around.numpy().reshape(shape)


@dr.syntax
def _beam(table, edges, place, sine):
    """The beam of finite sines, from the one in which their place of the table begins."""
    beam = dr.gather(mi.UInt32, table, place)
    more = sine >= dr.gather(mi.Float, edges, beam)
    while more:
        beam += 1
        more = sine >= dr.gather(mi.Float, edges, beam, more)
    return beam
