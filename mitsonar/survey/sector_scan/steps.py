"""Pings of a rotating head as rows of an energy record: mean levels, and the truth of every bin.

A row is the echo of a ping as the single beam of the head receives it, in the head's frame (x along the beam, y the
direction in which it turns, z across):

    b(u, v) = sinc(L u / λ) sqrt((1 - f) sinc²(H v / λ) + f),    u = d·y,  v = d·z;    zero behind the face

L, H and f -> length, height and floor of its face (`sonar.arrays.element_patterns`). Where the head turns between
transmission and reception, the two lobes lie side by side.

As for a sidescan's sides, a first, sparse pass of rays finds the directions that lead into time bins which few rays
reach, and a second pass makes the record. Rays are drawn through quantile tables (`tracing.launch`) as directions
d = (√(1 - u²) cos φ, u, √(1 - u²) sin φ): the table of u follows both lobes, those of φ the time axis.
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
from mitsonar.imaging.sidescan import mean_intensity
from mitsonar.scene.tracing.launch import CELLS, along_quantiles, draw, first_quantiles, refine_quantiles
from mitsonar.signal.gates import pulse_shares
from mitsonar.signal.matched_filtering import compression
from mitsonar.sonar.faces.beam_shapes import line_shape
from mitsonar.sonar.faces.directivity import Aperture
from mitsonar.sonar.faces.sidescan import Sidescan

from ..energy.coherent_beams import CoherentBeams
from ..energy.energy_bins import EnergyBins, ray_need
from ..energy.face_beams import BEAM_EDGE, FaceBeams
from ..energy.rows import EchoSource, Rays, RowResponse
from ..energy.side_launch import drawn_across, ray_grid, strata_of
from ..energy.sound_paths import SoundPaths
from ..motion.places import Place
from ..motion.underway import Underway
from ..pressure.array_survey import ArraySurvey

SHIFTS = 9                         # shifts that represent all pings
WAYS = (-0.5, 0.0, 0.5)            # [rad] φ of these shifts
FIRST_PASS = 0.15                  # share of the rays
RAYS_PER_BLOCK = 1 << 21
SUMS_PER_BLOCK = 1 << 23           # integers
TABLES_PER_BLOCK = 128             # tables of rays, a megabyte each: bounds memory where pings differ in depth
COHERENT_PER_BLOCK = 32            # pings whose coherent echoes are summed together


def face_of(survey: ArraySurvey) -> Sidescan:
    """Return the face and the pulse of a head, as those of a sidescan's side that looks along the beam."""
    wavelength = survey.planned_speed / survey.frequency
    transmit, receive = (Aperture(length=array.length, height=array.height,
                                  across_shape=line_shape(array.height / wavelength, floor=array.floor))
                         for array in (survey.transmit, survey.receive))
    return Sidescan(frequency=survey.frequency, source_level_db=survey.source_level_db,
                    pulse_length=compression(survey.pulse, survey.sampling_rate)[0],
                    transmit=transmit, receive=receive, depression_angle=0.0, sound_speed=survey.planned_speed)


class StepBeam:
    """Response of the beam of a head, whose record has bins of `bin_length` [s]."""

    count = 1

    def __init__(self, face: Sidescan, bin_length: float):
        self._faces, self._shares = FaceBeams(face), pulse_shares(bin_length, face.pulse_length)

    def two_way(self, sent: mi.Vector3f, back: mi.Vector3f) -> tuple[mi.Float, mi.Bool]:
        """Return the two-way intensity of directions in the head's frame, and True for those of the main lobe."""
        along, across = self._faces.two_way(sent.y, sent.z, back.y, back.z)
        pattern = dr.select((sent.x >= 0) & (back.x >= 0), along * across, 0)
        return mi.Float(pattern), mi.Bool(self._faces.lobe(sent.y, back.y) > BEAM_EDGE)

    def receive(self, place: Place, ping: mi.UInt32, sent: Vector, towards: Vector) -> tuple[mi.UInt32, mi.Float]:
        """Return the number of the beam, always 0, and its two-way intensity for echoes (R,)."""
        pattern, _ = self.two_way(place.body(ping, sent), place.body(ping, towards))
        return dr.zeros(mi.UInt32, dr.width(pattern)), pattern

    def shown(self, intensity: np.ndarray) -> np.ndarray:
        """Return intensities (rows, ..., bins) averaged over the pulse."""
        return mean_intensity(intensity, self._shares)


@dataclass(frozen=True, kw_only=True)
class StepRays(Rays):
    """Rays of a head's pings."""

    cell: mi.UInt32  # (R,): cell of the tables of φ, (pings, CELLS), that the ray was drawn in
    head: mi.Vector3f  # (R,): directions in the head's frame


