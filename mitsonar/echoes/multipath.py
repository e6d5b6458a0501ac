"""Paths of more than one bounce, from the first hits of a bundle of rays.

A path of n bounces is put together from two bundles of rays that leave the sonar: ray i goes on from its hit by
bounces drawn from the law of each surface until it has made n - 1, ray j makes one, and the two ends are connected
along the exact bent ray. Both ends of the path then lie where the beams look, however narrow they are. With
β the solid angle of a ray times the shares of power its bounces carried on,

    e² = β_i (σ_i / sin θ_i) (1 / A_ij) (σ_j / sin θ_j) ΔΩ_j (c_j / c_0)² 10^(-ᾱ L / 10) / q_ij

σ_i, σ_j towards each other, θ grazing angles that sound came in at, A_ij spreading area between the ends, c sound
speeds at j and at the source, q_ij the chance that i was paired with j: half of the partners are drawn evenly, half
near i.
(Bidirectional path tracing with one vertex from the receiver: Veach 1997, chapter 10; on sound: Siltanen et al. 2007.)
A_ij is kept above the patch that ray j stands for, over π, so that corners do not flare.

A point target is an end of its own, with its strength T in place of σ_j A_j ΔΩ_j / sin θ_j, A_j spreading area of the
way there: each ray is connected to one of them, drawn evenly, and the path counts both ways round.

What only mirrors cannot be an end of a connection. Smooth targets send rays on, and what they hit is connected to the
sonar; paths that begin at a smooth target count the other way round too, for none can be drawn that ends there (and so
those that begin and end at one, with something rough between, are left out). A flat sea surface is unfolded
(`free_rays`): each end is seen by way of it as well, and so are ends from each other; rays that meet it go on.
"""
from dataclasses import dataclass, fields, replace

import drjit as dr
import mitsuba as mi
import numpy as np

from ..device.arrays import arrays_of, upload
from ..device.chance import Salt, other_pair, pair, salted, uniform
from ..scene.materials import bistatic_strength, next_direction
from .paths import Paths
from .record import Leg
from .scatterers import TARGET_RADIUS
from .sonar_equation import (
    GRAZING, along_legs, echo_energy, leg_gain, lit_patch, passed_on, returned, returned_by_patch, scattered,
    solid_angle_of, speed_ratio,
)

__all__ = ["Bounces", "Ghosts"]

EVEN_SHARE = 0.5                   # of the partners that are drawn evenly


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

    energy: object
    loss_db: object
    out: object
    back: object
    between: object
    code: object
    label: object
    depth: object
    active: object


@dataclass(frozen=True, kw_only=True)
class _Ends:
    """Where rays are after some bounces, as `materials` looks at hits, and how they came there."""

    valid: object
    point: object
    normal: object
    arrival_direction: object
    sound_speed: object
    uv: object
    shape: object
    primitive: object
    label: object
    solid_angle: object            # ΔΩ, times the shares of power carried on [sr]
    patch: object                  # what of the surface the ray stands for, at its first hit [m²]
    between: object                # from the first hit on [s]
    loss_db: object
    code: object
    leg: object
    first_label: object            # of what the ray met first
    first_smooth: object           # whether that was a smooth target

    def chosen(self, index):
        return _Ends(**{field.name: value.chosen(index) if isinstance(value, Leg) else
                        dr.gather(type(value), value, index)
                        for field in fields(self) for value in [getattr(self, field.name)]})


@dataclass(frozen=True, kw_only=True)
class _Point:
    """Point targets, one a ray, as the sonar sees them."""

    valid: object
    point: object
    label: object
    leg: object
    worth: object                  # T (c_j / c_0)² / A_j, over the chance that this one was drawn [-]
    loss_db: object
    code: object


