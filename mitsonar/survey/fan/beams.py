"""The beams of an array as rows of an energy record, from which the truth of the array's picture is taken.

A row is what one beam receives of a ping. Rays are launched from the array's centre, aimed where the elements and the
time axis need them, and leave at the transmission. Which beam receives an echo, and in which bin, is decided by where
the array is and looks when that echo is back (`underway`).
"""
from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
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
MOST_SUMS = 1 << 27                # of beams x shapes x bins: 1 GB
BEAM = 1e-4                        # [sr] that the unit of energy is reckoned by, about that of a narrow beam
SLACK = 0.8, 1.25                  # of the record's ends: bent rays do not come back when straight ones would


@final
class Beams:
    """Hold a fan of beams of an array; see `rows.Rows`."""
    # angle (B,) [rad]; direction (B,) [rad]

    pings_per_block = 1

    hidden_in_beam = False

    def __init__(self, survey: ArraySurvey, angle: np.ndarray, direction: np.ndarray):
        geometry, bins = survey.geometry, survey.samples - survey.lead
        self._survey, self.per_ping, self.labels = survey, len(angle), len(survey.labels)
        if self.per_ping * bins * self.labels > MOST_SUMS:
            raise ValueError(f"{self.per_ping} beams, {bins} samples and {self.labels} shapes make more than "
                             f"{MOST_SUMS:.0e} sums of ground truth; take fewer beams, a shorter range, or let shapes "
                             "share an id")
        self.frequency, self.source_level_db, self.paths = survey.frequency, survey.source_level_db, Paths(1)
        self.bins = EnergyBins(start=survey.time[survey.lead] - 0.5 / survey.sampling_rate,
                               length=1 / survey.sampling_rate, count=bins, sound_speed=survey.sound_speed(0),
                               beam=BEAM, absorption_db=float(np.min(survey.absorption.absorption_db)))
        self.underway = Underway(survey.voyage.trajectory.during(survey.track.time, survey.time[-1]))
        self._beams = ArrayBeams(survey, angle, direction)
        wanted = max(RAYS_PER_BIN * self.per_ping * bins, FEWEST_RAYS)
        self._passes = min(-(-wanted // MOST_RAYS), MOST_PASSES)
        self._share = dr.opaque(mi.Float, 1 / self._passes)
        window = (SLACK[0] * survey.start, SLACK[1] * survey.time[-1])
        self._drawn = DrawnRays(survey.profile, window=window, rays=min(wanted, MOST_RAYS), pattern=self._beams.pattern,
                                surface=geometry.surface_label > 0 and not geometry.surface_mirrors)

    def passes(self, place: Place, seed: int,
               bins_of: Callable[[Place, Rays], tuple[mi.UInt32, mi.Bool]]) -> Iterator[Rays]:
        """Yield the rays of a ping, in as many passes as fit into memory."""
        ping = mi.UInt32(0)
        for number in range(self._passes):
            key = ping_key(seed, int(place.ping[0]), number, Salt.FAN_TRUTH)
            direction, solid_angle, _ = self._drawn.draw(place.origin(ping), place.rotation[0],
                                                         float(place.depth_below_of[0]), key)
            yield Rays(ping=ping, direction=direction, solid_angle=solid_angle * self._share)

    def aimed(self, place: Place, ping: mi.UInt32, direction: mi.Vector3f, solid_angle: mi.Float) -> Rays:
        """Return rays of given directions."""
        return Rays(ping=ping, direction=direction, solid_angle=solid_angle)

    def response(self, place: Place, rays: Rays, towards: Vector) -> RowResponse:
        """Return which beam receives echoes of rays: that whose direction is the nearest."""
        row, pattern = self._beams.receive(place, rays.ping, rays.direction, towards)
        return RowResponse(row=row, pattern=pattern, in_beam=mi.Bool(True), active=pattern > 0)

    def shown(self, intensity: np.ndarray) -> np.ndarray:
        """Return what beams and compressed pulse make of intensities (beams, ..., bins)."""
        return self._beams.shown(intensity)

    def shown_transposed(self, cotangent: np.ndarray) -> np.ndarray:
        """Return the transpose of `shown`."""
        return self._beams.shown_transposed(cotangent)

    def other_sources(self, sound: SoundPaths, seed: int) -> Sequence[EchoSource[Rays]]:
        """Return none: the truth of beams tells first hits and coherent echoes alone."""
        return ()

    def coherent(self, sound: SoundPaths) -> CoherentBeams | None:
        """Return the source of the echoes that have a phase of their own; None where the scene has none."""
        source = CoherentBeams(self._survey, sound, self._beams, self.bins,
                               drift=self.underway.drift(self.bins.sound_speed))
        return None if source.silent else source
