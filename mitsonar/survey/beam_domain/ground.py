"""Scatterers of a scene around a ping: strength of each echo at the sonar, and what hides it.

    thin       scatterers that the resolution requires                                  `echoes.thinned_scatterers`
    reach      their eigenrays, from a table for the depth of the sonar                 `echoes.eigenray_table`
    scatter    strength of the material, times the sonar equation                       `echoes.sonar_equation`
    hide       behind the bed's horizon, or behind objects          `tracing.bed_horizon`, `tracing.object_shadows`

Only the list of candidates is evaluated here; all the rest becomes part of the caller's kernel.
"""
from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import cast

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, compressed, opaque_vector, upload
from mitsonar.echoes.scatterers.scatterers import Cells, Scatterers
from mitsonar.echoes.scatterers.thinned_scatterers import Density, ThinnedScatterers, Useful
from mitsonar.echoes.sights.eigenray_table import EigenrayTable, TableLegs
from mitsonar.echoes.sonar_equation import GRAZING, along_legs
from mitsonar.propagation.device_rays.ray_fans import RayFans
from mitsonar.scene.labels import OBJECT, SEABED
from mitsonar.scene.materials import scattering_strength
from mitsonar.scene.shadows.bed_cover import bed_height, covered
from mitsonar.scene.shadows.bed_horizon import BedHorizon
from mitsonar.scene.shadows.object_shadows import ObjectShadows
from mitsonar.scene.tracing.connection import turned
from mitsonar.scene.tracing.hits import Hits

from ..pressure.array_survey import ArraySurvey
from ..pressure.ensonified_ping import ensonification_of

FREE, HIDDEN_BY_BED, HIDDEN_BY_OBJECT = 0, 1, 2
DEEP = 1e-3                        # [m] below the bed, least depth at which an object counts as buried
ASIDE = 5e-4                       # [m] off the surface of a scatterer, where the search for bed above it begins
TOGETHER = 1 << 19                 # scatterers whose paths by way of the surface are computed at once


@dataclass(frozen=True, kw_only=True, eq=False)
class LitScatterers:
    """Scatterers around a sonar, on the device."""

    scatterers: Cells
    offset: dr.ArrayBase  # (R,) [m], from the sonar
    legs: TableLegs  # from the sonar to the scatterers
    energy: mi.Float  # (R,), of their echoes, without beams
    state: mi.UInt32  # (R,): FREE, HIDDEN_BY_BED or HIDDEN_BY_OBJECT


