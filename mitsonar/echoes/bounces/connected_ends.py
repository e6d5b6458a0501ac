"""Connections of path ends with each other, with point targets and with the sonar; symbols as in `multipath`.

The part that a bed reflects coherently on to a target is a coherent echo (`sights.BedMirror`). Where sound scatters
from the bed on to a target, the bed's strength is therefore multiplied by the rest of the reflected power, 1 - |V/R|².
"""
from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import entries, picked, upload
from mitsonar.device.chance import Salt, pair, salted, uniform
from mitsonar.device.turns import workers_ended
from mitsonar.scattering.bodies.echo_taps import ReceivedBand
from mitsonar.scene.labels import SEABED
from mitsonar.scene.materials import bistatic_strength, coherent_reflection, reflects
from mitsonar.scene.tracing.connection import Connection, Connector
from mitsonar.scene.tracing.hits import Hits
from mitsonar.scene.tracing.launch import Strata

from ..paths import Paths
from ..point_targets import TARGET_RADIUS, PointTargets
from ..record import EchoLeg
from ..sights.bed_planes import first_zone
from ..sonar_equation import (
    along_legs,
    echo_energy,
    leg_gain,
    passed_on,
    returned,
    returned_by_patch,
    scattered,
    speed_ratio,
)
from .chosen_partners import CANDIDATES
from .ghosts import Ghosts, joined
from .path_ends import Ends, Origins, TargetEnds, computed, image_of

PERFECTLY_FLAT = 1e12              # [rad/m] lowest wavenumber of roughness that counts: above that of any roughness


