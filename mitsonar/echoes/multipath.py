"""Paths of more than one bounce, from the first hits of a bundle of rays.

A path of n bounces is put together from two bundles of rays that leave the sonar: ray i goes on from its hit by
bounces drawn from the law of each surface until it has made n - 1, ray j makes one, and the two ends are connected
along the exact bent ray. Both ends of the path then lie where the beams look, however narrow they are. With
β the solid angle of a ray times the shares of power its bounces carried on,

    e² = β_i (σ_i / sin θ_i) (1 / A_ij) (σ_j / sin θ_j) ΔΩ_j (c_j / c_0)² 10^(-ᾱ L / 10) / q_ij

σ_i, σ_j towards each other, θ grazing angles that sound came in at, A_ij spreading area between the ends, c sound
speeds at j and at the source, q_ij the chance that i was paired with j (`partners`).
(Bidirectional path tracing with one vertex from the receiver: Veach 1997, chapter 10; on sound: Siltanen et al. 2007.)
A_ij is kept above the patch that ray j stands for, over π, so that corners do not flare.

A point target is an end of its own, with its strength T in place of σ_j A_j ΔΩ_j / sin θ_j, A_j spreading area of the
way there: each ray is connected to one of them, drawn evenly, and the path counts both ways round.

What only mirrors cannot be an end of a connection. Smooth targets send rays on, and what they hit is connected to the
sonar; paths that begin at a smooth target count the other way round too, for none can be drawn that ends there (and so
those that begin and end at one, with something rough between, are left out). A flat sea surface is unfolded
(`tracing.water`): each end is seen by way of it as well, and so are ends from each other; rays that meet it go on.
"""
from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi

from ..device.arrays import picked
from ..device.chance import Salt, other_pair, pair, salted, uniform
from ..scene.materials import bistatic_strength, next_direction
from ..tracing.connection import Connector
from ..tracing.free_rays import FreeRays
from ..tracing.hits import Hits
from ..tracing.launch import Strata
from ..tracing.tracer import Sources
from .partners import partners
from .paths import Paths
from .point_targets import TARGET_RADIUS, PointTargets
from .record import Leg
from .sonar_equation import (
    GRAZING, along_legs, echo_energy, leg_gain, lit_patch, passed_on, returned, returned_by_patch, scattered,
    solid_angle_of, speed_ratio,
)

__all__ = ["Bounces", "Ghosts"]



@dataclass(frozen=True, kw_only=True)
class Ghosts:
    """Echoes that have bounced more than once, or by way of the surface, one an entry.

    Attributes
    ----------
    energy : Float (R,)
        e² but for absorption and patterns [-].
    loss_db : Float (R,)
        Absorption over the whole path.
    out, back : Leg
    between : Float64 (R,) [s]
    code : UInt32 (R,)
        See `paths`.
    label : UInt32 (R,)
        Of what the echo comes back from last.
    depth : Float (R,) [m]
        Where it does.
    active : Bool (R,)
    """

    energy: mi.Float
    loss_db: mi.Float
    out: Leg
    back: Leg
    between: mi.Float64
    code: mi.UInt32
    label: mi.UInt32
    depth: mi.Float
    active: mi.Bool


@dataclass(frozen=True, kw_only=True)
class _Sonar:
    """Where each ray left from: `Sources`, places (R,), indices of the sources, and sound speed there [m/s]."""

    sources: Sources
    origin: dr.ArrayBase
    source: mi.UInt32
    speed: mi.Float


@dataclass(frozen=True, kw_only=True)
class _Ends:
    """Where rays are after some bounces, and how they came there.

    Attributes
    ----------
    hits : Hits
        What they met last, without the way.
    solid_angle : Float (R,) [sr]
        ΔΩ, times the shares of power carried on.
    patch : Float (R,) [m²]
        What of the surface the ray stands for, at its first hit.
    between : Float64 (R,) [s]
        From the first hit on.
    loss_db : Float (R,)
        So far, one way.
    code : UInt32 (R,)
        See `paths`.
    leg : Leg
        To the first hit.
    first_label, first_smooth : UInt32 (R,), Bool (R,)
        Of what the ray met first; whether that was a smooth target.
    """

    hits: Hits
    solid_angle: mi.Float
    patch: mi.Float
    between: mi.Float64
    loss_db: mi.Float
    code: mi.UInt32
    leg: Leg
    first_label: mi.UInt32
    first_smooth: mi.Bool

    @property
    def valid(self) -> mi.Bool:
        """Whether the ray is on its way still."""
        return self.hits.valid

    @property
    def point(self) -> dr.ArrayBase:
        """Where it is, Array3f64 (R,) [m]."""
        return self.hits.point

    @property
    def label(self) -> mi.UInt32:
        """Of what it met last."""
        return self.hits.label

    def where(self, valid: mi.Bool) -> _Ends:
        """The same, of the rays that are also `valid`."""
        return replace(self, hits=replace(self.hits, valid=self.hits.valid & valid))

    def chosen(self, index: mi.UInt32) -> _Ends:
        """The ends with these numbers."""
        values: dict[str, Any] = {name: value.chosen(index) if isinstance(value, (Hits, Leg)) else picked(value, index)
                                  for name, value in vars(self).items()}
        return _Ends(**values)


