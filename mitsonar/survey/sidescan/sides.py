"""The sides of a sidescan as rows of an energy record.

A row is what the face of one side receives of a ping: port is 0, starboard 1. Rays of a side are launched from its own
face. A first, sparse pass finds out which directions lead into time bins that few rays reach; the second pass, which
alone makes the record, sends more rays there.
"""
from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import final

import mitsuba as mi
import numpy as np

from mitsonar.device.chance import Salt
from mitsonar.device.types import Vector
from mitsonar.echoes.sums.origin_sums import PLACE, WORDS
from mitsonar.imaging.sidescan import mean_intensity, pulse_shares
from mitsonar.scene.tracing.launch import CELLS, refined

from ..energy.energy_bins import EnergyBins, aside_need
from ..energy.rows import EchoSource, RowResponse
from ..energy.sound_paths import SoundPaths
from ..motion.places import Place
from ..motion.underway import Underway
from .coherent_sidescan import CoherentSidescan
from .face_beams import BEAM_EDGE, FaceBeams
from .side_echoes import SideMultipath, SideWater
from .side_launch import GROUP, SideLaunch, SideRays, Tables, scouts
from .sidescan_survey import SidescanSurvey

__all__ = ["Sides"]

RAYS_PER_BLOCK = 1 << 23           # a second of both of two threads: rays leave nothing in memory
WATER_PER_BLOCK, BOUNCES_PER_BLOCK = 1 << 21, 1 << 19      # but for those of the water, and of several bounces
SUMS_PER_BLOCK = 1 << 23           # integers: bounds a block's memory where shapes and bins are many
TABLES_PER_BLOCK = 128             # of rays, a megabyte each: bounds it where every ping has a depth of its own
MOST_SUMS = 1 << 32                # what an index reaches
THREADS_OWN = 1 << 20              # words of an array of sums of which every thread has a copy: others take more time


