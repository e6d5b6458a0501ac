"""Energy record: powers summed per row, bin, label and path, with the ground truth of every bin.

The stages of a block of pings, in order (`EnergyBlock.echoes`):

    place      places that pings are sent from, and the sonar's motion during the record     `places`, `underway`
    launch     directions drawn where beam and time axis need them, with solid angles        `sides`, `beams`
    trace      bent rays to their first hit, and on to the seabed that objects hide          `tracing.tracer`
    scatter    strength of the hit's material, times the sonar equation                      `first_hits`
    sum        sums in time bins, by row, label and path                                     `echoes.energy_sums`
    others     echoes of several bounces, of the water, and those that have a phase          `sides`, `beams`
    read       physical units, and the truth of every bin                                    `truth`, `origin_sums`

`rows.Rows` defines a row. Everything between launch and the bins is one Dr.Jit kernel; its numbers are opaque, so a
scene compiles once. Random numbers are hashed from (seed, ping, row, ray): neither blocks nor threads change them.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Generic

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, give_back_memory, upload
from mitsonar.device.turns import workers_ended
from mitsonar.echoes.paths import Paths
from mitsonar.echoes.sums.energy_sums import EchoSums, SummedEnergy
from mitsonar.echoes.sums.origin_sums import OriginSums, sector
from mitsonar.imaging import truth
from mitsonar.imaging.energy_record import CoherentSums, EnergyRecord, gathered
from mitsonar.imaging.truth import BinTruth
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.labels import OBJECT, SEABED
from mitsonar.scene.tracing.hits import Hits

from ..motion.places import Place, Places
from ..survey import PerSurroundings, Survey
from .first_hits import FirstHits, HitEchoes, received
from .rows import Rays, RaysOf, Rows
from .sound_paths import SoundPaths


class TruthSums:
    """Places and labels that the echoes of a block come from, summed bin by bin."""

    def __init__(self, geometry: Geometry, rows: Rows):
        self.hides, self._rows, self._lib = geometry.named.hides, rows, arrays_of(mi.Float)
        (x0, y0), (x1, y1) = geometry.horizontal_bounds
        top, bottom = geometry.depth_range
        self._lower, self._upper = np.array([x0, y0, top]), np.array([x1, y1, max(bottom, top + 1e-6)])
        self._corner = [dr.opaque(mi.Float64, v) for v in self._lower]
        self._per_metre = [dr.opaque(mi.Float64, v) for v in 1 / (self._upper - self._lower)]
        kinds = geometry.named.label_kinds()
        self._objects, self._kinds = np.flatnonzero(kinds == OBJECT) - 1, upload(mi.UInt32, kinds)
        self._farthest = dr.opaque(mi.Float, rows.bins.farthest)
        dr.eval(self._kinds)

    def sums(self, rows: int) -> OriginSums:
        """Return empty sums for a number of rows."""
        return OriginSums(self._lib, rows, self._rows.labels, self._rows.bins.count, self.hides)

    def add(self, sums: OriginSums, place: Place, rays: Rays, hits: Hits, echoes: HitEchoes) -> None:
        """Add the origins of rays' echoes."""
        kind = dr.gather(mi.UInt32, self._kinds, hits.label, echoes.active)
        point = [dr.clip(mi.Float((v - corner) * per_metre), 0, 1) for v, corner, per_metre in
                 zip((hits.point.x, hits.point.y, -hits.point.z), self._corner, self._per_metre)]
        sums.add(row=echoes.response.row, bin=echoes.bin, units=echoes.units, place=point, seabed=kind == SEABED,
                 active=echoes.active, in_beam=echoes.response.in_beam,
                 sector=sector(-rays.direction.z, place.depth_below(rays.ping), self._farthest))

    def read(self, sums: OriginSums, unit: np.ndarray, energy: SummedEnergy,
             coherent: CoherentSums | None) -> BinTruth:
        """Return the block's truth."""
        # unit [µPa²]
        origins, shown = sums.read(unit, self._lower, self._upper), self._rows.shown
        with_phase = () if coherent is None else (coherent.label_power, coherent.record.intensity)
        own = truth.shares(energy.label_intensity, np.asarray, *with_phase).copy()
        hidden, object_shadow = (np.zeros(energy.intensity.shape, kind) for kind in (np.float32, np.uint32))
        if origins.hidden_intensity is not None:
            hidden, object_shadow = truth.shadows(
                origins.hidden_intensity, origins.seabed_intensity, energy.intensity, shown,
                0.0 if coherent is None else coherent.record.intensity)
        meets = energy.meets
        if coherent is not None:
            meets = meets | ((coherent.record.in_beam > 0)[:, None] & (coherent.label_power > 0))
        # side lobes bring an object's echo to bins that are not its own: in a shadow it may be the strongest echo
        own[:, self._objects] *= meets[:, self._objects]
        return BinTruth(label=np.where(own.any(1), own.argmax(1) + 1, 0).astype(np.uint32),
                        share=truth.shares(energy.label_intensity, shown, *with_phase), hidden=hidden,
                        object_shadow=object_shadow, layover=origins.layover, seabed_place=origins.seabed_place)


def record(survey: Survey, rows: Rows, seed: int = 0,
           progress: Callable[[int, int], None] | None = None) -> EnergyRecord:
    """Compute the energy record of a survey."""
    pings, block = survey.track.pings, energy_blocks(survey, rows, int(seed))
    long = pings > rows.pings_per_block
    if long:
        give_back_memory()             # that of the plan, before blocks need as much

    parts = [stretch[start:start + rows.pings_per_block] for stretch in survey.stretches()
             for start in range(0, len(stretch), rows.pings_per_block)]
    blocks = survey.each_part(lambda ping: block.at(ping[0]).echoes(ping), parts, progress)
    whole = gathered(blocks, pings=pings, rows=rows.per_ping)
    dr.flush_malloc_cache()            # blocks are large: Dr.Jit would keep their memory beside what the picture needs
    if long:
        give_back_memory()
    return whole