class _Targets:
    """Point targets on the device."""

    def __init__(self, targets):
        position, strength_db, label = (np.array(column) for column in zip(*targets))
        self.count = len(label)
        self._position = [upload(mi.Float64, axis) for axis in position.T]
        self._strength = upload(mi.Float, (self.count * 10 ** (strength_db / 10)).astype(np.float32))
        self._label = upload(mi.UInt32, label.astype(np.uint32))

    def drawn(self, chance):
        """Position, strength over its chance, and label of targets drawn evenly."""
        count = dr.opaque(mi.UInt32, self.count)
        which = dr.minimum(mi.UInt32(chance * mi.Float(count)), count - 1)
        point = arrays_of(mi.Float).Array3f64(*(dr.gather(mi.Float64, axis, which) for axis in self._position))
        return point, dr.gather(mi.Float, self._strength, which), dr.gather(mi.UInt32, self._label, which)


class Bounces:
    """Make the ghosts of a scene.

    Parameters
    ----------
    free_rays : FreeRays
    absorption, folded_absorption : callable
        As `signal.echoes.Absorption`, of the water and of the water unfolded.
    frequency : float [Hz]
    paths : Paths
    surface_label : int
        Label of the sea surface, 0 if there is none.
    mirror : bool
        Whether it is flat.
    targets : sequence
        Point targets, as `trace.Geometry.targets` gives them.
    single : bool
        Make those of one bounce with the mirror before or after it as well: arrays make theirs of cells.
    """

    def __init__(self, free_rays, absorption, folded_absorption, *, frequency, paths, surface_label, mirror,
                 targets=(), single=True):
        self.targets = _Targets(targets) if targets else None
        self.free_rays, self.absorption, self.folded_absorption = free_rays, absorption, folded_absorption
        self.frequency, self.paths, self.mirror, self.single = frequency, paths, mirror, single
        self.surface, self.lib = dr.opaque(mi.UInt32, surface_label), free_rays.lib
        self._smooth = any(getattr(shape.bsdf(), "smooth", False)
                           for shape in free_rays.tracer.geometry.scene.shapes())

    def __call__(self, hits, solid_angle, origin, source_speed, strata, key, homeward):
        """Follow and connect a bundle of rays.

        Parameters
        ----------
        hits : trace.Hits
        solid_angle : Float (R,) [sr]
        origin : Array3f64 (R,) [m]
            Where each ray left.
        source_speed : Float (R,) [m/s]
        strata : Strata
            How the rays are numbered; partners are of the same row.
        key : UInt32 (R,)
            Of the chance in partners and lobes; the same for all rays of a row.
        homeward : callable(point, normal, active) -> Connection
            From where ray i left to a point.

        Yields
        ------
        Ghosts
        """
        most = self.paths.max_depth
        views = {1: self._first(hits, solid_angle, origin)}             # by bounces made so far
        points = self._points(origin, source_speed, strata, key, homeward) if self.targets else {}
        if self.mirror:
            views[2] = self._folded(views[1], origin)
            if self.single:
                yield from self._by_the_mirror(views[1], views[2], source_speed)
        for made, a in views.items():
            for bounces in range(made, most):
                partner, chance = _partners(strata, salted(key, Salt.PARTNER, bounces))
                for more, b in views.items():
                    for folded in (False, True)[:len(views)]:
                        if bounces + folded + more <= most:
                            ghosts = self._connected(a, b.chosen(partner), chance, source_speed, folded)
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
                        yield from self._home(replace(a, valid=a.valid & mirrored), origin, source_speed, homeward,
                                              bounces + 2 <= most)

    def _loss_db(self, z0, z1, way, folded=False):
        """Absorption of one way [dB]."""
        absorption = self.folded_absorption if folded else self.absorption
        return 0.5 * absorption(mi.Float(z0), mi.Float(z1), way.arc_length, mi.Float(way.ray_parameter))

    def _first(self, hits, solid_angle, origin):
        leg = Leg.along(hits, origin, hits.point)
        sine = -dr.dot(hits.normal, hits.arrival_direction)
        valid = hits.valid & (sine > GRAZING)
        if self.mirror:
            valid &= hits.label != self.surface                         # what lies beyond is seen folded
        patch = lit_patch(solid_angle, spreading_area=hits.spreading_area, sin_grazing=sine)
        return _evaluated(_Ends(
            valid=valid, point=hits.point, normal=hits.normal, arrival_direction=hits.arrival_direction,
            sound_speed=hits.sound_speed, uv=hits.uv, shape=hits.shape, primitive=hits.primitive, label=hits.label,
            solid_angle=solid_angle, patch=patch, between=dr.zeros(mi.Float64, dr.width(solid_angle)),
            loss_db=self._loss_db(-origin.z, -hits.point.z, hits),
            code=Paths.extended(mi.UInt32(1), hits.label == self.surface), leg=leg,
            first_label=hits.label, first_smooth=dr.zeros(mi.Bool, dr.width(solid_angle))))

    def _folded(self, ends, origin):
        """The same points, met by way of the mirror."""
        none = mi.Vector3f(0, 0, 0)
        way = self.free_rays.connect(origin, none, ends.point, ends.normal, ends.valid, folded=True)
        image = type(origin)(origin.x, origin.y, -origin.z)
        sine = -dr.dot(ends.normal, way.arrival_direction)
        leg = Leg.along(way, image, ends.point, folded=True)
        code = Paths.extended(Paths.extended(dr.ones(mi.UInt32, dr.width(sine)), mi.Bool(True)), mi.Bool(False))
        return _evaluated(replace(
            ends, valid=ends.valid & way.free & (sine > GRAZING), arrival_direction=way.arrival_direction, leg=leg,
            solid_angle=solid_angle_of(ends.patch, spreading_area=way.spreading_area, sin_grazing=sine), code=code,
            loss_db=self._loss_db(origin.z, -ends.point.z, way, folded=True)))

    def _by_the_mirror(self, direct, folded, source_speed):
        """One bounce off a surface, and the mirror before or after it or both."""
        ratio = speed_ratio(direct.sound_speed, source_speed)
        for out, back, bounces in ((direct, folded, 2), (folded, direct, 2), (folded, folded, 3)):
            if bounces > self.paths.max_depth:
                continue
            strength, _ = bistatic_strength(out, -back.arrival_direction, out.valid & back.valid, self.frequency)
            gains = [leg_gain(spreading_area=end.leg.spreading_area, speed_ratio=ratio) for end in (out, back)]
            energy = along_legs(out.patch * strength, *gains)
            code = out.code if back is direct else Paths.extended(out.code, mi.Bool(True))
            yield self._ghosts(energy, out, back, out.between, code, out.valid & back.valid)

    def _connected(self, a, b, chance, source_speed, folded):
        active = a.valid & b.valid
        way = self.free_rays.connect(a.point, a.normal, b.point, b.normal, active, folded=folded)
        active &= way.free
        strength_a, sine_a = bistatic_strength(a, way.launch_direction, active, self.frequency)
        strength_b, sine_b = bistatic_strength(b, -way.arrival_direction, active, self.frequency)
        intensity = passed_on(scattered(a.solid_angle, strength_a, sine_a), spreading_area=way.spreading_area,
                              patch=b.patch)
        energy = returned_by_patch(intensity, solid_angle=b.solid_angle, strength=strength_b, sin_grazing=sine_b,
                                   speed_ratio=speed_ratio(b.sound_speed, source_speed)) / chance
        start = a.point.z if folded else -a.point.z
        loss_db = self._loss_db(start, -b.point.z, way, folded)
        code = Paths.extended(a.code, mi.Bool(True)) if folded else a.code
        code = _joined(code, b.code)
        return self._ghosts(energy, a, b, a.between + way.travel_time, code, active, loss_db)

    def _points(self, origin, source_speed, strata, key, homeward):
        """A point target for every ray, seen straight and by way of the mirror, by bounces made so far."""
        _, within, _, _ = strata.split(dr.arange(mi.UInt32, strata.rays))
        chance, _ = pair(within, salted(key, Salt.TARGET))
        point, strength, label = self.targets.drawn(uniform(self.lib, chance))
        none, seen = mi.Vector3f(0, 0, 0), {}
        for folded in (False, True)[:1 + (self.mirror and self.paths.max_depth > 2)]:
            place, code = origin, dr.ones(mi.UInt32, strata.rays)
            if folded:
                way = self.free_rays.connect(origin, none, point, none, folded=True, short=TARGET_RADIUS)
                place, code = type(origin)(origin.x, origin.y, -origin.z), Paths.extended(code, mi.Bool(True))
            else:
                way = homeward(point, none, mi.Bool(True), TARGET_RADIUS)
            worth = returned(strength, spreading_area=way.spreading_area,
                             speed_ratio=speed_ratio(way.sound_speed, source_speed))
            target = _Point(valid=way.free, point=point, label=label, leg=Leg.along(way, place, point, folded=folded),
                            worth=worth, loss_db=self._loss_db(-place.z, -point.z, way, folded),
                            code=Paths.extended(code, mi.Bool(False)))
            leg = [value for name, value in vars(target.leg).items() if name != "folded"]
            dr.eval([value for name, value in vars(target).items() if name != "leg"], leg)
            seen[1 + folded] = target
        return seen

    def _at_target(self, ends, target, folded):
        """From the ends to point targets, straight or by way of the mirror, and home."""
        active = ends.valid & target.valid
        way = self.free_rays.connect(ends.point, ends.normal, target.point, mi.Vector3f(0, 0, 0), active,
                                     folded=folded, short=TARGET_RADIUS)
        active &= way.free
        strength, sine = bistatic_strength(ends, way.launch_direction, active, self.frequency)
        energy = passed_on(scattered(ends.solid_angle, strength, sine) * target.worth,
                           spreading_area=way.spreading_area, patch=ends.patch)
        code = Paths.extended(ends.code, mi.Bool(True)) if folded else ends.code
        start = ends.point.z if folded else -ends.point.z
        return self._ghosts(energy, ends, target, ends.between + way.travel_time, _joined(code, target.code), active,
                            self._loss_db(start, -target.point.z, way, folded))

    def _on(self, ends, strata, key):
        """Bounce once more, and whether that was a mirror's."""
        first, second = pair(strata.split(dr.arange(mi.UInt32, strata.rays))[1], key)
        third, _ = other_pair(second, key)
        first, second, third = (uniform(self.lib, bits) for bits in (first, second, third))
        direction, share, mirrored = next_direction(ends, ends.valid, self.frequency, first,
                                                    mi.Point2f(second, third))
        if self.mirror:
            at_surface, towards = ends.label == self.surface, ends.arrival_direction
            image = towards - 2 * dr.dot(ends.normal, towards) * ends.normal
            direction, share = dr.select(at_surface, image, direction), dr.select(at_surface, 1, share)
        active = ends.valid & (share > 0)
        hits = self.free_rays.hit(ends.point, ends.normal, direction, active)
        sine = -dr.dot(hits.normal, hits.arrival_direction)
        return _evaluated(replace(
            ends, valid=active & hits.valid & (sine > GRAZING), point=hits.point, normal=hits.normal,
            arrival_direction=hits.arrival_direction, sound_speed=hits.sound_speed, uv=hits.uv, shape=hits.shape,
            primitive=hits.primitive, label=hits.label, solid_angle=ends.solid_angle * share,
            between=ends.between + hits.travel_time, code=Paths.extended(ends.code, hits.label == self.surface),
            loss_db=ends.loss_db + self._loss_db(-ends.point.z, -hits.point.z, hits))), mirrored

    def _home(self, ends, origin, source_speed, homeward, again):
        """What a smooth target has sent rays to, connected to the sonar; by way of the mirror too if `again`."""
        for folded in (False, True)[:1 + (self.mirror and again)]:
            place, code = origin, ends.code
            if folded:
                way = self.free_rays.connect(origin, mi.Vector3f(0, 0, 0), ends.point, ends.normal, ends.valid,
                                             folded=True)
                place, code = type(origin)(origin.x, origin.y, -origin.z), Paths.extended(code, mi.Bool(True))
            else:
                way = homeward(ends.point, ends.normal, ends.valid)
            active = ends.valid & way.free
            strength, sine = bistatic_strength(ends, -way.arrival_direction, active, self.frequency)
            energy = echo_energy(solid_angle=ends.solid_angle, strength=strength, sin_grazing=sine,
                                 spreading_area=way.spreading_area,
                                 speed_ratio=speed_ratio(ends.sound_speed, source_speed))
            back = replace(ends, leg=Leg.along(way, place, ends.point, folded=folded),
                           loss_db=self._loss_db(-place.z, -ends.point.z, way, folded))
            ghosts = self._ghosts(energy, ends, back, ends.between, code, active)
            yield ghosts
            yield self._reversed(ghosts, ends, origin)

    def _reversed(self, ghosts, ends, origin):
        """The same paths the other way round, of those that began at a smooth target."""
        return replace(self._turned(ghosts, ends, origin), active=ghosts.active & ends.first_smooth)

    def _turned(self, ghosts, ends, origin):
        """The same paths the other way round."""
        z = ghosts.out.offset.z + (-origin.z if ghosts.out.folded else origin.z)
        return replace(ghosts, out=ghosts.back, back=ghosts.out, label=ends.first_label, depth=mi.Float(-z))

    def _ghosts(self, energy, out, back, between, code, active, loss_db=0.0):
        active = active & (energy > 0) & dr.isfinite(energy)
        return Ghosts(energy=energy, loss_db=out.loss_db + back.loss_db + loss_db, out=out.leg, back=back.leg,
                      between=between, code=code, label=back.label, depth=mi.Float(-back.point.z), active=active)


