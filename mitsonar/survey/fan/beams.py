"""Beams of an array as rows of an energy record, for the truth of the array's picture.

A row is the energy that one beam receives of a ping. Rays start at the array's centre at the transmission, in
directions drawn for the elements' patterns and the record's time window. The beam and the bin of an echo follow from
the place and attitude of the array at the echo's reception (`underway`).
"""
from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import final

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.chance import Salt, ping_key
from mitsonar.device.types import Vector
from mitsonar.echoes.paths import Paths
from mitsonar.scene.tracing.aimed_launch import DrawnRays

from ..energy.coherent_beams import CoherentBeams
from ..energy.energy_bins import EnergyBins
from ..energy.rows import EchoSource, Rays, RowResponse
from ..energy.sound_paths import SoundPaths
from ..motion.places import Place
from ..motion.underway import Underway
from ..pressure.array_survey import ArraySurvey
from .array_beams import ArrayBeams

RAYS_PER_BIN = 12
FEWEST_RAYS, MOST_RAYS, MOST_PASSES = 200_000, 3_000_000, 16        # rays of a pass
MOST_SUMS = 1 << 27                # beams x shapes x bins: 1 GB
BEAM = 1e-4                        # [sr] solid angle in the unit of energy, about that of a narrow beam
SLACK = 0.8, 1.25                  # factors on the record's ends, because bent rays do not return when straight ones do


@final
class Beams:
    """Fan of beams of an array, with angles (B,) [rad] and directions (B, 3); see `rows.Rows`."""

    pings_per_block = 1
    hidden_in_beam = False

    def __init__(self, survey: ArraySurvey, angle: np.ndarray, direction: np.ndarray):
        world, bins = survey.world, survey.samples - survey.lead
        self._directions = angle, direction
        self._survey, self.per_ping, self.labels = survey, len(angle), len(survey.labels)
        if self.per_ping * bins * self.labels > MOST_SUMS:
            raise ValueError(f"{self.per_ping} beams, {bins} samples and {self.labels} shapes make more than "
                             f"{MOST_SUMS:.0e} sums of ground truth; take fewer beams, a shorter range, or let shapes "
                             "share an id")
        self.frequency, self.source_level_db, self.paths = survey.frequency, survey.source_level_db, Paths(1)
        self.bins = EnergyBins(start=survey.time[survey.lead] - 0.5 / survey.sampling_rate,
                               length=1 / survey.sampling_rate, count=bins, sound_speed=survey.planned_speed,
                               beam=BEAM, absorption_db=survey.waters.least_absorption_db)
        self.underway = Underway.of(survey, survey.time[-1])
        self._beams = ArrayBeams(survey, angle, direction)
        wanted = max(RAYS_PER_BIN * self.per_ping * bins, FEWEST_RAYS)
        self._passes = min(-(-wanted // MOST_RAYS), MOST_PASSES)
        self._share = dr.opaque(mi.Float, 1 / self._passes)
        window = (SLACK[0] * survey.start, SLACK[1] * survey.time[-1])
        self._drawn = partial(DrawnRays, window=window, rays=min(wanted, MOST_RAYS), pattern=self._beams.pattern,
                              surface=world.surface_label > 0 and not world.surface_mirrors)

    def within(self, survey: ArraySurvey) -> Beams:
        """Return the beams in a part of the survey: their patterns depend on its sound speed."""
        return Beams(survey, *self._directions) if self._survey.changes else self

    def passes(self, place: Place, seed: int,
               bins_of: Callable[[Place, Rays], tuple[mi.UInt32, mi.Bool]]) -> Iterator[Rays]:
        """Yield the rays of a ping, in passes that fit into memory."""
        ping, drawn = mi.UInt32(0), self._drawn(place.profile)
        for number in range(self._passes):
            key = ping_key(seed, int(place.ping[0]), number, Salt.FAN_TRUTH)
            direction, solid_angle, _ = drawn.draw(place.origin(ping), place.rotation[0],
                                                   float(place.depth_below_of[0]), key)
            yield Rays(ping=ping, direction=direction, solid_angle=solid_angle * self._share)

    def aimed(self, place: Place, ping: mi.UInt32, direction: mi.Vector3f, solid_angle: mi.Float) -> Rays:
        """Return rays in given directions."""
        return Rays(ping=ping, direction=direction, solid_angle=solid_angle)

    def response(self, place: Place, rays: Rays, towards: Vector) -> RowResponse:
        """Return the beam that receives the echo of each ray: the one with the nearest direction."""
        row, pattern = self._beams.receive(place, rays.ping, rays.direction, towards)
        return RowResponse(row=row, pattern=pattern, in_beam=mi.Bool(True), active=pattern > 0)

    def shown(self, intensity: np.ndarray) -> np.ndarray:
        """Return the picture of intensities (beams, ..., bins): mixed by the beams, smeared by the compressed pulse."""
        return self._beams.shown(intensity)

    def shown_transposed(self, cotangent: np.ndarray) -> np.ndarray:
        """Return the transpose of `shown`."""
        return self._beams.shown_transposed(cotangent)

    def other_sources(self, sound: SoundPaths, seed: int) -> Sequence[EchoSource[Rays]]:
        """Return an empty tuple: the truth of beams has first hits and coherent echoes only."""
        return ()

    def coherent(self, sound: SoundPaths) -> CoherentBeams | None:
        """Return the source of coherent echoes; None if the scene has none."""
        source = CoherentBeams(self._survey, sound, self._beams, self.bins,
                               drift=self.underway.drift(self.bins.sound_speed))
        return None if source.silent else source
