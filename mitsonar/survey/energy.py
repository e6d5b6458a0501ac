"""A sidescan run over a scene: rays out, echoes in, block of pings by block of pings.

The stages of one block, in order (`_Block`):

    launch      directions drawn through quantile tables, each with its solid angle          `sonar.launch`
    trace       bent rays to their first hit                                                 `trace`
    scatter     strength of the hit's material towards the receiver                          Mitsuba BSDFs
    echo        the sonar equation, summed into time bins                                    `signal.echoes`

Everything between launch and the bins is one Dr.Jit kernel; its numbers are opaque, so a scene compiles once. Random
numbers are hashed from (seed, ping, side, ray): neither blocks nor threads change them. Both legs follow the same path,
but for where it ends: the platform moves and turns until each echo is back (`underway`).
"""
from dataclasses import dataclass, replace
from functools import cached_property, partial

import drjit as dr
import mitsuba as mi
import numpy as np

from ..device.arrays import arrays_of, upload
from ..device.chance import Salt, other_pair, pair, seeded, stratified, uniform
from ..echoes.energy_sums import UNIT_BITS, EchoSums, sum_size
from ..echoes.multipath import Bounces
from ..echoes.origin_sums import WORDS
from ..echoes.paths import Paths
from ..echoes.sights import Sights
from ..echoes.sonar_equation import absorbed, echo_energy, speed_ratio
from ..echoes.volume import WaterEchoes
from ..imaging.energy_record import EnergyRecord, gathered
from ..imaging.sidescan import mean_intensity, pulse_shares
from ..scene.materials import scattering_strength
from ..sonar.directivity import sinc
from ..sonar.sidescan import Sidescan
from ..tracing.connection import Connector
from ..tracing.free_rays import FreeRays
from ..tracing.launch import CELLS, Strata, across_quantiles, along_quantiles, draw, first_quantiles, refine_quantiles
from ..tracing.tracer import Tracer
from ..water.absorption_table import Absorption
from .coherent_sidescan import CoherentEchoes
from .places import Place
from .survey import Survey
from .truth import TruthSums
from .underway import Underway

__all__ = ["SidescanSurvey"]

RAYS_PER_BLOCK = 1 << 21
SUMS_PER_BLOCK = 1 << 23           # integers: bounds a block's memory where shapes and bins are many
FANS_PER_BLOCK = 128               # a megabyte each: bounds it where every ping has a depth of its own
MOST_SUMS = 1 << 32                # what an index reaches
BEAM_EDGE = 0.25                   # two-way intensity at the edge of the main lobe as shadows see it (-6 dB)


