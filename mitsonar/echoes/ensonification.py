"""Which scatterers a ping ensonifies, and how strongly: two ways, one answer.

    scatterers    every cell within reach is connected to the sonar along its own bent ray, and counts if the way is
                  free: |e|² = σ dA g²
    rays          rays find cells, the energies of the rays in a cell add:
                  |e|² = Σ_k ΔΩ_k (σ / sin θ_i) (c_h / c_0)² 10^(-2 ᾱ L / 10) / A

e is the echo's pressure 1 m from a source of pressure 1 at 1 m, without the patterns of the elements: the cell's
Gaussian (`cells`) times |e|; symbols as in `sonar_equation`. With enough rays both are the same; the first has no noise
of sampling and costs what lies within reach, the second costs what is sent.
"""
from __future__ import annotations

from collections.abc import Callable, Iterator

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, compressed, upload
from mitsonar.scattering.bodies.echo_taps import HeardBand
from mitsonar.scene.materials import scattering_strength
from mitsonar.scene.tracing.aimed_launch import DrawnRays
from mitsonar.scene.tracing.connection import Connector
from mitsonar.scene.tracing.launch import Strata
from mitsonar.scene.tracing.tracer import Sources, Tracer
from mitsonar.scene.tracing.water import DeviceWater

from .bounces.surface_ghosts import ArrayGhosts
from .point_targets import PointTargets
from .record import Echoes, EchoLeg
from .scatterers.element_beams import ElementBeams
from .scatterers.pieces import NEGLIGIBLE, Pieces, pieces_in_beams, pieces_in_reach
from .scatterers.scatterers import Cells, Scatterers
from .scatterers.side_lobes import SideLobes
from .sights.sights import Sights
from .smooth.targets import SmoothTargets
from .sonar_equation import GRAZING, absorbed, along_legs, echo_energy, lit_patch, speed_ratio

CELLS_PER_BLOCK = 1 << 19
WORTH_ASKING = 0.2                 # share of cells that beams may make negligible from which on each is asked
MOST_CELLS = 10 ** 9               # of a ping: minutes of connecting