class Ground:
    """Scatterers of a survey's scene within the ranges from nearest to farthest [m]."""

    def __init__(self, survey: ArraySurvey, beside: Ground | None = None):
        geometry, water = survey.surroundings
        reach = 0.5 * survey.time[-1] * survey.waters.fastest
        facets = beside._facets if beside is not None else Scatterers(
            geometry, np.inf, survey.pass_number, survey.world.seed)
        self._survey, self._lib = survey, arrays_of(mi.Float)
        self.ensonification = ensonification_of(survey, facets)
        self.nearest, self.farthest = self.ensonification.nearest, self.ensonification.farthest
        self._facets = facets
        self._scatterers = beside._scatterers if beside is not None else ThinnedScatterers(
            facets, farthest=reach, places=survey.planned.track.position,
            everywhere=survey.passage.stepping is not None, margin=self.ensonification.margin)
        as_far = beside if beside is not None and beside.farthest == self.farthest else None
        self._horizon = as_far._horizon if as_far else BedHorizon(geometry, self.farthest)
        self._objects = as_far._objects if as_far else ObjectShadows(geometry, water, self.farthest)
        self._kinds = upload(mi.UInt32, geometry.named.label_kinds())
        self._buried = beside._buried if beside is not None else self._partly_buried()
        self._table: EigenrayTable | None = None
        dr.eval(self._kinds)

    def lit(self, density: Density, useful: Useful) -> LitScatterers | None:
        """Return the scatterers around a place; None if there are none."""
        patch, number = self._scatterers.candidates(density, useful)
        if not dr.width(patch):
            return None
        table = self._table_of(-float(density.origin[2]))
        scatterers, exist = self._scatterers.at(patch, number, density)
        offset = scatterers.point - opaque_vector(self._lib.Array3f64, density.origin)
        legs = self.through_field(table.legs(offset), offset, density.origin, table)
        energy = self._energy(scatterers, exist & legs.exists, legs, table)
        return LitScatterers(scatterers=scatterers, offset=offset, legs=legs, energy=energy,
                             state=self._state(scatterers, legs, table, density.origin, energy > 0))

    def through_field(self, legs: TableLegs, offset: dr.ArrayBase, origin: np.ndarray,
                       table: EigenrayTable) -> TableLegs:
        """Return legs with what the water's field adds to their times, and turns their waves by at the sonar."""
        water = self.ensonification.water
        if water.field is None:
            return legs
        launch, speed = legs.launch_direction, dr.opaque(mi.Float64, table.sound_speed)
        level = dr.sqrt(dr.maximum(1 - dr.square(launch.z), 1e-12))
        heading, start = mi.Vector2f(launch.x, launch.y) / level, opaque_vector(self._lib.Array3f64, origin)
        ray = water.through_field(start, heading, mi.Float64(legs.horizontal_range), -(start.z + offset.z),
                                  legs.distance, mi.Float64(level) / speed, -launch.z)
        slope = ray.slope_upwards(self._lib.Array3f64)
        return replace(legs, travel_time=legs.travel_time + ray.later, launch_direction=turned(launch, slope, speed))

    def hiding(self, origin: np.ndarray, hidden: mi.UInt32, offset: tuple[mi.Float, mi.Float],
               launch_sine: mi.Float) -> mi.UInt32:
        """Return the numbers (H,) of the objects that hide scatterers; 0 if no object is found."""
        # origin (3,) [m]; hidden (H,), numbers of the scatterers; offset x, y (R,) [m]; launch_sine (R,)
        x, y, launch = (dr.gather(mi.Float, column, hidden) for column in (*offset, launch_sine))
        across = dr.sqrt(x * x + y * y)
        cosine = dr.sqrt(dr.maximum(1 - launch * launch, 0)) / dr.maximum(across, 1e-6)
        return self._objects.first(self._objects.sources(-float(origin[2])), _point(origin),
                                   mi.Vector3f(x * cosine, y * cosine, -launch), across)

    def mirrored(self, density: Density, useful: Useful) -> Iterator[Cells]:
        """Yield the scatterers around a place in blocks if a flat surface mirrors them and its paths count."""
        sights = self.ensonification.sights
        if not sights.mirror or sights.max_depth == 1:
            return
        patch, number = self._scatterers.candidates(density, useful)
        for first in range(0, dr.width(patch), TOGETHER):
            index = dr.arange(mi.UInt32, min(TOGETHER, dr.width(patch) - first)) + first
            block, exist = self._scatterers.at(dr.gather(mi.UInt32, patch, index),
                                               dr.gather(mi.UInt32, number, index), density)
            there = compressed(exist)
            if dr.width(there):
                yield block.chosen(there)

    def under_bed(self, origin: np.ndarray) -> Callable[[dr.ArrayBase], mi.Bool] | None:
        """Return a test of points (R,) [m] that is True only for those that the bed hides from a place (3,) [m].

        None if nothing is known without rays.
        """
        return self._horizon.under(origin)

    def fans(self, origin: np.ndarray) -> RayFans:
        """Return rays that leave a place (3,) [m], by chords fine enough to decide if something is in the way."""
        depth = -float(origin[2])
        if self._objects.exist:
            return self._objects.sources(depth).ray_fans
        return self.ensonification.tracer.sources([depth]).ray_fans

    def table(self, ping: int) -> EigenrayTable:
        """Return the table of eigenrays of a ping."""
        return self._table_of(-float(self._survey.track.position[ping, 2]))

    def _table_of(self, depth: float) -> EigenrayTable:
        """Return the table of a depth; the last table is kept."""
        if self._table is None or self._table.depth != depth:
            self._table = EigenrayTable(self.ensonification.connector, depth=depth, farthest=self.farthest)
        return self._table

    def _energy(self, scatterers: Cells, lit: mi.Bool, legs: TableLegs, table: EigenrayTable) -> mi.Float:
        """Return the energies of the scatterers' echoes, without beams."""
        # textures of materials refer to places of the scene
        hits = Hits.on_surface(valid=lit, point=scatterers.point, normal=scatterers.normal,
                               arrival_direction=legs.arrival_direction,
                               sound_speed=dr.opaque(mi.Float64, table.sound_speed), shape=scatterers.shape,
                               primitive=scatterers.primitive, uv=scatterers.uv, smooth=scatterers.smooth)
        strength, sin_grazing = scattering_strength(hits, lit, self._survey.frequency)
        energy = along_legs(strength * scatterers.area, legs.gain, legs.gain)
        return dr.select(lit & (sin_grazing > GRAZING) & dr.isfinite(energy), dr.maximum(energy, 0), 0)

    def _partly_buried(self) -> mi.Bool | None:
        """Return a flag for every label, True for an object that reaches below the bed; None if there are none."""
        geometry, facets = self._facets.geometry, self._facets
        kinds = geometry.named.label_kinds()
        buried = np.zeros(len(kinds), bool)
        of_objects = np.flatnonzero(facets.scattering & (kinds[facets.label] == OBJECT)).astype(np.uint32)
        if not of_objects.size or not self._horizon.exists:
            return None
        # objects that move may come to lie under a crest of the bed at another ping
        if -geometry.deepest_moving < self._horizon.highest:
            buried[[body.label for body in geometry.bodies]] = True
        corners = facets.corners(of_objects).reshape(-1, 3)
        # buried corners lie below the highest point of the bed, so few corners of tall objects remain
        low = np.flatnonzero(corners[:, 2] < self._horizon.highest)
        if low.size:
            # a facet has three corners, and a corner many facets, of which one is enough
            corners, number = np.unique(corners[low], axis=0, return_index=True)
            below = corners[:, 2] < bed_height(geometry, *corners[:, :2].T.astype(float)) - DEEP
            buried[facets.label[of_objects[low[number[below]] // 3]]] = True
        return upload(mi.Bool, buried) if buried.any() else None

    def _state(self, scatterers: Cells, legs: TableLegs, table: EigenrayTable, origin: np.ndarray,
               active: mi.Bool) -> mi.UInt32:
        """Return the states of scatterers: free, or hidden by the bed or by an object."""
        launch, arrival = legs.launch_direction, legs.arrival_direction
        on_bed = dr.gather(mi.UInt32, self._kinds, scatterers.label) == SEABED
        state = dr.zeros(mi.UInt32, dr.width(scatterers.label))
        heading = mi.Vector2f(launch.x, launch.y)
        water = self.ensonification.water
        horizon = self._horizon.around(origin, table.launch_rise, water.fastest / water.slowest)
        if horizon is not None:
            hidden = horizon.hidden(heading, legs.horizontal_range, launch.z, on_bed)
            # the far side of a crest, whose upward normal points away
            hidden |= on_bed & (dr.dot(scatterers.normal, arrival) * scatterers.normal.z > 0)
            state = dr.select(active & hidden, HIDDEN_BY_BED, state)
        if self._buried is not None:
            # the horizon decides only for points deep below the bed, and from where it begins
            in_doubt = active & (state == FREE) & dr.gather(mi.Bool, self._buried, scatterers.label)
            aside = dr.copysign(dr.opaque(mi.Float, ASIDE), -dr.dot(scatterers.normal, arrival))
            outward = cast(mi.Float, aside) * scatterers.normal
            place = mi.Point3f(mi.Vector3f(scatterers.point) + outward)
            under = self._horizon.deep(place, in_doubt)
            under |= covered(self._facets.geometry, place, in_doubt & ~under)
            state = dr.select(in_doubt & under, HIDDEN_BY_BED, state)
            if dr.backend_v(mi.Float) != dr.JitBackend.LLVM:
                dr.eval(state)     # OptiX leaves out what a kernel traces in a second scene, here that of the objects
        if self._objects.exist:
            behind = self._objects.sectors(origin).behind(heading, legs.horizontal_range)
            hidden = self._objects.hidden(
                self._objects.sources(-float(origin[2])), _point(origin), launch, arrival,
                mi.Point3f(scatterers.point), scatterers.normal,
                legs.horizontal_range, active & (state == FREE) & behind)
            state = dr.select(hidden, HIDDEN_BY_OBJECT, state)
        return state


def _point(origin: np.ndarray) -> mi.Point3f:
    return mi.Point3f(*(dr.opaque(mi.Float, float(v)) for v in origin))
