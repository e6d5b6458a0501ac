"""Echoes that an array receives after several bounces, by way of a flat sea surface, and from the water.

A cell that is reached along one leg and sends back along another, m of them by way of the mirror, whose reflection is
-1, has the echo of `sonar_equation.along_legs` times g (-1)^m, where g is the cell's Gaussian. Paths of more bounces
(`multipath`) and points of the water (`volume`) have energies only. Their Gaussians are hashed from the ray, because
the sum of many such paths is speckle; they are coherent from element to element, not from ping to ping.
"""
from __future__ import annotations

from collections.abc import Iterator

import drjit as dr
import mitsuba as mi

from mitsonar.device.arrays import arrays_of, compressed
from mitsonar.device.chance import Salt, gaussian, hashed_pair, salted
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

FAINTEST = 1e-12                   # relative to the strongest of its kind: weaker echoes are dropped


class ArrayGhosts:
    """Echoes of a scene by way of several bounces, the mirror, and the water."""

    def __init__(self, tracer: Tracer, sights: Sights, *, max_depth: int,
                 frequency: float, window: tuple[float, float]):                              # [Hz], [s]
        geometry, water = tracer.geometry, tracer.water
        self.tracer, self.sights = tracer, sights
        self.frequency, self.max_depth = frequency, max_depth
        self.lib = arrays_of(mi.Float)
        self.paths = Paths(max_depth, surface=geometry.surface_label > 0, volume=water.scatters)
        self.bounces = Bounces(sights.connector, FreeRays(tracer), frequency=frequency, paths=self.paths,
                               energies=False) if max_depth > 1 else None
        self.water = WaterEchoes(sights.connector, window) if water.scatters else None

    # ---- one scatterer, by way of the mirror

    def overhead(self, sources: Sources, origin: dr.ArrayBase) -> Iterator[Echoes]:
        """Yield the echo of a flat sea surface straight above."""
        if self.sights.mirror:
            echoes, free = self.sights.overhead(sources, origin, mi.UInt32(0))
            yield from self._made(echoes.energy, echoes.amplitude, echoes.out, None, free, "s")

    def of_cells(self, sources: Sources, origin: dr.ArrayBase, way: Connection, cells: Cells,
                 area: mi.Float) -> Iterator[Echoes]:
        """Yield the echoes of cells by way of the mirror: out, back, and both; `area` [m²] is that of each cell."""
        if not self.sights.mirror or self.max_depth == 1:
            return
        source = mi.UInt32(0)
        ends = {False: self.sights.along(sources, origin, source, cells.point, way),
                True: self.sights.see(sources, origin, source, cells.point, cells.normal, folded=True)}
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
        """Yield the echoes of several bounces from rays in given directions."""
        if self.bounces is None:
            return
        hits = self.tracer.trace(sources, origin, mi.UInt32(0), direction)
        dr.eval(hits)
        start = origin + dr.zeros(type(origin), strata.rays)
        row_key = dr.opaque(mi.UInt32, salted(key, Salt.ARRAY_BOUNCES))
        followed = self.bounces.follow(hits, solid_angle, sources, start, mi.UInt32(0), strata, row_key)
        for number, ghosts in enumerate(followed):
            energy = ghosts.energy * absorbed(ghosts.loss_db)
            strongest = dr.max(dr.select(ghosts.active, energy, 0))
            active = ghosts.active & (energy > FAINTEST * strongest)
            path = self.paths.numbers(ghosts.code)
            # together, so that no path has a kernel of its own
            dr.eval(energy, active, path, ghosts)
            for name in self.paths.names:
                index = compressed(active & (path == dr.opaque(mi.UInt32, self.paths.number(name))))
                if dr.width(index):
                    power = dr.gather(mi.Float, energy, index)
                    ray = dr.gather(mi.UInt32, ghosts.ray, index)
                    bits = hashed_pair(self.lib, ray, row_key, dr.opaque(mi.UInt32, number))
                    yield Echoes(out=ghosts.out.chosen(index), back=ghosts.back.chosen(index),
                                 between=dr.gather(mi.Float64, ghosts.between, index), energy=power, path=name,
                                 amplitude=self._drawn(power, bits)).evaluated()

    def of_water(self, sources: Sources, origin: dr.ArrayBase, direction: mi.Vector3f, solid_angle: mi.Float,
                 place: mi.Float, key: int) -> Iterator[Echoes]:
        """Yield the echoes of points of the water, one along each direction, at a `place` in [0, 1) of the window."""
        if self.water is None:
            return
        row_key = dr.opaque(mi.UInt32, key)
        connected = self.water.draw_connected(sources, origin, direction, solid_angle, place)
        if connected is None:
            return
        index, drawn = connected
        energy = drawn.energy * absorbed(drawn.loss_db)
        yield from self._made(energy, self._drawn(energy, hashed_pair(self.lib, index, row_key)),
                              EchoLeg.along(drawn.way, origin, drawn.point), None, drawn.active, "v")

    def _drawn(self, energy, bits):
        """Return complex Gaussian amplitudes of mean square `energy`, from two hashes."""
        root = dr.sqrt(dr.maximum(energy, 0))
        return tuple(root * part for part in gaussian(self.lib, *bits))

    def _made(self, energy, amplitude, out, back, lit, path):
        """Yield the echoes that exist; without `back`, they return along the way out."""
        between = dr.zeros(mi.Float64, dr.width(energy))
        echoes = Echoes(out=out, back=out if back is None else back, between=between, energy=energy,
                        amplitude=amplitude, path=path)
        yield from echoes.where(lit & (energy > 0) & dr.isfinite(energy))
