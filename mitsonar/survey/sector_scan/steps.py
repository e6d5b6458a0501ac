"""The pings of a rotating head as rows of an energy record: mean levels, and the truth of every bin.

A row is what the one beam of the head receives of a ping. As of a sidescan's sides, a first, sparse pass of rays finds
out which directions lead into time bins that few rays reach, and a second one makes the record.

Rays of a rotating head's pings, drawn through quantile tables: see `tracing.launch`.

A direction is (u, φ) in the head's frame, d = (√(1 - u²) cos φ, u, √(1 - u²) sin φ). The table of u follows the lobes
at transmission and at reception, wherever the head turns meanwhile; those of φ follow the time axis.
"""
from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import final

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.device.chance import Salt
from mitsonar.device.types import Vector
from mitsonar.echoes.paths import Paths
from mitsonar.echoes.sums.origin_sums import WORDS
from mitsonar.scene.tracing.launch import CELLS, along_quantiles, draw, first_quantiles, refine_quantiles
from mitsonar.sonar.faces.sidescan import Sidescan

from ..energy.coherent_beams import CoherentBeams
from ..energy.energy_bins import EnergyBins, ray_need
from ..energy.rows import EchoSource, Rays, RowResponse
from ..energy.side_launch import drawn_across, ray_grid, strata_of
from ..energy.sound_paths import SoundPaths
from ..motion.places import Place
from ..motion.underway import Underway
from ..pressure.array_survey import ArraySurvey
from .beam import StepBeam, face_of

SHIFTS = 9                         # that stand for all pings
WAYS = (-0.5, 0.0, 0.5)            # [rad] φ at which shifts are looked at


@dataclass(frozen=True, kw_only=True)
class StepRays(Rays):
    """Hold rays of a head's pings."""

    cell: mi.UInt32  # (R,): of the table of φ that the ray was drawn through, (pings, CELLS)
    head: mi.Vector3f  # (R,): their directions in the head's frame


class StepLaunch:
    """Draw rays of pings."""
    # window [s]

    def __init__(self, survey: ArraySurvey, face: Sidescan, underway: Underway, window: tuple[float, float]):
        self._survey, self._face, self._window, self._lib = survey, face, window, arrays_of(mi.Float)
        shifts = underway.aside_shifts(survey.track.rotation(), face.sound_speed, WAYS)
        table = along_quantiles(face, np.unique(np.quantile(shifts, np.linspace(0, 1, SHIFTS))))
        self._along = upload(mi.Float, table.astype(np.float32))
        dr.eval(self._along)

    def first_quantiles(self, place: Place) -> np.ndarray:
        """Return the tables of φ, (pings, CELLS + 1) [rad], that suit a level bed."""
        survey = self._survey
        phi = np.linspace(-np.pi / 2, np.pi / 2, CELLS + 1)
        along = np.stack([np.cos(phi), 0 * phi, np.sin(phi)], -1)
        depression = np.arcsin(np.clip(-np.einsum("pj,kj->pk", place.rotation[:, 2], along), -1, 1))
        mean_speed = float(np.mean(survey.profile.at(np.linspace(*survey.geometry.depth_range, 9))))
        scatters = survey.geometry.surface_label and not survey.geometry.surface_mirrors
        return first_quantiles(self._face, depression, place.depth_below_of, mean_speed, self._window,
                               -place.position[:, 2] if scatters else None)

    def drawn(self, place: Place, quantiles: np.ndarray, grid: tuple[int, int], seed: int, salt: int) -> StepRays:
        """Draw the rays of a pass: `grid` strata in φ and u for each ping, through tables of φ."""
        strata = strata_of(self._lib, place.rows, grid)
        ping, phi, phi_width, cell, share = drawn_across(self._lib, place, strata, quantiles, seed, salt)
        u, u_width, _ = draw(self._along, mi.UInt32(0), share)
        w = dr.sqrt(dr.maximum(1 - u * u, 0))
        sine, cosine = dr.sincos(phi)
        head = mi.Vector3f(w * cosine, u, w * sine)
        return StepRays(ping=ping, cell=cell, head=head, direction=place.scene(ping, head),
                        solid_angle=phi_width * u_width / mi.Float(strata.per_row))


