"""Ends of paths made from rays: their first hits, the same by way of the mirror, and one bounce more.

    ΔΩ_n = ΔΩ_(n-1) σ / (sin θ p)           p the density that the direction of bounce n - 1 was drawn with

so that on the average a bounce carries on the surface's albedo (`scene.materials.next_direction`).
"""
from __future__ import annotations

from dataclasses import replace

import drjit as dr
import mitsuba as mi

from mitsonar.device.chance import other_pair, pair, uniform
from mitsonar.scene.materials import next_direction
from mitsonar.scene.tracing.connection import Connector
from mitsonar.scene.tracing.free_rays import FreeRays
from mitsonar.scene.tracing.hits import Hits
from mitsonar.scene.tracing.launch import Strata

from ..paths import Paths
from ..record import Leg
from ..sonar_equation import GRAZING, lit_patch, solid_angle_of
from .path_ends import Ends, computed, image_of

__all__ = ["TracedEnds"]


class TracedEnds:
    """Make ends of rays.

    Parameters
    ----------
    connector : Connector
    free_rays : FreeRays
    frequency : float [Hz]
    """

    def __init__(self, connector: Connector, free_rays: FreeRays, *, frequency: float):
        geometry = connector.geometry
        self._connector, self._free_rays, self._water = connector, free_rays, connector.water
        self._frequency, self._lib, self._mirror = frequency, connector.lib, geometry.surface_mirrors
        self._surface = dr.opaque(mi.UInt32, geometry.surface_label)

    def first(self, hits: Hits, solid_angle: mi.Float, origin: dr.ArrayBase) -> Ends:
        """Give the ends that rays have met first."""
        sine = -dr.dot(hits.normal, hits.arrival_direction)
        valid = hits.valid & (sine > GRAZING)
        if self._mirror:
            valid &= hits.label != self._surface                        # what lies beyond is seen folded
        loss_db = self._water.one_way_db(origin, hits.point, hits)
        patch = lit_patch(solid_angle, spreading_area=hits.spreading_area, sin_grazing=sine)
        return computed(Ends(
            hits=replace(hits.without_way(), valid=valid), solid_angle=solid_angle, patch=patch,
            between=dr.zeros(mi.Float64, dr.width(solid_angle)), loss_db=loss_db,
            code=Paths.extended(mi.UInt32(1), hits.label == self._surface), leg=Leg.along(hits, origin, hits.point),
            first_label=hits.label, first_smooth=dr.zeros(mi.Bool, dr.width(solid_angle))))

    def folded(self, ends: Ends, origin: dr.ArrayBase) -> Ends:
        """Give the same points, met by way of the mirror."""
        hits = ends.hits
        way = self._connector.join(origin, mi.Vector3f(0, 0, 0), hits.point, hits.normal, hits.valid, folded=True)
        sine = -dr.dot(hits.normal, way.arrival_direction)
        code = Paths.extended(Paths.extended(dr.ones(mi.UInt32, dr.width(sine)), mi.Bool(True)), mi.Bool(False))
        return computed(replace(
            ends, hits=replace(hits, valid=hits.valid & way.free & (sine > GRAZING),
                               arrival_direction=way.arrival_direction),
            leg=Leg.along(way, image_of(origin), hits.point, folded=True), code=code,
            solid_angle=solid_angle_of(ends.patch, spreading_area=way.spreading_area, sin_grazing=sine),
            loss_db=self._water.one_way_db(origin, hits.point, way, folded=True)))

    def next(self, ends: Ends, strata: Strata, key: mi.UInt32, *, smooth_only: bool) -> tuple[Ends, mi.Bool]:
        """Give the ends after one bounce more, and whether that was off a smooth target; `smooth_only`: no others."""
        first, second = pair(strata.split(dr.arange(mi.UInt32, strata.rays))[1], key)
        third, _ = other_pair(second, key)
        first, second, third = (uniform(self._lib, bits) for bits in (first, second, third))
        last = ends.hits
        direction, share, mirrored = next_direction(last, last.valid, self._frequency, first, mi.Point2f(second, third))
        if self._mirror:
            at_surface, towards = last.label == self._surface, last.arrival_direction
            image = towards - 2 * dr.dot(last.normal, towards) * last.normal
            direction, share = dr.select(at_surface, image, direction), dr.select(at_surface, 1, share)
        active = last.valid & (share > 0)
        if smooth_only:
            active &= mirrored
        hits = self._free_rays.hit(last.point, last.normal, direction, active)
        sine = -dr.dot(hits.normal, hits.arrival_direction)
        return computed(replace(
            ends, hits=replace(hits.without_way(), valid=active & hits.valid & (sine > GRAZING)),
            solid_angle=ends.solid_angle * share, between=ends.between + hits.travel_time,
            code=Paths.extended(ends.code, hits.label == self._surface),
            loss_db=ends.loss_db + self._water.one_way_db(last.point, hits.point, hits))), mirrored
