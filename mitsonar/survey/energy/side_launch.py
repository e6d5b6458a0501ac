"""Rays of a sidescan's sides, drawn through quantile tables (`tracing.launch`), and the scout pings of these tables.

A direction of a side is (u, φ), as in `sonar.sidescan`. The tables of u follow the beam along the platform, wherever it
turns during the record (`underway`); those of φ follow the time axis, or the beam across.

Rays aside of the core, |u| < u_c, are drawn by azimuth α and angle β below the plane of the body, u = cos β sin α:

    ΔΩ = 2 (π/2 - α_c) cos β Δβ / w,    sin α_c = u_c,    β = φ + δ cos φ

and those with |u| < u_c have no weight. w -> share of rays aside in the cell; δ(α) compensates the tilt of the body
towards α, so that a cell of φ is about one slant range on a level bed at every α.

The first pass of a ping finds the cells of its table that lead into time bins which few rays reach (`aside_need`).
Pings of a group use the table of one of them, the scout, carried to their own roll and height (`SideLaunch.carried`):
far off, a degree of roll moves a ray by the range over the height. The table decides the directions of rays, never
their weights. Ping i uses the table of its scout s if both see ground in common at the end of the record,

    |x_i - x_s| + R |e_i - e_s| < w R

x -> position, e -> forward axis of the body, R -> ``farthest``, w -> ``width``; else the ping is a scout itself. At
shorter range the scout's table is that of ground beside the ping's. Groups are numbered in the whole survey, so blocks
do not matter.
"""
from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from types import ModuleType

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.device.chance import Salt, even_bits, hashed, other_pair, pair, salted, seeded, stratified, uniform
from mitsonar.device.types import DrJitArray
from mitsonar.scene.tracing.launch import (
    CELLS,
    WIDE_SHARE,
    Strata,
    across_quantiles,
    along_quantiles,
    core_of,
    core_quantiles,
    draw,
    first_quantiles,
    one_way_quantiles,
)
from mitsonar.sonar.motion.track import Track
from mitsonar.water.profile import SoundSpeedProfile

from ..motion.places import Place
from ..motion.underway import Underway
from .rows import Rays
from .sidescan_survey import SidescanSurvey

GROUP = 4                          # pings that may have a scout in common
TALL = 16                          # strata of φ in a tall tile
BOUNCE_SHARE = 1 / 5               # rays for paths of several bounces, relative to those of a pass
WIDEST_CORE = 0.5                  # largest u at which the core ends
MOST_TILT = 0.7                    # [rad] largest correction of β: below 1, angles stay in order
LAYERS = 16                        # layers of water for the travel time to a level bed
MANY_ASIDE, WAYS = 0.15, 8         # above this share of rays aside, a tile sends them in `WAYS` directions, not in one
FIRST_ASIDE = 0.25                 # share aside in a first pass, which must find the ground that side lobes alone see