@dataclass(frozen=True, kw_only=True)
class _Target:
    """Point targets, one a ray, as the sonar sees them: `worth` is T (c_j / c_0)² / A_j over the chance of the draw."""

    valid: mi.Bool
    point: dr.ArrayBase
    label: mi.UInt32
    leg: Leg
    worth: mi.Float
    loss_db: mi.Float
    code: mi.UInt32


class Bounces:
    """Make the ghosts of a scene.

    Parameters
    ----------
    connector : Connector
    free_rays : FreeRays
    frequency : float [Hz]
    paths : Paths
    single : bool
        Make those of one bounce with the mirror before or after it as well: arrays make theirs of cells.
    """

    def __init__(self, connector: Connector, free_rays: FreeRays, *, frequency: float, paths: Paths,
                 single: bool = True):
        geometry = connector.geometry
        self.connector, self.free_rays, self.water = connector, free_rays, connector.water
        self.frequency, self.paths, self.single, self.lib = frequency, paths, single, connector.lib
        self.targets, self.mirror = PointTargets(geometry.targets()), geometry.surface_mirrors
        self.surface = dr.opaque(mi.UInt32, geometry.surface_label)
        self._smooth = any(getattr(shape.bsdf(), "smooth", False) for shape in geometry.scene.shapes())

    def follow(self, hits: Hits, solid_angle: mi.Float, sources: Sources, origin: dr.ArrayBase, source: mi.UInt32,
               strata: Strata, key: mi.UInt32) -> Iterator[Ghosts]:
        """Follow and connect a bundle of rays.

        Parameters
        ----------
        hits : Hits
        solid_angle : Float (R,) [sr]
        sources : Sources
        origin : Array3f64 (R,) [m]
            Where each ray left.
        source : UInt32 (R,)
            Index into `sources`.
        strata : Strata
            How the rays are numbered; partners are of the same row.
        key : UInt32 (R,)
            Of the chance in partners and lobes; the same for all rays of a row.

        Yields
        ------
        Ghosts
        """
        most = self.paths.max_depth
        sonar = _Sonar(sources=sources, origin=origin, source=source,
                       speed=mi.Float(sources.state.gather(self.lib, source)[1]))
        views = {1: self._first(hits, solid_angle, origin)}             # by bounces made so far
        points = self._points(sonar, strata, key) if self.targets else {}
        if self.mirror:
            views[2] = self._folded(views[1], origin)
            if self.single:
                yield from self._by_the_mirror(views[1], views[2], sonar)
        for made, a in views.items():
            for bounces in range(made, most):
                partner, chance = partners(strata, salted(key, Salt.PARTNER, bounces))
                for more, b in views.items():
                    for folded in (False, True)[:len(views)]:
                        if bounces + folded + more <= most:
                            ghosts = self._connected(a, b.chosen(partner), chance, sonar, folded)
                            yield ghosts
                            if self._smooth and bounces > made:
                                yield self._reversed(ghosts, a, origin)
                for more, target in points.items():
                    for folded in (False, True)[:len(views)]:
                        if bounces + folded + more <= most:
                            ghosts = self._at_target(a, target, folded)
                            yield ghosts
                            yield self._turned(ghosts, a, origin)
                if bounces + 1 < most or self._smooth:
                    a, mirrored = self._on(a, strata, salted(key, Salt.DIRECTION, bounces))
                    if bounces == made:
                        a = _evaluated(replace(a, first_smooth=mirrored))
                    if self._smooth:
                        yield from self._home(a.where(mirrored), sonar, bounces + 2 <= most)

    def _loss_db(self, start, end, way, folded=False):
        """Absorption of one way between points [dB]."""
        return 0.5 * self.water.loss_db(start, end, way, folded)

    def _first(self, hits, solid_angle, origin):
        sine = -dr.dot(hits.normal, hits.arrival_direction)
        valid = hits.valid & (sine > GRAZING)
        if self.mirror:
            valid &= hits.label != self.surface                         # what lies beyond is seen folded
        patch = lit_patch(solid_angle, spreading_area=hits.spreading_area, sin_grazing=sine)
        return _evaluated(_Ends(
            hits=replace(hits.without_way(), valid=valid), solid_angle=solid_angle, patch=patch,
            between=dr.zeros(mi.Float64, dr.width(solid_angle)), loss_db=self._loss_db(origin, hits.point, hits),
            code=Paths.extended(mi.UInt32(1), hits.label == self.surface), leg=Leg.along(hits, origin, hits.point),
            first_label=hits.label, first_smooth=dr.zeros(mi.Bool, dr.width(solid_angle))))

    def _folded(self, ends, origin):
        """The same points, met by way of the mirror."""
        hits = ends.hits
        way = self.connector.join(origin, mi.Vector3f(0, 0, 0), hits.point, hits.normal, hits.valid, folded=True)
        sine = -dr.dot(hits.normal, way.arrival_direction)
        code = Paths.extended(Paths.extended(dr.ones(mi.UInt32, dr.width(sine)), mi.Bool(True)), mi.Bool(False))
        return _evaluated(replace(
            ends, hits=replace(hits, valid=hits.valid & way.free & (sine > GRAZING),
                               arrival_direction=way.arrival_direction),
            leg=Leg.along(way, _image(origin), hits.point, folded=True), code=code,
            solid_angle=solid_angle_of(ends.patch, spreading_area=way.spreading_area, sin_grazing=sine),
            loss_db=self._loss_db(origin, hits.point, way, folded=True)))

    def _by_the_mirror(self, direct, folded, sonar):
        """One bounce off a surface, and the mirror before or after it or both."""
        ratio = speed_ratio(direct.hits.sound_speed, sonar.speed)
        for out, back, bounces in ((direct, folded, 2), (folded, direct, 2), (folded, folded, 3)):
            if bounces > self.paths.max_depth:
                continue
            active = out.valid & back.valid
            strength, _ = bistatic_strength(out.hits, -back.hits.arrival_direction, active, self.frequency)
            gains = [leg_gain(spreading_area=end.leg.spreading_area, speed_ratio=ratio) for end in (out, back)]
            energy = along_legs(out.patch * strength, *gains)
            code = out.code if back is direct else Paths.extended(out.code, mi.Bool(True))
            yield self._ghosts(energy, out, back, out.between, code, active)

    def _connected(self, a, b, chance, sonar, folded):
        active = a.valid & b.valid
        way = self.connector.join(a.point, a.hits.normal, b.point, b.hits.normal, active, folded=folded)
        active &= way.free
        strength_a, sine_a = bistatic_strength(a.hits, way.launch_direction, active, self.frequency)
        strength_b, sine_b = bistatic_strength(b.hits, -way.arrival_direction, active, self.frequency)
        intensity = passed_on(scattered(a.solid_angle, strength_a, sine_a), spreading_area=way.spreading_area,
                              patch=b.patch)
        energy = returned_by_patch(intensity, solid_angle=b.solid_angle, strength=strength_b, sin_grazing=sine_b,
                                   speed_ratio=speed_ratio(b.hits.sound_speed, sonar.speed)) / chance
        loss_db = self._loss_db(a.point, b.point, way, folded)
        code = Paths.extended(a.code, mi.Bool(True)) if folded else a.code
        code = _joined(code, b.code)
        return self._ghosts(energy, a, b, a.between + way.travel_time, code, active, loss_db)

    def _points(self, sonar, strata, key):
        """A point target for every ray, seen straight and by way of the mirror, by bounces made so far."""
        _, within, _, _ = strata.split(dr.arange(mi.UInt32, strata.rays))
        bits, _ = pair(within, salted(key, Salt.TARGET))
        which, strength = self.targets.drawn(uniform(self.lib, bits))
        point, label, seen = self.targets.position(which), self.targets.label(which), {}
        for folded in (False, True)[:1 + (self.mirror and self.paths.max_depth > 2)]:
            way, place, code = self._seen(sonar, point, mi.Vector3f(0, 0, 0), mi.Bool(True), folded,
                                          dr.ones(mi.UInt32, strata.rays), TARGET_RADIUS)
            worth = returned(strength, spreading_area=way.spreading_area,
                             speed_ratio=speed_ratio(way.sound_speed, sonar.speed))
            target = _Target(valid=way.free, point=point, label=label, worth=worth,
                             leg=Leg.along(way, place, point, folded=folded),
                             loss_db=self._loss_db(sonar.origin, point, way, folded),
                             code=Paths.extended(code, mi.Bool(False)))
            seen[1 + folded] = _evaluated(target)
        return seen

    def _seen(self, sonar, point, normal, active, folded, code, short=0.0):
        """Ways from the sonar to points, where those start, and the code of the path with the mirror on it."""
        if not folded:
            way = self.connector.connect(sonar.sources, sonar.origin, sonar.source, point, normal, active, short=short)
            return way, sonar.origin, code
        way = self.connector.join(sonar.origin, mi.Vector3f(0, 0, 0), point, normal, active, folded=True, short=short)
        return way, _image(sonar.origin), Paths.extended(code, mi.Bool(True))

    def _at_target(self, ends, target, folded):
        """From the ends to point targets, straight or by way of the mirror, and home."""
        active = ends.valid & target.valid
        way = self.connector.join(ends.point, ends.hits.normal, target.point, mi.Vector3f(0, 0, 0), active,
                                  folded=folded, short=TARGET_RADIUS)
        active &= way.free
        strength, sine = bistatic_strength(ends.hits, way.launch_direction, active, self.frequency)
        energy = passed_on(scattered(ends.solid_angle, strength, sine) * target.worth,
                           spreading_area=way.spreading_area, patch=ends.patch)
        code = Paths.extended(ends.code, mi.Bool(True)) if folded else ends.code
        return self._ghosts(energy, ends, target, ends.between + way.travel_time, _joined(code, target.code), active,
                            self._loss_db(ends.point, target.point, way, folded))

    def _on(self, ends, strata, key):
        """Bounce once more, and whether that was a mirror's."""
        first, second = pair(strata.split(dr.arange(mi.UInt32, strata.rays))[1], key)
        third, _ = other_pair(second, key)
        first, second, third = (uniform(self.lib, bits) for bits in (first, second, third))
        last = ends.hits
        direction, share, mirrored = next_direction(last, last.valid, self.frequency, first, mi.Point2f(second, third))
        if self.mirror:
            at_surface, towards = last.label == self.surface, last.arrival_direction
            image = towards - 2 * dr.dot(last.normal, towards) * last.normal
            direction, share = dr.select(at_surface, image, direction), dr.select(at_surface, 1, share)
        active = last.valid & (share > 0)
        hits = self.free_rays.hit(last.point, last.normal, direction, active)
        sine = -dr.dot(hits.normal, hits.arrival_direction)
        return _evaluated(replace(
            ends, hits=replace(hits.without_way(), valid=active & hits.valid & (sine > GRAZING)),
            solid_angle=ends.solid_angle * share, between=ends.between + hits.travel_time,
            code=Paths.extended(ends.code, hits.label == self.surface),
            loss_db=ends.loss_db + self._loss_db(last.point, hits.point, hits))), mirrored

    def _home(self, ends, sonar, again):
        """What a smooth target has sent rays to, connected to the sonar; by way of the mirror too if `again`."""
        hits = ends.hits
        for folded in (False, True)[:1 + (self.mirror and again)]:
            way, place, code = self._seen(sonar, hits.point, hits.normal, hits.valid, folded, ends.code)
            active = hits.valid & way.free
            strength, sine = bistatic_strength(hits, -way.arrival_direction, active, self.frequency)
            energy = echo_energy(solid_angle=ends.solid_angle, strength=strength, sin_grazing=sine,
                                 spreading_area=way.spreading_area,
                                 speed_ratio=speed_ratio(hits.sound_speed, sonar.speed))
            back = replace(ends, leg=Leg.along(way, place, hits.point, folded=folded),
                           loss_db=self._loss_db(sonar.origin, hits.point, way, folded))
            ghosts = self._ghosts(energy, ends, back, ends.between, code, active)
            yield ghosts
            yield self._reversed(ghosts, ends, sonar.origin)

    def _reversed(self, ghosts, ends, origin):
        """The same paths the other way round, of those that began at a smooth target."""
        return replace(self._turned(ghosts, ends, origin), active=ghosts.active & ends.first_smooth)

    def _turned(self, ghosts, ends, origin):
        """The same paths the other way round."""
        z = ghosts.out.offset.z + (-origin.z if ghosts.out.folded else origin.z)
        return replace(ghosts, out=ghosts.back, back=ghosts.out, label=ends.first_label, depth=mi.Float(-z))

    def _ghosts(self, energy, out, back, between, code, active, loss_db: mi.Float | float = 0.0):
        active = active & (energy > 0) & dr.isfinite(energy)
        return Ghosts(energy=energy, loss_db=out.loss_db + back.loss_db + loss_db, out=out.leg, back=back.leg,
                      between=between, code=code, label=back.label, depth=mi.Float(-back.point.z), active=active)


def _image(origin):
    """Where the sonar's image in the surface stands."""
    return type(origin)(origin.x, origin.y, -origin.z)


def _evaluated(record):
    """The same record, computed."""
    dr.eval(record)
    return record


def _joined(code, last):
    """Codes of paths that go on with the bounces of `last` in reverse: it came from the other end."""
    # the last bounce of `last` comes first on the way back; all its bounces but the final lie nearer the sonar
    for _ in range(2):
        more = last > 1
        code = dr.select(more, 2 * code + (last & 1), code)
        last = dr.select(more, last >> 1, last)
    return code
