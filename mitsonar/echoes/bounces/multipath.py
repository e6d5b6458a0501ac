"""Paths of more than one bounce, from the first hits of a bundle of rays.

A path of n bounces joins two bundles of rays that leave the sonar. Ray i goes on from its hit, by directions drawn from
the law of each surface, until it has made n - 1 bounces; ray j makes one. The two ends are connected along the exact
bent ray. Both ends of the path then lie in the beams, however narrow they are. With β the solid angle of a ray times
the shares of power that its bounces carried on,

    e² = β_i (σ_i / sin θ_i) (1 / A_ij) (σ_j / sin θ_j) ΔΩ_j (c_j / c_0)² 10^(-ᾱ L / 10) / q_ij

σ_i, σ_j are strengths towards each other, θ grazing angles of incidence, A_ij the spreading area between the ends, c
sound speeds at j and at the source, and q_ij the probability that i was paired with j: partners are chosen by the
pair's likely energy (`chosen_partners`).
(Bidirectional path tracing with one vertex from the receiver: Veach 1997, chapter 10; on sound: Siltanen et al. 2007.)
A_ij is kept above the patch that ray j stands for, over π, so that corners do not become infinite.

Point targets are ends of their own, with the strength T in place of σ_j A_j ΔΩ_j / sin θ_j, where A_j is the spreading
area of the leg to the target. Each ray is connected to one target, drawn evenly, and the path counts both ways.

Perfect mirrors cannot be ends of a connection. Smooth targets send rays on, and what those hit is connected to the
sonar. Paths that begin at a smooth target also count in reverse, because no path that ends there can be drawn. (Paths
that begin and end at smooth targets, with a rough surface between, are therefore left out.) A flat sea surface is
unfolded (`tracing.water`): each end is also seen by way of it, and so are ends from each other. Its hits go on.

A further bounce changes the solid angle of a ray to

    ΔΩ_n = ΔΩ_(n-1) σ / (sin θ p)           p the density from which the direction of bounce n - 1 was drawn

so that a bounce carries on, on average, the surface's albedo (`scene.materials.next_direction`). Directions are drawn
from the law or near the plane of the beam, with the density p of both. Only a share of the rays, `GOING_ON`, goes on
from a rough surface; p is multiplied by it.
"""
from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import product

import drjit as dr
import mitsuba as mi

from mitsonar.device.arrays import entries, picked
from mitsonar.device.chance import Salt, other_pair, pair, salted, uniform
from mitsonar.device.turns import workers_ended
from mitsonar.scene.materials import mirrors, next_direction
from mitsonar.scene.protocols import is_smooth
from mitsonar.scene.tracing.connection import Connector
from mitsonar.scene.tracing.free_rays import FreeRays
from mitsonar.scene.tracing.hits import Hits
from mitsonar.scene.tracing.launch import Strata
from mitsonar.scene.tracing.tracer import Sources

from ..paths import Paths
from ..record import EchoLeg
from ..sonar_equation import GRAZING, lit_patch, solid_angle_of
from .chosen_partners import ChosenPartners
from .connected_ends import ConnectedEnds
from .ghosts import Ghosts
from .path_ends import Ends, Origins, computed, going, image_of

GOING_ON = 0.5                     # share of the rays that go on from a rough surface, drawn evenly


