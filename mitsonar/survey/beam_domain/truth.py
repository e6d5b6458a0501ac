"""Truth of an image in the beam domain, from the same echoes as the image.

    E_l[b, t] = Σ |e|² over the echoes of instance l in beam b and bin t, blurred by `blur`

Scatterers that objects hide count as the loss of seabed echo by these objects (`imaging.truth`); scatterers behind the
horizon of the bed do not count. Echoes with a phase of their own are first added, instance by instance, then squared.

The many echoes of the seabed are summed on the device (`FrameBins`); the few echoes of objects, and the echoes that
objects hide, are summed on the host within boxes of beams and bins. Beams meet halfway between their sines. Cell
b T + t is bin t of beam b.
"""
from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, compressed, entries, held, upload
from mitsonar.device.turns import workers_ended
from mitsonar.echoes.sums.origin_sums import SECTORS, sector
from mitsonar.imaging.energy_record import EnergyRecord, powers
from mitsonar.imaging.truth import HALF, BinTruth
from mitsonar.scene.labels import ShapeLabels
from mitsonar.signal.beam_grid.stripes import cell_sums
from mitsonar.signal.beam_grid.transforms import divided

from .blur import LEAST, Blur, OneBeam
from .ground import FREE
from .ping_echoes import GridEchoes, TargetEchoes

PER_BEAM = 8                       # entries per beam of the table that finds beams
FEWER_SECTORS = SECTORS // 64      # sectors joined to one here, since scatterers are too few for more
IN_LOBE = SECTORS // FEWER_SECTORS # flag of a word above its sector
CELL = 1                           # bins and beams to either side in which scatterers are counted
ROWS = 16                          # beams whose shares are computed together: they stay in a core's cache
HARDLY = 1e-6                      # share of the strongest bin's energy below which a bin has no place on the bed


