"""Echoes around a rotating head: of scatterers thinned to its resolution, and of all that has a phase of its own.

    thin       scatterers that the resolution asks for, fixed to the ground             `echoes.thinned_scatterers`
    reach      their eigenrays, from a table of this depth                              `echoes.eigenray_table`
    scatter    strength of the material, times the sonar equation                       `echoes.sonar_equation`
    hide       behind the bed's horizon, or behind objects          `tracing.bed_horizon`, `tracing.object_shadows`
    others     point targets, smooth surfaces, a flat surface overhead                  `echoes.ensonification`

They are those of one place, whatever way the head looks: what its beam makes of them at every ping is `step_signals`.
"""
from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from ..device.arrays import arrays_of, compressed, upload
from ..echoes.eigenray_table import EigenrayTable, TableLegs
from ..echoes.record import Echoes
from ..echoes.scatterers import Cells, Scatterers
from ..echoes.sonar_equation import GRAZING, along_legs
from ..echoes.thinned_scatterers import Density, ThinnedScatterers, ThinnedSet
from ..scene.labels import SEABED
from ..scene.materials import scattering_strength
from ..sonar.sidescan import Sidescan
from ..tracing.bed_horizon import BedHorizon, Horizon
from ..tracing.hits import Hits
from ..tracing.object_shadows import ObjectShadows
from .array_survey import ArraySurvey
from .ensonified_ping import ensonification_of

__all__ = ["HeadEchoes", "StepEchoes"]

GHOSTS_TOGETHER = 1 << 19          # scatterers that are looked at by way of the surface at a time


@dataclass(frozen=True, kw_only=True, eq=False)
class HeadEchoes:
    """Echoes of one place, as a head there hears them that stands still and looks everywhere alike.

    Attributes
    ----------
    sent, towards : Vector3f (R,)
        Unit, scene: where sound leaves for, and where its echo comes from.
    distance : Float (R,) [m]
        To where the echo comes from.
    delay : Float64 (R,) [s]
    real, imaginary : Float (R,)
        Complex amplitude for a source level of 0 dB, without the carrier's phase.
    """

    sent: mi.Vector3f
    towards: mi.Vector3f
    distance: mi.Float
    delay: mi.Float64
    real: mi.Float
    imaginary: mi.Float

    @property
    def count(self) -> int:
        """How many."""
        return dr.width(self.delay)