class ConnectedEnds:
    """Connections of the ends of one bundle of rays."""

    def __init__(self, connector: Connector, *, frequency: float, max_depth: int):             # frequency [Hz]
        geometry = connector.geometry
        self._connector, self._water, self._lib = connector, connector.water, connector.lib
        self._frequency, self._max_depth = frequency, max_depth
        self.targets = PointTargets.of(geometry, ReceivedBand.about(frequency), connector.water.profile,
                                       resolved=False)
        self._mirror = geometry.surface_mirrors
        self._beds = upload(mi.Bool, geometry.named.label_kinds() == SEABED) if reflects(geometry) else None

    def by_the_mirror(self, direct: Ends, folded: Ends, sonar: Origins) -> Iterator[Ghosts]:
        """Yield ghosts of one bounce off a surface, with the mirror before it, after it, or both."""
        ratio = speed_ratio(direct.hits.sound_speed, sonar.speed)
        for out, back, bounces in ((direct, folded, 2), (folded, direct, 2), (folded, folded, 3)):
            if bounces > self._max_depth:
                continue
            active = out.valid & back.valid
            strength, _ = bistatic_strength(out.hits, -back.hits.arrival_direction, active, self._frequency)
            gains = [leg_gain(spreading_area=end.leg.spreading_area, speed_ratio=ratio) for end in (out, back)]
            energy = along_legs(out.patch * strength, *gains)
            code = out.code if back is direct else Paths.extended(out.code, mi.Bool(True))
            yield Ghosts.of(energy, out, back, out.between, code, active)

    def pairs(self, a: Ends, b: Ends, chance: mi.Float, sonar: Origins, folded: bool) -> Ghosts:
        """Return ghosts from the ends a to the ends b, each pair drawn with a chance, straight or by the mirror."""
        active = a.valid & b.valid
        way = self._connector.join(a.point, a.hits.normal, b.point, b.hits.normal, active, folded=folded)
        active &= way.free
        strength_a, sine_a = bistatic_strength(a.hits, way.launch_direction, active, self._frequency)
        strength_b, sine_b = bistatic_strength(b.hits, -way.arrival_direction, active, self._frequency)
        # neighbours in a corner are found as often as if rays were denser by the number of candidates
        intensity = passed_on(scattered(a.solid_angle, strength_a, sine_a), spreading_area=way.spreading_area,
                              patch=b.patch / CANDIDATES)
        energy = returned_by_patch(intensity, solid_angle=b.solid_angle, strength=strength_b, sin_grazing=sine_b,
                                   speed_ratio=speed_ratio(b.hits.sound_speed, picked(sonar.speed, a.ray))) / chance
        loss_db = self._water.one_way_db(a.point, b.point, way, folded)
        code = Paths.extended(a.code, mi.Bool(True)) if folded else a.code
        return Ghosts.of(energy, a, b, a.between + way.travel_time, joined(code, b.code), active, loss_db)

    def points(self, sonar: Origins, strata: Strata, key: mi.UInt32) -> dict[int, TargetEnds]:
        """Return one point target for every ray, seen straight and by way of the mirror, by bounces made so far."""
        _, within, _, _ = strata.split(dr.arange(mi.UInt32, strata.rays))
        bits, _ = pair(within, salted(key, Salt.TARGET))
        which, strength = self.targets.drawn(uniform(self._lib, bits))
        point, label, seen = self.targets.position(which), self.targets.label(which), {}
        for folded in (False, True)[:1 + (self._mirror and self._max_depth > 2)]:
            way, place, code = self._seen(sonar, point, mi.Vector3f(0, 0, 0), mi.Bool(True), folded,
                                          dr.ones(mi.UInt32, strata.rays), TARGET_RADIUS)
            worth = returned(strength, spreading_area=way.spreading_area,
                             speed_ratio=speed_ratio(way.sound_speed, sonar.speed))
            target = TargetEnds(valid=way.free, point=point, label=label, worth=worth,
                                leg=EchoLeg.along(way, place, point, folded=folded),
                                loss_db=self._water.one_way_db(sonar.origin, point, way, folded),
                                code=Paths.extended(code, mi.Bool(False)))
            seen[1 + folded] = computed(target)
        return seen

    def at_target(self, ends: Ends, target: TargetEnds, folded: bool) -> Ghosts:
        """Return ghosts from the ends to point targets, straight or by way of the mirror, and back to the sonar."""
        target = entries(target, ends.ray)
        active = ends.valid & target.valid
        way = self._connector.join(ends.point, ends.hits.normal, target.point, mi.Vector3f(0, 0, 0), active,
                                   folded=folded, short=TARGET_RADIUS)
        active &= way.free
        strength, sine = bistatic_strength(ends.hits, way.launch_direction, active, self._frequency)
        strength *= self._diffuse(ends.hits, sine, mi.Float(dr.norm(ends.leg.offset)), way.arc_length, active)
        energy = passed_on(scattered(ends.solid_angle, strength, sine) * target.worth,
                           spreading_area=way.spreading_area, patch=ends.patch)
        code = Paths.extended(ends.code, mi.Bool(True)) if folded else ends.code
        return Ghosts.of(energy, ends, target, ends.between + way.travel_time, joined(code, target.code), active,
                         self._water.one_way_db(ends.point, target.point, way, folded))

    def home(self, ends: Ends, sonar: Origins, again: bool) -> Iterator[Ghosts]:
        """Yield ghosts from the hits of rays off smooth targets to the sonar; `again` adds those by the mirror."""
        hits, sonar = ends.hits, sonar.of(ends.ray)
        for folded in (False, True)[:1 + (self._mirror and again)]:
            with workers_ended():                    # of few rays: kernels take longer to record than to run
                way, place, code = self._seen(sonar, hits.point, hits.normal, hits.valid, folded, ends.code)
            active = hits.valid & way.free
            strength, sine = bistatic_strength(hits, -way.arrival_direction, active, self._frequency)
            between = mi.Float(ends.between * hits.sound_speed)
            strength *= self._diffuse(hits, sine, between, way.arc_length, active)
            energy = echo_energy(solid_angle=ends.solid_angle, strength=strength, sin_grazing=sine,
                                 spreading_area=way.spreading_area,
                                 speed_ratio=speed_ratio(hits.sound_speed, sonar.speed))
            back = replace(ends, leg=EchoLeg.along(way, place, hits.point, folded=folded),
                           loss_db=self._water.one_way_db(sonar.origin, hits.point, way, folded))
            ghosts = Ghosts.of(energy, ends, back, ends.between, code, active)
            yield ghosts
            yield ghosts.reversed(sonar.origin)

    def _diffuse(self, hits: Hits, sine: mi.Float, first: mi.Float, second: mi.Float,
                 active: mi.Bool) -> mi.Float | float:
        """Return the share that a bed scatters in random phases, between legs of lengths `first` and `second` [m]."""
        if self._beds is None:
            return 1.0
        active = active & dr.gather(mi.Bool, self._beds, hits.label, active)
        lowest = (2 * np.pi) / first_zone(mi.Float(hits.sound_speed) / dr.opaque(mi.Float, self._frequency), first,
                                          second)
        (a, b), (c, d) = (coherent_reflection(hits, sine, active, self._frequency, cut, smooth_too=False)
                          for cut in (lowest, mi.Float(PERFECTLY_FLAT)))
        flat = c * c + d * d
        return dr.select(active & (flat > 0), dr.maximum(1 - (a * a + b * b) / dr.maximum(flat, 1e-20), 0), 1)

    def _seen(self, sonar: Origins, point: dr.ArrayBase, normal: mi.Vector3f, active: mi.Bool, folded: bool,
              code: mi.UInt32, short: float = 0.0) -> tuple[Connection, dr.ArrayBase, mi.UInt32]:
        """Return ways from the sonar to points, where those start, and the path code with the mirror included."""
        if not folded:
            way = self._connector.connect(sonar.sources, sonar.origin, sonar.source, point, normal, active, short=short)
            return way, sonar.origin, code
        way = self._connector.join(sonar.origin, mi.Vector3f(0, 0, 0), point, normal, active, folded=True, short=short)
        return way, image_of(sonar.origin), Paths.extended(code, mi.Bool(True))
