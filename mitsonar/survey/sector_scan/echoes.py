"""Echoes around a rotating head: of scatterers thinned to its resolution, and of all that has a phase of its own.

    ground     scatterers with their legs and energies, and what hides them             `ground`
    others     point targets, smooth surfaces, a flat surface overhead                  `echoes.ensonification`

They are those of one place, whatever way the head looks: what its beam makes of them at every ping is `signals`.

Which echoes which pings of a rotating head hear: those about the bearing it looks in.

The envelope of a sinc's side lobes is 1 / (πx), x = u L / λ, so that of the two-way intensity is 1 / (πx)⁴; what lies
at larger cosines u to the beam's side than `StepBeam.reach` is left out. A cosine is u = cos ε sin Δ, ε the elevation
off the plane that the head turns in and Δ the bearing from its own, so echoes are sorted by bearing in classes of ε.
"""
from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import compressed, upload
from mitsonar.echoes.ensonification import Ensonification
from mitsonar.echoes.record import Echoes
from mitsonar.echoes.scatterers.thinned_scatterers import Density
from mitsonar.sonar.faces.sidescan import Sidescan

from ..beam_domain.ground import FREE, Ground
from ..pressure.array_survey import ArraySurvey


@dataclass(frozen=True, kw_only=True, eq=False)
class HeadEchoes:
    """Echoes of one place, as a head there hears them that stands still and looks everywhere alike."""

    sent: mi.Vector3f  # (R,): unit, scene
    towards: mi.Vector3f  # (R,): unit, scene
    distance: mi.Float  # (R,) [m]: to where the echo comes from
    delay: mi.Float64  # (R,) [s]
    real: mi.Float  # (R,): complex amplitude for a source level of 0 dB, without the carrier's phase
    imaginary: mi.Float  # (R,): complex amplitude for a source level of 0 dB, without the carrier's phase

    @property
    def count(self) -> int:
        """How many."""
        return dr.width(self.delay)


class StepEchoes:
    """Make the echoes around the places of a survey."""

    def __init__(self, survey: ArraySurvey, face: Sidescan, *, per_cell: float):
        self._ground, self._per_cell = Ground(survey), float(per_cell)
        self._cell = 0.5 * face.sound_speed / survey.pulse.bandwidth, face.wavelength / face.longest

    @property
    def ensonification(self) -> Ensonification:
        """Makes what else there is."""
        return self._ground.ensonification

    def of_scatterers(self, origin: np.ndarray, axis: np.ndarray,
                      useful: Callable[[mi.Vector3f, mi.Float], mi.Bool]) -> HeadEchoes | None:
        """Return the echoes of the scatterers around a place; None where there is none."""
        # origin (3,) [m]; axis (3,)
        lit = self._ground.lit(self._density(origin, axis), useful)
        if lit is None:
            return None
        root, (a, b), heard = dr.sqrt(lit.energy), lit.scatterers.amplitude, (lit.energy > 0) & (lit.state == FREE)
        towards, distance, delay = lit.legs.launch_direction, lit.legs.distance, 2 * lit.legs.travel_time
        real, imaginary = root * a, root * b
        dr.eval(heard, towards, distance, delay, real, imaginary)
        index = compressed(heard)
        if not dr.width(index):
            return None
        towards = dr.gather(mi.Vector3f, towards, index)
        return _evaluated(HeadEchoes(
            sent=towards, towards=towards, distance=dr.gather(mi.Float, distance, index),
            delay=dr.gather(mi.Float64, delay, index), real=dr.gather(mi.Float, real, index),
            imaginary=dr.gather(mi.Float, imaginary, index)))

    def mirrored(self, origin: np.ndarray, axis: np.ndarray,
                 useful: Callable[[mi.Vector3f, mi.Float], mi.Bool]) -> Iterator[HeadEchoes]:
        """Yield the echoes of the scatterers by way of a flat surface that mirrors; arguments as of `of_scatterers`."""
        for cells in self._ground.mirrored(self._density(origin, axis), useful):
            for echoes in self.ensonification.mirrored_echoes(origin, cells):
                yield _still(echoes)

    def _density(self, origin: np.ndarray, axis: np.ndarray) -> Density:
        """How densely a place needs scatterers."""
        return Density(origin=origin, axis=axis, per_cell=self._per_cell, range_cell=self._cell[0],
                       sine_cell=self._cell[1], nearest=self._ground.nearest, farthest=self._ground.farthest,
                       around=True)

    def coherent(self, origin: np.ndarray) -> Iterator[HeadEchoes]:
        """Yield the echoes that owe no phase to chance."""
        for _, echoes in self.ensonification.coherent_echoes(origin):
            yield _still(echoes)

    def by_chance(self, origin: np.ndarray, rotation: np.ndarray, depth_below: float,
                  key: int) -> Iterator[HeadEchoes]:
        """Yield the echoes of more bounces and of the water, drawn for one ping; `key` is that ping's."""
        for echoes in self.ensonification.random_echoes(origin, rotation, depth_below, key):
            yield _still(echoes)