class FrameBins:
    """Beams and bins of a frame."""

    def __init__(self, edges: np.ndarray, *, lobe: int, lead: int, bins: int, per_bin: int = 1):
        self.beams, self.bins, self._lobe, self._lead, self._per_bin = len(edges) - 1, bins, lobe, lead, per_bin
        places = PER_BEAM * self.beams
        first, last = float(edges[0]), float(edges[-1])
        # the beam at the beginning of each entry; the right beam is a few steps from there
        begin = np.linspace(first, last, places + 1)[:-1]
        self._table = upload(mi.UInt32, np.clip(np.searchsorted(edges, begin, side="right") - 1, 0,
                                                self.beams - 1).astype(np.uint32))
        self._edges = upload(mi.Float, np.append(edges[1:-1], np.inf).astype(np.float32))
        self._ends = [dr.opaque(mi.Float, value) for value in (first, last, places / (last - first))]
        self._places = dr.opaque(mi.Float, places - 1)
        dr.eval(self._table, self._edges)

    @property
    def cells(self) -> int:
        """Return the number of bins of all beams."""
        return self.beams * self.bins

    def cell_of(self, echoes: GridEchoes) -> tuple[mi.UInt32, mi.UInt32, mi.Bool]:
        """Return the cells and beams of echoes, and True for echoes with energy inside the image."""
        first, last, per_sine = self._ends
        sine = held(echoes.sine, first, last)
        beam = _beam(self._table, self._edges, mi.UInt32(held((sine - first) * per_sine, 0.0, self._places)), sine)
        bin = dr.round(echoes.column) - dr.opaque(mi.Float, self._lead)
        if self._per_bin > 1:
            bin = dr.floor((bin + 0.5) * dr.opaque(mi.Float, 1 / self._per_bin))
        inside = (echoes.sine >= first) & (echoes.sine < last) & (bin >= 0) & (
            bin < dr.opaque(mi.Float, self.bins)) & (echoes.energy > 0)
        cell = beam * dr.opaque(mi.UInt32, self.bins) + mi.UInt32(dr.select(inside, bin, 0))
        return cell, beam, inside

    def sums(self, echoes: GridEchoes, cell: mi.UInt32, beam: mi.UInt32, active: mi.Bool, word: mi.UInt32,
             counts: CellCounts) -> mi.Float:
        """Return the sums over each cell of an energy, and of the energy times x, y and depth, Float (4 B T,)."""
        energy, place = echoes.energy, (echoes.x, echoes.y, echoes.depth)
        return cell_sums(cell, beam, active, [energy, *(energy * axis for axis in place)], rows=self.beams,
                         columns=self.bins, word=word, count=counts.add)

    def ground(self, sums: mi.Float, others: mi.Float | None,
               origin: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the energies and mean places of `sums`, and the mean depths with the sums of other echoes added."""
        # origin (3,) [m] -> energy (B, T), place (B, T, 3) [m], depth (B, T) [m]
        lib, index = arrays_of(mi.Float), dr.arange(mi.UInt32, self.cells)
        _, column = divided(lib, index, self.bins)
        last = dr.opaque(mi.UInt32, self.bins - 1)

        def around(table: mi.Float) -> list[dr.ArrayBase]:
            return [dr.gather(lib.Array4f, table, index), dr.gather(lib.Array4f, table, index - 1, column > 0),
                    dr.gather(lib.Array4f, table, index + 1, column < last)]

        own = around(sums)
        energy = own[0][0]
        dr.eval(energy)
        most = float(dr.max(energy)[0])
        mean = self._mean(own, HARDLY * most, origin)
        depth = mean[2]
        if others is not None:
            both = [part + other for part, other in zip(own, around(others))]
            depth = self._mean(both, HARDLY * float(dr.max(both[0][0])[0]), np.zeros(3))[2]
        # a row of four is written as one packet
        place = dr.empty(mi.Float, 4 * self.cells)
        dr.scatter(place, lib.Array4f(*mean, depth), index)
        dr.eval(place)
        place = place.numpy().reshape(self.beams, self.bins, 4)
        return self._shaped(energy), place[..., :3], place[..., 3]

    def _shaped(self, values: mi.Float | mi.UInt32) -> np.ndarray:
        """Return values of cells on the host, (B, T)."""
        return values.numpy().reshape(self.beams, self.bins)

    def _mean(self, sums: Sequence[dr.ArrayBase], least: float, origin: np.ndarray) -> list[mi.Float]:
        """Return the means of x, y and depth in cells with more energy than `least`."""
        # sums of the cells themselves, before and after
        own, before, after = sums
        enough = dr.opaque(mi.Float, least)
        # a bin that has no scatterer by chance takes the places of its neighbours
        empty = ~(own[0] > enough)
        near = own + dr.select(empty, before, 0) + dr.select(empty, after, 0)
        has_bed = near[0] > enough
        per_energy = dr.rcp(dr.select(has_bed, near[0], 1))
        return [dr.select(has_bed, dr.fma(moment, per_energy, dr.opaque(mi.Float, float(zero))), dr.nan)
                for moment, zero in zip((near[1], near[2], near[3]), (origin[0], origin[1], 0.0))]

    def counted(self, counts: CellCounts) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the number of separate runs of sectors in every bin (B, T), and of echoes in and around it (B, T).

        The last array counts the echoes of the main lobe alone, those of all beams within the width of a beam.
        """
        dr.eval(counts.sectors, counts.echoes)
        lib, index = arrays_of(mi.Float), dr.arange(mi.UInt32, self.cells)
        row, column = divided(lib, index, self.bins)
        bins, last_row, last = (dr.opaque(mi.UInt32, n) for n in (self.bins, self.beams - 1, self.bins - 1))
        # a bin counts the sectors of its neighbours, too: its own few scatterers may miss a sector
        seen = counts.sectors
        for beside, there in ((index - 1, column > 0), (index + 1, column < last), (index - bins, row > 0),
                              (index + bins, row < last_row)):
            seen = seen | dr.gather(mi.UInt64, counts.sectors, beside, there)
        # a single sector between others lacks an echo by chance
        seen = seen | (seen << 1) & (seen >> 1)
        runs = dr.select(counts.echoes[0] > 0, mi.UInt32(dr.popcnt(seen & ~(seen << 1))), 0)
        dr.eval(runs)
        rays, in_lobe = self._shaped(counts.echoes[0]), self._shaped(counts.echoes[-1])
        around = _around(rays, CELL)
        same = len(counts.echoes) == 1 and self._lobe <= CELL
        return (self._shaped(runs).astype(np.uint8), around,
                around if same else _around(in_lobe, max(self._lobe, CELL)))


class CellCounts:
    """Numbers of echoes in cells, and the sectors that they come from as a bit mask: whole numbers, in any order."""

    def __init__(self, cells: int, *, lobe: bool):
        self.sectors = dr.zeros(mi.UInt64, cells)
        #: of all echoes; of those in the main lobe, if these are told apart
        self.echoes = [dr.zeros(mi.UInt32, cells) for _ in range(1 + lobe)]

    def add(self, cell: mi.UInt32, word: mi.UInt32, active: mi.Bool) -> None:
        """Add echoes; `word` holds the sector of each, and `IN_LOBE` for an echo in the main lobe."""
        # the sums are too large for copies of each thread
        direct = dr.ReduceMode.Direct
        dr.scatter_reduce(dr.ReduceOp.Or, self.sectors, mi.UInt64(1) << mi.UInt64(word % IN_LOBE), cell, active, direct)
        for echoes, number in zip(self.echoes, (mi.UInt32(1), word // IN_LOBE)):
            dr.scatter_add(echoes, number, cell, active, direct)


def word_of(echoes: GridEchoes, in_lobe: mi.Bool | None, depth_below: float, farthest: float) -> mi.UInt32:
    """Return the words of echoes, see `CellCounts`."""
    word = sector(echoes.launch_sine, dr.opaque(mi.Float, depth_below), dr.opaque(mi.Float, farthest)) // FEWER_SECTORS
    return word if in_lobe is None else word | dr.select(in_lobe, mi.UInt32(IN_LOBE), 0)


def _around(values: np.ndarray, beams: int) -> np.ndarray:
    """Return the sums of values (B, T) over their neighbours, so many beams and `CELL` bins to either side."""
    return _summed(_summed(values, beams), CELL, axis=1)


def _summed(values: np.ndarray, reach: int, axis: int = 0) -> np.ndarray:
    """Return the sums of values over their neighbours up to a distance along an axis."""
    values = np.moveaxis(values, axis, 0)
    total = values.copy(order="K")
    for step in range(1, reach + 1):
        total[step:] += values[:-step]
        total[:-step] += values[step:]
    return np.moveaxis(total, 0, axis)


@dr.syntax
def _beam(table, edges, place, sine):
    """Return the beams of finite sines, searched from the beams at the beginning of their table entries."""
    beam = dr.gather(mi.UInt32, table, place)
    more = sine >= dr.gather(mi.Float, edges, beam)
    while more:
        beam += 1
        more = sine >= dr.gather(mi.Float, edges, beam, more)
    return beam


@dataclass(frozen=True, kw_only=True)
class _TruthPlane:
    """Blurred energies (beams, bins) of one instance within a box."""

    label: int
    first_beam: int
    first_bin: int
    energy: np.ndarray

    @property
    def where(self) -> tuple[slice, slice]:
        """Return the slices of beams and bins of the box."""
        return (slice(self.first_beam, self.first_beam + self.energy.shape[0]),
                slice(self.first_bin, self.first_bin + self.energy.shape[1]))

    def among(self, first: int, end: int) -> _TruthPlane:
        """Return the part of the box within beams, which are counted from the first of these."""
        low, high = (min(max(beam - self.first_beam, 0), len(self.energy)) for beam in (first, end))
        return replace(self, first_beam=self.first_beam + low - first, energy=self.energy[low:high])


@dataclass(frozen=True, kw_only=True)
class _TruthGround:
    """Sums of a frame: planes of seabeds, of objects, and of seabed that objects hide; places and counts."""

    seabed: list[_TruthPlane]
    place: np.ndarray
    depth: np.ndarray
    layover: np.ndarray
    rays: np.ndarray
    rays_in_beam: np.ndarray
    objects: list[_TruthPlane]
    lost: list[_TruthPlane]


class FrameTruth:
    """Truth of frames."""

    def __init__(self, blur: Blur | OneBeam, *, lead: int, bins: int, named: ShapeLabels, per_bin: int = 1):
        self._blur, self._labels, self._seabed = blur, len(named), sorted(named.seabed)
        self._bins = FrameBins(blur.edges, lobe=blur.lobe, lead=lead, bins=bins, per_bin=per_bin)
        self._is_seabed = upload(mi.Bool, np.isin(np.arange(len(named) + 1), self._seabed))
        dr.eval(self._is_seabed)

    def of(self, scatterers: GridEchoes | None, hidden: tuple[mi.UInt32, mi.UInt32],
           targets: Sequence[TargetEchoes], *, in_lobe: mi.Bool | None, origin: np.ndarray, depth_below: float,
           farthest: float, source_power: float) -> EnergyRecord:
        """Return the truth of a frame, arrays (B, ..., bins)."""
        # hidden (H,): numbers of scatterers, and of the objects that hide them; in_lobe (R,), None: all
        # origin (3,) [m]; depth_below, farthest [m]; source_power [µPa²]
        shape = self._bins.beams, self._bins.bins
        ground = self._nothing(shape) if scatterers is None else self._ground(
            scatterers, hidden, in_lobe, origin, depth_below, farthest)
        planes = [*ground.seabed, *ground.objects, *self._of_targets(targets)]
        total, hidden_share = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
        label, object_shadow = np.zeros(shape, np.uint32), np.zeros(shape, np.uint32)
        share = np.zeros((shape[0], self._labels, shape[1]), np.float32)
        with workers_ended():
            for first in range(0, shape[0], ROWS):
                rows = slice(first, last := first + ROWS)
                there, seabed, lost = ([part for plane in group if len((part := plane.among(first, last)).energy)]
                                       for group in (planes, ground.seabed, ground.lost))
                _share_out(there, total[rows], share[rows], label[rows])
                if lost:
                    _shade(seabed, lost, total[rows], hidden_share[rows], object_shadow[rows])
                total[rows] *= np.float32(source_power)
        return EnergyRecord(
            intensity=total, depth=ground.depth, rays=ground.rays, rays_in_beam=ground.rays_in_beam,
            truth=BinTruth(label=label, share=share, hidden=hidden_share, object_shadow=object_shadow,
                           layover=ground.layover, seabed_place=ground.place))

    def _nothing(self, shape: tuple[int, int]) -> _TruthGround:
        """Return the sums of a frame without scatterers."""
        none = np.zeros(shape, np.uint32)
        return _TruthGround(seabed=[], objects=[], lost=[], layover=np.zeros(shape, np.uint8), rays=none,
                            rays_in_beam=none, place=np.full((*shape, 3), np.nan, np.float32),
                            depth=np.full(shape, np.nan, np.float32))

    def _ground(self, echoes: GridEchoes, hidden: tuple[mi.UInt32, mi.UInt32], in_lobe: mi.Bool | None,
                origin: np.ndarray, depth_below: float, farthest: float) -> _TruthGround:
        """Return the sums of the scatterers' echoes, and of the seabed's echoes that objects hide."""
        bins, several = self._bins, len(self._seabed) > 1
        cell, beam, inside = bins.cell_of(echoes)
        free = inside & (echoes.state == FREE)
        on_bed = free & dr.gather(mi.Bool, self._is_seabed, echoes.label)
        listed, word = free if several else free & ~on_bed, word_of(echoes, in_lobe, depth_below, farthest)
        counts = CellCounts(bins.cells, lobe=in_lobe is not None)
        dr.schedule(listed, word)                       # made by the kernel of the sums
        sums = bins.sums(echoes, cell, beam, on_bed, word, counts)
        # without objects in the image they are 0, so that it has the kernels of other images of the scene
        others = dr.zeros(mi.Float, 4 * bins.cells) if len(self._seabed) < self._labels else None
        planes, index = [], compressed(listed)
        if dr.width(index):
            few = entries(echoes, index)
            cell, beam, _ = bins.cell_of(few)
            of_objects = ~dr.gather(mi.Bool, self._is_seabed, few.label)
            dr.eval(cell, few.energy, few.label)
            others = bins.sums(few, cell, beam, of_objects, dr.gather(mi.UInt32, word, index), counts)
            planes = list(self._planes(cell.numpy(), few.energy.numpy(), few.label.numpy()))
        energy, place, depth = bins.ground(sums, others, origin)
        layover, rays, rays_in_beam = bins.counted(counts)
        seabed = [plane for plane in planes if plane.label in self._seabed] if several else [
            self._shown(label, energy, (0, bins.beams, 0, bins.bins)) for label in self._seabed]
        number, hider = hidden
        lost = []
        if dr.width(number):
            behind = entries(echoes, number)
            cell, _, inside = bins.cell_of(behind)
            taken = compressed(inside & (hider > 0) & dr.gather(mi.Bool, self._is_seabed, behind.label))
            if dr.width(taken):
                lost = list(self._planes(*(dr.gather(type(column), column, taken).numpy()
                                           for column in (cell, behind.energy, hider))))
        objects = [plane for plane in planes if plane.label not in self._seabed]
        return _TruthGround(seabed=seabed, place=place, depth=depth, layover=layover, rays=rays,
                            rays_in_beam=rays_in_beam, objects=objects, lost=lost)

    def _planes(self, cell: np.ndarray, energy: np.ndarray, label: np.ndarray) -> Iterator[_TruthPlane]:
        """Yield the blurred energies of echoes, instance by instance."""
        for number in np.unique(label):
            own = label == number
            row, bin = np.divmod(cell[own].astype(np.int64), self._bins.bins)
            box = int(row.min()), int(row.max()) + 1, int(bin.min()), int(bin.max()) + 1
            size = box[1] - box[0], box[3] - box[2]
            place = (row - box[0]) * size[1] + (bin - box[2])
            yield self._shown(int(number), np.bincount(place, energy[own], size[0] * size[1]).reshape(size), box)

    def _shown(self, label: int, energy: np.ndarray, box: tuple[int, int, int, int]) -> _TruthPlane:
        """Return the blurred energies of a box."""
        b0, b1, t0, t1 = self._blur.grown(box, self._bins.bins)
        if (b1 - b0, t1 - t0) != energy.shape:
            wide = np.zeros((b1 - b0, t1 - t0), np.float32)
            wide[box[0] - b0:box[1] - b0, box[2] - t0:box[3] - t0] = energy
            energy = wide
        return _TruthPlane(label=label, first_beam=b0, first_bin=t0, energy=self._blur.shown(energy, b0))

    def _of_targets(self, targets: Sequence[TargetEchoes]) -> Iterator[_TruthPlane]:
        """Yield the energies of echoes with a phase, which are added per instance and bin before they are squared."""
        parts = []
        for target in targets:
            cell, _, inside = self._bins.cell_of(target.echoes)
            shown = np.flatnonzero(inside.numpy() & (target.label > 0))
            number = target.label[shown].astype(np.int64) * self._bins.cells + cell.numpy()[shown]
            parts.append((number, target.echoes.real.numpy()[shown], target.echoes.imaginary.numpy()[shown]))
        if parts:
            number, power = powers(*(np.concatenate(column) for column in zip(*parts)))
            label, cell = np.divmod(number, self._bins.cells)
            yield from self._planes(cell, power, label)


def _share_out(planes: Sequence[_TruthPlane], total: np.ndarray, share: np.ndarray, label: np.ndarray) -> None:
    """Write the total energy of planes, the share of every instance in it, and the instance with the most."""
    # total, label (b, T), share (b, L, T), all 0
    for plane in planes:
        total[plane.where] += plane.energy
    per_total = np.reciprocal(np.maximum(total, LEAST))             # smaller ones have no inverse in 32 bits
    best = np.zeros_like(total)
    for plane in planes:
        beams, bins = plane.where
        part, most = share[beams, plane.label - 1, bins], best[plane.where]
        part += plane.energy * per_total[plane.where]
        np.copyto(label[plane.where], np.uint32(plane.label), where=part > most)
        np.maximum(most, part, out=most)


def _shade(seabed: Sequence[_TruthPlane], lost: Sequence[_TruthPlane], total: np.ndarray, hidden: np.ndarray,
           shadow: np.ndarray) -> None:
    """Write the share of the seabed's echo that objects hide, and the objects of shadows; see `imaging.truth`."""
    # total, hidden, shadow (b, T)
    taken, most = np.zeros_like(total), np.zeros_like(total)
    for plane in lost:
        taken[plane.where] += plane.energy
        shadow[plane.where] = np.where(plane.energy > most[plane.where], plane.label, shadow[plane.where])
        most[plane.where] = np.maximum(most[plane.where], plane.energy)
    bed = taken.copy()
    for plane in seabed:
        bed[plane.where] += plane.energy
    np.divide(taken, bed, out=hidden, where=taken > 0)
    shadow[(hidden <= HALF) | (total >= HALF * bed)] = 0
