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
from dataclasses import replace

import drjit as dr
import mitsuba as mi

from ..device.chance import Salt, salted
from ..tracing.connection import Connector
from ..tracing.free_rays import FreeRays
from ..tracing.hits import Hits
from ..tracing.launch import Strata
from ..tracing.tracer import Sources
from .connected_ends import ConnectedEnds
from .ghosts import Ghosts
from .partners import partners
from .path_ends import Origins, computed
from .paths import Paths
from .traced_ends import TracedEnds

__all__ = ["Bounces"]


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
        self._most, self._single, self._lib = paths.max_depth, single, connector.lib
        self._mirror = geometry.surface_mirrors
        self._ends = TracedEnds(connector, free_rays, frequency=frequency)
        self._connected = ConnectedEnds(connector, frequency=frequency, max_depth=paths.max_depth)
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
        most = self._most
        sonar = Origins(sources=sources, origin=origin, source=source,
                        speed=mi.Float(sources.state.gather(self._lib, source)[1]))
        views = {1: self._ends.first(hits, solid_angle, origin)}        # by bounces made so far
        points = self._connected.points(sonar, strata, key) if self._connected.targets else {}
        if self._mirror:
            views[2] = self._ends.folded(views[1], origin)
            if self._single:
                yield from self._connected.by_the_mirror(views[1], views[2], sonar)
        for made, a in views.items():
            for bounces in range(made, most):
                partner, chance = partners(strata, salted(key, Salt.PARTNER, bounces))
                for more, b in views.items():
                    for folded in (False, True)[:len(views)]:
                        if bounces + folded + more <= most:
                            ghosts = self._connected.pairs(a, b.chosen(partner), chance, sonar, folded)
                            yield ghosts
                            if self._smooth and bounces > made:
                                yield ghosts.reversed(a, origin)
                for more, target in points.items():
                    for folded in (False, True)[:len(views)]:
                        if bounces + folded + more <= most:
                            ghosts = self._connected.at_target(a, target, folded)
                            yield ghosts
                            yield ghosts.turned(a, origin)
                if bounces + 1 < most or self._smooth:
                    a, mirrored = self._ends.next(a, strata, salted(key, Salt.DIRECTION, bounces))
                    if bounces == made:
                        a = computed(replace(a, first_smooth=mirrored))
                    if self._smooth:
                        yield from self._connected.home(a.where(mirrored), sonar, bounces + 2 <= most)