class StepLaunch:
    """Directions of the rays of pings."""

    def __init__(self, survey: ArraySurvey, face: Sidescan, underway: Underway, window: tuple[float, float]):
        # window [s]
        self._survey, self._face, self._window, self._lib = survey, face, window, arrays_of(mi.Float)
        shifts = underway.aside_shifts(survey.planned.track.rotation(), face.sound_speed, WAYS)
        table = along_quantiles(face, np.unique(np.quantile(shifts, np.linspace(0, 1, SHIFTS))))
        self._along = upload(mi.Float, table.astype(np.float32))
        dr.eval(self._along)

    def first_quantiles(self, place: Place) -> np.ndarray:
        """Return the tables of φ, (pings, CELLS + 1) [rad], that suit a level bed."""
        survey = self._survey
        phi = np.linspace(-np.pi / 2, np.pi / 2, CELLS + 1)
        along = np.stack([np.cos(phi), 0 * phi, np.sin(phi)], -1)
        depression = np.arcsin(np.clip(-np.einsum("pj,kj->pk", place.rotation[:, 2], along), -1, 1))
        mean_speed = float(np.mean(place.profile.at(np.linspace(*survey.world.depth_range, 9))))
        scatters = survey.world.surface_label and not survey.world.surface_mirrors
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


@final
class Steps:
    """Pings of a head as rows; see `rows.Rows`."""

    per_ping, hidden_in_beam = 1, True

    def __init__(self, survey: ArraySurvey, window: tuple[float, float], count: int):
        # window [s]; count of bins
        self._survey, self._window, self.labels, self.paths = survey, window, len(survey.labels), Paths(1)
        self.frequency, self.source_level_db = survey.frequency, survey.source_level_db
        face, length = face_of(survey), (window[1] - window[0]) / count
        self.bins = EnergyBins(start=window[0], length=length, count=count, sound_speed=face.sound_speed,
                               beam=face.solid_angle(), absorption_db=survey.waters.least_absorption_db)
        self.underway = Underway.of(survey, survey.time[-1])
        self.face, self.beam = face, StepBeam(face, length)
        self._launch = StepLaunch(survey, face, self.underway, window)
        first = round(FIRST_PASS * survey.rays)
        self._grids = ray_grid(max(first, 1)), ray_grid(max(survey.rays - first, 1))
        self.pings_per_block = self._pings_per_block()

    def _pings_per_block(self) -> int:
        """Return the number of pings in a block, bounded by rays and by the memory of sums and tables."""
        survey, pings = self._survey, self._survey.planned.track.pings
        sums = self.bins.count * (self.labels * (2 if survey.world.named.hides else 1) + WORDS)
        rays = sum(grid[0] * grid[1] for grid in self._grids)
        level = len(np.unique(survey.planned.track.position[:, 2])) == 1
        return max(1, min(RAYS_PER_BLOCK // rays, SUMS_PER_BLOCK // sums, pings if level else TABLES_PER_BLOCK, pings,
                          COHERENT_PER_BLOCK))

    def within(self, survey: ArraySurvey) -> Steps:
        """Return the rows of a part of the survey: the pattern of the face depends on its sound speed."""
        return Steps(survey, self._window, self.bins.count) if self._survey.changes else self

    def passes(self, place: Place, seed: int,
               bins_of: Callable[[Place, StepRays], tuple[mi.UInt32, mi.Bool]]) -> Iterator[StepRays]:
        """Yield the rays that make the record."""
        quantiles = self._launch.first_quantiles(place)
        rays = self._launch.drawn(place, quantiles, self._grids[0], seed, Salt.FIRST_PASS)
        need = ray_need(rays.ping, rays.cell, *bins_of(place, rays), rows=place.rows, bins=self.bins)
        yield self._launch.drawn(place, refine_quantiles(quantiles, need), self._grids[1], seed, Salt.SECOND_PASS)

    def aimed(self, place: Place, ping: mi.UInt32, direction: mi.Vector3f, solid_angle: mi.Float) -> StepRays:
        """Return rays in given directions, drawn through no table."""
        return StepRays(ping=ping, direction=direction, solid_angle=solid_angle, cell=mi.UInt32(0),
                        head=place.body(ping, direction))

    def response(self, place: Place, rays: StepRays, towards: Vector) -> RowResponse:
        """Return the response of the beam, at the head's attitude when each echo is back."""
        back = rays.head if place.still else place.body(rays.ping, towards)
        pattern, in_beam = self.beam.two_way(rays.head, back)
        return RowResponse(row=rays.ping, pattern=pattern, in_beam=in_beam, active=pattern > 0)

    def shown(self, intensity: np.ndarray) -> np.ndarray:
        """Return intensities (rows, ..., bins) averaged over the pulse."""
        return self.beam.shown(intensity)

    def other_sources(self, sound: SoundPaths, seed: int) -> Sequence[EchoSource[StepRays]]:
        """Return no sources: mean levels and truth hold first hits and coherent echoes only."""
        return ()

    def coherent(self, sound: SoundPaths) -> CoherentBeams | None:
        """Return the source of coherent echoes, None where the scene has none."""
        source = CoherentBeams(self._survey, sound, self.beam, self.bins,
                               drift=self.underway.drift(self.bins.sound_speed))
        return None if source.silent else source