class TracedEnds:
    """Ends of rays: their first hits, the same by way of the mirror, and those after one more bounce."""

    def __init__(self, connector: Connector, free_rays: FreeRays, *, frequency: float):        # frequency [Hz]
        geometry = connector.geometry
        self._connector, self._free_rays, self._water = connector, free_rays, connector.water
        self._frequency, self._lib, self._mirror = frequency, connector.lib, geometry.surface_mirrors
        self._surface = dr.opaque(mi.UInt32, geometry.surface_label)

    def first(self, hits: Hits, solid_angle: mi.Float, origin: dr.ArrayBase) -> Ends:
        """Return the ends at the first hits of rays."""
        sine = -dr.dot(hits.normal, hits.arrival_direction)
        valid = hits.valid & (sine > GRAZING)
        if self._mirror:
            valid &= hits.label != self._surface                        # points beyond the mirror are seen folded
        loss_db = self._water.one_way_db(origin, hits.point, hits)
        patch = lit_patch(solid_angle, spreading_area=hits.spreading_area, sin_grazing=sine)
        return computed(Ends(
            hits=replace(hits.without_way(), valid=valid), solid_angle=solid_angle, patch=patch,
            between=dr.zeros(mi.Float64, dr.width(solid_angle)), loss_db=loss_db,
            code=Paths.extended(mi.UInt32(1), hits.label == self._surface), leg=EchoLeg.along(hits, origin, hits.point),
            first_label=hits.label, first_smooth=dr.zeros(mi.Bool, dr.width(solid_angle)),
            ray=dr.arange(mi.UInt32, dr.width(solid_angle))))

    def folded(self, ends: Ends, origin: dr.ArrayBase) -> Ends:
        """Return the same points, reached by way of the mirror."""
        hits = ends.hits
        way = self._connector.join(origin, mi.Vector3f(0, 0, 0), hits.point, hits.normal, hits.valid, folded=True)
        sine = -dr.dot(hits.normal, way.arrival_direction)
        code = Paths.extended(Paths.extended(dr.ones(mi.UInt32, dr.width(sine)), mi.Bool(True)), mi.Bool(False))
        return computed(replace(
            ends, hits=replace(hits, valid=hits.valid & way.free & (sine > GRAZING),
                               arrival_direction=way.arrival_direction),
            leg=EchoLeg.along(way, image_of(origin), hits.point, folded=True), code=code,
            solid_angle=solid_angle_of(ends.patch, spreading_area=way.spreading_area, sin_grazing=sine),
            loss_db=self._water.one_way_db(origin, hits.point, way, folded=True)))

    def next(self, ends: Ends, strata: Strata, key: mi.UInt32, *, smooth_only: bool) -> tuple[Ends, mi.Bool]:
        """Return the ends after one more bounce, and whether it was off a smooth target; `smooth_only`: only those.

        Kernels may still be at work on them. Ends of rays that meet nothing more are not valid.
        """
        on = mirrors(ends.hits)
        if not smooth_only:
            own_key, within = picked(key, ends.ray), strata.split(ends.ray)[1]
            on |= uniform(self._lib, pair(within, salted(own_key, Salt.GOES_ON))[0]) < GOING_ON
        _, ends = ends.only(on)
        return computed(self._bounced(ends, strata, key, smooth_only))

    @workers_ended()
    def _bounced(self, ends: Ends, strata: Strata, key: mi.UInt32, smooth_only: bool) -> tuple[Ends, mi.Bool]:
        """Return the results of `next`, not evaluated, of ends that all go on; their kernels take long to record."""
        key, within, last = picked(key, ends.ray), strata.split(ends.ray)[1], ends.hits
        first, second = pair(within, key)
        first, second, third, fourth = (uniform(self._lib, bits) for bits in (first, second, *other_pair(second, key)))
        direction, share, mirrored = next_direction(
            last, last.valid, self._frequency, mi.Vector3f(ends.leg.launch_direction), first,
            mi.Point2f(second, third), fourth)
        if self._mirror:
            at_surface, towards = last.label == self._surface, last.arrival_direction
            image = towards - 2 * dr.dot(last.normal, towards) * last.normal
            direction, share = dr.select(at_surface, image, direction), dr.select(at_surface, 1, share)
        if not smooth_only:
            share = dr.select(mirrored, share, share * float(1 / GOING_ON))
        active = last.valid & (share > 0)
        hits = self._free_rays.hit(last.point, last.normal, direction, active)
        sine = -dr.dot(hits.normal, hits.arrival_direction)
        there = active & hits.valid & (sine > GRAZING)
        ends = replace(
            ends, hits=replace(hits.without_way(), valid=there),
            solid_angle=ends.solid_angle * share, between=ends.between + hits.travel_time,
            code=Paths.extended(ends.code, hits.label == self._surface),
            loss_db=ends.loss_db + self._water.one_way_db(last.point, hits.point, hits))
        return ends, mirrored


NUMBER_STEP = 1 << 8               # between the random numbers of uses: the candidates of each use take the next few
LONGEST = 2.001                    # longest path over the range of rays: there and back, and rounding
MOST_WAYS = 8                      # to connect ends: either view, folded or not; more than there are