class StepEchoes:
    """Make the echoes around the places of a survey.

    Parameters
    ----------
    survey : ArraySurvey
        Of one transmit and one receive element at the head.
    face : Sidescan
        Of the head.
    per_cell : float [-]
        Scatterers a resolution cell.
    """

    def __init__(self, survey: ArraySurvey, face: Sidescan, *, per_cell: float):
        geometry, reach = survey.geometry, 0.5 * survey.time[-1] * survey.water.fastest
        facets = Scatterers(geometry, np.inf)
        self._survey, self._lib, self._per_cell = survey, arrays_of(mi.Float), float(per_cell)
        self.ensonification = ensonification_of(survey, facets)
        self._scatterers, self._farthest = ThinnedScatterers(
            facets, farthest=reach, places=survey.track.position), self.ensonification.farthest
        self._horizon = BedHorizon(geometry, self._farthest)
        self._objects = ObjectShadows(geometry, survey.water, self._farthest)
        self._kinds = upload(mi.UInt32, geometry.named.label_kinds())
        self._cell = 0.5 * face.sound_speed / survey.pulse.bandwidth, face.wavelength / face.longest
        self._table: EigenrayTable | None = None
        dr.eval(self._kinds)

    def of_scatterers(self, origin: np.ndarray, axis: np.ndarray,
                      useful: Callable[[mi.Vector3f, mi.Float], mi.Bool]) -> HeadEchoes | None:
        """Give the echoes of the scatterers around a place; None where there is none.

        Parameters
        ----------
        origin : (3,) [m]
        axis : (3,)
            That the head turns about, scene coordinates.
        useful : callable(direction, distance) -> Bool
            Whether a scene direction is looked into at a distance [m].
        """
        density, patch, number = self._candidates(origin, axis, useful)
        if not dr.width(patch):
            return None
        table = self._table_of(-float(origin[2]))
        scatterers = self._scatterers.at(patch, number, density)
        legs = table.legs(scatterers.offset)
        energy = self._energy(scatterers, legs, table, scatterers.exists & legs.exists)
        heard = energy > 0
        heard &= ~self._behind_bed(scatterers, legs, table, origin, heard)
        heard &= ~self._behind_objects(scatterers, legs, origin, heard)
        root, (a, b) = dr.sqrt(energy), scatterers.amplitude
        towards, distance, delay = legs.launch_direction, legs.distance, 2 * legs.travel_time
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
        sights = self.ensonification.sights
        if not sights.mirror or sights.max_depth == 1:
            return
        density, patch, number = self._candidates(origin, axis, useful)
        start = self._lib.Array3f64(*(dr.opaque(mi.Float64, float(v)) for v in origin))
        for first in range(0, dr.width(patch), GHOSTS_TOGETHER):
            index = dr.arange(mi.UInt32, min(GHOSTS_TOGETHER, dr.width(patch) - first)) + first
            some = self._scatterers.at(dr.gather(mi.UInt32, patch, index), dr.gather(mi.UInt32, number, index),
                                       density).where_existing()
            if not dr.width(some.area):
                continue
            cells = Cells(point=start + some.offset, normal=some.normal, area=some.area, amplitude=some.amplitude,
                          shape=some.shape, primitive=some.primitive, uv=some.uv)
            for echoes in self.ensonification.mirrored_echoes(origin, cells):
                yield _still(echoes)

    def _candidates(self, origin: np.ndarray, axis: np.ndarray, useful: Callable[[mi.Vector3f, mi.Float], mi.Bool],
                    ) -> tuple[Density, mi.UInt32, mi.UInt32]:
        """How densely a place needs scatterers, and which may exist: patches and numbers."""
        density = Density(origin=origin, axis=axis, per_cell=self._per_cell, range_cell=self._cell[0],
                          sine_cell=self._cell[1], nearest=self.ensonification.nearest, farthest=self._farthest,
                          around=True)
        return density, *self._scatterers.candidates(density, useful)

    def coherent(self, origin: np.ndarray) -> Iterator[HeadEchoes]:
        """Yield the echoes that owe no phase to chance."""
        for _, echoes in self.ensonification.coherent_echoes(origin):
            yield _still(echoes)

    def by_chance(self, origin: np.ndarray, rotation: np.ndarray, depth_below: float,
                  key: int) -> Iterator[HeadEchoes]:
        """Yield the echoes of more bounces and of the water, drawn for one ping; `key` is that ping's."""
        for echoes in self.ensonification.random_echoes(origin, rotation, depth_below, key):
            yield _still(echoes)

    def _table_of(self, depth: float) -> EigenrayTable:
        """The table of a depth; the last one is kept."""
        if self._table is None or self._table.depth != depth:
            self._table = EigenrayTable(self.ensonification.connector, depth=depth, farthest=self._farthest)
        return self._table

    def _energy(self, scatterers: ThinnedSet, legs: TableLegs, table: EigenrayTable, lit: mi.Bool) -> mi.Float:
        hits = Hits.on_surface(valid=lit, point=scatterers.offset, normal=scatterers.normal,
                               arrival_direction=legs.arrival_direction,
                               sound_speed=dr.opaque(mi.Float64, table.sound_speed), shape=scatterers.shape,
                               primitive=scatterers.primitive, uv=scatterers.uv)
        strength, sin_grazing = scattering_strength(hits, lit, self._survey.frequency)
        energy = along_legs(strength * scatterers.area, legs.gain, legs.gain)
        return dr.select(lit & (sin_grazing > GRAZING) & dr.isfinite(energy), dr.maximum(energy, 0), 0)

    def _behind_bed(self, scatterers: ThinnedSet, legs: TableLegs, table: EigenrayTable, origin: np.ndarray,
                    active: mi.Bool) -> mi.Bool:
        """Which scatterers the bed hides, or has on its far side."""
        horizon: Horizon | None = self._horizon.around(origin, table.launch_rise)
        if horizon is None:
            return mi.Bool(False)
        launch = legs.launch_direction
        on_bed = dr.gather(mi.UInt32, self._kinds, scatterers.label) == SEABED
        turned_away = dr.dot(scatterers.normal, legs.arrival_direction) * scatterers.normal.z > 0
        hidden = horizon.hidden(mi.Vector2f(launch.x, launch.y), legs.horizontal_range, launch.z, on_bed)
        return active & (hidden | (on_bed & turned_away))

    def _behind_objects(self, scatterers: ThinnedSet, legs: TableLegs, origin: np.ndarray, active: mi.Bool) -> mi.Bool:
        """Which scatterers objects hide."""
        if not self._objects.exist:
            return mi.Bool(False)
        launch = legs.launch_direction
        behind = self._objects.sectors(origin).behind(mi.Vector2f(launch.x, launch.y), legs.horizontal_range)
        here = [dr.opaque(mi.Float, float(v)) for v in origin]
        point = mi.Point3f(*(v + mi.Float(part) for v, part in zip(here, scatterers.offset)))
        return self._objects.hidden(
            self._objects.sources(-float(origin[2])), mi.Point3f(*here), launch, legs.arrival_direction, point,
            scatterers.normal, legs.horizontal_range, active & behind)


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
