"""Which scatterers a ping lights, and how strongly: two ways, one answer.

    scatterers    every cell within reach is connected to the sonar along its own bent ray, and counts if the way is
                  free: |e|² = σ dA (c_h / c_0)² 10^(-2 ᾱ L / 10) / A²
    rays          rays find cells, the energies of the rays in a cell add:
                  |e|² = Σ_k ΔΩ_k (σ / sin θ_i) (c_h / c_0)² 10^(-2 ᾱ L / 10) / A

e = g |e| is the echo's pressure 1 m from a source of pressure 1 at 1 m, without the patterns of the elements; symbols
as in `signal.echoes`, g the cell's Gaussian (`scattering.cells`). With enough rays both are the same; the first has
no noise of sampling and costs what lies within reach, the second costs what is sent.
"""
import drjit as dr
import mitsuba as mi
import numpy as np

from ..device.arrays import arrays_of, upload
from ..scene.materials import scattering_strength
from ..tracing.aimed_launch import DrawnRays
from ..tracing.connection import Connector
from ..tracing.free_rays import FreeRays
from ..tracing.tracer import Tracer
from ..water.absorption_table import Absorption
from .record import Echoes, Leg
from .scatterers import TARGET_RADIUS
from .sights import Sights
from .sonar_equation import GRAZING, absorbed, along_legs, echo_energy, leg_gain, lit_patch, speed_ratio
from .smooth.targets import SmoothTargets
from .surface_ghosts import ArrayGhosts

__all__ = ["LIGHTING", "Ensonification"]

LIGHTING = ("scatterers", "rays")
CELLS_PER_BLOCK = 1 << 19
MOST_CELLS = 10 ** 9               # of a ping: minutes of connecting
NEGLIGIBLE = 1e-8                  # two-way intensity of the beams below which a cell is not looked at


