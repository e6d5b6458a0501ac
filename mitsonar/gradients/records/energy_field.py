"""Compute an energy record as a function of the scene, with gradients.

The stages are those of `survey.energy`; three of them differ:

    trace      once, detached: hits of rays, and their eigenrays                             `EnergyField.kept`
    finish     for every derivative, attached                                                `finish`
    sum        into bins without steps                                                       `tent_bins`

Rays are drawn when the field is made, and stay fixed in the sonar's frame however the scene changes afterwards. Values
at two places therefore differ by the change alone.
"""
from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import upload
from mitsonar.propagation.device_rays.layer_table import LayerTable
from mitsonar.scene.tracing.hits import Hits
from mitsonar.scene.tracing.tracer import Tracer, registry_index
from mitsonar.scene.tracing.water import DeviceWater
from mitsonar.survey.energy.energy import ray_range
from mitsonar.survey.energy.first_hits import FirstHits, HitEchoes, Losses, received
from mitsonar.survey.energy.rows import Rays, Rows
from mitsonar.survey.motion.places import Place, Places
from mitsonar.survey.survey import Survey

from ..attached.finish import Facets, finished, side_of
from ..attached.geometry import AttachedGeometry
from ..attached.ray_shift import ray_shift
from ..attached.track import AttachedTrack
from ..edges.edge_terms import EdgeTerms, edge_terms, outline_terms
from ..edges.jump_lines import JumpLines
from ..edges.line_samples import LineSampler
from ..edges.shape_outlines import OutlineSampler
from .tent_bins import TentBins

BELOW = 1.0                        # [m]
FINE = 2e-5                        # [m] of rays to either side of a line, chord against arc: see `edge_terms.ASIDE`
FEWEST_POINTS, POINTS_PER_RAY = 256, 1 / 8         # of lines at which energies jump, a ping

@dataclass(frozen=True, kw_only=True)
class Block:
    """Hold a block of pings with its rays."""

    ping: np.ndarray  # (B,)
    rays: list[Rays]  # pass by pass, on the device


@dataclass(frozen=True, kw_only=True)
class Kept:
    """Hold detached hits of a pass of rays; the rays are as drawn, not turned with the sonar."""

    rays: Rays
    hits: Hits
    facets: Facets
    side: mi.Float | None = None       # see `finish.side_of`


@dataclass(frozen=True, kw_only=True)
class Samplers:
    """Draw points on lines of meshes and on outlines of other shapes; None where there are none."""

    tracer: Tracer
    lines: LineSampler | None
    shapes: OutlineSampler | None