def scouts(track: Track, farthest: float, width: float) -> np.ndarray:
    """Return the number of the scout of each ping, (P,) int; its rays are traced in the surroundings of that ping."""
    # farthest [m]; width [rad]
    ping = np.arange(track.pings)
    scout = np.minimum(ping // GROUP * GROUP + GROUP // 2, track.pings - 1)
    position, forward = track.position, track.rotation()[..., 0]
    apart = np.linalg.norm(position - position[scout], axis=-1)
    apart += farthest * np.linalg.norm(forward - forward[scout], axis=-1)
    return np.where(apart < width * farthest, scout, ping)


@dataclass(frozen=True)
class Tables:
    """Tables that the rays of rows are drawn through."""

    phi: np.ndarray  # (rows, CELLS + 1) [rad]: quantiles
    aside: np.ndarray  # (rows, CELLS): share of rays aside of the core


@dataclass(frozen=True, kw_only=True)
class SideRays(Rays):
    """Rays of sides."""

    row: mi.UInt32  # (R,): side of a ping of the block
    side: mi.Float  # (R,): -1 port, 1 starboard
    cell: mi.UInt32  # (R,): cell of the tables of φ, (rows, CELLS), that the ray was drawn in
    aside: mi.Bool  # (R,): True if the ray was drawn aside of the core
    u: DrJitArray  # (R,): of the direction, see `face_beams`
    v: DrJitArray  # (R,): of the direction, see `face_beams`
    strata: Strata  # numbering of the rays
    quantiles: np.ndarray | None  # [rad]: tables of φ that the rays were drawn through


class SideLaunch:
    """Directions of the rays of sides."""

    def __init__(self, survey: SidescanSurvey, underway: Underway, depression: mi.Float, *, shadows: bool = True):
        # depression [rad]
        sonar = survey.sonar
        self._survey, self._lib, self._depression = survey, arrays_of(mi.Float), depression
        self._group, shifts = underway.along_shifts(survey.planned.track.rotation(), sonar.sound_speed,
                                                   sonar.wavelength / sonar.longest)
        self._shifts, self._underway = shifts, underway
        self.largest_shift = max(float(np.abs(group).max()) for group in shifts)
        tables = np.stack([along_quantiles(sonar, group) for group in shifts])
        self._along = upload(mi.Float, tables.astype(np.float32))
        core = min(core_of(sonar, self.largest_shift), WIDEST_CORE)
        cores, outside = zip(*(core_quantiles(sonar, group, core) for group in shifts))
        self._cores, self.aside = upload(mi.Float, np.stack(cores).astype(np.float32)), max(outside)
        self._core, self._span = dr.opaque(mi.Float, core), dr.opaque(mi.Float, 0.5 * np.pi - float(np.arcsin(core)))
        self.shadows, self.first_aside = shadows, max(FIRST_ASIDE, self.aside) if shadows else self.aside
        self._across = upload(mi.Float, across_quantiles(sonar).astype(np.float32))
        dr.eval(self._along, self._across, self._cores)

    def grids(self) -> tuple[tuple[int, int] | None, tuple[int, int]]:
        """Return the strata (φ, u) of one side in the first pass, None without one, and in the second."""
        survey = self._survey
        first = int(round(survey.rays * survey.first_pass / 2))
        return ray_grid(first) if first else None, ray_grid(max(1, survey.rays // 2 - first))

    def first_quantiles(self, place: Place) -> np.ndarray:
        """Return the tables of φ, (rows, CELLS + 1) [rad], that suit a level bed."""
        survey = self._survey
        phi = np.linspace(-np.pi / 2, np.pi / 2, CELLS + 1)
        side = np.array([-1.0, 1.0])
        body = np.stack(np.broadcast_arrays(0.0, side[:, None] * np.cos(phi), np.sin(phi)), -1)      # (side, phi, 3)
        down = -np.einsum("pj,skj->psk", place.rotation[:, 2], body)                                 # (ping, side, phi)
        depression = np.arcsin(np.clip(down, -1, 1)).reshape(-1, CELLS + 1)
        below = np.repeat(place.depth_below_of, 2)
        profile = place.profile
        mean_speed = float(np.mean(profile.at(np.linspace(*survey.world.depth_range, 9))))
        depression = _straight(profile, depression, np.repeat(-place.position[:, 2], 2), below, mean_speed)
        above = None
        if survey.world.surface_label and not survey.world.surface_mirrors:
            above = np.repeat(-place.position[:, 2], 2)
        return first_quantiles(survey.sonar, depression, below, mean_speed, survey.window, above)

    def drawn(self, place: Place, tables: Tables, grid: tuple[int, int], seed: int, salt: int) -> SideRays:
        """Draw the rays of a pass: `grid` strata in φ and u for each row."""
        return self._drawn(place, tables.phi, grid, seed, salt, self._cores,
                           upload(mi.Float, tables.aside.astype(np.float32)))

    def carried(self, tables: np.ndarray, scout: np.ndarray, ping: np.ndarray) -> np.ndarray:
        """Return tables of φ (B, 2, CELLS + 1) of scouts, carried to the roll and height of pings, (B,) each.

        The seabed does not roll, so a table is carried as one of depression angles in the athwart plane. At another
        height, the same share of a level bed, and of the surface, lies at the same share of the record.
        """
        survey, side = self._survey, np.array([-1.0, 1.0])
        rotation, depth = survey.track.rotation(), -survey.track.position[:, 2]
        tilt = np.arctan2(-rotation[:, 2, 1, None] * side, -rotation[:, 2, 2, None])[..., None]
        below, above = (_ratio(values[ping], values[scout])[:, None, None] for values in (survey.depth_below, depth))
        depression = tables + tilt[scout]
        ratio = np.where(depression > 0, below, above)
        phi = np.arctan2(ratio * np.sin(depression), np.cos(depression)) - tilt[ping]
        phi = np.maximum.accumulate(np.clip(phi, -np.pi / 2, np.pi / 2), -1)
        phi[..., 0], phi[..., -1] = -np.pi / 2, np.pi / 2
        return phi

    def one_way(self, place: Place, rays: SideRays, seed: int) -> SideRays:
        """Draw rays for paths of several bounces: across as in a pass, along by the beams of single faces."""
        first, second = rays.strata.shape
        grid = ray_grid(max(1, round(first * second * BOUNCE_SHARE)))
        return self._drawn(place, rays.quantiles, grid, seed, Salt.BOUNCE_RAYS, self._along_one_way)

    @cached_property
    def _along_one_way(self) -> DrJitArray:
        """Return the tables of u that follow the beam of each face alone."""
        tables = np.stack([one_way_quantiles(self._survey.sonar, group) for group in self._shifts])
        along = upload(mi.Float, tables.astype(np.float32))
        dr.eval(along)
        return along

    def _drawn(self, place, quantiles, grid, seed, salt, along, aside=None):
        strata = strata_of(self._lib, place.rows, grid)
        drawn = drawn_across(self._lib, place, strata, quantiles, seed, salt, aside)
        return self._rays(place, *drawn, strata, quantiles, along, aside)

    def across_beam(self, place: Place, grid: tuple[int, int], seed: int) -> tuple[SideRays, mi.UInt32, mi.UInt32]:
        """Draw rays over the whole beam, regardless of hits; return also their numbers in their row, and its key."""
        lib, strata = self._lib, strata_of(self._lib, place.rows, grid)
        row, within, i_phi, i_u = strata.split(dr.arange(mi.UInt32, strata.rays))
        key = seeded(place.key(row), seed, Salt.WATER)
        a, b = pair(within, key)
        xi_phi = stratified(lib, i_phi, uniform(lib, a), strata.first)
        phi, phi_width, cell = draw(self._across, mi.UInt32(0), xi_phi)
        xi_u = stratified(lib, i_u, uniform(lib, b), strata.second)
        rays = self._rays(place, row, phi, phi_width, cell, xi_u, strata, None, self._along)
        return rays, mi.UInt32(within), key

    def aimed(self, place: Place, ping: mi.UInt32, direction: mi.Vector3f, solid_angle: mi.Float,
              grid: tuple[int, int]) -> SideRays:
        """Return rays in given directions, drawn through no table, each of the side that it leaves by."""
        body = place.body(ping, direction)
        side = dr.select(body.y < 0, mi.Float(-1), mi.Float(1))
        v = body.z * dr.cos(self._depression) - abs(body.y) * dr.sin(self._depression)
        row = 2 * ping + dr.select(side > 0, mi.UInt32(1), mi.UInt32(0))
        return SideRays(row=row, ping=ping, cell=mi.UInt32(0), direction=direction, side=side, u=body.x, v=v,
                        aside=mi.Bool(False), strata=strata_of(self._lib, place.rows, grid), quantiles=None,
                        solid_angle=solid_angle)

    def _rays(self, place, row, phi, phi_width, cell, xi_u, strata, quantiles, along, aside=None):
        """Return rays at angles φ, with u drawn through the tables `along` by numbers of [0, 1).

        Where cells have shares `aside`, numbers at either end of [0, 1) give rays aside of the core: for these, φ is
        the angle below the plane of the body, and the azimuth is uniform beyond |u| = core.
        """
        sin_phi, cos_phi = dr.sincos(phi)
        out, share = mi.Bool(False), None
        if aside is not None:
            share = dr.gather(mi.Float, aside, cell)
            out, end, xi_u = _ends(xi_u, share)
        u, width, _ = draw(along, self._table_of(place, row), xi_u)
        w = dr.sqrt(dr.maximum(1 - u * u, 0))
        across, down, v = w * cos_phi, w * sin_phi, w * dr.sin(phi - self._depression)
        side = mi.Float(row & 1) * 2 - 1
        if share is not None:
            sine, cosine = dr.sincos(dr.copysign(dr.fma(abs(end), -self._span, 0.5 * np.pi), end))
            level = place.body(row >> 1, mi.Vector3f(0, 0, -1))
            tilt = (level.y * side * (1 - cosine) - level.x * sine) / dr.maximum(level.z, 0.1)
            tilt = dr.clip(tilt, -MOST_TILT, MOST_TILT)
            sin_beta, cos_beta = dr.sincos(dr.fma(tilt, cos_phi, phi))
            width = dr.select(out, 2 * self._span / share * cos_beta * (1 - tilt * sin_phi), width / (1 - share))
            u = dr.select(out, cos_beta * sine, u)
            width = dr.select(out & (abs(u) < self._core), 0, width)
            across, down = dr.select(out, cos_beta * cosine, across), dr.select(out, sin_beta, down)
            v = dr.select(out, down * dr.cos(self._depression) - across * dr.sin(self._depression), v)
        direction = place.scene(row >> 1, mi.Vector3f(u, side * across, down))
        return SideRays(row=row, ping=row >> 1, cell=cell, direction=direction, side=side, strata=strata, u=u, v=v,
                        aside=out, quantiles=quantiles, solid_angle=phi_width * width / mi.Float(strata.per_row))

    def _table_of(self, place, row):
        """Return the number of the table of u that rays of a row are drawn through."""
        if place.still:
            return mi.UInt32(0)
        if self._survey.passage.latest is None:
            group = self._group[place.ping]
        else:
            sonar = self._survey.sonar
            group = self._underway.groups_of(place.ping, place.rotation, sonar.sound_speed,
                                             sonar.wavelength / sonar.longest)
        return dr.gather(mi.UInt32, upload(mi.UInt32, group), row)


def _straight(profile: SoundSpeedProfile, depression: np.ndarray, depth: np.ndarray, below: np.ndarray,
              speed: float) -> np.ndarray:
    """Return the angles at which straight rays of one speed are back from the bed when rays at `depression` are.

        1 / sin θ = <c̄ / (c sin θ(z))>,    cos θ(z) = cos θ₀ c(z) / c(z₀)
    """
    layers = (np.arange(LAYERS) + 0.5) / LAYERS
    layer_speed = profile.at(depth[:, None] + np.maximum(below, 0)[:, None] * layers)[:, None]
    cosine = np.cos(depression)[..., None] * layer_speed / profile.at(depth)[:, None, None]
    slower = speed / (layer_speed * np.sqrt(np.maximum(1 - cosine ** 2, 1e-12)))
    straight = np.arcsin(np.minimum(1 / slower.mean(-1), 1))
    return np.where(depression > 0, straight, depression)


def _ratio(values: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return values divided by others, 1 where either is not above 0."""
    positive = (values > 0) & (others > 0)
    return np.where(positive, values / np.where(positive, others, 1), 1)


def _ends(xi, share):
    """Split numbers of [0, 1): True at both ends, the signed place within an end, and the others spread over [0, 1)."""
    half = 0.5 * share
    low, high = xi < half, xi > 1 - half
    end = dr.select(low, xi, 1 - xi) / half
    return low | high, dr.select(low, -end, end), dr.clip((xi - half) / (1 - share), 0, 1)


def drawn_across(lib: ModuleType, place: Place, strata: Strata, quantiles: np.ndarray, seed: int, salt: int,
                 aside: DrJitArray | None = None) -> tuple[mi.UInt32, mi.Float, mi.Float, mi.UInt32, mi.Float]:
    """Draw φ of the rays of a pass through quantile tables (rows, CELLS + 1) [rad], and the number that u is drawn by.

    `aside` (rows CELLS,) is the share of rays that leave aside of the beam, `WIDE_SHARE` where it is None.
    """
    # -> row, phi [rad], width of phi [rad], cell, number in [0, 1) for u: (R,) each
    row, within, i_phi, i_u = strata.split(dr.arange(mi.UInt32, strata.rays))
    key = seeded(place.key(row), seed, salt)
    a, b = pair(within, key)
    # each of the n_u rays of a stratum of φ has a slice of it, scrambled so that every ray may get every slice (no
    # bias). Time bins then see n_phi n_u strata, not n_phi, and their edges cost little noise.
    scramble, _ = other_pair(i_phi, key)
    slice_phi = i_u ^ (scramble & (strata.second - 1))
    within_phi = (mi.Float(slice_phi) + uniform(lib, a)) / mi.Float(strata.second)
    xi_phi = stratified(lib, i_phi, within_phi, strata.first)
    phi, phi_width, cell = draw(upload(mi.Float, quantiles.astype(np.float32)), row, xi_phi)
    share = WIDE_SHARE if aside is None else dr.gather(mi.Float, aside, cell)
    xi_u = stratified(lib, i_u, _within_u(lib, strata, key, i_phi, i_u, uniform(lib, b), share), strata.second)
    return mi.UInt32(row), mi.Float(phi), mi.Float(phi_width), mi.UInt32(cell), xi_u


def _within_u(lib, strata, key, i_phi, i_u, chance, share):
    """Return the places of rays in [0, 1) within their strata of u.

    Each ray of a tile has a slice of its stratum of u, as of its stratum of φ. The outermost strata begin with rays
    that leave aside of the beam, a `share` of all. A ray aside of the beam costs as much as a packet of rays that stay
    together, so those of a tile leave it in one direction, drawn evenly from tile to tile.
    """
    tile, key = i_phi >> strata.high_bits, salted(key, Salt.TAILS)
    high = mi.UInt32(1) << strata.high_bits
    # neighbours lie nearly half a stratum apart, because a time bin may hold only a few strata of φ
    slice_u = (7 * i_phi + hashed(lib, key, tile, i_u)) & (high - 1)
    place = (mi.Float(slice_u) + chance) / mi.Float(high)
    from_end = dr.minimum(i_u, strata.second - 1 - i_u)
    aside = dr.clip(mi.Float(strata.second) * (0.5 * share) - mi.Float(from_end), 0, 1)
    ways = dr.select(share > MANY_ASIDE, lib.UInt32(WAYS), 1)
    shared = aside * uniform(lib, even_bits(lib, ways * tile + (i_phi & (ways - 1)), key, i_u))
    place = dr.select(place < aside, shared, place)
    return dr.select((i_u > from_end) & (aside > 0), dr.maximum(1 - place, 0), place)


def ray_grid(rays: int) -> tuple[int, int]:
    """Return the strata (φ, u) for about this many rays, multiples of a tile; a narrow beam needs few strata of u."""
    steps_u = 4 if rays < 4096 else 8 if rays < 32768 else 16
    step = 4 if rays < 4096 else TALL
    return max(step, step * round(rays / (step * steps_u))), steps_u


def strata_of(lib: ModuleType, rows: int, grid: tuple[int, int]) -> Strata:
    """Return strata (φ, u) of rows; tiles are tall if they fit, as strata of φ are much narrower than those of u."""
    return Strata(lib, rows, *grid, tall=grid[0] % TALL == 0)