FIRST_PASS = 0.15                  # of the rays
RAYS_PER_BLOCK = 1 << 21
SUMS_PER_BLOCK = 1 << 23           # integers
TABLES_PER_BLOCK = 128             # of rays, a megabyte each: bounds it where every ping has a depth of its own
COHERENT_PER_BLOCK = 32            # pings whose coherent echoes are summed together


@final
class Steps:
    """Hold the pings of a head; see `rows.Rows`."""
    # window [s]

    per_ping, hidden_in_beam = 1, True

    def __init__(self, survey: ArraySurvey, window: tuple[float, float], count: int):
        self._survey, self.labels, self.paths = survey, len(survey.labels), Paths(1)
        self.frequency, self.source_level_db = survey.frequency, survey.source_level_db
        face, length = face_of(survey), (window[1] - window[0]) / count
        self.bins = EnergyBins(start=window[0], length=length, count=count, sound_speed=face.sound_speed,
                               beam=face.solid_angle(), absorption_db=float(np.min(survey.absorption.absorption_db)))
        self.underway = Underway(survey.voyage.trajectory.during(survey.track.time, survey.time[-1]))
        self.face, self.beam = face, StepBeam(face, length)
        self._launch = StepLaunch(survey, face, self.underway, window)
        first = round(FIRST_PASS * survey.rays)
        self._grids = ray_grid(max(first, 1)), ray_grid(max(survey.rays - first, 1))
        self.pings_per_block = self._pings_per_block()

    def _pings_per_block(self) -> int:
        """Return the pings of a block, bounded by rays and by the memory of sums and tables."""
        survey, pings = self._survey, self._survey.track.pings
        sums = self.bins.count * (self.labels * (2 if survey.geometry.named.hides else 1) + WORDS)
        rays = sum(grid[0] * grid[1] for grid in self._grids)
        level = len(np.unique(survey.track.position[:, 2])) == 1
        return max(1, min(RAYS_PER_BLOCK // rays, SUMS_PER_BLOCK // sums, pings if level else TABLES_PER_BLOCK, pings,
                          COHERENT_PER_BLOCK))

    def passes(self, place: Place, seed: int,
               bins_of: Callable[[Place, StepRays], tuple[mi.UInt32, mi.Bool]]) -> Iterator[StepRays]:
        """Yield the rays that make the record."""
        quantiles = self._launch.first_quantiles(place)
        rays = self._launch.drawn(place, quantiles, self._grids[0], seed, Salt.FIRST_PASS)
        need = ray_need(rays.ping, rays.cell, *bins_of(place, rays), rows=place.rows, bins=self.bins)
        yield self._launch.drawn(place, refine_quantiles(quantiles, need), self._grids[1], seed, Salt.SECOND_PASS)

    def aimed(self, place: Place, ping: mi.UInt32, direction: mi.Vector3f, solid_angle: mi.Float) -> StepRays:
        """Return rays of given directions; they come from no table."""
        return StepRays(ping=ping, direction=direction, solid_angle=solid_angle, cell=mi.UInt32(0),
                        head=place.body(ping, direction))

    def response(self, place: Place, rays: StepRays, towards: Vector) -> RowResponse:
        """Return how the beam receives echoes, as the head looks when they are back."""
        back = rays.head if place.still else place.body(rays.ping, towards)
        pattern, in_beam = self.beam.two_way(rays.head, back)
        return RowResponse(row=rays.ping, pattern=pattern, in_beam=in_beam, active=pattern > 0)

    def shown(self, intensity: np.ndarray) -> np.ndarray:
        """Return the mean level that the pulse makes of intensities (rows, ..., bins)."""
        return self.beam.shown(intensity)

    def other_sources(self, sound: SoundPaths, seed: int) -> Sequence[EchoSource[StepRays]]:
        """Return none: mean levels and truth tell first hits and coherent echoes alone."""
        return ()

    def coherent(self, sound: SoundPaths) -> CoherentBeams | None:
        """Return the source of the echoes that have a phase of their own; None where the scene has none."""
        source = CoherentBeams(self._survey, sound, self.beam, self.bins,
                               drift=self.underway.drift(self.bins.sound_speed))
        return None if source.silent else source