class Ensonification:
    """Ensonify the scatterers of a scene from anywhere in its water."""
    # frequency [Hz]; window [s]; margin [m]; resolution [m]

    def __init__(self, scatterers: Scatterers, water: DeviceWater, *, frequency: float, window: tuple[float, float],
                 margin: float, method: str, rays: int, beams: ElementBeams | None, resolution: float = np.inf,
                 max_depth: int = 1, thin_below: float = 0.0, band: HeardBand | None = None):
        self.scatterers, self.water, self.frequency, self.window = scatterers, water, frequency, window
        self.method, self.beams = method, beams or None
        self.side_lobes = SideLobes(scatterers=scatterers, below=thin_below) if thin_below and beams else None
        geometry = scatterers.geometry
        self.targets = PointTargets(geometry.targets(), band or HeardBand.about(frequency), water.profile)
        self.nearest = 0.5 * window[0] * water.slowest - margin
        self.farthest = 0.5 * window[1] * water.fastest + margin
        self.lib = arrays_of(mi.Float)
        self.tracer = Tracer(geometry, water, max_range=self.farthest)
        self.connector = Connector(geometry, water)
        self.sights = Sights(self.connector, max_depth=max_depth, frequency=frequency)
        self.smooth = SmoothTargets(self.sights, frequency=frequency, resolution=resolution, reach=margin,
                                    farthest=self.farthest)
        self.drawn_rays = DrawnRays(water.profile, window=window, rays=rays, pattern=self.pattern,
                                    surface=geometry.surface_label > 0 and not geometry.surface_mirrors)
        self.ghosts = ArrayGhosts(self.tracer, self.sights, frequency=frequency, window=window, max_depth=max_depth)

    @property
    def pattern(self) -> Callable | None:
        """Two-way intensity of the beams, called with directions and a rotation; None where all are alike."""
        return None if self.beams is None else self.beams.intensity

    def echoes(self, origin: np.ndarray, rotation: np.ndarray, depth_below: float, key: int) -> Iterator[Echoes]:
        """Ensonify the scatterers from a source."""
        # origin (3,) [m]; rotation (3, 3); depth_below [m]
        yield from self.scatterer_echoes(origin, rotation, depth_below, key)
        yield from self.random_echoes(origin, rotation, depth_below, key)

    def pieces(self, origin: np.ndarray) -> list[tuple[str, Pieces]]:
        """Pieces of facets within reach of a source (3,) [m], each kind with its path."""
        facets = self.scatterers.in_reach(origin, self.nearest, self.farthest)
        found = []
        for path, at_surface in (("b", False), ("s", True)):
            facets_there = facets[self.scatterers.at_surface[facets] == at_surface]
            pieces = pieces_in_reach(self.scatterers, facets_there, origin, self.nearest, self.farthest)
            cells = int(pieces.cells.sum())
            if cells > MOST_CELLS:
                raise ValueError(f"{cells:.2g} cells of the scene lie within reach of a ping, and {MOST_CELLS:.0e} is "
                                 "the most; take larger cells, a shorter range, or let rays find them")
            found.append((path, pieces))
        return found

    def scatterer_echoes(self, origin: np.ndarray, rotation: np.ndarray, depth_below: float, key: int,
                         progress: Callable[[float], object] | None = None) -> Iterator[Echoes]:
        """Echoes of scatterers, whose phases are their own: the same from wherever they are ensonified.

        `progress` is called with the share of the cells that are done, from 0 to 1, block by block.
        """
        sources, start = self._source(origin)
        if self.method == "scatterers":
            within_reach = [(path, self._in_beams(sources, start, rotation, pieces))
                            for path, pieces in self.pieces(origin)]
            total, done = max(sum(int(pieces.cells.sum()) for _, (_, pieces, _) in within_reach), 1), 0
            for path, (aim, pieces, bound) in within_reach:
                for facet, s in self._cells(pieces, bound):
                    yield from self._echoes(sources, start, rotation, facet, s, path, aim=aim)
                    done += dr.width(facet)
                    if progress is not None:
                        progress(done / total)
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
        for _, echoes in self.coherent_echoes(origin):
            yield echoes

    def coherent_echoes(self, origin: np.ndarray) -> Iterator[tuple[mi.UInt32, Echoes]]:
        """Yield echoes that owe no phase to chance, with their labels: targets, smooth surfaces, a mirror overhead."""
        if not (self.targets or self.smooth or self.sights.mirror):
            return
        sources, start = self._source(origin)
        for echoes, free in self._of_targets(sources, start):
            label = self.targets.label(compressed(free))
            for some in echoes.where(free):
                yield label, some
        for _, label, echoes in self.smooth.echoes(sources, np.array([origin], float), np.zeros(1, np.uint32)):
            yield label, echoes
        for echoes in self.ghosts.overhead(sources, start):
            yield dr.full(mi.UInt32, self.sights.geometry.surface_label, echoes.count), echoes

    def mirrored_echoes(self, origin: np.ndarray, cells: Cells) -> Iterator[Echoes]:
        """Yield the echoes of scatterers by way of a flat surface that mirrors: there, back, or both."""
        if not self.sights.mirror or self.ghosts.max_depth == 1:
            return
        sources, start = self._source(origin)
        way = self.connector.connect(sources, start, mi.UInt32(0), cells.point, cells.normal, coarse=True)
        yield from self.ghosts.of_cells(sources, start, way, cells, cells.area)

    def random_echoes(self, origin: np.ndarray, rotation: np.ndarray, depth_below: float, key: int,
                      in_water: Callable[[], tuple[mi.Vector3f, mi.Float, Strata]] | None = None) -> Iterator[Echoes]:
        """Echoes of more bounces and of the water, which are drawn by chance: other ones from every source.

        `in_water` draws the directions of the points of the water; None: those of the elements' beams are taken.
        """
        sources, start = self._source(origin)
        if self.ghosts.bounces is not None:
            rays = self.drawn_rays.draw(start, rotation, depth_below, key)
            yield from self.ghosts.of_rays(sources, start, *rays, key)
        if self.ghosts.water is not None:
            rays = self.drawn_rays.draw(start, rotation, None, key) if in_water is None else in_water()
            yield from self.ghosts.of_water(sources, start, *rays, key)

    def _source(self, origin):
        return (self.tracer.sources([-origin[2]]),
                self.lib.Array3f64(*(dr.opaque(self.lib.Float64, float(v)) for v in origin)))

    def _in_beams(self, sources: Sources, origin: dr.ArrayBase, rotation: np.ndarray,
                  pieces: Pieces) -> tuple[bool, Pieces, np.ndarray]:
        """Return whether cells have to be asked one by one what beams leave of them; pieces that may count, and their
        bounds.

        Where few would have to be, all are taken: less work than to ask.
        """
        if self.beams is None:
            return False, pieces, np.ones(len(pieces.facet))
        enough = max(NEGLIGIBLE, self.side_lobes.below) if self.side_lobes else NEGLIGIBLE
        found, bound = pieces_in_beams(pieces, self.connector, self.beams, sources, origin, rotation, enough)
        pieces, bound, doubtful = pieces.chosen(found >= 0), bound[found >= 0], found[found >= 0] == 0
        if self.side_lobes:
            return bool(doubtful.any()), pieces, bound
        cells = pieces.cells
        return bool(cells[doubtful].sum() > WORTH_ASKING * cells.sum()), pieces, bound

    def _cells(self, pieces, bound):
        """Cells of pieces, block by block; of those in side lobes only such as may exist."""
        if self.side_lobes is None:
            return self.scatterers.listed(pieces.runs(), CELLS_PER_BLOCK)
        return self.side_lobes.listed(pieces, bound, CELLS_PER_BLOCK)

    def _echoes(self, sources, origin, rotation, facet, s, path, brought=None, aim=True):
        """Echoes of cells: of all that can be connected, or with the energies and areas (R,) that rays have brought.

        Those that beams make negligible are left out if they are to `aim` at cells, and those in side lobes thinned.
        """
        share = None
        if self.beams is not None and aim:
            # where the rays leave for: the straight line there may lie in another lobe
            point = self.scatterers.at(facet, s).point
            direction = self.connector.launch_direction(sources, origin, mi.UInt32(0), point)
            distance = mi.Float(dr.norm(point - origin))
            bound = self.beams.bound(direction, distance, rotation)
            counts = bound > NEGLIGIBLE
            if self.side_lobes is not None and brought is None:
                share = self.side_lobes.share(bound)
                counts &= self.side_lobes.exist(facet, s, share)
                dr.eval(counts, share)
            index = compressed(counts)
            if not dr.width(index):
                return
            facet, s = dr.gather(mi.UInt32, facet, index), dr.gather(mi.UInt32, s, index)
            brought = brought and [dr.gather(mi.Float, column, index) for column in brought]
            share = None if share is None else dr.gather(mi.Float, share, index)
            dr.eval(facet, s, brought, share)
        cells = self.scatterers.at(facet, s)
        way = self.connector.connect(sources, origin, mi.UInt32(0), cells.point, cells.normal,
                                     occlusion=brought is None, coarse=True)
        reached = way.free & (way.travel_time < dr.opaque(mi.Float64, 0.55 * self.window[1] + 1e-3))
        if brought is not None:
            energy, area = brought
        else:
            area = cells.area if share is None else cells.area / share
            strength, sin_grazing = scattering_strength(cells.hits(way), reached, self.frequency)
            gain = self.sights.along(sources, origin, mi.UInt32(0), cells.point, way).gain
            energy = along_legs(strength * area, gain, gain)
            reached &= sin_grazing > GRAZING
        root = dr.sqrt(dr.maximum(energy, 0))
        reached &= (root > 0) & dr.isfinite(root)
        leg = EchoLeg.along(way, origin, cells.point)
        yield from Echoes(out=leg, back=leg, between=dr.zeros(mi.Float64, dr.width(reached)), energy=energy, path=path,
                          amplitude=(root * cells.amplitude[0], root * cells.amplitude[1])).where(reached)
        if path == "b":
            yield from self.ghosts.of_cells(sources, origin, way, cells, area)

    def points(self, sources: Sources, origin: dr.ArrayBase) -> Iterator[tuple[mi.UInt32, Echoes]]:
        """Yield the labels and the echoes of the point targets that are seen straight."""
        for echoes, free in self._of_targets(sources, origin, mirrored=False):
            label = self.targets.label(compressed(free))
            for some in echoes.where(free):
                yield label, some

    def _of_targets(self, sources, origin, mirrored=True):
        """Echoes of the point targets, and whether they are seen."""
        targets = self.targets
        if targets:
            yield from targets.echoes(self.sights, sources, origin, mi.UInt32(0), dr.arange(mi.UInt32, len(targets)),
                                      mirrored=mirrored)

    # ---- rays that find cells

    def _found(self, sources, origin, rotation, depth_below, key):
        """Cells that rays find: facets, numbers within them, and the energies and areas of their rays."""
        direction, solid_angle, _ = self.drawn_rays.draw(origin, rotation, depth_below, key)
        hits = self.tracer.trace(sources, origin, mi.UInt32(0), direction)
        strength, sin_grazing = scattering_strength(hits, hits.valid, self.frequency)
        ratio = speed_ratio(hits.sound_speed, sources.state.gather(self.lib, mi.UInt32(0))[1])
        energy = echo_energy(solid_angle=solid_angle, strength=strength, sin_grazing=sin_grazing,
                             spreading_area=hits.spreading_area, speed_ratio=ratio,
                             loss=absorbed(self.water.loss_db(origin, hits.point, hits)))
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
