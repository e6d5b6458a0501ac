"""Ensonification of a scene: the echoes that one ping receives from its scatterers, by either of two methods.

    scatterers    every cell within reach is connected to the sonar along its own bent ray, and counts if nothing is in
                  the way: |e|² = σ dA g²
    rays          rays find the cells, and the energies of the rays in a cell are added:
                  |e|² = Σ_k ΔΩ_k (σ / sin θ_i) (c_h / c_0)² 10^(-2 ᾱ L / 10) / A

e is the echo's pressure 1 m from a source of pressure 1 at 1 m, without the patterns of the elements: the cell's
Gaussian (`scatterers`) times |e|. Symbols as in `sonar_equation`. With enough rays both methods agree. The first has no
sampling noise and costs time by the scene within reach, the second by the number of rays.
"""
from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, compressed, entries, upload
from mitsonar.device.chance import Salt, salted
from mitsonar.device.progress import Share, nobody
from mitsonar.scattering.bodies.echo_taps import ReceivedBand
from mitsonar.scene.materials import scattering_strength
from mitsonar.scene.tracing.aimed_launch import DrawnRays
from mitsonar.scene.tracing.connection import Connector
from mitsonar.scene.tracing.tracer import Sources, Tracer
from mitsonar.scene.tracing.water import DeviceWater

from .body_motion import BodyMotion
from .bounces.fan_rays import FanRays
from .bounces.surface_ghosts import ArrayGhosts
from .bounces.volume import line_lattice
from .point_targets import PointTargets
from .record import Echoes, EchoLeg
from .scatterers.element_beams import ElementBeams
from .scatterers.pieces import NEGLIGIBLE, Pieces, SideLobes, pieces_in_beams, pieces_in_reach
from .scatterers.scatterers import Cells, Scatterers
from .sights.sights import Sights
from .smooth.targets import SmoothTargets
from .sonar_equation import GRAZING, absorbed, along_legs, echo_energy, lit_patch, speed_ratio

CELLS_PER_BLOCK = 1 << 20
WATER_PER_BLOCK = 1 << 19          # points
WORTH_ASKING = 0.2                 # share of cells in doubtful beams above which each cell is tested
MOST_CELLS = 10 ** 9               # of a ping: minutes of connecting
BOTTOM_AND_SURFACE = ("b", False), ("s", True)     # path, and whether the facet belongs to the sea surface