def _evaluated(ends):
    leg = [value for name, value in vars(ends.leg).items() if name != "folded"]
    dr.eval([value for name, value in vars(ends).items() if name != "leg"], leg)
    return ends


def _joined(code, last):
    """Codes of paths that go on with the bounces of `last` in reverse: it came from the other end."""
    # the last bounce of `last` comes first on the way back; all its bounces but the final lie nearer the sonar
    for _ in range(2):
        more = last > 1
        code = dr.select(more, 2 * code + (last & 1), code)
        last = dr.select(more, last >> 1, last)
    return code


def _partners(strata, key):
    """A partner of the same row for every ray, and the chance with which it was drawn."""
    row, within, i, j = strata.split(dr.arange(mi.UInt32, strata.rays))
    first, second = pair(within, key)
    third, fourth = other_pair(first, key)
    even = uniform(strata.lib, third) < EVEN_SHARE
    chosen = []
    for place, count, bits, sign in ((i, strata.first, first, fourth & 1), (j, strata.second, second, fourth & 2)):
        u = uniform(strata.lib, bits)
        wide = dr.minimum(mi.UInt32(u * mi.Float(count)), count - 1)
        # distances m with chance log((m + 2) / (m + 1)): all scales alike
        most = mi.Float(count >> 1)
        step = dr.minimum(mi.UInt32(dr.exp(u * dr.log(most + 2)) - 1), count >> 1)
        near = dr.select(sign != 0, place + step, place + count - step)
        near = dr.select(near >= count, near - count, near)
        chosen.append(dr.select(even, wide, near))
    chance = mi.Float(1)
    for place, partner, count in zip((i, j), chosen, (strata.first, strata.second)):
        apart = dr.select(partner > place, partner - place, place - partner)
        apart = dr.minimum(apart, count - apart)
        m, most = mi.Float(apart), mi.Float(count >> 1)
        both_signs = (apart > 0) & (apart < (count >> 1))
        chance *= dr.log((m + 2) / (m + 1)) / dr.log(most + 2) * dr.select(both_signs, mi.Float(0.5), mi.Float(1))
    chance = EVEN_SHARE / mi.Float(strata.per_row) + (1 - EVEN_SHARE) * chance
    return strata.index(row, *chosen), chance
