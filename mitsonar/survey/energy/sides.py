"""Sides of a sidescan as rows of an energy record, with their echoes of several bounces and of the water.

A row is the echo of a ping as the face of one side receives it: port is 0, starboard 1. Rays of a side are launched
from its own face. A first, sparse pass finds the directions that lead into time bins which few rays reach; the second
pass, which alone makes the record, sends more rays there. For echoes other than those of first hits

    p² = 10^(SL/10) B_t B_r e²

with B_t, B_r -> intensity patterns of the faces in the directions of departure and arrival, and e² -> the rest of the
echo (`echoes.multipath`, `echoes.volume`).
"""
from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import final

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import picked
from mitsonar.device.chance import Salt, seeded
from mitsonar.device.types import Vector
from mitsonar.echoes.bounces.ghosts import Ghosts
from mitsonar.echoes.bounces.multipath import Bounces
from mitsonar.echoes.bounces.volume import WaterEchoes, line_lattice
from mitsonar.echoes.sums.energy_sums import EchoSums
from mitsonar.echoes.sums.origin_sums import PLACE, WORDS
from mitsonar.imaging.sidescan import mean_intensity
from mitsonar.scene.tracing.hits import Hits
from mitsonar.scene.tracing.launch import CELLS, refined
from mitsonar.signal.gates import pulse_shares

from ..motion.places import Place
from ..motion.underway import Underway
from .coherent_sides import CoherentSides
from .energy_bins import EnergyBins, aside_need
from .face_beams import BEAM_EDGE, FaceBeams
from .rows import EchoSource, RowResponse
from .side_launch import GROUP, SideLaunch, SideRays, Tables, scouts
from .sidescan_survey import SidescanSurvey
from .sound_paths import SoundPaths

FEWER_POINTS = 4                   # rays for one point of the water, which has no shape to resolve


class SideMultipath:
    """Echoes of several bounces, from rays of their own; those of point targets use the rays of a pass."""

    def __init__(self, survey: SidescanSurvey, sound: SoundPaths, beams: FaceBeams, bins: EnergyBins,
                 launch: SideLaunch, seed: int):
        self._launch, self._tracer = launch, sound.tracer
        self._beams, self._bins, self._seed, self._paths = beams, bins, seed, survey.paths
        self._bounces = Bounces(sound.connector, sound.free_rays, frequency=survey.sonar.frequency, paths=survey.paths)

    def add(self, place: Place, rays: SideRays, hits: Hits, sums: EchoSums) -> None:
        """Add the echoes of several bounces to the sums; `rays` and `hits` are those of a pass."""
        key = seeded(place.key(rays.row), self._seed, Salt.BOUNCES)
        if self._bounces.targets:
            # small objects near a bed need rays that are dense on it, as those of a pass are
            followed = self._bounces.follow(hits, rays.solid_angle, place.sources, place.origin(rays.ping),
                                            place.source(rays.ping), rays.strata, key, surfaces=False)
            self._add(place, rays, followed, sums)
        own = self._launch.one_way(place, rays, self._seed)
        origin, source = place.origin(own.ping), place.source(own.ping)
        first_hits = self._tracer.trace(place.sources, origin, source, own.direction)
        body = place.body(own.ping, own.direction)
        seen = 0.5 * (self._beams.one_way(body, self._beams.transmit) + self._beams.one_way(body, self._beams.receive))
        dr.eval(first_hits, seen)
        key = seeded(place.key(own.row), self._seed, Salt.BOUNCES)
        self._add(place, own, self._bounces.follow(first_hits, own.solid_angle, place.sources, origin, source,
                                                   own.strata, key, seen, targets=False), sums)

    def _add(self, place: Place, rays: SideRays, followed: Iterator[Ghosts], sums: EchoSums) -> None:
        """Add ghosts as the faces send and receive them."""
        for ghosts in followed:
            ping, row = picked(rays.ping, ghosts.ray), picked(rays.row, ghosts.ray)
            side = picked(rays.side, ghosts.ray)
            elapsed = ghosts.out.travel_time + ghosts.between + ghosts.back.travel_time
            received = place.receive(ping, ghosts.back.sent_towards, ghosts.back.offset, elapsed)
            bin, inside = self._bins.of(received.delay, ghosts.active)
            pattern = mi.Float(1)
            for towards, face in ((ghosts.out.sent_towards, self._beams.transmit),
                                  (received.towards, self._beams.receive)):
                body = place.body(ping, towards)
                inside &= body.y * side > 0
                pattern *= self._beams.one_way(body, face)
            sums.add(row=row, label=ghosts.label, bin=bin, active=inside, in_beam=mi.Bool(False), counted=False,
                     units=self._bins.units(ghosts.energy * pattern, ghosts.loss_db, bin, inside), depth=ghosts.depth,
                     path=self._paths.numbers(ghosts.code))