@final
class Sides:
    """Both sides of a sidescan; see `rows.Rows`.

    Parameters
    ----------
    survey : SidescanSurvey
    shadows : bool
        Send more rays aside of the beam where bins lack them, as in shadows.

    Raises
    ------
    ValueError
        If a ping has more bins and shapes than an index reaches.
    """

    per_ping, hidden_in_beam = 2, True

    def __init__(self, survey: SidescanSurvey, *, shadows: bool = True):
        sonar = survey.sonar
        self._survey = survey
        self.labels, self.paths = len(survey.labels), survey.paths
        self.frequency, self.source_level_db = sonar.frequency, sonar.source_level_db
        self.bins = EnergyBins(
            start=survey.window[0], length=survey.bin_length, count=survey.bins, sound_speed=sonar.sound_speed,
            beam=sonar.solid_angle(), absorption_db=float(np.min(survey.absorption.absorption_db)))
        self.underway = Underway(
            survey.voyage.trajectory.during(survey.track.time, survey.window[1] + sonar.pulse_length))
        self._beams = FaceBeams(sonar)
        self._launch = SideLaunch(survey, self.underway, self._beams.depression, shadows=shadows)
        self._first_grid, self._second_grid = self._launch.grids()
        self._scouts = scouts(survey.track, self.bins.farthest, sonar.wavelength / sonar.longest)
        self._found: dict[tuple[int, int], list[np.ndarray]] = {}
        self._shares = pulse_shares(survey.bin_length, sonar.pulse_length)
        self.pings_per_block = self._pings_per_block()

    def _pings_per_block(self) -> int:
        """How many pings a block holds: bounded by rays and by the memory of sums and of tables of rays."""
        survey, pings = self._survey, self._survey.track.pings
        by_label = self.labels * (2 if survey.geometry.named.hides else 1)
        sums = 2 * survey.bins * (by_label + len(self.paths) - 1 + WORDS)
        if sums >= MOST_SUMS:
            raise ValueError(f"{survey.bins} bins and {len(survey.geometry.labels)} shapes make {sums} sums a ping, "
                             f"over {MOST_SUMS}; take fewer bins or let shapes share an id")
        rays = min(RAYS_PER_BLOCK, RAYS_PER_BLOCK if survey.volume is None else WATER_PER_BLOCK,
                   RAYS_PER_BLOCK if survey.max_depth == 1 else BOUNCES_PER_BLOCK)
        by_rays = rays // (2 * sum(grid[0] * grid[1] for grid in (self._first_grid, self._second_grid) if grid))
        level = len(np.unique(survey.track.position[:, 2])) == 1
        by_copies = THREADS_OWN // (2 * survey.bins * PLACE)
        most = max(1, min(by_rays, by_copies, SUMS_PER_BLOCK // sums, pings if level else TABLES_PER_BLOCK, pings))
        return most if most < GROUP else most // GROUP * GROUP

    def passes(self, place: Place, seed: int,
               bins_of: Callable[[Place, SideRays], tuple[mi.UInt32, mi.Bool]]) -> Iterator[SideRays]:
        """Yield the rays that make the record, in one pass."""
        if self._first_grid is None:
            tables = self._even(place, self._launch.aside)
        else:
            tables = self._asked(place, self._first_grid, seed, bins_of)
        yield self._launch.drawn(place, tables, self._second_grid, seed, Salt.SECOND_PASS)

    def _even(self, place, aside):
        """Tables that suit a level bed, with one share of rays aside of the core."""
        phi = self._launch.first_quantiles(place)
        return Tables(phi, np.full((len(phi), CELLS), aside))

    def _asked(self, place, grid, seed, bins_of):
        """Tables that lead into bins which few rays reach, as the pings' scouts find out."""
        asked = self._scouts[place.ping]
        known, new = self._found, np.array([one for one in np.unique(asked) if (seed, one) not in self._found], int)
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
            found = (rows.reshape(len(new), self.per_ping, -1) for rows in tables)
            known = known | {(seed, one): rows for one, *rows in zip(new, *found)}
        # a later block may ask those of this one: a group has no more of them than pings
        self._found = {key: known[key] for key in ((seed, one) for one in np.unique(asked)[-GROUP:])}
        phi, aside = (np.stack(rows) for rows in zip(*(known[seed, one] for one in asked)))
        phi = self._launch.carried(phi, asked, place.ping)
        return Tables(phi.reshape(place.rows, -1), aside.reshape(place.rows, -1))

    def aimed(self, place: Place, ping: mi.UInt32, direction: mi.Vector3f, solid_angle: mi.Float) -> SideRays:
        """Give rays of given directions, each of the side that it leaves by."""
        return self._launch.aimed(place, ping, direction, solid_angle, self._second_grid)

    def response(self, place: Place, rays: SideRays, towards: Vector) -> RowResponse:
        """Give how the side that sent a ray receives its echo: nothing comes from the other side of the body."""
        u, v, same_side = rays.u, rays.v, mi.Bool(True)
        if not place.still:
            body = place.body(rays.ping, towards)
            u, v, same_side = body.x, self._beams.across(body), body.y * rays.side > 0
        along, across = self._beams.two_way(rays.u, rays.v, u, v)
        lobe = along if place.still else self._beams.lobe(rays.u, u)
        return RowResponse(row=rays.row, pattern=along * across, in_beam=lobe > BEAM_EDGE, active=same_side)

    def shown(self, intensity: np.ndarray) -> np.ndarray:
        """Give the mean level that the pulse makes of intensities (rows, ..., bins)."""
        return mean_intensity(intensity, self._shares)

    def other_sources(self, sound: SoundPaths, seed: int) -> Sequence[EchoSource[SideRays]]:
        """Give the sources of echoes of several bounces, and of the water."""
        sources: list[EchoSource[SideRays]] = []
        if self._survey.max_depth > 1:
            sources.append(SideMultipath(self._survey, sound, self._beams, self.bins, self._launch, seed))
        if self._survey.volume is not None:
            sources.append(SideWater(self._survey, sound, self._beams, self.bins, self._launch, seed))
        return sources

    def coherent(self, sound: SoundPaths) -> CoherentSidescan | None:
        """Give the source of the echoes that have a phase of their own; None where the scene has none."""
        source = CoherentSidescan(self._survey, sound, self._beams, drift=self.underway.drift(self.bins.sound_speed),
                                  shift=self._launch.largest_shift)
        return None if source.silent else source