class Ensonification:
    """Light the scatterers of a scene from anywhere in its water.

    Parameters
    ----------
    scatterers : Scatterers
    profile : SoundSpeedProfile
    absorption : AbsorptionColumn
    frequency : float [Hz]
    window : (float, float) [s]
        Two-way times that matter.
    margin : float [m]
        How far the elements lie, and move, from the sources.
    lighting : str
        One of LIGHTING.
    rays : int
        Per source, for "rays".
    beams : ElementBeams or None
        Rays are sent where they are strong, and cells that they make negligible are left out. None: nothing is.
    resolution : float [m]
        Ranges that are told apart; cells of smooth surfaces are smaller.
    max_depth : int
        Bounces that an echo may have made.
    volume : water.VolumeScattering or None
        What the water itself sends back.
    """

    def __init__(self, scatterers, profile, absorption, *, frequency, window, margin, lighting, rays, beams,
                 resolution=np.inf, max_depth=1, volume=None):
        self.scatterers, self.frequency, self.window = scatterers, frequency, window
        self.lighting, self.beams = lighting, beams or None
        geometry = scatterers.geometry
        fastest, slowest = float(np.max(profile.sound_speed)), float(np.min(profile.sound_speed))
        self.nearest = 0.5 * window[0] * slowest - margin
        self.farthest = 0.5 * window[1] * fastest + margin
        self.lib = arrays_of(mi.Float)
        self.tracer = Tracer(geometry, profile, max_range=self.farthest)
        self.connector, self.free_rays = Connector(self.tracer), FreeRays(self.tracer)
        self.loss_db = Absorption(absorption, profile, max(geometry.depth_range[1], 1.0), mi.Float)
        deepest = max(geometry.depth_range[1], 1.0)
        folded_db = Absorption(absorption.mirrored(), profile.mirrored(), deepest, mi.Float,
                               top=-deepest) if geometry.surface_mirrors else None
        sights = Sights(self.connector, self.free_rays, self.loss_db, folded_db, max_depth=max_depth)
        self.smooth = SmoothTargets(sights, self.tracer, frequency=frequency, resolution=resolution, reach=margin,
                                    farthest=self.farthest)
        self.drawn_rays = DrawnRays(profile, window=window, rays=rays, pattern=self.pattern,
                                    surface=geometry.surface_label > 0 and not geometry.surface_mirrors)
        self.ghosts = ArrayGhosts(geometry, self.tracer, self.connector, self.free_rays, sights, self.loss_db,
                                  frequency=frequency, window=window, max_depth=max_depth, volume=volume)

    @property
    def pattern(self):
        """Two-way intensity of the beams, called with directions and a rotation; None where all are alike."""
        return None if self.beams is None else self.beams.intensity

    def __call__(self, origin, rotation, depth_below, key):
        """Light the scatterers from a source.

        Parameters
        ----------
        origin : (3,) [m]
            Scene coordinates.
        rotation : (3, 3)
            Body to scene.
        depth_below : float [m]
            Seabed below the source: where rays go first.
        key : int
            Of the random numbers rays are drawn with.

        Yields
        ------
        Echoes
            Block by block; point targets and smooth surfaces come after cells, and last what is `drawn`.
        """
        yield from self.lit(origin, rotation, depth_below, key)
        yield from self.drawn(origin, rotation, depth_below, key)

    def stretches(self, origin):
        """Cells within reach of a source: triples of path, `Scatterers.stretches` and how many there are."""
        facets = self.scatterers.in_reach(origin, self.nearest, self.farthest)
        found = []
        for path, at_surface in (("b", False), ("s", True)):
            facets_there = facets[self.scatterers.at_surface[facets] == at_surface]
            stretches = self.scatterers.stretches(facets_there, origin, self.farthest)
            cells = int(stretches[2].sum())
            if cells > MOST_CELLS:
                raise ValueError(f"{cells:.2g} cells of the scene lie within reach of a ping, and {MOST_CELLS:.0e} is "
                                 "the most; take larger cells, a shorter range, or let rays light them")
            found.append((path, stretches, cells))
        return found

    def lit(self, origin, rotation, depth_below, key, told=None):
        """Echoes of scatterers alone, whose phases are their own: the same from wherever they are lit.

        `told` is called with the share of the cells that are done, from 0 to 1, block by block.
        """
        sources, start = self._source(origin)
        if self.lighting == "scatterers":
            within_reach, done = self.stretches(origin), 0
            total = max(sum(cells for *_, cells in within_reach), 1)
            for path, stretches, _ in within_reach:
                for facet, s in self.scatterers.listed(stretches, CELLS_PER_BLOCK):
                    yield from self._echoes(sources, start, rotation, facet, s, path)
                    done += dr.width(facet)
                    if told is not None:
                        told(done / total)
        else:
            found = self._found(sources, start, rotation, depth_below, key)
            for path, at_surface in (("b", False), ("s", True)):
                there = self.scatterers.at_surface[found[0]] == at_surface
                facet, s, *brought = (column[there] for column in found)
                for first in range(0, len(facet), CELLS_PER_BLOCK):
                    some = slice(first, first + CELLS_PER_BLOCK)
                    yield from self._echoes(sources, start, rotation, upload(mi.UInt32, facet[some]),
                                            upload(mi.UInt32, s[some]), path,
                                            [upload(mi.Float, column[some].astype(np.float32)) for column in brought])
        if self.scatterers.targets:
            yield from self._targets(sources, start)
        for _, _, echoes in self.smooth(sources, np.array([origin], float), np.zeros(1, np.uint32)):
            yield echoes
        yield from self.ghosts.overhead(sources, start)

    def drawn(self, origin, rotation, depth_below, key):
        """Echoes of more bounces and of the water: by chance, and others from every source."""
        sources, start = self._source(origin)
        if self.ghosts.bounces is not None:
            yield from self.ghosts.of_rays(sources, start, *self.drawn_rays(start, rotation, depth_below, key), key)
        if self.ghosts.water is not None:
            yield from self.ghosts.of_water(sources, start, *self.drawn_rays(start, rotation, None, key), key)

    def _source(self, origin):
        return (self.tracer.sources([-origin[2]]),
                self.lib.Array3f64(*(dr.opaque(self.lib.Float64, float(v)) for v in origin)))

    def _echoes(self, sources, origin, rotation, facet, s, path, brought=None):
        """Echoes of cells, lit by connecting them, or with the energies and areas (R,) that rays have brought."""
        if self.beams is not None:
            # where the rays leave for: the straight line there may lie in another lobe
            point = self.scatterers.at(facet, s).point
            direction = self.connector.launch_direction(sources, origin, mi.UInt32(0), point)
            distance = mi.Float(dr.norm(point - origin))
            index = dr.compress(self.beams.bound(direction, distance, rotation) > NEGLIGIBLE)
            if not dr.width(index):
                return
            facet, s = dr.gather(mi.UInt32, facet, index), dr.gather(mi.UInt32, s, index)
            brought = brought and [dr.gather(mi.Float, column, index) for column in brought]
            dr.eval(facet, s, brought)
        cells = self.scatterers.at(facet, s)
        way = self.connector(sources, origin, mi.UInt32(0), cells.point, cells.normal, occlusion=brought is None)
        lit = way.free & (way.travel_time < 0.55 * self.window[1] + 1e-3)
        hits = _Lit(cells, way)
        if brought is not None:
            energy, area = brought
        else:
            area = cells.area
            strength, sin_grazing = scattering_strength(hits, lit, self.frequency)
            gain = self._gain(sources, cells.point, way)
            energy = along_legs(strength * cells.area, gain, gain)
            lit &= sin_grazing > GRAZING
        root = dr.sqrt(dr.maximum(energy, 0))
        lit &= (root > 0) & dr.isfinite(root)
        yield from self._kept(origin, cells.point, way, energy, tuple(root * part for part in cells.amplitude), lit,
                              path)
        if path == "b":
            yield from self.ghosts.of_cells(sources, origin, hits, way, cells, area)

    def points(self, sources, origin):
        """Yield the labels (R,) uint32 and the echoes of the point targets that are seen."""
        if self.scatterers.targets:
            kept, _, way, _ = self._of_points(sources, origin)
            for echoes in kept:
                yield np.array([label for *_, label in self.scatterers.targets], np.uint32)[way.free.numpy()], echoes

    def _targets(self, sources, origin):
        """Echoes of the point targets."""
        kept, *of = self._of_points(sources, origin)
        yield from kept
        yield from self.ghosts.of_targets(sources, origin, *of)

    def _of_points(self, sources, origin):
        """Echoes of the point targets that are seen, all points, the ways there, and their amplitudes."""
        point, strength_db, _ = zip(*self.scatterers.targets)
        point = self.lib.Array3f64(*(upload(mi.Float64, column) for column in np.array(point).T))
        # it may lie on a surface, which must not hide it
        way = self.connector(sources, origin, mi.UInt32(0), point, mi.Vector3f(0, 0, 0), short=TARGET_RADIUS)
        pressure = upload(mi.Float, (10 ** (np.array(strength_db) / 20)).astype(np.float32))
        gain = self._gain(sources, point, way)
        energy = along_legs(dr.square(pressure), gain, gain)
        nothing = dr.zeros(mi.Float, dr.width(energy))
        return self._kept(origin, point, way, energy, (dr.sqrt(energy), nothing), way.free), point, way, pressure

    def _gain(self, sources, point, way):
        """Gain of the legs to points [1/m²]."""
        return leg_gain(spreading_area=way.spreading_area, speed_ratio=self._speed_ratio(sources, way),
                        loss_db=self._loss_db(sources, point, way))

    def _speed_ratio(self, sources, way):
        return speed_ratio(way.sound_speed, sources.state.gather(self.lib, mi.UInt32(0))[1])

    def _loss_db(self, sources, point, way):
        source_depth = mi.Float(sources.state.gather(self.lib, mi.UInt32(0))[0])
        return self.loss_db(source_depth, mi.Float(-point.z), way.arc_length, mi.Float(way.ray_parameter))

    def _kept(self, origin, point, way, energy, amplitude, lit, path="b"):
        leg = Leg.along(way, origin, point)
        echoes = Echoes(out=leg, back=leg, between=dr.zeros(mi.Float64, dr.width(lit)), energy=energy,
                        amplitude=amplitude, path=path).evaluated()
        dr.eval(lit)
        index = dr.compress(lit)
        if dr.width(index):
            yield echoes.chosen(index).evaluated()

    # ---- rays that find cells

    def _found(self, sources, origin, rotation, depth_below, key):
        """Cells that rays find: facets, numbers within them, and the energies and areas of their rays."""
        direction, solid_angle, _ = self.drawn_rays(origin, rotation, depth_below, key)
        hits = self.tracer(sources, origin, mi.UInt32(0), direction)
        strength, sin_grazing = scattering_strength(hits, hits.valid, self.frequency)
        energy = echo_energy(solid_angle=solid_angle, strength=strength, sin_grazing=sin_grazing,
                             spreading_area=hits.spreading_area, speed_ratio=self._speed_ratio(sources, hits),
                             loss=absorbed(self._loss_db(sources, hits.point, hits)))
        facet, s = self.scatterers.of(hits)
        area = lit_patch(solid_angle, spreading_area=hits.spreading_area, sin_grazing=sin_grazing)
        columns = facet, s, energy, area
        dr.eval(columns, hits.valid, sin_grazing)
        found = hits.valid.numpy() & (sin_grazing.numpy() > GRAZING) & (energy.numpy() > 0)
        facet, s, energy, area = (column.numpy()[found] for column in columns)
        found = self.scatterers.scattering[facet]
        cell, which = np.unique((facet[found].astype(np.uint64) << np.uint64(32)) | s[found], return_inverse=True)
        return ((cell >> np.uint64(32)).astype(np.uint32), cell.astype(np.uint32),
                *(np.bincount(which, weights=column[found], minlength=len(cell)) for column in (energy, area)))


class _Lit:
    """Cells as `materials.scattering_strength` looks at hits: normals on the side the ray comes from."""

    def __init__(self, cells, way):
        self.cells = cells
        self.point, self.uv, self.shape, self.primitive = cells.point, cells.uv, cells.shape, cells.primitive
        self.arrival_direction, self.sound_speed = way.arrival_direction, way.sound_speed
        self.normal = dr.select(dr.dot(cells.normal, way.arrival_direction) > 0, -cells.normal, cells.normal)

    def seen_along(self, way):
        """The same cells, lit from elsewhere."""
        return _Lit(self.cells, way)
