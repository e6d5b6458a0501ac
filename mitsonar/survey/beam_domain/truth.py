"""The truth of a picture in the beam domain, from the very echoes that the picture is made of.

    E_l[b, t] = Σ |e|² over the echoes of instance l that beam b and bin t receive;     shown by `blur`

Scatterers that objects hide count for what these take from the seabed (`imaging.truth`), those behind the bed's own
horizon for nothing. Echoes with a phase of their own are added first, instance by instance, and squared then.
"""
from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy.ndimage import uniform_filter

from ...device.arrays import upload
from ...echoes.origin_sums import SECTORS, sector
from ...imaging.energy_record import EnergyRecord
from ...imaging.truth import HALF, BinTruth
from ...scene.labels import ShapeLabels
from .blur import Blur
from .record import FREE, HIDDEN_BY_OBJECT, GridEchoes, TargetEchoes

__all__ = ["FrameTruth"]

CELL = 3                           # bins and beams, each way, over which scatterers are counted
FEWER_SECTORS = SECTORS // 64      # that make one here: scatterers are too few for more
HARDLY = 1e-6                      # of the strongest bin's energy: a bed that brings less has no place


@dataclass(frozen=True, kw_only=True)
class _Placed:
    """Echoes on the host: beam, bin and energy of each, all within the picture."""

    row: np.ndarray
    bin: np.ndarray
    energy: np.ndarray


@dataclass(frozen=True, kw_only=True)
class _Plane:
    """Energies (beams, bins) of one instance as the picture shows them, within a box."""

    label: int
    first_beam: int
    first_bin: int
    energy: np.ndarray

    @property
    def where(self) -> tuple[slice, slice]:
        """The box."""
        return (slice(self.first_beam, self.first_beam + self.energy.shape[0]),
                slice(self.first_bin, self.first_bin + self.energy.shape[1]))