class Ensonification:
    """Echoes of a scene for a source anywhere in its water."""

    def __init__(self, scatterers: Scatterers, water: DeviceWater, *,
                 frequency: float,                        # [Hz]
                 window: tuple[float, float],             # [s]
                 margin: float,                           # [m]
                 method: str, rays: int, beams: ElementBeams | None,
                 resolution: float = np.inf,              # [m]
                 spread: float = np.inf,                  # [s], of an echo's arrivals about that at the source
                 max_depth: int = 1, thin_below: float = 0.0, band: ReceivedBand | None = None,
                 fan: FanRays | None = None):             # directions of points of the water, for an array's beams
        self.scatterers, self.water, self.frequency, self.window = scatterers, water, frequency, window
        self.method, self.beams = method, beams or None
        self.side_lobes = SideLobes(below=thin_below) if thin_below and beams else None
        geometry = scatterers.geometry
        self.motion = BodyMotion.of(geometry)
        self.targets = PointTargets.of(geometry, band or ReceivedBand.about(frequency), water.profile)
        self.margin, self.spread = margin, spread
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
        self._fan = fan
        self.ghosts = ArrayGhosts(self.tracer, self.sights, frequency=frequency, window=window, max_depth=max_depth)

    def with_targets(self, targets: PointTargets) -> Ensonification:
        """Return the same ensonification with other point targets."""
        other = copy.copy(self)
        other.targets = targets
        return other

    def turning(self, turn: float) -> Ensonification:
        """Return the same ensonification for arrays that turn by another angle [rad] during reception."""
        if self.beams is None or self.beams.turning(turn) is self.beams:
            return self
        other = copy.copy(self)
        other.beams = self.beams.turning(turn)
        return other

    def reach(self, origin: np.ndarray) -> tuple[float, float]:
        """Return the distances from a source (3,) [m] between which scatterers have echoes within the window.

        No way out is longer than `farthest`, so the speed of sound at depths farther off than that does not count.
        """
        if self.water.field is not None:
            return self.nearest, self.farthest
        slowest, fastest = self.water.profile.extremes(-origin[2] - self.farthest, -origin[2] + self.farthest)
        early, late = (0.5 * self.spread * speed if np.isfinite(self.spread) else self.margin
                       for speed in (slowest, fastest))
        nearest, farthest = 0.5 * self.window[0] * slowest - early, 0.5 * self.window[1] * fastest + late
        # by way of a mirror, echoes of nearer scatterers arrive within the window
        return self.nearest if self.sights.mirror else max(nearest, self.nearest), min(farthest, self.farthest)

    @property
    def pattern(self) -> Callable | None:
        """Two-way intensity of the beams as a function of directions and a rotation, or None if it is uniform."""
        return None if self.beams is None else self.beams.intensity

    def echoes(self, origin: np.ndarray, rotation: np.ndarray, depth_below: float, key: int) -> Iterator[Echoes]:
        """Yield all echoes of a ping from `origin` (3,) [m] at an attitude (3, 3), `depth_below` [m] above the bed."""
        yield from self.scatterer_echoes(origin, rotation, depth_below, key)
        yield from self.random_echoes(origin, rotation, depth_below, key)

    def pieces(self, origin: np.ndarray) -> list[tuple[str, Pieces]]:
        """Return the path and the pieces of facets within reach of a source (3,) [m], for bottom and surface."""
        reach = self.reach(origin)
        facets, pieces = self.scatterers.in_reach(origin, *reach), []
        for path, at_surface in BOTTOM_AND_SURFACE:
            facets_there = facets[self.scatterers.at_surface[facets] == at_surface]
            pieces.append((path, pieces_in_reach(self.scatterers, facets_there, origin, *reach)))
            cells = int(pieces[-1][1].cells.sum())
            if cells > MOST_CELLS:
                raise ValueError(f"{cells:.2g} cells of the scene lie within reach of a ping; the limit is "
                                 f"{MOST_CELLS:.0e}. Use larger cells, a shorter range, or ensonification \"rays\".")
        return pieces

    def scatterer_echoes(self, origin: np.ndarray, rotation: np.ndarray, depth_below: float, key: int,
                         progress: Share = nobody) -> Iterator[Echoes]:
        """Yield the echoes of scatterers, whose phases are the same from wherever they are ensonified.

        `progress` is called block by block with the share of the cells that are done, from 0 to 1.
        """
        sources, start = self._source(origin)
        if self.method == "scatterers":
            within_reach = [(path, part) for path, pieces in self.pieces(origin)
                            for part in self._in_beams(sources, start, rotation, pieces)]
            total, done = max(sum(int(pieces.cells.sum()) for _, (_, pieces, _) in within_reach), 1), 0
            for path, (aim, pieces, bound) in within_reach:
                for facet, k in self._cells(pieces, bound):
                    yield from self._echoes(sources, start, rotation, facet, k, path, aim=aim)
                    done += dr.width(facet)
                    progress(done / total)
        else:
            facets, *columns = self._cells_of_rays(sources, start, rotation, depth_below, key)
            for path, at_surface in BOTTOM_AND_SURFACE:
                there = self.scatterers.at_surface[facets] == at_surface
                facet, k, energy, area = (column[there] for column in (facets, *columns))
                for first in range(0, len(facet), CELLS_PER_BLOCK):
                    block = slice(first, first + CELLS_PER_BLOCK)
                    yield from self._echoes(sources, start, rotation, upload(mi.UInt32, facet[block]),
                                            upload(mi.UInt32, k[block]), path,
                                            [upload(mi.Float, column[block].astype(np.float32))
                                             for column in (energy, area)])
        for _, echoes in self.coherent_echoes(origin):
            yield echoes

    def coherent_echoes(self, origin: np.ndarray) -> Iterator[tuple[mi.UInt32, Echoes]]:
        """Yield labels and echoes whose phase is not random: targets, smooth surfaces, a mirror overhead."""
        if not (self.targets or self.smooth or self.sights.mirror):
            return
        sources, start = self._source(origin)
        yield from self.points(sources, start, mirrored=True)
        for _, label, echoes in self.smooth.echoes(sources, np.array([origin], float), np.zeros(1, np.uint32)):
            yield label, echoes
        for echoes in self.ghosts.overhead(sources, start):
            yield dr.full(mi.UInt32, self.sights.geometry.surface_label, echoes.count), echoes

    def mirrored_echoes(self, origin: np.ndarray, cells: Cells) -> Iterator[Echoes]:
        """Yield the echoes of scatterers by way of a mirroring sea surface: out, back, or both."""
        if not self.sights.mirror or self.ghosts.max_depth == 1:
            return
        sources, start = self._source(origin)
        way = self.connector.connect(sources, start, mi.UInt32(0), cells.point, cells.normal)
        yield from self.ghosts.of_cells(sources, start, way, cells, cells.area)

    def random_echoes(self, origin: np.ndarray, rotation: np.ndarray, depth_below: float,
                      key: int) -> Iterator[Echoes]:
        """Yield the echoes of several bounces and of the water, which are random and differ from source to source."""
        yield from self.bounced_echoes(origin, rotation, depth_below, key)
        if self.ghosts.water is not None:
            sources, start = self._source(origin)
            rays, row_key = self.water_rays(origin, rotation, depth_below, key), salted(key, Salt.ARRAY_WATER)
            dr.eval(rays)
            for block in range(-(-dr.width(rays[1]) // WATER_PER_BLOCK)):
                index = dr.arange(mi.UInt32, block * WATER_PER_BLOCK,
                                  min((block + 1) * WATER_PER_BLOCK, dr.width(rays[1])))
                yield from self.ghosts.of_water(sources, start, *entries(rays, index), salted(row_key, 0, block))

    def water_rays(self, origin: np.ndarray, rotation: np.ndarray, depth_below: float,
                   key: int) -> tuple[mi.Vector3f, mi.Float, mi.Float]:
        """Return directions (R,), solid angles (R,) [sr] and places (R,) in the window of points of the water."""
        row_key = salted(key, Salt.ARRAY_WATER)
        if self._fan is not None:
            return self._fan.draw(rotation, -float(origin[2]), depth_below, self.pattern, row_key)
        direction, solid_angle, _ = self.drawn_rays.draw(self._source(origin)[1], rotation, None, key)
        number = dr.arange(mi.UInt32, dr.width(direction))
        return direction, solid_angle, line_lattice(number, dr.opaque(mi.UInt32, row_key))

    def bounced_echoes(self, origin: np.ndarray, rotation: np.ndarray, depth_below: float,
                       key: int) -> Iterator[Echoes]:
        """Yield the echoes of several bounces, which are random and differ from source to source."""
        if self.ghosts.bounces is not None:
            sources, start = self._source(origin)
            rays = self.drawn_rays.draw(start, rotation, depth_below, key)
            yield from self.ghosts.of_rays(sources, start, *rays, key)

    def _source(self, origin):
        return (self.tracer.sources([-origin[2]]),
                self.lib.Array3f64(*(dr.opaque(self.lib.Float64, float(v)) for v in origin)))

    def _in_beams(self, sources: Sources, origin: dr.ArrayBase, rotation: np.ndarray,
                  pieces: Pieces) -> list[tuple[bool, Pieces, np.ndarray]]:
        """Return whether cells have to be tested against the beams one by one; the pieces that may count; their bounds.

        If few cells would fail, all are taken: that is less work than to test them. With side lobes, the pieces of the
        main lobe, of which all cells count, are a part of their own if there are no more blocks of cells for it.
        """
        if self.beams is None:
            return [(False, pieces, np.ones(len(pieces.facet)))]
        enough = max(NEGLIGIBLE, self.side_lobes.below) if self.side_lobes else NEGLIGIBLE
        verdict, bound = pieces_in_beams(pieces, self.connector, self.beams, sources, origin, rotation, enough)
        kept = verdict >= 0
        pieces, bound, doubtful = pieces.chosen(kept), bound[kept], verdict[kept] == 0
        if self.side_lobes:
            listed = pieces.runs(self.side_lobes.largest_share(bound))[-1]
            certain, rest = (-(-int(listed[those].sum()) // CELLS_PER_BLOCK) for those in (~doubtful, doubtful))
            if certain and rest and certain + rest <= -(-int(listed.sum()) // CELLS_PER_BLOCK):
                return [(asked, pieces.chosen(doubtful == asked), bound[doubtful == asked]) for asked in (False, True)]
            return [(bool(doubtful.any()), pieces, bound)]
        cells = pieces.cells
        return [(bool(cells[doubtful].sum() > WORTH_ASKING * cells.sum()), pieces, bound)]

    def _cells(self, pieces, bound):
        """Yield the cells of pieces, block by block; in side lobes only cells that may exist."""
        share = None if self.side_lobes is None else self.side_lobes.largest_share(bound)
        return self.scatterers.listed(pieces.runs(share), CELLS_PER_BLOCK)

    def _echoes(self, sources, origin, rotation, facet, k, path, from_rays=None, aim=True):
        """Yield the echoes of cells that can be connected, or that rays found with energies and areas `from_rays`.

        With `aim`, cells that beams make negligible are left out, and cells in side lobes are thinned.
        """
        share = None
        if self.beams is not None and aim:
            # the direction in which the rays leave; the straight line may lie in another lobe
            point = self.scatterers.at(facet, k).point
            direction = self.connector.launch_direction(sources, origin, mi.UInt32(0), point)
            distance = mi.Float(dr.norm(point - origin))
            bound = self.beams.bound(direction, distance, rotation)
            counts = bound > NEGLIGIBLE
            if self.side_lobes is not None and from_rays is None:
                share = self.side_lobes.share(bound)
                counts &= self.scatterers.exist(facet, k, share)
                dr.eval(counts, share)
            index = compressed(counts)
            if not dr.width(index):
                return
            facet, k = dr.gather(mi.UInt32, facet, index), dr.gather(mi.UInt32, k, index)
            from_rays = from_rays and [dr.gather(mi.Float, column, index) for column in from_rays]
            share = None if share is None else dr.gather(mi.Float, share, index)
            dr.eval(facet, k, from_rays, share)
        cells = self.scatterers.at(facet, k)
        cells = self.scatterers.glinted(cells, cells.area if share is None else cells.area / share)
        way = self.connector.connect(sources, origin, mi.UInt32(0), cells.point, cells.normal,
                                     occlusion=from_rays is None)
        reached = way.free & (way.travel_time < dr.opaque(mi.Float64, 0.55 * self.window[1] + 1e-3))
        if from_rays is not None:
            energy, area = from_rays
        else:
            area = cells.area
            strength, sin_grazing = scattering_strength(cells.hits(way), reached, self.frequency)
            gain = self.sights.along(sources, origin, mi.UInt32(0), cells.point, way).gain
            energy = along_legs(strength * area, gain, gain)
            reached &= sin_grazing > GRAZING
        root = dr.sqrt(dr.maximum(energy, 0))
        reached &= (root > 0) & dr.isfinite(root)
        leg = EchoLeg.along(way, origin, cells.point)
        back, between, shift = leg, dr.zeros(mi.Float64, dr.width(reached)), None
        if self.motion is not None:
            arrival = way.arrival_direction
            shift = self.motion.shift(cells.motion, cells.point, arrival, arrival, mi.Float(way.sound_speed))
            # a copy is not `single`: there is a time between the legs
            back, between = replace(leg), self.motion.later(cells.motion, shift, way.travel_time)
        yield from Echoes(out=leg, back=back, between=between, energy=energy, path=path, shift=shift,
                          amplitude=(root * cells.amplitude[0], root * cells.amplitude[1])).where(reached)
        if path == "b":
            yield from self.ghosts.of_cells(sources, origin, way, cells, area)

    def points(self, sources: Sources, origin: dr.ArrayBase,
               mirrored: bool = False) -> Iterator[tuple[mi.UInt32, Echoes]]:
        """Yield the labels and echoes of visible point targets: straight ones, or also those by way of mirrors."""
        if not self.targets:
            return
        for echoes, free in self.targets.echoes(self.sights, sources, origin, mi.UInt32(0),
                                                dr.arange(mi.UInt32, len(self.targets)), mirrored=mirrored):
            label = self.targets.label(compressed(free))
            for visible in echoes.where(free):
                yield label, visible

    def _cells_of_rays(self, sources, origin, rotation, depth_below, key):
        """Return the cells that rays find: facets, numbers k, and the summed energies and areas of their rays."""
        direction, solid_angle, _ = self.drawn_rays.draw(origin, rotation, depth_below, key)
        hits = self.tracer.trace(sources, origin, mi.UInt32(0), direction)
        strength, sin_grazing = scattering_strength(hits, hits.valid, self.frequency)
        ratio = speed_ratio(hits.sound_speed, sources.state.gather(self.lib, mi.UInt32(0))[1])
        energy = echo_energy(solid_angle=solid_angle, strength=strength, sin_grazing=sin_grazing,
                             spreading_area=hits.spreading_area, speed_ratio=ratio,
                             loss=absorbed(self.water.loss_db(origin, hits.point, hits)))
        facet, k = self.scatterers.of(hits)
        area = lit_patch(solid_angle, spreading_area=hits.spreading_area, sin_grazing=sin_grazing)
        columns = facet, k, energy, area
        dr.eval(columns, hits.valid, sin_grazing)
        lit = hits.valid.numpy() & (sin_grazing.numpy() > GRAZING) & (energy.numpy() > 0)
        facet, k, energy, area = (column.numpy()[lit] for column in columns)
        scattering = self.scatterers.scattering[facet]
        cell, number = np.unique((facet[scattering].astype(np.uint64) << np.uint64(32)) | k[scattering],
                                 return_inverse=True)
        return ((cell >> np.uint64(32)).astype(np.uint32), cell.astype(np.uint32),
                *(np.bincount(number, weights=column[scattering], minlength=len(cell)) for column in (energy, area)))