def _still(echoes: Echoes) -> HeadEchoes:
    out, back = echoes.out, echoes.back
    count = echoes.count
    whole = dr.zeros(mi.Float, count)
    return _evaluated(HeadEchoes(
        sent=mi.Vector3f(out.sent_towards) + whole, towards=mi.Vector3f(back.sent_towards) + whole,
        distance=mi.Float(dr.norm(back.offset)) + whole, delay=echoes.arrival + back.travel_time + mi.Float64(whole),
        real=echoes.amplitude[0] + whole, imaginary=echoes.amplitude[1] + whole))


def _evaluated(echoes: HeadEchoes) -> HeadEchoes:
    dr.eval(*vars(echoes).values())
    return echoes


STEEPEST = (25.0, 50.0, 90.0)      # [degrees] elevations that the classes end at
AT_ONCE = 1 << 22                  # pairs of ping and echo


@dataclass(frozen=True, kw_only=True, eq=False)
class Pairs:
    """Echoes and the pings of a block that hear them."""

    echoes: HeadEchoes
    row: mi.UInt32  # (N,): number of the ping in the block
    index: mi.UInt32  # (N,): of the echo
    active: mi.Bool  # (N,)

    @classmethod
    def all_of(cls, echoes: HeadEchoes, row: int) -> Pairs:
        """Let one ping hear all echoes."""
        count = echoes.count
        return cls(echoes=echoes, row=dr.full(mi.UInt32, row, count), index=dr.arange(mi.UInt32, count),
                   active=dr.full(mi.Bool, True, count))


class SortedEchoes:
    """Echoes around a head that stands still, sorted by bearing."""
    # frame (3, 3)

    def __init__(self, frame: np.ndarray, echoes: Sequence[HeadEchoes], reach: float):
        self._frame, self._parts = frame, []
        for some in echoes:
            towards = np.stack([column.numpy() for column in some.sent], -1) @ frame
            bearing = np.arctan2(towards[:, 1], towards[:, 0])
            steepness = np.rad2deg(np.arcsin(np.minimum(np.abs(towards[:, 2]), 1)))
            low = -1.0
            for high in STEEPEST:
                mine = np.flatnonzero((steepness > low) & (steepness <= high)).astype(np.uint32)
                low, cosine = high, np.cos(np.deg2rad(high))
                if len(mine):
                    mine = mine[np.argsort(bearing[mine], kind="stable")]
                    half = np.arcsin(reach / cosine) if reach < cosine else np.pi
                    self._parts.append((some, upload(mi.UInt32, mine), bearing[mine], half))

    def heard(self, looks: np.ndarray) -> Iterator[Pairs]:
        """Yield what pings hear that look along unit vectors (P, 3)."""
        towards = looks @ self._frame
        bearing = np.arctan2(towards[:, 1], towards[:, 0])
        for echoes, order, sorted_bearing, half in self._parts:
            total = len(sorted_bearing)
            first, count = np.zeros(len(bearing), np.int64), np.full(len(bearing), total)
            if half < np.pi:
                three = np.concatenate([sorted_bearing - 2 * np.pi, sorted_bearing, sorted_bearing + 2 * np.pi])
                first = np.searchsorted(three, bearing - half)
                count = np.minimum(np.searchsorted(three, bearing + half) - first, total)
            width = int(count.max())
            if not width:
                continue
            rows = max(1, AT_ONCE // width)
            for start in range(0, len(bearing), rows):
                some = slice(start, start + rows)
                yield self._chosen(echoes, order, start, first[some] % total, count[some], width, total)

    def _chosen(self, echoes: HeadEchoes, order: mi.UInt32, start: int, first: np.ndarray, count: np.ndarray,
                width: int, total: int) -> Pairs:
        """Pairs of some pings, each with as many lanes as the one with the most echoes."""
        lane, wide = dr.arange(mi.UInt32, len(first) * width), dr.opaque(mi.UInt32, width)
        row = lane // wide
        place = lane - row * wide
        begin, end = (dr.gather(mi.UInt32, upload(mi.UInt32, part.astype(np.uint32)), row) for part in (first, count))
        active, place = place < end, begin + place
        all_of_them = dr.opaque(mi.UInt32, total)
        place = dr.select(place >= all_of_them, place - all_of_them, place)
        return Pairs(echoes=echoes, row=row + dr.opaque(mi.UInt32, start), index=dr.gather(mi.UInt32, order, place),
                     active=active)
