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
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, compressed, held, upload
from mitsonar.echoes.sums.energy_sums import sum_size
from mitsonar.echoes.sums.origin_sums import SECTORS, sector
from mitsonar.imaging.energy_record import EnergyRecord, powers
from mitsonar.imaging.truth import HALF, BinTruth
from mitsonar.scene.labels import ShapeLabels
from mitsonar.signal.beam_grid.stripes import cell_sums
from mitsonar.signal.beam_grid.transforms import divided

from .blur import Blur, OneBeam
from .ground import FREE
from .ping_echoes import GridEchoes, TargetEchoes

PER_BEAM = 8                       # entries per beam of the table that finds beams
FEWER_SECTORS = SECTORS // 64      # sectors joined to one here, since scatterers are too few for more
LAST = (1 << 32) - 1               # a step back, in whole numbers without a sign
CELL = 1                           # bins and beams to either side in which scatterers are counted
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

    def cell_of(self, echoes: GridEchoes) -> tuple[mi.UInt32, mi.Bool]:
        """Return the cells of echoes, and True for echoes with energy inside the image; both are evaluated."""
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

    def sums(self, cell: mi.UInt32, active: mi.Bool, *columns: mi.Float) -> mi.Float:
        """Return the sums over each cell of an energy, and of the energy times x, y and depth, Float (4 B T,)."""
        energy, *place = columns
        return cell_sums(cell, active, [energy, *(energy * axis for axis in place)], rows=self.beams, columns=self.bins)

    def ground(self, sums: mi.Float, origin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the energies and mean places of `sums`."""
        # origin (3,) [m] -> energy (B, T), place (B, T, 3) [m]
        total, mean = self._means([sums], origin)
        # a row of four is written as one packet; the fourth number is unused
        place = dr.empty(mi.Float, 4 * self.cells)
        dr.scatter(place, arrays_of(mi.Float).Array4f(*mean, 0), dr.arange(mi.UInt32, self.cells))
        dr.eval(place)
        return self._shaped(total), place.numpy().reshape(self.beams, self.bins, 4)[..., :3]

    def mean_depth(self, *sums: mi.Float) -> np.ndarray:
        """Return the mean depths of all `sums` together, (B, T) [m]."""
        return self._shaped(self._means(sums, np.zeros(3))[1][2])

    def _shaped(self, values: mi.Float | mi.UInt32) -> np.ndarray:
        """Return values of cells on the host, (B, T)."""
        return values.numpy().reshape(self.beams, self.bins)

    def _means(self, sums: Sequence[mi.Float], origin: np.ndarray) -> tuple[mi.Float, list[mi.Float]]:
        """Return the energies of all `sums`, evaluated, and the means of x, y and depth; see `ground`."""
        lib, index = arrays_of(mi.Float), dr.arange(mi.UInt32, self.cells)

        def of(cell: mi.UInt32, active: mi.Bool) -> dr.ArrayBase:
            return sum((dr.gather(lib.Array4f, part, cell, active) for part in sums[1:]),
                       dr.gather(lib.Array4f, sums[0], cell, active))

        own = of(index, mi.Bool(True))
        total = own[0]
        dr.eval(total)
        least = dr.opaque(mi.Float, HARDLY * float(dr.max(total)[0]))
        # a bin that has no scatterer by chance takes the places of its neighbours
        empty, (_, column) = ~(total > least), divided(lib, index, self.bins)
        last = dr.opaque(mi.UInt32, self.bins - 1)
        near = own + of(index - 1, empty & (column > 0)) + of(index + 1, empty & (column < last))
        has_bed = near[0] > least
        per_energy = dr.rcp(dr.select(has_bed, near[0], 1))
        return total, [dr.select(has_bed, dr.fma(moment, per_energy, dr.opaque(mi.Float, float(zero))), dr.nan)
                       for moment, zero in zip((near[1], near[2], near[3]), (origin[0], origin[1], 0.0))]

    def counted(self, echoes: GridEchoes, cell: mi.UInt32, active: mi.Bool, in_lobe: mi.Bool | None,
                depth_below: float, farthest: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the number of separate runs of sectors in every bin (B, T), and of echoes in and around it (B, T).

        The last array counts the echoes of the main lobe alone, those of all beams within the width of a beam.
        """
        number = sector(echoes.launch_sine, dr.opaque(mi.Float, depth_below), dr.opaque(mi.Float, farthest))
        mask = dr.zeros(mi.UInt64, sum_size(self.cells))
        # the sums are too large for copies of each thread
        direct = dr.ReduceMode.Direct
        dr.scatter_reduce(dr.ReduceOp.Or, mask, mi.UInt64(1) << mi.UInt64(number // FEWER_SECTORS), cell, active,
                          direct)
        # of all echoes, and of those in the main lobe
        each = [mi.UInt32(1)] if in_lobe is None else [mi.UInt32(1), mi.UInt32(in_lobe)]
        counts = [dr.zeros(mi.UInt32, sum_size(self.cells)) for _ in each]
        for count, one in zip(counts, each):
            dr.scatter_add(count, one, cell, active, direct)
        dr.eval(mask, counts)
        lib, index = arrays_of(mi.Float), dr.arange(mi.UInt32, self.cells)
        row, column = divided(lib, index, self.bins)
        bins, beams = (dr.opaque(mi.UInt32, n) for n in (self.bins, self.beams))
        around, seen = [mi.UInt32(0) for _ in counts], mi.UInt64(0)
        for down in range(-CELL, CELL + 1):
            for along in range(-CELL, CELL + 1):
                # before the first row or column these are large numbers
                there = (row + mi.UInt32(down & LAST) < beams) & (column + mi.UInt32(along & LAST) < bins)
                beside = index + mi.UInt32(down & LAST) * bins + mi.UInt32(along & LAST)
                around = [total + dr.gather(mi.UInt32, count, beside, there) for total, count in zip(around, counts)]
                # a bin counts the sectors of its neighbours, too: its own few scatterers may miss a sector
                if abs(down) + abs(along) <= CELL:
                    seen |= dr.gather(mi.UInt64, mask, beside, there)
        # a single sector between others lacks an echo by chance
        seen = seen | (seen << 1) & (seen >> 1)
        own = [dr.gather(mi.UInt32, count, index) for count in counts]
        runs = dr.select(own[0] > 0, mi.UInt32(dr.popcnt(seen & ~(seen << 1))), 0)
        wide = self._lobe > CELL
        rays, in_beam = around[0], own[-1] if wide else around[-1]
        dr.eval(runs, rays, in_beam)
        among = self._shaped(in_beam)
        if wide:
            among = _summed(_summed(among, self._lobe), CELL, axis=1)
        return self._shaped(runs).astype(np.uint8), self._shaped(rays), among


def _summed(values: np.ndarray, reach: int, axis: int = 0) -> np.ndarray:
    """Return the sums of values over their neighbours up to a distance along an axis."""
    total = np.cumsum(np.pad(values, [(reach + 1, reach) if k == axis else (0, 0) for k in range(values.ndim)]), axis,
                      values.dtype)
    size = values.shape[axis]
    return total.take(range(2 * reach + 1, 2 * reach + 1 + size), axis) - total.take(range(size), axis)


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
        total, best, label = np.zeros(shape, np.float32), np.zeros(shape, np.float32), np.zeros(shape, np.uint32)
        by_label = {}
        for plane in planes:
            total[plane.where] += plane.energy
            by_label.setdefault(plane.label, []).append(plane)
        share = np.zeros((shape[0], self._labels, shape[1]), np.float32)
        per_total = np.reciprocal(total, out=np.zeros(shape, np.float32), where=total > 0)
        for number, of_instance in by_label.items():
            for plane in of_instance:
                beams, bins = plane.where
                part = plane.energy * per_total[plane.where]
                share[beams, number - 1, bins] += part
                part = share[beams, number - 1, bins]
                more = part > best[plane.where]
                label[plane.where] = np.where(more, np.uint32(number), label[plane.where])
                best[plane.where] = np.maximum(best[plane.where], part)
        dark, object_shadow = self._shadows(ground, total)
        return EnergyRecord(
            intensity=total * np.float32(source_power), depth=ground.depth, rays=ground.rays,
            rays_in_beam=ground.rays_in_beam,
            truth=BinTruth(label=label, share=share, hidden=dark, object_shadow=object_shadow, layover=ground.layover,
                           seabed_place=ground.place))

    def _nothing(self, shape: tuple[int, int]) -> _TruthGround:
        """Return the sums of a frame without scatterers."""
        none = np.zeros(shape, np.uint32)
        return _TruthGround(seabed=[], objects=[], lost=[], layover=np.zeros(shape, np.uint8), rays=none,
                            rays_in_beam=none, place=np.full((*shape, 3), np.nan, np.float32),
                            depth=np.full(shape, np.nan, np.float32))

    def _ground(self, echoes: GridEchoes, hidden: tuple[mi.UInt32, mi.UInt32], in_lobe: mi.Bool | None,
                origin: np.ndarray, depth_below: float, farthest: float) -> _TruthGround:
        """Return the sums of the scatterers' echoes, and of the seabed's echoes that objects hide."""
        bins = self._bins
        cell, inside = bins.cell_of(echoes)
        free = inside & (echoes.state == FREE)
        on_bed = free & dr.gather(mi.Bool, self._is_seabed, echoes.label)
        columns = echoes.energy, echoes.x, echoes.y, echoes.depth
        sums = bins.sums(cell, on_bed, *columns)
        (energy, place), others = bins.ground(sums, origin), compressed(free & ~on_bed)
        depth = place[..., 2]
        if dr.width(others):
            own = (dr.gather(mi.Float, column, others) for column in columns)
            depth = bins.mean_depth(sums, bins.sums(dr.gather(mi.UInt32, cell, others), mi.Bool(True), *own))
        layover, rays, rays_in_beam = bins.counted(echoes, cell, free, in_lobe, depth_below, farthest)
        seabed = []
        if len(self._seabed) == 1:
            seabed = [self._shown(self._seabed[0], energy, (0, bins.beams, 0, bins.bins))]
        few = compressed(free) if len(self._seabed) > 1 else others
        objects = list(self._planes(*_columns(few, cell, echoes.energy, echoes.label)))
        if len(self._seabed) > 1:
            seabed = [plane for plane in objects if plane.label in self._seabed]
            objects = [plane for plane in objects if plane.label not in self._seabed]
        index, hider = hidden
        lost = []
        if dr.width(index):
            of_bed = dr.gather(mi.Bool, inside, index) & (hider > 0) & dr.gather(
                mi.Bool, self._is_seabed, dr.gather(mi.UInt32, echoes.label, index))
            taken = compressed(of_bed)
            if dr.width(taken):
                number = dr.gather(mi.UInt32, index, taken)
                lost = list(self._planes(dr.gather(mi.UInt32, cell, number).numpy(),
                                         dr.gather(mi.Float, echoes.energy, number).numpy(),
                                         dr.gather(mi.UInt32, hider, taken).numpy()))
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
            cell, inside = self._bins.cell_of(target.echoes)
            shown = np.flatnonzero(inside.numpy() & (target.label > 0))
            number = target.label[shown].astype(np.int64) * self._bins.cells + cell.numpy()[shown]
            parts.append((number, target.echoes.real.numpy()[shown], target.echoes.imaginary.numpy()[shown]))
        if parts:
            number, power = powers(*(np.concatenate(column) for column in zip(*parts)))
            label, cell = np.divmod(number, self._bins.cells)
            yield from self._planes(cell, power, label)

    def _shadows(self, ground: _TruthGround, total: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the share of the seabed's echo that objects hide, and the objects of shadows; see `imaging.truth`."""
        hidden, shadow = np.zeros(total.shape, np.float32), np.zeros(total.shape, np.uint32)
        if not ground.lost:
            return hidden, shadow
        lost, most = np.zeros(total.shape, np.float32), np.zeros(total.shape, np.float32)
        for plane in ground.lost:
            lost[plane.where] += plane.energy
            more = plane.energy > most[plane.where]
            shadow[plane.where] = np.where(more, plane.label, shadow[plane.where])
            most[plane.where] = np.maximum(most[plane.where], plane.energy)
        bins = np.flatnonzero(lost)
        bed = lost.copy()
        for plane in ground.seabed:
            bed[plane.where] += plane.energy
        bed, taken = bed.ravel()[bins], lost.ravel()[bins]
        share = taken / bed
        hidden.ravel()[bins] = share
        dark = (share > HALF) & (total.ravel()[bins] < HALF * bed)
        shadow.ravel()[bins[~dark]] = 0
        return hidden, shadow


def _columns(index: mi.UInt32, *columns: mi.Float | mi.UInt32) -> list[np.ndarray]:
    """Return the entries of columns at numbers, on the host."""
    return [dr.gather(type(column), column, index).numpy() for column in columns]
