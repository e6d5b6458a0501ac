"""Echoes that an array hears by way of more than one bounce, by way of a flat surface, and from the water.

    e = g √(σ A_cell (c_h / c_0)² 10^(-ᾱ L / 10) / (A_out A_back)) (-1)^m

for a cell seen along one leg and sending back along another, m of them by way of the mirror, whose reflection is -1;
σ from the one to the other, g the cell's Gaussian or a target's strength. Paths of more bounces (`bounces`) and points
of the water (`water_echoes`) bring energies; their Gaussians are hashed from the ray, for what the sum of many such
paths is: speckle. They are coherent from element to element, not from ping to ping.
"""
import drjit as dr
import mitsuba as mi
import numpy as np

from ..device.arrays import arrays_of
from ..device.chance import Salt, gaussian, hashed_pair, pair, salted, uniform
from ..scene.materials import bistatic_strength
from .multipath import Bounces
from .paths import Paths
from .record import Echoes, Leg
from .scatterers import TARGET_RADIUS
from .sonar_equation import absorbed, along_legs
from .volume import WaterEchoes

__all__ = ["ArrayGhosts"]

FAINTEST = 1e-12                   # of the strongest of its kind: weaker echoes are dropped


class ArrayGhosts:
    """Make these echoes for a source.

    Parameters
    ----------
    geometry : Geometry
    tracer, connector, free_rays
        Of the scene and its water.
    sights : Sights
    loss_db : signal.echoes.Absorption
    frequency : float [Hz]
    window : (float, float) [s]
    max_depth : int
    volume : water.VolumeScattering or None
    """

    def __init__(self, geometry, tracer, connector, free_rays, sights, loss_db, *, frequency, window, max_depth,
                 volume):
        self.geometry, self.tracer, self.connector = geometry, tracer, connector
        self.frequency, self.max_depth = frequency, max_depth
        self.lib = arrays_of(mi.Float)
        self.paths = Paths(max_depth, surface=geometry.surface_label > 0, volume=volume is not None)
        self.sights = sights
        self.bounces = Bounces(free_rays, loss_db, sights.folded_db, frequency=frequency, paths=self.paths,
                               surface_label=geometry.surface_label, mirror=sights.mirror, targets=geometry.targets(),
                               single=False) if max_depth > 1 else None
        self.water = None if volume is None else WaterEchoes(volume, connector, loss_db, window)

    # ---- one scatterer, by way of the mirror

    def overhead(self, sources, origin):
        """The echo of a flat surface straight above."""
        if self.sights.mirror:
            echoes, free = self.sights.overhead(sources, origin, mi.UInt32(0))
            yield from self._made(echoes.energy, echoes.amplitude, echoes.out, None, free, "s")

    def of_cells(self, sources, origin, hits, way, cells, area):
        """Echoes of lit cells by way of the mirror: there, back, and both; `area` [m²] that each stands for."""
        if self.sights.mirror and self.max_depth > 1:
            def strength(out, back, lit):
                seen = hits.seen_along(out)
                return bistatic_strength(seen, -back.arrival_direction, lit, self.frequency)[0] * area

            yield from self._by_the_mirror(sources, origin, cells.point, cells.normal, way, strength, cells.amplitude)

    def of_targets(self, sources, origin, point, way, pressure):
        """Echoes of point targets by way of the mirror."""
        if self.sights.mirror and self.max_depth > 1:
            nothing = dr.zeros(mi.Float, dr.width(pressure))
            yield from self._by_the_mirror(sources, origin, point, mi.Vector3f(0, 0, 0), way,
                                           lambda out, back, lit: dr.square(pressure), (nothing + 1, nothing),
                                           short=TARGET_RADIUS)

    def _by_the_mirror(self, sources, origin, point, normal, way, strength, amplitude, short=0.0):
        none = mi.UInt32(0)
        ends = {False: self.sights.of(sources, origin, none, point, way),
                True: self.sights(sources, origin, none, point, normal, folded=True, short=short)}
        for first, last, sign in self.sights.ways():
            out, back = ends[first], ends[last]
            lit = out.way.free & back.way.free
            energy = along_legs(strength(out.way, back.way, lit), out.gain, back.gain)
            root = dr.sqrt(dr.maximum(energy, 0)) * sign
            yield from self._made(energy, tuple(root * part for part in amplitude), out.leg,
                                  None if first == last else back.leg, lit, "sbs" if first == last else "bs")

    # ---- rays, and points of the water

    def of_rays(self, sources, origin, direction, solid_angle, strata, key):
        """Echoes of more bounces, from rays sent out in given directions."""
        if self.bounces is None:
            return
        hits = self.tracer(sources, origin, mi.UInt32(0), direction)
        dr.eval(vars(hits))
        start = origin + dr.zeros(type(origin), strata.rays)
        speed = dr.opaque(mi.Float, float(self.tracer.profile.at(-np.ravel(origin.z.numpy())[0])))
        row_key = dr.opaque(mi.UInt32, salted(key, Salt.ARRAY_BOUNCES))

        def homeward(point, normal, active, short=0.0):
            return self.connector(sources, origin, mi.UInt32(0), point, normal, active, short=short)

        for number, ghosts in enumerate(self.bounces(hits, solid_angle, start, speed, strata, row_key, homeward)):
            energy = ghosts.energy * absorbed(ghosts.loss_db)
            active = self._worthwhile(energy, ghosts.active)
            path = self.paths.numbers(ghosts.code)
            # once for all names, and no kernel of its own for any of them
            dr.eval(energy, active, path, vars(ghosts), vars(ghosts.out), vars(ghosts.back))
            for name in self.paths.names:
                some = dr.compress(active & (path == dr.opaque(mi.UInt32, self.paths.number(name))))
                if dr.width(some):
                    power = dr.gather(mi.Float, energy, some)
                    chance = hashed_pair(self.lib, some, row_key, dr.opaque(mi.UInt32, number))
                    yield Echoes(out=ghosts.out.chosen(some), back=ghosts.back.chosen(some),
                                 between=dr.gather(mi.Float64, ghosts.between, some), energy=power, path=name,
                                 amplitude=self._drawn(power, chance)).evaluated()

    def of_water(self, sources, origin, direction, solid_angle, strata, key):
        """Echoes of points of the water, one along each direction."""
        if self.water is None:
            return
        speed = dr.opaque(mi.Float, float(self.tracer.profile.at(-np.ravel(origin.z.numpy())[0])))
        row_key = dr.opaque(mi.UInt32, salted(key, Salt.ARRAY_WATER))
        index = dr.arange(mi.UInt32, strata.rays)
        chance, _ = pair(index, row_key)
        drawn = self.water(sources, origin, mi.UInt32(0), speed, direction, solid_angle, strata,
                           uniform(self.lib, chance))
        energy = drawn.energy * absorbed(drawn.loss_db)
        yield from self._made(energy, self._drawn(energy, hashed_pair(self.lib, index, row_key)),
                              Leg.along(drawn.way, origin, drawn.point), None, drawn.active, "v")

    def _drawn(self, energy, bits):
        root = dr.sqrt(dr.maximum(energy, 0))
        return tuple(root * part for part in gaussian(self.lib, *bits))

    def _worthwhile(self, energy, active):
        strongest = dr.max(dr.select(active, energy, 0))
        return active & (energy > FAINTEST * strongest)

    def _made(self, energy, amplitude, out, back, lit, path):
        """The echoes that are there; `back` None: along the way out."""
        lit = lit & (energy > 0) & dr.isfinite(energy)
        width = dr.width(energy)
        echoes = Echoes(out=out, back=out if back is None else back, between=dr.zeros(mi.Float64, width),
                        energy=energy, amplitude=amplitude, path=path).evaluated()
        dr.eval(lit)
        index = dr.compress(lit)
        if dr.width(index):
            yield echoes.chosen(index).evaluated()