class Bounces:
    """Ghosts of a scene."""

    def __init__(self, connector: Connector, free_rays: FreeRays, *, frequency: float, paths: Paths,    # [Hz]
                 energies: bool = True):
        # energies: ghosts are summed as energies, so that many of them can come together; those of one bounce, too
        geometry = connector.geometry
        self._most, self._energies, self._lib = paths.max_depth, energies, connector.lib
        self._mirror = geometry.surface_mirrors
        self._ends = TracedEnds(connector, free_rays, frequency=frequency)
        self._connected = ConnectedEnds(connector, frequency=frequency, max_depth=paths.max_depth)
        self._partners = ChosenPartners(connector.water.profile, frequency=frequency,
                                        longest=LONGEST * free_rays.tracer.max_range,
                                        surface=0 if self._mirror else geometry.surface_label)
        self.targets = bool(self._connected.targets)
        self._smooth = any(map(is_smooth, geometry.scene.shapes()))

    def follow(self, hits: Hits, solid_angle: mi.Float, sources: Sources, origin: dr.ArrayBase, source: mi.UInt32,
               strata: Strata, key: mi.UInt32, seen: mi.Float | None = None, *, surfaces: bool = True,
               targets: bool = True) -> Iterator[Ghosts]:
        """Yield the ghosts of a bundle of rays."""
        # solid_angle (R,) [sr]; origin (R,) [m]; source (R,); key (R,); seen (R,)
        most, targets = self._most, targets and self.targets
        seen = dr.ones(mi.Float, strata.rays) if seen is None else seen
        sonar = Origins(sources=sources, origin=origin, source=source,
                        speed=mi.Float(sources.state.gather(self._lib, source)[1]))
        views = {1: self._ends.first(hits, solid_angle, origin)}        # by number of bounces made so far
        points = self._connected.points(sonar, strata, key) if targets else {}
        if self._mirror:
            views[2] = self._ends.folded(views[1], origin)
            if self._energies and surfaces:
                yield from self._connected.by_the_mirror(views[1], views[2], sonar)
        known = {made: self._partners.likely(view, seen, strata) for made, view in views.items()} if surfaces else {}
        off_smooth: dict[tuple[bool, bool], Ends] = {}
        for made, a in views.items():
            for bounces in range(made, most):
                pairs = []
                if surfaces:
                    likely = known[made] if bounces == made else self._partners.likely(a, seen, strata)
                    use = MOST_WAYS * (made * most + bounces)
                    pairs = [*self._between(a, likely, views, known, most - bounces, strata, key, use)]
                smooth = self._smooth and surfaces
                goes_on = bounces + 1 < most or smooth
                # before the ghosts of pairs, whose kernels are traced while this one is at work
                more = self._ends.next(a, strata, salted(key, Salt.DIRECTION, bounces),
                                       smooth_only=bounces + 1 == most) if goes_on else None
                for some, partners, chance, folded in pairs:
                    ghosts = self._connected.pairs(some, partners, chance, sonar, folded)
                    yield ghosts
                    if self._smooth and bounces > made:
                        yield ghosts.reversed(picked(origin, ghosts.ray))
                for seen_by, target in points.items():
                    for folded in (False, True)[:len(views)]:
                        if bounces + folded + seen_by <= most:
                            ghosts = self._connected.at_target(a, target, folded)
                            yield ghosts
                            yield ghosts.turned(picked(origin, ghosts.ray))
                if more is not None:
                    a, mirrored = more
                    if bounces == made:
                        a = replace(a, first_smooth=mirrored)
                    index, a = a.only(mi.Bool(True))
                    a, mirrored = computed((a, picked(mirrored, index)))
                    if smooth:
                        off, again = computed(a.only(mirrored)[1]), self._mirror and bounces + 2 <= most
                        if self._energies:
                            kind = again, a.leg.folded
                            off_smooth[kind] = off_smooth[kind].and_those(off) if kind in off_smooth else off
                        else:
                            yield from self._connected.home(off, sonar, again)
        for (again, _), off in off_smooth.items():
            yield from self._connected.home(computed(off), sonar, again)

    def _between(self, a: Ends, likely: mi.Float, views: Mapping[int, Ends], known: Mapping[int, mi.Float], left: int,
                 strata: Strata, key: mi.UInt32, use: int) -> Iterator[tuple[Ends, Ends, mi.Float, bool]]:
        """Yield ends and their partners in the views, the probabilities of these pairs, and if the mirror is between.

        Pairs make at most `left` further bounces. `likely` and `known` are the tables of the ends and of the views
        (`chosen_partners`). Random numbers are numbered from `use` on.
        """
        ways = product(views.items(), (False, True)[:1 + self._mirror])
        for number, ((more, b), folded) in enumerate(ways, use):
            if more + folded <= left:
                pair_key = salted(key, Salt.PARTNER, dr.opaque(mi.UInt32, number * NUMBER_STEP))
                chosen = self._partners.choose(a, likely, known[more], strata, picked(pair_key, a.ray), folded=folded)
                kept = [going(a.valid & (chance > 0)) for _, chance in chosen]
                parts = [(index, valid, *entries(pairs, index)) for (index, valid), pairs in zip(kept, chosen)]
                if self._energies:                     # all kinds of pairs in one kernel
                    parts = [tuple(map(dr.concat, zip(*parts)))]
                for index, valid, partner, chance in parts:
                    some = a.chosen(index)
                    yield replace(some, hits=replace(some.hits, valid=valid)), b.chosen(partner), chance, folded