class FrameTruth:
    """Make the truth of frames.

    Parameters
    ----------
    blur : Blur
        Of the beams.
    lead, bins : int
        Samples of the record before the picture's, and of the picture.
    named : ShapeLabels
    """

    def __init__(self, blur: Blur, *, lead: int, bins: int, named: ShapeLabels):
        self._blur, self._lead, self._bins = blur, lead, bins
        self._labels, self._seabed = len(named), named.seabed
        self._edges = blur.edges

    def of(self, scatterers: GridEchoes | None, hidden: tuple[np.ndarray, np.ndarray],
           targets: Sequence[TargetEchoes], *, origin: np.ndarray, depth_below: float, farthest: float,
           source_power: float) -> EnergyRecord:
        """Give the truth of a frame; arrays (B, ..., bins).

        Parameters
        ----------
        scatterers : GridEchoes or None
        hidden : (H,), (H,) uint32
            Numbers of the scatterers that objects hide, and of the objects.
        targets : sequence of TargetEchoes
        origin : (3,) [m]
            Of the places.
        depth_below, farthest : float [m]
            Bed below the sonar; range at which the record ends.
        source_power : float [µPa²]
            10^(SL/10).
        """
        shape = self._blur.beams, self._bins
        planes, lost = [], []
        seabed = np.zeros(shape)
        place = np.full((*shape, 3), np.nan, np.float32)
        layover, rays = np.zeros(shape, np.uint8), np.zeros(shape, np.uint32)
        if scatterers is not None:
            every = _Columns(scatterers, self._edges, self._lead, self._bins)
            free = every.state == FREE
            for label in range(1, self._labels + 1):
                some = np.flatnonzero(free & (every.label == label))
                if len(some):
                    energy, box = self._summed(every.placed(some))
                    planes.append(self._shown(label, energy, box))
                    if label in self._seabed:
                        seabed[box[0]:box[1], box[2]:box[3]] += energy
            on_bed = free & np.isin(every.label, list(self._seabed))
            place = self._places(every, np.flatnonzero(on_bed), seabed, origin)
            layover, rays = self._counted(every, np.flatnonzero(free), depth_below, farthest)
            lost = list(self._hidden(every, *hidden))
        planes += list(self._of_targets(targets))
        total = np.zeros(shape, np.float32)
        for plane in planes:
            total[plane.where] += plane.energy
        share = np.zeros((shape[0], self._labels, shape[1]), np.float32)
        for plane in planes:
            beams, bins = plane.where
            with np.errstate(divide="ignore", invalid="ignore"):
                part = np.where(total[plane.where] > 0, plane.energy / total[plane.where], 0)
            share[beams, plane.label - 1, bins] += part
        label = np.where(total > 0, share.argmax(1) + 1, 0).astype(np.uint32)
        dark, object_shadow = self._shadows(lost, [plane for plane in planes if plane.label in self._seabed], total)
        return EnergyRecord(
            intensity=total * source_power, depth=place[..., 2], rays=rays, rays_in_beam=rays,
            truth=BinTruth(label=label, share=share, hidden=dark, object_shadow=object_shadow, layover=layover,
                           seabed_place=place))

    def _summed(self, placed: _Placed) -> tuple[np.ndarray, tuple[int, int, int, int]]:
        """Energies of echoes within the box that holds them: (b, t), and the box."""
        b0, b1 = int(placed.row.min()), int(placed.row.max()) + 1
        t0, t1 = int(placed.bin.min()), int(placed.bin.max()) + 1
        index = (placed.row - b0) * (t1 - t0) + (placed.bin - t0)
        energy = np.bincount(index, placed.energy, (b1 - b0) * (t1 - t0))
        return energy.reshape(b1 - b0, t1 - t0), (b0, b1, t0, t1)

    def _shown(self, label: int, energy: np.ndarray, box: tuple[int, int, int, int]) -> _Plane:
        """What the picture makes of energies in a box."""
        b0, b1, t0, t1 = self._blur.grown(box, self._bins)
        wide = np.zeros((b1 - b0, t1 - t0), np.float32)
        wide[box[0] - b0:box[1] - b0, box[2] - t0:box[3] - t0] = energy
        return _Plane(label=label, first_beam=b0, first_bin=t0, energy=self._blur.shown(wide, b0))

    def _hidden(self, every: _Columns, index: np.ndarray, hider: np.ndarray) -> Iterator[_Plane]:
        """What objects take from the seabed, object by object."""
        of_bed = every.inside[index] & np.isin(every.label[index], list(self._seabed)) & (hider > 0)
        index, hider = index[of_bed], hider[of_bed]
        for label in np.unique(hider):
            energy, box = self._summed(every.placed(index[hider == label]))
            yield self._shown(int(label), energy, box)

    def _of_targets(self, targets: Sequence[TargetEchoes]) -> Iterator[_Plane]:
        """Echoes with a phase, squared when those of an instance in a bin are added."""
        parts = []
        for target in targets:
            every = _Columns(target.echoes, self._edges, self._lead, self._bins)
            some = np.flatnonzero(every.inside & (target.label > 0))
            parts.append((target.label[some], every.row[some], every.bin[some],
                          every.pressure(target.echoes)[some]))
        if not parts:
            return
        label, row, bin, pressure = (np.concatenate(column) for column in zip(*parts))
        for number in np.unique(label):
            mine = label == number
            key, which = np.unique(row[mine] * self._bins + bin[mine], return_inverse=True)
            z = np.bincount(which, pressure[mine].real) + 1j * np.bincount(which, pressure[mine].imag)
            energy, box = self._summed(_Placed(row=key // self._bins, bin=key % self._bins, energy=np.abs(z) ** 2))
            yield self._shown(int(number), energy, box)

    def _shadows(self, lost: Sequence[_Plane], seabed: Sequence[_Plane],
                 total: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Share of the seabed's echo that objects hide, and whose shadow a bin lies in; see `imaging.truth.shadows`."""
        hidden, whose = np.zeros(total.shape, np.float32), np.zeros(total.shape, np.uint32)
        if not lost:
            return hidden, whose
        by_object, most = np.zeros(total.shape, np.float32), np.zeros(total.shape, np.float32)
        for plane in lost:
            by_object[plane.where] += plane.energy
            more = plane.energy > most[plane.where]
            whose[plane.where] = np.where(more, plane.label, whose[plane.where])
            most[plane.where] = np.maximum(most[plane.where], plane.energy)
        whole = by_object.copy()
        for plane in seabed:
            whole[plane.where] += plane.energy
        hidden = np.where(whole > 0, by_object / np.where(whole > 0, whole, 1), 0).astype(np.float32)
        dark = (hidden > HALF) & (total < HALF * whole)
        return hidden, np.where(dark, whose, 0).astype(np.uint32)

    def _places(self, every: _Columns, some: np.ndarray, seabed: np.ndarray, origin: np.ndarray) -> np.ndarray:
        """Mean places of the seabed, weighted by energy: (B, bins, 3) float32 [m], NaN where there is hardly any."""
        index = every.index[some]
        energy = every.energy[some].astype(float)
        there = seabed > HARDLY * seabed.max(initial=0)
        place = np.full((*seabed.shape, 3), np.nan, np.float32)
        for axis, (column, zero) in enumerate(((every.x, origin[0]), (every.y, origin[1]), (every.depth, 0.0))):
            mean = np.bincount(index, energy * column[some], seabed.size).reshape(seabed.shape)
            place[..., axis] = np.where(there, mean / np.where(there, seabed, 1) + zero, np.nan)
        return place

    def _counted(self, every: _Columns, some: np.ndarray, depth_below: float,
                 farthest: float) -> tuple[np.ndarray, np.ndarray]:
        """Separate runs of sectors in every bin, and scatterers of the resolution cell around it."""
        shape = self._blur.beams, self._bins
        index = every.index[some]
        count = np.bincount(index, minlength=shape[0] * shape[1]).reshape(shape)
        near = uniform_filter(count.astype(np.float32), CELL, mode="constant") * CELL ** 2
        layover = _runs(upload(mi.UInt32, index.astype(np.uint32)), upload(mi.Float, every.launch_sine[some]),
                        shape[0] * shape[1], depth_below, farthest)
        return layover.numpy().astype(np.uint8).reshape(shape), np.rint(near).astype(np.uint32)


def _runs(index: mi.UInt32, launch_sine: mi.Float, bins: int, depth_below: float, farthest: float) -> mi.UInt32:
    """Count the separate runs of sectors that echoes of bins come from; see `echoes.origin_sums`."""
    number = sector(launch_sine, dr.opaque(mi.Float, depth_below), dr.opaque(mi.Float, farthest)) // FEWER_SECTORS
    mask = dr.zeros(mi.UInt64, bins)
    dr.scatter_reduce(dr.ReduceOp.Or, mask, mi.UInt64(1) << mi.UInt64(number), index)
    # a single sector without an echo lies between others by chance
    mask = mask | (mask << 1) & (mask >> 1)
    return mi.UInt32(dr.popcnt(mask & ~(mask << 1)))


class _Columns:
    """Echoes of a block on the host: where in the picture each lies."""

    def __init__(self, echoes: GridEchoes, edges: np.ndarray, lead: int, bins: int):
        self.label, self.state, self.energy = (column.numpy() for column in (echoes.label, echoes.state,
                                                                             echoes.energy))
        self.x, self.y, self.depth = echoes.x.numpy(), echoes.y.numpy(), echoes.depth.numpy()
        self.launch_sine = echoes.launch_sine.numpy()
        sine, column = echoes.sine.numpy(), echoes.column.numpy()
        beams = len(edges) - 1
        step = np.diff(edges)
        if np.ptp(step) < 1e-6 * abs(step[0]):                       # equal steps need no search
            row = np.floor((sine - np.float32(edges[0])) * np.float32(1 / step[0]))
        else:
            row = (np.searchsorted(edges, sine, side="right") - 1).astype(np.float32)
        bin = np.rint(column) - lead
        self.inside = (row >= 0) & (row < beams) & (bin >= 0) & (bin < bins) & (self.energy > 0)
        self.row = np.where(self.inside, row, 0).astype(np.int64)
        self.bin = np.where(self.inside, bin, 0).astype(np.int64)
        self.index = self.row * bins + self.bin
        self.state = np.where(self.inside, self.state, np.uint32(HIDDEN_BY_OBJECT + 1))

    def placed(self, some: np.ndarray) -> _Placed:
        """Echoes with these numbers."""
        return _Placed(row=self.row[some], bin=self.bin[some], energy=self.energy[some])

    def pressure(self, echoes: GridEchoes) -> np.ndarray:
        """Complex amplitudes."""
        return echoes.real.numpy() + 1j * echoes.imaginary.numpy()