def ray_range(survey: Survey, rows: Rows) -> float:
    """Return the range of rays [m]: that of half the two-way time, plus what the sonar may come nearer during it."""
    return 0.5 * rows.bins.end * survey.waters.fastest * (1 + 0.5 * rows.underway.drift(rows.bins.sound_speed))


def energy_blocks(survey: Survey, rows: Rows[RaysOf], seed: int) -> PerSurroundings[Survey, EnergyBlock[RaysOf]]:
    """Return the source of the records of blocks of pings, for each of the survey's surroundings."""
    return PerSurroundings(survey, lambda part: EnergyBlock(part, rows, seed))


class EnergyBlock(Generic[RaysOf]):
    """Energy records of blocks of pings that share their surroundings."""

    def __init__(self, survey: Survey, rows: Rows[RaysOf], seed: int):
        geometry, self._lib, rows = survey.surroundings.geometry, arrays_of(mi.Float), rows.within(survey)
        self._rows, self._seed, self._depth_range = rows, seed, geometry.depth_range
        self._sound = SoundPaths.of(survey, ray_range(survey, rows), rows.frequency)
        self._places = Places(survey, self._sound.tracer, rows.underway, rows.per_ping)
        self._first_hits = FirstHits(rows, self._sound.water, smooth_patches=geometry.smooth_beds)
        self._truth = TruthSums(geometry, rows)
        self._others, self._coherent = rows.other_sources(self._sound, seed), rows.coherent(self._sound)
        self._mirrors, self._surface = geometry.surface_mirrors, dr.opaque(mi.UInt32, geometry.surface_label)

    def echoes(self, ping: np.ndarray) -> EnergyRecord:
        """Return the record of the pings with given numbers (B,); arrays (B x rows, ..., bins)."""
        rows, place = self._rows, self._places.of(ping)
        sums = EchoSums(self._lib, place.rows, rows.labels, rows.bins.count, self._depth_range, len(rows.paths))
        origins = self._truth.sums(place.rows)
        for rays in rows.passes(place, self._seed, self._bins_of):
            hits = self._traced(place, rays, origins if self._truth.hides else None)
            self._add(sums, origins, place, rays, hits)
            for source in self._others:
                source.add(place, rays, hits, sums)
            dr.eval(sums.sums(), origins.sums())
        return self._read(sums, origins, place)

    def _traced(self, place: Place, rays: RaysOf, origins: OriginSums | None = None) -> Hits:
        """Trace rays to their first hits, and add the echoes that objects hide to `origins`."""
        way = place.sources, place.origin(rays.ping), place.source(rays.ping), rays.direction
        if origins is None:
            hits = self._sound.tracer.trace(*way)
        else:
            hits = self._sound.tracer.trace_with_hidden(*way, partial(self._add_hidden, origins, place, rays))
        if self._mirrors:
            # no energy comes back from there: other sources make the echoes by way of a mirror
            hits = replace(hits, valid=hits.valid & (hits.label != self._surface))
        return hits

    def _bins_of(self, place: Place, rays: RaysOf) -> tuple[mi.UInt32, mi.Bool]:
        """Return the bins that echoes of rays arrive in, and which echoes lie in the record."""
        hits = self._traced(place, rays)
        return self._rows.bins.of(received(place, rays, hits).delay, hits.valid)

    def _add(self, sums: EchoSums, origins: OriginSums, place: Place, rays: RaysOf, hits: Hits) -> None:
        """Add the echoes of first hits to `sums`, and their origins to `origins`."""
        echoes = self._first_hits.echoes(place, rays, hits)
        path = self._rows.paths.numbers(Paths.extended(mi.UInt32(1), hits.label == self._surface))
        sums.add(row=echoes.response.row, label=hits.label, bin=echoes.bin, units=echoes.units, path=path,
                 in_beam=echoes.response.in_beam, depth=mi.Float(-hits.point.z), active=echoes.active)
        self._truth.add(origins, place, rays, hits, echoes)

    def _add_hidden(self, origins: OriginSums, place: Place, rays: RaysOf, hits: Hits, hidden: Hits) -> None:
        """Add the seabed's echoes that objects hide, by the label of the hiding object."""
        echoes = self._first_hits.echoes(place, rays, hidden)
        counted = echoes.response.in_beam if self._rows.hidden_in_beam else True
        origins.add_hidden(row=echoes.response.row, label=hits.label, bin=echoes.bin, units=echoes.units,
                           active=echoes.active & counted)

    def _read(self, sums: EchoSums, origins: OriginSums, place: Place) -> EnergyRecord:
        """Return the sums in physical units, with the coherent echoes and the truth."""
        unit = 10 ** (self._rows.source_level_db / 10) * self._rows.bins.unit
        coherent = None if self._coherent is None else self._coherent.sum(place)      # while rays are still traced
        with workers_ended():
            energy = sums.read(unit)
            return EnergyRecord(
                intensity=energy.intensity, depth=energy.depth, rays=energy.rays, rays_in_beam=energy.rays_in_beam,
                path_intensity=energy.path_intensity, coherent=None if coherent is None else coherent.record,
                truth=self._truth.read(origins, unit, energy, coherent))