class SideWater:
    """Echoes of the water, from points along rays of their own."""

    def __init__(self, survey: SidescanSurvey, sound: SoundPaths, beams: FaceBeams, bins: EnergyBins,
                 launch: SideLaunch, seed: int):
        self._beams, self._bins, self._launch, self._seed = beams, bins, launch, seed
        self._echoes = WaterEchoes(sound.connector, survey.window)
        self._label = dr.opaque(mi.UInt32, max(survey.labels))
        self._path = dr.opaque(mi.UInt32, survey.paths.number("v"))

    def add(self, place: Place, rays: SideRays, hits: Hits, sums: EchoSums) -> None:
        """Add the echoes of points to the sums, one for every `FEWER_POINTS` rays of a pass."""
        phi, u = rays.strata.shape
        rays, number, key = self._launch.across_beam(place, (max(4, phi // (4 * FEWER_POINTS) * 4), u), self._seed)
        origin = place.origin(rays.ping)
        drawn = self._echoes.draw(place.sources, origin, place.source(rays.ping), rays.direction, rays.solid_angle,
                                  line_lattice(number, key))
        sent = place.body(rays.ping, drawn.way.launch_direction)
        received = place.receive(rays.ping, drawn.way.launch_direction, drawn.point - origin,
                                 2 * drawn.way.travel_time)
        back = sent if place.still else place.body(rays.ping, received.towards)
        along, across = self._beams.two_way(sent.x, self._beams.across(sent), back.x, self._beams.across(back))
        bin, inside = self._bins.of(received.delay, drawn.active & (back.y * rays.side > 0))
        sums.add(row=rays.row, label=self._label, bin=bin, active=inside, in_beam=mi.Bool(False), counted=False,
                 units=self._bins.units(drawn.energy * along * across, drawn.loss_db, bin, inside),
                 depth=mi.Float(-drawn.point.z), path=self._path)


RAYS_PER_BLOCK = 1 << 23           # a second of work for two threads: rays leave nothing in memory
KEPT_PER_BLOCK = 1 << 21           # where the water echoes or paths have several bounces: a part of the rays is kept
SUMS_PER_BLOCK = 1 << 23           # integers: bounds a block's memory where shapes and bins are many
TABLES_PER_BLOCK = 32              # tables of rays, a megabyte each: bounds memory where pings differ in depth
MOST_SUMS = 1 << 32                # range of an index
THREADS_OWN = 1 << 20              # words of the largest array of sums that each thread copies; a larger one is slower


@final
class Sides:
    """Both sides of a sidescan; see `rows.Rows`."""

    per_ping, hidden_in_beam = 2, True

    def __init__(self, survey: SidescanSurvey, *, shadows: bool = True):
        sonar = survey.sonar
        self._survey = survey
        self.labels, self.paths = len(survey.labels), survey.paths
        self.frequency, self.source_level_db = sonar.frequency, sonar.source_level_db
        self.bins = EnergyBins(
            start=survey.window[0], length=survey.bin_length, count=survey.bins, sound_speed=sonar.sound_speed,
            beam=sonar.solid_angle(), absorption_db=survey.waters.least_absorption_db)
        self.underway = Underway.of(survey, survey.window[1] + sonar.pulse_length)
        self._beams = FaceBeams(sonar)
        self._launch = SideLaunch(survey, self.underway, self._beams.depression, shadows=shadows)
        self._first_grid, self._second_grid = self._launch.grids()
        self._scouts = scouts(survey.planned.track, self.bins.farthest, sonar.wavelength / sonar.longest)
        self._scouted: dict[tuple[int, int, int], list[np.ndarray]] = {}
        self._shares = pulse_shares(survey.bin_length, sonar.pulse_length)
        self.pings_per_block = self._pings_per_block()

    def _pings_per_block(self) -> int:
        """Return the number of pings in a block, bounded by rays and by the memory of sums and tables."""
        survey, pings = self._survey, self._survey.track.pings
        by_label = self.labels * (2 if survey.world.named.hides else 1)
        sums = 2 * survey.bins * (by_label + len(self.paths) - 1 + WORDS)
        if sums >= MOST_SUMS:
            raise ValueError(f"{survey.bins} bins and {len(survey.world.labels)} shapes make {sums} sums a ping, "
                             f"over {MOST_SUMS}; take fewer bins or let shapes share an id")
        rays = RAYS_PER_BLOCK if survey.max_depth == 1 and not survey.waters.scatter else KEPT_PER_BLOCK
        by_rays = rays // (2 * sum(grid[0] * grid[1] for grid in (self._first_grid, self._second_grid) if grid))
        level = len(np.unique(survey.planned.track.position[:, 2])) == 1
        by_copies = THREADS_OWN // (2 * survey.bins * PLACE)
        most = max(1, min(by_rays, by_copies, SUMS_PER_BLOCK // sums, pings if level else TABLES_PER_BLOCK, pings))
        return most if most < GROUP else most // GROUP * GROUP

    def within(self, survey: SidescanSurvey) -> Sides:
        """Return these rows: a sidescan's own sound speed, which its beams and bins have, is one for all pings."""
        return self

    def passes(self, place: Place, seed: int,
               bins_of: Callable[[Place, SideRays], tuple[mi.UInt32, mi.Bool]]) -> Iterator[SideRays]:
        """Yield the rays that make the record."""
        if self._first_grid is None:
            tables = self._even(place, self._launch.aside)
        else:
            tables = self._scouted_tables(place, self._first_grid, seed, bins_of)
        yield self._launch.drawn(place, tables, self._second_grid, seed, Salt.SECOND_PASS)

    def _even(self, place, aside):
        """Return tables that suit a level bed, with the same share of rays aside of the core in every cell."""
        phi = self._launch.first_quantiles(place)
        return Tables(phi, np.full((len(phi), CELLS), aside))

    def _scouted_tables(self, place, grid, seed, bins_of):
        """Return tables that send more rays into bins which few rays of the pings' scouts reach."""
        # a step cannot know the pings after it, so it is its own scout
        alone, around = self._survey.passage.stepping is not None, self._survey.surroundings_of(place.ping[0])
        scout = place.ping if alone else self._scouts[place.ping]
        known = self._scouted
        new = np.array([ping for ping in np.unique(scout) if (seed, around, ping) not in known], int)
        if len(new):
            ahead, wanted = place.of(new), self._launch.aside
            first = self._even(ahead, self._launch.first_aside)
            rays = self._launch.drawn(ahead, first, grid, seed, Salt.FIRST_PASS)
            bin, inside = bins_of(ahead, rays)
            need = aside_need(rays.row, rays.cell, bin, inside, rays.aside, rows=ahead.rows, bins=self.bins,
                              drawn=self._launch.first_aside, wanted=wanted)
            need = need if self._launch.shadows else np.stack([need[0] + need[1], 0 * need[1]])
            tables = refined(first.phi, need[0], need[1], wanted)
            if not self._launch.shadows:
                tables = tables[0], np.full_like(tables[1], wanted)
            by_ping = (rows.reshape(len(new), self.per_ping, -1) for rows in tables)
            known = known | {(seed, around, ping): rows for ping, *rows in zip(new, *by_ping)}
        # the next block of pings may use the scouts of this one
        self._scouted = {} if alone else {
            key: rows for key, rows in known.items() if key[:2] == (seed, around) and key[2] >= scout.min()}
        phi, aside = (np.stack(rows) for rows in zip(*(known[seed, around, ping] for ping in scout)))
        phi = self._launch.carried(phi, scout, place.ping)
        return Tables(phi.reshape(place.rows, -1), aside.reshape(place.rows, -1))

    def aimed(self, place: Place, ping: mi.UInt32, direction: mi.Vector3f, solid_angle: mi.Float) -> SideRays:
        """Return rays in given directions, each of the side that it leaves by."""
        return self._launch.aimed(place, ping, direction, solid_angle, self._second_grid)

    def response(self, place: Place, rays: SideRays, towards: Vector) -> RowResponse:
        """Return the response of the side that sent a ray; it receives nothing from the other side of the body."""
        u, v, same_side = rays.u, rays.v, mi.Bool(True)
        if not place.still:
            body = place.body(rays.ping, towards)
            u, v, same_side = body.x, self._beams.across(body), body.y * rays.side > 0
        along, across = self._beams.two_way(rays.u, rays.v, u, v)
        lobe = along if place.still else self._beams.lobe(rays.u, u)
        return RowResponse(row=rays.row, pattern=along * across, in_beam=lobe > BEAM_EDGE, active=same_side)

    def shown(self, intensity: np.ndarray) -> np.ndarray:
        """Return intensities (rows, ..., bins) averaged over the pulse."""
        return mean_intensity(intensity, self._shares)

    def other_sources(self, sound: SoundPaths, seed: int) -> Sequence[EchoSource[SideRays]]:
        """Return the sources of the echoes of several bounces and of the water."""
        sources: list[EchoSource[SideRays]] = []
        if self._survey.max_depth > 1:
            sources.append(SideMultipath(self._survey, sound, self._beams, self.bins, self._launch, seed))
        if sound.water.scatters:
            sources.append(SideWater(self._survey, sound, self._beams, self.bins, self._launch, seed))
        return sources

    def coherent(self, sound: SoundPaths) -> CoherentSides | None:
        """Return the source of coherent echoes, None where the scene has none."""
        source = CoherentSides(self._survey, sound, self._beams, drift=self.underway.drift(self.bins.sound_speed),
                                  shift=self._launch.largest_shift)
        return None if source.silent else source