class EnergyField:
    """Compute the energy record of a survey as a function of the scene."""

    def __init__(self, survey: Survey, rows: Rows, seed: int):
        self.rows, self._seed = rows, seed
        self._tents = TentBins(rows.bins)
        self._range = ray_range(survey, rows)
        self.unit = 10 ** (rows.source_level_db / 10)
        with dr.suspend_grad():
            self.blocks = list(self._drawn(survey))

    def of_rows(self, rows: Rows) -> EnergyField:
        """Return the same rays received by the rows that a render of the changed scene would plan."""
        other = copy.copy(self)
        other.rows, other._tents = rows, TentBins(rows.bins)
        return other

    def _drawn(self, survey: Survey) -> Iterator[Block]:
        """Yield every block with its rays, drawn for the present scene."""
        rows, places = self.rows, self.at(survey)

        def bins_of(place: Place, rays: Rays) -> tuple[mi.UInt32, mi.Bool]:
            hits = places.tracer.trace(place.sources, place.origin(rays.ping), place.source(rays.ping), rays.direction)
            return rows.bins.of(received(place, rays, hits).delay, hits.valid)

        pings = survey.track.pings
        for start in range(0, pings, rows.pings_per_block):
            ping = np.arange(start, min(start + rows.pings_per_block, pings))
            rays = list(rows.passes(places.of(ping), self._seed, bins_of))
            for some in rays:
                dr.eval([getattr(some, field.name) for field in fields(some)])
            yield Block(ping=ping, rays=rays)

    def at(self, survey: Survey) -> Scenery:
        """Return the scene and the track of a survey that may have changed."""
        # tables end below all hits: beyond their ends nothing moves
        tracer = Tracer(survey.world.only, survey.device_water(BELOW), max_range=self._range)
        return Scenery(survey=survey, tracer=tracer, losses=tracer.water, layers=tracer.water.direct.layers,
                       places=Places(survey, tracer, self.rows.underway, self.rows.per_ping),
                       speeds=upload(mi.Float64, tracer.water.profile.sound_speed),
                       facets=AttachedGeometry(tracer.geometry))

    def kept(self, scenery: Scenery, block: Block) -> list[Kept]:
        """Trace a block's rays, without gradients."""
        place, found = scenery.of(block.ping), []
        with dr.suspend_grad():
            for rays in block.rays:
                origin, direction = place.origin(rays.ping), scenery.turned(place, rays).direction
                hits, met = scenery.tracer.trace_met(place.sources, origin, place.source(rays.ping), direction)
                if scenery.mirrors:
                    hits = replace(hits, valid=hits.valid & (hits.label != scenery.surface))
                on_mesh, face, u, v = scenery.tracer.facet(met, hits.valid)
                facets = Facets(on_mesh=on_mesh, shape=registry_index(met), face=face, u=mi.Float(u), v=mi.Float(v))
                side = side_of(hits, scenery.water.direct.layers, scenery.speeds, origin, direction)
                found.append(Kept(rays=rays, hits=hits, facets=facets, side=side))
        return found

    def sampler(self, scenery: Scenery, lines: JumpLines | None, outlined: Sequence[int]) -> Samplers:
        """Return samplers of points on lines, and on outlines of the shapes without facets `outlined`."""
        with dr.suspend_grad():
            tracer = Tracer(scenery.tracer.geometry, scenery.water, max_range=self._range, tolerance=FINE)
            of_lines = of_shapes = None
            if lines is not None:
                of_lines = LineSampler(lines, tracer, self.rows, scenery.survey.track.position, self._range, self._seed)
            if outlined and scenery.facets.shapes is not None:
                of_shapes = OutlineSampler(scenery.facets.shapes, outlined, tracer, self.rows, self._range, self._seed)
            return Samplers(tracer=tracer, lines=of_lines, shapes=of_shapes)

    def edges(self, scenery: Scenery, block: Block, samplers: Samplers) -> list[EdgeTerms]:
        """Trace either side of points on lines at which energies jump, detached; none where no line is in view."""
        place, rays = scenery.of(block.ping), sum(dr.width(rays.direction) for rays in block.rays)
        count = max(FEWEST_POINTS, int(rays / len(block.ping) * POINTS_PER_RAY))
        surface, found = scenery.surface if scenery.mirrors else None, []
        with dr.suspend_grad():
            first_hits = FirstHits(self.rows, scenery.water, self._tents.of, smooth_patches=True)
            if samplers.lines is not None:
                samples = samplers.lines.drawn(place, count)
                if len(samples.line):
                    found.append(edge_terms(samplers.tracer, self.rows, first_hits, place, samplers.lines.lines,
                                            samples, surface=surface, drawn=scenery.drawn))
            points = None if samplers.shapes is None else samplers.shapes.drawn(place, count)
            if points is not None:
                found.append(outline_terms(samplers.tracer, self.rows, first_hits, place, points, surface=surface,
                                           drawn=scenery.drawn))
        return found

    def echoes(self, scenery: Scenery, block: Block, kept: Kept) -> HitEchoes:
        """Return the detached echoes of a pass of rays."""
        place = scenery.of(block.ping)
        rays = scenery.turned(place, kept.rays)
        first_hits = FirstHits(self.rows, scenery.water, self._tents.of, smooth_patches=True)
        return first_hits.echoes(place, rays, kept.hits)

    def sums(self, scenery: Scenery, block: Block, kept: list[Kept], edges: Sequence[EdgeTerms] = ()) -> mi.Float64:
        """Return energies (rows x bins,) [1/m²] of a block, attached where the scene is."""
        place = scenery.attached(block.ping)
        total = dr.zeros(mi.Float64, place.rows * self.rows.bins.count)
        first_hits = FirstHits(self.rows, scenery.losses, self._tents.of, smooth_patches=True)
        for one in kept:
            rays, hits = self._finished(scenery, place, one)
            self._tents.add(total, first_hits.echoes(place, rays, hits))
        for term in edges:
            points, across = term.points, None
            if scenery.moves:
                direction = scenery.turned(place, points.drawn).direction
                origin = place.origin(points.rays.ping)
                across = ray_shift(scenery.layers, scenery.speeds, origin, direction, points.hits).across
            term.add(total, self._tents, scenery.facets, across)
        return total

    def _finished(self, scenery: Scenery, place: Place, kept: Kept) -> tuple[Rays, Hits]:
        rays, hits = scenery.turned(place, kept.rays), kept.hits
        origin = place.origin(rays.ping)
        way, down = dr.detach(hits.point - origin), -dr.detach(rays.direction).z
        distance = mi.Float(dr.sqrt(way.x * way.x + way.y * way.y))
        shift = None
        if scenery.moves:
            shift = ray_shift(scenery.layers, scenery.speeds, origin, rays.direction, hits)
        return rays, finished(hits, kept.facets, scenery.facets, scenery.layers, mi.Float(down), distance, shift,
                              kept.side)


@dataclass(frozen=True, kw_only=True, eq=False)
class Scenery:
    """Hold a survey's scene, water and track at one moment."""

    survey: Survey
    tracer: Tracer
    places: Places
    losses: Losses
    layers: LayerTable
    speeds: mi.Float64  # (K,) [m/s], at the nodes of the profile
    facets: AttachedGeometry
    track: AttachedTrack | None = None

    @property
    def water(self) -> DeviceWater:
        """Return the water, without gradients."""
        return self.tracer.water

    @property
    def mirrors(self) -> bool:
        """Return True if the sea surface mirrors."""
        return self.survey.world.surface_mirrors

    @property
    def surface(self) -> int:
        """Return the label of the sea surface, or 0."""
        return self.survey.world.surface_label

    @property
    def moves(self) -> bool:
        """True if rays themselves carry gradients, by water or track."""
        return self.track is not None

    def of(self, ping: np.ndarray) -> Place:
        """Return the detached place of pings (B,)."""
        return self.places.of(ping)

    def attached(self, ping: np.ndarray) -> Place:
        """Return the place of pings (B,), attached where the track or the water is."""
        place = self.of(ping)
        return place if self.track is None else self.track.place(place)

    def turned(self, place: Place, rays: Rays) -> Rays:
        """Return rays turned with the sonar."""
        return rays if self.track is None else self.track.turned(place, rays)

    def drawn(self, place: Place, rays: Rays) -> Rays:
        """Return rays as they were drawn: the inverse of `turned`."""
        return rays if self.track is None else self.track.drawn(place, rays)