@dataclass(frozen=True, kw_only=True)
class SidescanSurvey(Survey):
    """A run of a sidescan.

    Attributes
    ----------
    sonar : Sidescan
    window : (float, float) [s]
        Two-way time recorded.
    bins : int
    first_pass : float
        Share of the rays that only finds out where rays are needed; 0 for none.

    `rays` are both sides and both passes together; each side's share of a pass is rounded to strata, at least 16.
    """

    sonar: Sidescan
    window: tuple[float, float]
    bins: int
    first_pass: float

    @property
    def bin_length(self):
        """Duration of a time bin [s]."""
        return (self.window[1] - self.window[0]) / self.bins

    @property
    def slant_range(self):
        """Slant range of the bins' centres [m], (bins,), at the sonar's sound speed."""
        return 0.5 * self.sonar.sound_speed * (self.window[0] + (np.arange(self.bins) + 0.5) * self.bin_length)

    def pings_per_block(self):
        """How many pings a block holds: bounded by rays and by the memory of sums and fans."""
        by_label = len(self.labels) * (2 if self.geometry.named.hides else 1)
        sums = 2 * self.bins * (by_label + len(self.paths) - 1 + WORDS)
        if sums >= MOST_SUMS:
            raise ValueError(f"{self.bins} bins and {len(self.geometry.labels)} shapes make {sums} sums a ping, over "
                             f"{MOST_SUMS}; take fewer bins or let shapes share an id")
        rays = RAYS_PER_BLOCK if self.max_depth == 1 else RAYS_PER_BLOCK // 8
        by_rays = rays // (2 * sum(grid[0] * grid[1] for grid in self.grids() if grid))
        level = len(np.unique(self.track.position[:, 2])) == 1
        return max(1, min(by_rays, SUMS_PER_BLOCK // sums, self.track.pings if level else FANS_PER_BLOCK,
                          self.track.pings))

    @property
    def labels(self):
        """Number → what it stands for: the scene's shapes and, where it scatters, the water."""
        labels = self.geometry.labels
        return labels if self.volume is None else {**labels, 1 + max(labels): "water"}

    @cached_property
    def underway(self):
        """The motion within pings."""
        return Underway(self.voyage.trajectory.during(self.track.time, self.window[1] + self.sonar.pulse_length))

    @cached_property
    def shifts(self):
        """By how much the cosine along the body changes between transmission and reception, see `Underway.shifts`."""
        sonar = self.sonar
        return self.underway.shifts(self.track.rotation(), sonar.sound_speed, sonar.wavelength / sonar.longest)

    def grids(self):
        """Strata (φ, u) of the first pass, None where there is none, and of the second, for one side."""
        first = int(round(self.rays * self.first_pass / 2))
        return _grid(first) if first else None, _grid(max(1, self.rays // 2 - first))

    def echoes(self, seed=0, progress=None):
        """Run the survey.

        Parameters
        ----------
        seed : int
        progress : callable(done, total) or None
            Called after every block with the number of pings done.

        Returns
        -------
        EnergyRecord
            Arrays (ping, side, bin).
        """
        pings, block = self.track.pings, self.pings_per_block()
        kernel = _Block(self, seed)

        def blocks():
            for start in range(0, pings, block):
                yield kernel(np.arange(start, min(start + block, pings)))
                if progress is not None:
                    progress(min(start + block, pings), pings)

        return gathered(blocks(), pings=pings, rows=2)


class _Block:
    """The kernel of a survey, and the tables that all its blocks share."""

    def __init__(self, survey, seed):
        self.survey, self.seed = survey, int(seed)
        sonar, geometry = survey.sonar, survey.geometry
        self.lib = arrays_of(mi.Float)
        fastest = float(np.max(survey.profile.sound_speed))
        # half the two-way time, and what a platform gains that comes nearer meanwhile
        farthest = 0.5 * survey.window[1] * fastest * (1 + 0.5 * survey.underway.drift(sonar.sound_speed))
        self.tracer = Tracer(geometry, survey.profile, max_range=farthest)
        self.rotation = survey.track.rotation()
        self.solid_angle = sonar.solid_angle()
        self.kind, shifts = survey.shifts
        self.along = upload(mi.Float, np.stack([along_quantiles(sonar, some) for some in shifts]).astype(np.float32))
        deepest = max(geometry.depth_range[1], -float(survey.track.position[:, 2].min()))
        self.absorption = Absorption(survey.absorption, survey.profile, deepest, mi.Float)
        sides = [side / sonar.wavelength for face in (sonar.transmit, sonar.receive)
                 for side in (face.length, face.height)]
        self.sides = [dr.opaque(mi.Float, side) for side in sides]
        self.depression = dr.opaque(mi.Float, sonar.depression_angle)
        self.bins = dr.opaque(mi.UInt32, survey.bins)
        self.start = dr.opaque(mi.Float64, survey.window[0])
        self.bins_per_second = dr.opaque(mi.Float64, 1 / survey.bin_length)
        top, bottom = geometry.depth_range
        self.top, self.per_depth = dr.opaque(mi.Float, top), dr.opaque(mi.Float, 1 / max(bottom - top, 1e-6))
        nearest = 0.25 * sonar.sound_speed * survey.bin_length
        self.range2 = np.maximum(survey.slant_range, nearest) ** 2
        # worth of one unit of echo energy in each bin, relative to 10^(SL/10) [1/m²]; its absorption stays in decibels
        # until the last, for float32 ends at -380 dB
        unit = self.solid_angle / (self.range2 * 2.0 ** UNIT_BITS)
        loss_db = 2 * float(np.min(survey.absorption.absorption_db)) * survey.slant_range
        self.unit = unit * 10 ** (-loss_db / 10)
        per_bin = np.stack([1 / unit, loss_db], 1).astype(np.float32)
        self.per_bin = upload(mi.Float, per_bin)
        dr.eval(self.along, self.per_bin)
        self.first_grid, self.second_grid = survey.grids()
        self.surface = dr.opaque(mi.UInt32, geometry.surface_label)
        self.truth = TruthSums(
            geometry, labels=len(survey.labels), bins=survey.bins, depth_below=survey.depth_below,
            farthest=0.5 * sonar.sound_speed * survey.window[1],
            shown=partial(mean_intensity, shares=pulse_shares(survey.bin_length, sonar.pulse_length)))
        self.connector = Connector(self.tracer)
        mirror, free_rays = geometry.surface_mirrors, FreeRays(self.tracer)
        folded = Absorption(survey.absorption.mirrored(), survey.profile.mirrored(), deepest, mi.Float,
                            top=-deepest) if mirror else None
        sights = Sights(self.connector, free_rays, self.absorption, folded, max_depth=survey.max_depth)
        self.coherent = CoherentEchoes(survey, sights, self.tracer)
        self.bounces = Bounces(
            free_rays, self.absorption, folded, frequency=sonar.frequency, paths=survey.paths,
            surface_label=geometry.surface_label, mirror=mirror,
            targets=geometry.targets()) if survey.max_depth > 1 else None
        self.water = None
        if survey.volume is not None:
            self.water = WaterEchoes(survey.volume, self.connector, self.absorption, survey.window)
            self.water_label = 1 + max(geometry.labels)
            self.across = upload(mi.Float, across_quantiles(sonar).astype(np.float32))

    def __call__(self, ping):
        """Echoes of the pings with these numbers (B,)."""
        survey, rows = self.survey, 2 * len(ping)
        depth = -survey.track.position[ping, 2]
        unique, source = np.unique(depth, return_inverse=True)
        place = Place(self.lib, ping, survey.track.position[ping], self.rotation[ping], source,
                       self.tracer.sources(unique), survey.underway.block(ping), self.kind[ping])
        quantiles = self._first_quantiles(ping)
        if self.first_grid:
            quantiles = refine_quantiles(quantiles, self._need(place, quantiles))
        sums = EchoSums(self.lib, rows, len(survey.labels), survey.bins, len(survey.paths))
        origins = self.truth.sums(ping, rows)
        ray = self._launch(place, quantiles, self.second_grid, Salt.SECOND_PASS)
        hits, hidden = self._trace(place, ray, hidden=self.truth.hides)
        units, bin, in_window, in_beam = self._echo(place, ray, hits)
        sums.add(row=ray.row, label=hits.label, bin=bin, units=units, in_beam=in_beam,
                 height=self._height(mi.Float(-hits.point.z)), active=in_window,
                 path=survey.paths.numbers(Paths.extended(mi.UInt32(1), hits.label == self.surface)))
        self.truth.add(origins, ray, hits, bin=bin, units=units, in_beam=in_beam, active=in_window)
        if hidden is not None:
            units, bin, in_window, _ = self._echo(place, ray, hidden)
            origins.add_hidden(row=ray.row, label=hits.label, bin=bin, units=units, active=in_window)
        if self.bounces is not None:
            self._add_ghosts(place, ray, hits, sums)
        if self.water is not None:
            self._add_water(place, sums)
        dr.eval(sums.sums(), origins.sums())
        unit = 10 ** (survey.sonar.source_level_db / 10) * self.unit
        energy = sums.read(unit, survey.geometry.depth_range)
        coherent = self.coherent(place, ping, source) if self.coherent else None
        return EnergyRecord(intensity=energy.intensity, depth=energy.depth, rays=energy.rays,
                            rays_in_beam=energy.rays_in_beam, path_intensity=energy.path_intensity,
                            coherent=coherent and coherent.record,
                            truth=self.truth.read(origins, unit, energy, coherent))

    def _first_quantiles(self, ping):
        survey = self.survey
        phi = np.linspace(-np.pi / 2, np.pi / 2, CELLS + 1)
        side = np.array([-1.0, 1.0])
        body = np.stack(np.broadcast_arrays(0.0, side[:, None] * np.cos(phi), np.sin(phi)), -1)      # (side, phi, 3)
        down = -np.einsum("pj,skj->psk", self.rotation[ping][:, 2], body)                            # (ping, side, phi)
        depression = np.arcsin(np.clip(down, -1, 1)).reshape(-1, CELLS + 1)
        below = np.repeat(survey.depth_below[ping], 2)
        mean_speed = float(np.mean(survey.profile.at(np.linspace(*survey.geometry.depth_range, 9))))
        above = None
        if survey.geometry.surface_label and not survey.geometry.surface_mirrors:
            above = np.repeat(-survey.track.position[ping, 2], 2)
        return first_quantiles(survey.sonar, depression, below, mean_speed, survey.window, above)

    def _need(self, place, quantiles):
        """Trace the first pass and ask how far each cell of φ leads into bins that few rays reach."""
        ray = self._launch(place, quantiles, self.first_grid, Salt.FIRST_PASS)
        hits, _ = self._trace(place, ray)
        bin, in_window = self._bin(self._received(place, ray, hits).delay, hits.valid)
        index = ray.row * self.bins + bin
        cell = ray.cell
        count = dr.zeros(mi.UInt32, sum_size(place.rows * self.survey.bins))
        dr.scatter_add(count, mi.UInt32(1), index, in_window)
        dr.eval(count, index, in_window, cell)
        share = mi.UInt64(2.0 ** 32 / mi.Float64(dr.maximum(dr.gather(mi.UInt32, count, index, in_window), 1)))
        need = dr.zeros(mi.UInt64, sum_size(place.rows * CELLS))
        dr.scatter_add(need, share, cell, in_window)
        return need.numpy()[:place.rows * CELLS].reshape(place.rows, CELLS) / 2.0 ** 32

    def _launch(self, place, quantiles, grid, salt):
        """Draw the rays of a pass: `grid` strata in φ and u for each row (ping and side)."""
        strata = Strata(self.lib, place.rows, *grid)
        n_phi, n_u, per_row = strata.first, strata.second, strata.per_row
        row, within, i_phi, i_u = strata.split(dr.arange(mi.UInt32, strata.rays))
        key = seeded(dr.gather(mi.UInt32, place.key, row), self.seed, salt)
        a, b = pair(within, key)
        # the n_u rays of a stratum of φ share it out: each of them a slice of its own, scrambled so that every ray may
        # get every slice (no bias). Time bins then see n_phi n_u strata, not n_phi, and their edges cost little noise.
        scramble, _ = other_pair(i_phi, key)
        slice_phi = i_u ^ (scramble & (n_u - 1))
        xi_phi = stratified(self.lib, i_phi, (mi.Float(slice_phi) + uniform(self.lib, a)) / mi.Float(n_u), n_phi)
        xi_u = stratified(self.lib, i_u, uniform(self.lib, b), n_u)
        phi, phi_width, cell = draw(upload(mi.Float, quantiles.astype(np.float32)), row, xi_phi)
        u, u_width, _ = draw(self.along, place.kind(row), xi_u)
        w = dr.sqrt(dr.maximum(1 - u * u, 0))
        sin_phi, cos_phi = dr.sincos(phi)
        side = mi.Float(row & 1) * 2 - 1
        body = mi.Vector3f(u, side * w * cos_phi, w * sin_phi)
        return _Rays(row=row, ping=row >> 1, cell=cell, direction=place.turn(row >> 1, body), side=side,
                     solid_angle=phi_width * u_width / mi.Float(per_row), u=u, v=w * dr.sin(phi - self.depression))

    def _trace(self, place, ray, hidden=False):
        """Hits, and those that objects hide or None."""
        way = place.sources, place.origin(ray.ping), place.source(ray.ping), ray.direction
        hits, behind = self.tracer.with_hidden(*way) if hidden else (self.tracer(*way), None)
        if self.survey.geometry.surface_mirrors:
            # nothing comes back from there: it lights no shadow, and what lies beyond is seen by others (`bounces`)
            hits = replace(hits, valid=hits.valid & (hits.label != self.surface))
        return hits, behind

    def _add_ghosts(self, place, ray, hits, sums):
        """Add what bounced more than once: p² = 10^(SL/10) B_t B_r e²."""
        source_depth, source_speed = place.medium(ray.ping)
        origin, source = place.origin(ray.ping), place.source(ray.ping)

        def homeward(point, normal, active, short=0.0):
            return self.connector(place.sources, origin, source, point, normal, active, short=short)

        strata = Strata(self.lib, place.rows, *self.second_grid)
        key = seeded(dr.gather(mi.UInt32, place.key, ray.row), self.seed, Salt.BOUNCES)
        side = mi.Float(ray.row & 1) * 2 - 1
        for ghosts in self.bounces(hits, ray.solid_angle, origin, source_speed, strata, key, homeward):
            elapsed = ghosts.out.travel_time + ghosts.between + ghosts.back.travel_time
            heard = place.receive(ray.ping, ghosts.back.sent_towards, ghosts.back.offset, elapsed)
            bin, inside = self._bin(heard.delay, ghosts.active)
            pattern = mi.Float(1)
            for towards, face in ((ghosts.out.sent_towards, self.sides[:2]), (heard.towards, self.sides[2:])):
                body = place.body(ray.ping, towards)
                inside &= body.y * side > 0
                pattern *= dr.square(sinc(body.x * face[0]) * sinc(self._across(body) * face[1]))
            units = self._units(ghosts.energy * pattern, ghosts.loss_db, bin, inside)
            sums.add(row=ray.row, label=ghosts.label, bin=bin, units=units, in_beam=mi.Bool(False), counted=False,
                     height=self._height(ghosts.depth), active=inside, path=self.survey.paths.numbers(ghosts.code))

    def _add_water(self, place, sums):
        """Add what the water sends back: p² = 10^(SL/10) B e²."""
        strata = Strata(self.lib, place.rows, *self.second_grid)
        row, within, i_phi, i_u = strata.split(dr.arange(mi.UInt32, strata.rays))
        ping, side = row >> 1, mi.Float(row & 1) * 2 - 1
        key = seeded(dr.gather(mi.UInt32, place.key, row), self.seed, Salt.WATER)
        a, b = pair(within, key)
        c, _ = other_pair(a, key)
        xi_phi = stratified(self.lib, i_phi, uniform(self.lib, a), strata.first)
        xi_u = stratified(self.lib, i_u, uniform(self.lib, b), strata.second)
        phi, phi_width, _ = draw(self.across, mi.UInt32(0), xi_phi)
        u, u_width, _ = draw(self.along, place.kind(row), xi_u)
        w = dr.sqrt(dr.maximum(1 - u * u, 0))
        sine, cosine = dr.sincos(phi)
        direction = place.turn(ping, mi.Vector3f(u, side * w * cosine, w * sine))
        source_speed = place.medium(ping)[1]
        drawn = self.water(place.sources, place.origin(ping), place.source(ping), source_speed, direction,
                           phi_width * u_width / mi.Float(strata.per_row), strata, uniform(self.lib, c))
        sent = place.body(ping, drawn.way.launch_direction)
        received = place.receive(ping, drawn.way.launch_direction, drawn.point - place.origin(ping),
                                 2 * drawn.way.travel_time)
        heard = sent if place.still else place.body(ping, received.towards)
        along, across = self._patterns(sent.x, self._across(sent), heard.x, self._across(heard))
        bin, inside = self._bin(received.delay, drawn.active & (heard.y * side > 0))
        sums.add(row=row, label=dr.opaque(mi.UInt32, self.water_label), bin=bin, in_beam=mi.Bool(False), counted=False,
                 units=self._units(drawn.energy * along * across, drawn.loss_db, bin, inside),
                 height=self._height(mi.Float(-drawn.point.z)), active=inside,
                 path=dr.opaque(mi.UInt32, self.survey.paths.number("v")))

    def _across(self, body):
        """v of body directions: the sine of the angle to the faces' normal, downwards."""
        return body.z * dr.cos(self.depression) - abs(body.y) * dr.sin(self.depression)

    def _height(self, depth):
        """Depths as fractions of the scene's."""
        return dr.clip((depth - self.top) * self.per_depth, 0, 1)

    def _units(self, energy, loss_db, bin, inside):
        """Echo energies with their absorption in units of their bins."""
        units, unit_loss_db = dr.gather(self.lib.Array2f, self.per_bin, bin, inside)
        energy = energy * absorbed(loss_db - unit_loss_db)
        return dr.select(dr.isfinite(energy), mi.Float64(energy) * mi.Float64(units), 0)

    def _patterns(self, u, v, heard_u, heard_v):
        """Two-way intensity along and across the platform."""
        transmit_u, transmit_v, receive_u, receive_v = self.sides
        return (dr.square(sinc(u * transmit_u) * sinc(heard_u * receive_u)),
                dr.square(sinc(v * transmit_v) * sinc(heard_v * receive_v)))

    def _received(self, place, ray, hits):
        """How the echoes of hits are heard."""
        return place.receive(ray.ping, ray.direction, hits.point - place.origin(ray.ping), 2 * hits.travel_time)

    def _bin(self, delay, valid):
        place = (delay - self.start) * self.bins_per_second
        inside = valid & (place >= 0) & (place < mi.Float64(self.bins))
        return mi.UInt32(dr.select(inside, place, 0)), inside

    def _echo(self, place, ray, hits):
        """Echo of each ray in units of its bin, the bin, and whether it lies in the window and in the main lobe."""
        received, u, v = self._received(place, ray, hits), ray.u, ray.v
        bin, inside = self._bin(received.delay, hits.valid)
        if not place.still:
            body = place.body(ray.ping, received.towards)
            u, v, inside = body.x, self._across(body), inside & (body.y * ray.side > 0)
        along, across = self._patterns(ray.u, ray.v, u, v)
        lobe = along
        if not place.still:
            # what is sent and what is heard are lobes side by side; their product has its middle half-way
            middle = 0.5 * (ray.u + u)
            lobe, _ = self._patterns(middle, ray.v, middle, v)
        strength, sin_grazing = scattering_strength(hits, inside, self.survey.sonar.frequency)
        source_depth, source_speed = place.medium(ray.ping)
        units, unit_loss_db = dr.gather(self.lib.Array2f, self.per_bin, bin, inside)
        loss_db = self.absorption(source_depth, mi.Float(-hits.point.z), hits.arc_length, mi.Float(hits.ray_parameter))
        energy = echo_energy(solid_angle=ray.solid_angle, pattern=along * across, strength=strength,
                             sin_grazing=sin_grazing, spreading_area=hits.spreading_area,
                             speed_ratio=speed_ratio(hits.sound_speed, source_speed),
                             loss=absorbed(loss_db - unit_loss_db))
        return mi.Float64(energy) * mi.Float64(units), bin, inside & dr.isfinite(energy), lobe > BEAM_EDGE


@dataclass(frozen=True, kw_only=True)
class _Rays:
    row: object
    ping: object
    cell: object
    direction: object
    side: object
    solid_angle: object
    u: object
    v: object


def _grid(rays):
    """Strata (φ, u) for about this many rays, multiples of 4: u needs few, the beam is narrow."""
    steps_u = 4 if rays < 4096 else 8 if rays < 32768 else 16
    return max(4, 4 * round(rays / (4 * steps_u))), steps_u
