"""Echoes that an array hears by way of more than one bounce, by way of a flat surface, and from the water.

A cell that is seen along one leg and sends back along another, m of them by way of the mirror, whose reflection is -1,
echoes as `sonar_equation.along_legs` has it, times g (-1)^m: g is the cell's Gaussian. Paths of more bounces
(`multipath`) and points of the water (`volume`) bring energies; their Gaussians are hashed from the ray, for what the
sum of many such paths is: speckle. They are coherent from element to element, not from ping to ping.
"""
from __future__ import annotations

from collections.abc import Iterator

import drjit as dr
import mitsuba as mi

from mitsonar.device.arrays import arrays_of, compressed
from mitsonar.device.chance import Salt, gaussian, hashed_pair, pair, salted, uniform
from mitsonar.scene.materials import bistatic_strength
from mitsonar.scene.tracing.connection import Connection
from mitsonar.scene.tracing.free_rays import FreeRays
from mitsonar.scene.tracing.launch import Strata
from mitsonar.scene.tracing.tracer import Sources, Tracer

from ..paths import Paths
from ..record import Echoes, EchoLeg
from ..scatterers.scatterers import Cells
from ..sights.sights import Sights
from ..sonar_equation import absorbed, along_legs
from .multipath import Bounces
from .volume import WaterEchoes

FAINTEST = 1e-12                   # of the strongest of its kind: weaker echoes are dropped


class ArrayGhosts:
    """Make these echoes for a source."""
    # frequency [Hz]; window [s]

    def __init__(self, tracer: Tracer, sights: Sights, *, frequency: float, window: tuple[float, float],
                 max_depth: int):
        geometry, water = tracer.geometry, tracer.water
        self.tracer, self.sights = tracer, sights
        self.frequency, self.max_depth = frequency, max_depth
        self.lib = arrays_of(mi.Float)
        self.paths = Paths(max_depth, surface=geometry.surface_label > 0, volume=water.scatters)
        self.bounces = Bounces(sights.connector, FreeRays(tracer), frequency=frequency, paths=self.paths,
                               single=False) if max_depth > 1 else None
        self.water = WaterEchoes(sights.connector, window) if water.scatters else None

    # ---- one scatterer, by way of the mirror

    def overhead(self, sources: Sources, origin: dr.ArrayBase) -> Iterator[Echoes]:
        """The echo of a flat surface straight above."""
        if self.sights.mirror:
            echoes, free = self.sights.overhead(sources, origin, mi.UInt32(0))
            yield from self._made(echoes.energy, echoes.amplitude, echoes.out, None, free, "s")

    def of_cells(self, sources: Sources, origin: dr.ArrayBase, way: Connection, cells: Cells,
                 area: mi.Float) -> Iterator[Echoes]:
        """Echoes of lit cells by way of the mirror: there, back, and both; `area` [m²] that each stands for."""
        if not self.sights.mirror or self.max_depth == 1:
            return
        none = mi.UInt32(0)
        ends = {False: self.sights.along(sources, origin, none, cells.point, way),
                True: self.sights.see(sources, origin, none, cells.point, cells.normal, folded=True)}
        for first, last, sign in self.sights.ways():
            out, back = ends[first], ends[last]
            lit = out.way.free & back.way.free
            strength, _ = bistatic_strength(cells.hits(out.way), -back.way.arrival_direction, lit, self.frequency)
            energy = along_legs(strength * area, out.gain, back.gain)
            root = dr.sqrt(dr.maximum(energy, 0)) * sign
            yield from self._made(energy, tuple(root * part for part in cells.amplitude), out.leg,
                                  None if first == last else back.leg, lit, "sbs" if first == last else "bs")

    # ---- rays, and points of the water

    def of_rays(self, sources: Sources, origin: dr.ArrayBase, direction: mi.Vector3f, solid_angle: mi.Float,
                strata: Strata, key: int) -> Iterator[Echoes]:
        """Echoes of more bounces, from rays sent out in given directions."""
        if self.bounces is None:
            return
        hits = self.tracer.trace(sources, origin, mi.UInt32(0), direction)
        dr.eval(hits)
        start = origin + dr.zeros(type(origin), strata.rays)
        row_key = dr.opaque(mi.UInt32, salted(key, Salt.ARRAY_BOUNCES))
        followed = self.bounces.follow(hits, solid_angle, sources, start, mi.UInt32(0), strata, row_key)
        for number, ghosts in enumerate(followed):
            energy = ghosts.energy * absorbed(ghosts.loss_db)
            active = self._worthwhile(energy, ghosts.active)
            path = self.paths.numbers(ghosts.code)
            # once for all names, and no kernel of its own for any of them
            dr.eval(energy, active, path, ghosts)
            for name in self.paths.names:
                some = compressed(active & (path == dr.opaque(mi.UInt32, self.paths.number(name))))
                if dr.width(some):
                    power = dr.gather(mi.Float, energy, some)
                    bits = hashed_pair(self.lib, some, row_key, dr.opaque(mi.UInt32, number))
                    yield Echoes(out=ghosts.out.chosen(some), back=ghosts.back.chosen(some),
                                 between=dr.gather(mi.Float64, ghosts.between, some), energy=power, path=name,
                                 amplitude=self._drawn(power, bits)).evaluated()

    def of_water(self, sources: Sources, origin: dr.ArrayBase, direction: mi.Vector3f, solid_angle: mi.Float,
                 strata: Strata, key: int) -> Iterator[Echoes]:
        """Echoes of points of the water, one along each direction."""
        if self.water is None:
            return
        row_key = dr.opaque(mi.UInt32, salted(key, Salt.ARRAY_WATER))
        index = dr.arange(mi.UInt32, strata.rays)
        bits, _ = pair(index, row_key)
        drawn = self.water.draw(sources, origin, mi.UInt32(0), direction, solid_angle, strata,
                                uniform(self.lib, bits))
        energy = drawn.energy * absorbed(drawn.loss_db)
        yield from self._made(energy, self._drawn(energy, hashed_pair(self.lib, index, row_key)),
                              EchoLeg.along(drawn.way, origin, drawn.point), None, drawn.active, "v")

    def _drawn(self, energy, bits):
        root = dr.sqrt(dr.maximum(energy, 0))
        return tuple(root * part for part in gaussian(self.lib, *bits))

    def _worthwhile(self, energy, active):
        strongest = dr.max(dr.select(active, energy, 0))
        return active & (energy > FAINTEST * strongest)

    def _made(self, energy, amplitude, out, back, lit, path):
        """The echoes that are there; `back` None: along the way out."""
        between = dr.zeros(mi.Float64, dr.width(energy))
        echoes = Echoes(out=out, back=out if back is None else back, between=between, energy=energy,
                        amplitude=amplitude, path=path)
        yield from echoes.where(lit & (energy > 0) & dr.isfinite(energy))
