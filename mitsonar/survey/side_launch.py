"""Rays of a sidescan's sides, drawn through quantile tables: see `tracing.launch`.

A direction of a side is (u, φ), as `sonar.sidescan` has it. The tables of u follow the beam along the platform,
wherever it turns while echoes are under way (`underway`); those of φ follow the time axis, or the beam across.
"""
from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from types import ModuleType

import drjit as dr
import mitsuba as mi
import numpy as np

from ..device.arrays import arrays_of, upload
from ..device.chance import Salt, even_bits, hashed, other_pair, pair, salted, seeded, stratified, uniform
from ..device.types import DrJitArray
from ..tracing.launch import (
    CELLS, WIDE_SHARE, Strata, across_quantiles, along_quantiles, draw, first_quantiles, one_way_quantiles,
)
from .places import Place
from .rows import Rays
from .sidescan_survey import SidescanSurvey
from .underway import Underway

__all__ = ["SideLaunch", "SideRays", "drawn_across", "ray_grid", "strata_of"]

TALL = 16                          # strata of φ in a tall tile
BOUNCE_SHARE = 1 / 3               # of a pass's rays: as many more are drawn for paths of several bounces


@dataclass(frozen=True, kw_only=True)
class SideRays(Rays):
    """Rays of sides.

    Attributes
    ----------
    row : UInt32 (R,)
        Side of a ping of the block.
    side : Float (R,)
        -1 port, 1 starboard.
    cell : UInt32 (R,)
        Of the table of φ that the ray was drawn through, (rows, CELLS).
    u, v : Float (R,)
        Of the direction, see `face_beams`.
    strata : Strata
        How the rays are numbered.
    quantiles : (rows, CELLS + 1) [rad] or None
        Tables of φ that the rays were drawn through; None: one for all.
    """

    row: mi.UInt32
    side: mi.Float
    cell: mi.UInt32
    u: DrJitArray
    v: DrJitArray
    strata: Strata
    quantiles: np.ndarray | None


class SideLaunch:
    """Draw rays of sides.

    Parameters
    ----------
    survey : SidescanSurvey
    underway : Underway
    depression : Float [rad]
        Of the faces.
    """

    def __init__(self, survey: SidescanSurvey, underway: Underway, depression: mi.Float):
        sonar = survey.sonar
        self._survey, self._lib, self._depression = survey, arrays_of(mi.Float), depression
        self._group, shifts = underway.along_shifts(survey.track.rotation(), sonar.sound_speed,
                                                   sonar.wavelength / sonar.longest)
        self._shifts = shifts
        self.largest_shift = max(float(np.abs(some).max()) for some in shifts)
        tables = np.stack([along_quantiles(sonar, some) for some in shifts])
        self._along = upload(mi.Float, tables.astype(np.float32))
        self._across = upload(mi.Float, across_quantiles(sonar).astype(np.float32))
        dr.eval(self._along, self._across)

    def grids(self) -> tuple[tuple[int, int] | None, tuple[int, int]]:
        """Strata (φ, u) of the first pass, None where there is none, and of the second, for one side."""
        survey = self._survey
        first = int(round(survey.rays * survey.first_pass / 2))
        return ray_grid(first) if first else None, ray_grid(max(1, survey.rays // 2 - first))

    def first_quantiles(self, place: Place) -> np.ndarray:
        """Give the tables of φ, (rows, CELLS + 1) [rad], that suit a level bed."""
        survey = self._survey
        phi = np.linspace(-np.pi / 2, np.pi / 2, CELLS + 1)
        side = np.array([-1.0, 1.0])
        body = np.stack(np.broadcast_arrays(0.0, side[:, None] * np.cos(phi), np.sin(phi)), -1)      # (side, phi, 3)
        down = -np.einsum("pj,skj->psk", place.rotation[:, 2], body)                                 # (ping, side, phi)
        depression = np.arcsin(np.clip(down, -1, 1)).reshape(-1, CELLS + 1)
        below = np.repeat(place.depth_below_of, 2)
        mean_speed = float(np.mean(survey.profile.at(np.linspace(*survey.geometry.depth_range, 9))))
        above = None
        if survey.geometry.surface_label and not survey.geometry.surface_mirrors:
            above = np.repeat(-place.position[:, 2], 2)
        return first_quantiles(survey.sonar, depression, below, mean_speed, survey.window, above)

    def drawn(self, place: Place, quantiles: np.ndarray, grid: tuple[int, int], seed: int, salt: int) -> SideRays:
        """Draw the rays of a pass: `grid` strata in φ and u for each row, through tables of φ."""
        return self._drawn(place, quantiles, grid, seed, salt, self._along)

    def one_way(self, place: Place, rays: SideRays, seed: int) -> SideRays:
        """Draw rays for paths of several bounces: across like those of a pass, along by the beams of single faces."""
        first, second = rays.strata.shape
        grid = ray_grid(max(1, round(first * second * BOUNCE_SHARE)))
        return self._drawn(place, rays.quantiles, grid, seed, Salt.BOUNCE_RAYS, self._along_one_way)

    @cached_property
    def _along_one_way(self) -> DrJitArray:
        """The tables of u that follow the beams of the faces one by one."""
        tables = np.stack([one_way_quantiles(self._survey.sonar, some) for some in self._shifts])
        along = upload(mi.Float, tables.astype(np.float32))
        dr.eval(along)
        return along

    def _drawn(self, place, quantiles, grid, seed, salt, along):
        strata = strata_of(self._lib, place.rows, grid)
        drawn = drawn_across(self._lib, place, strata, quantiles, seed, salt)
        return self._rays(place, *drawn, strata, quantiles, along)

    def across_beam(self, place: Place, grid: tuple[int, int], seed: int) -> tuple[SideRays, mi.Float]:
        """Draw rays over the whole beam, whatever they meet, and a number of [0, 1) more for each of them."""
        lib, strata = self._lib, strata_of(self._lib, place.rows, grid)
        row, within, i_phi, i_u = strata.split(dr.arange(mi.UInt32, strata.rays))
        key = seeded(place.key(row), seed, Salt.WATER)
        a, b = pair(within, key)
        c, _ = other_pair(a, key)
        xi_phi = stratified(lib, i_phi, uniform(lib, a), strata.first)
        phi, phi_width, cell = draw(self._across, mi.UInt32(0), xi_phi)
        xi_u = stratified(lib, i_u, uniform(lib, b), strata.second)
        rays = self._rays(place, row, phi, phi_width, cell, xi_u, strata, None, self._along)
        return rays, mi.Float(uniform(lib, c))

    def aimed(self, place: Place, ping: mi.UInt32, direction: mi.Vector3f, solid_angle: mi.Float,
              grid: tuple[int, int]) -> SideRays:
        """Give rays of given directions, which come from no table, each of the side that it leaves by."""
        body = place.body(ping, direction)
        side = dr.select(body.y < 0, mi.Float(-1), mi.Float(1))
        v = body.z * dr.cos(self._depression) - abs(body.y) * dr.sin(self._depression)
        row = 2 * ping + dr.select(side > 0, mi.UInt32(1), mi.UInt32(0))
        return SideRays(row=row, ping=ping, cell=mi.UInt32(0), direction=direction, side=side, u=body.x, v=v,
                        strata=strata_of(self._lib, place.rows, grid), quantiles=None, solid_angle=solid_angle)

    def _rays(self, place, row, phi, phi_width, cell, xi_u, strata, quantiles, along):
        """Rays at angles φ, their u drawn through the tables `along` with numbers of [0, 1)."""
        u, u_width, _ = draw(along, self._table_of(place, row), xi_u)
        w = dr.sqrt(dr.maximum(1 - u * u, 0))
        sin_phi, cos_phi = dr.sincos(phi)
        side = mi.Float(row & 1) * 2 - 1
        direction = place.scene(row >> 1, mi.Vector3f(u, side * w * cos_phi, w * sin_phi))
        return SideRays(row=row, ping=row >> 1, cell=cell, direction=direction, side=side, strata=strata, u=u,
                        v=w * dr.sin(phi - self._depression), quantiles=quantiles,
                        solid_angle=phi_width * u_width / mi.Float(strata.per_row))

    def _table_of(self, place, row):
        """Number of the table of u that rays of a row are drawn through."""
        if place.still:
            return mi.UInt32(0)
        return dr.gather(mi.UInt32, upload(mi.UInt32, self._group[place.ping]), row)


def drawn_across(lib: ModuleType, place: Place, strata: Strata, quantiles: np.ndarray, seed: int,
                 salt: int) -> tuple[mi.UInt32, mi.Float, mi.Float, mi.UInt32, mi.Float]:
    """Draw φ of the rays of a pass through tables of it, (rows, CELLS + 1).

    Returns
    -------
    row : UInt32 (R,)
        Of the block.
    phi, width : Float (R,) [rad]
        The angle, and the reciprocal of its density.
    cell : UInt32 (R,)
        Of the tables, (rows, CELLS).
    along : Float (R,)
        A stratified number of [0, 1) to draw u with.
    """
    row, within, i_phi, i_u = strata.split(dr.arange(mi.UInt32, strata.rays))
    key = seeded(place.key(row), seed, salt)
    a, b = pair(within, key)
    # the n_u rays of a stratum of φ share it out: each of them a slice of its own, scrambled so that every ray may
    # get every slice (no bias). Time bins then see n_phi n_u strata, not n_phi, and their edges cost little noise.
    scramble, _ = other_pair(i_phi, key)
    slice_phi = i_u ^ (scramble & (strata.second - 1))
    within_phi = (mi.Float(slice_phi) + uniform(lib, a)) / mi.Float(strata.second)
    xi_phi = stratified(lib, i_phi, within_phi, strata.first)
    phi, phi_width, cell = draw(upload(mi.Float, quantiles.astype(np.float32)), row, xi_phi)
    xi_u = stratified(lib, i_u, _within_u(lib, strata, key, i_phi, i_u, uniform(lib, b)), strata.second)
    return mi.UInt32(row), mi.Float(phi), mi.Float(phi_width), mi.UInt32(cell), xi_u


def _within_u(lib, strata, key, i_phi, i_u, chance):
    """Places of rays in [0, 1) within their strata of u.

    The rays of a tile in one stratum of u share it out, as those of a stratum of φ do. The outermost strata begin with
    what is spread over all directions (`WIDE_SHARE`). A ray aside of the beam costs as much as a packet of rays that
    stay together, so those of a tile leave it in one direction, drawn evenly from tile to tile.
    """
    tile, key = i_phi >> strata.high_bits, salted(key, Salt.TAILS)
    high = mi.UInt32(1) << strata.high_bits
    # neighbours lie nearly half a stratum apart: a time bin may hold only a few strata of φ
    slice_u = (7 * i_phi + hashed(lib, key, tile, i_u)) & (high - 1)
    place = (mi.Float(slice_u) + chance) / mi.Float(high)
    aside = dr.minimum(mi.Float(strata.second) * (0.5 * WIDE_SHARE), 1)
    last = i_u == strata.second - 1
    shared = aside * uniform(lib, even_bits(lib, tile, key, i_u))
    outermost = (place < aside) & ((i_u == 0) | last)
    place = dr.select(outermost, shared, place)
    return dr.select(last, dr.maximum(1 - place, 0), place)


def ray_grid(rays: int) -> tuple[int, int]:
    """Give the strata (φ, u) for about this many rays, multiples of a tile: u needs few, the beam is narrow."""
    steps_u = 4 if rays < 4096 else 8 if rays < 32768 else 16
    step = 4 if rays < 4096 else TALL
    return max(step, step * round(rays / (step * steps_u))), steps_u


def strata_of(lib: ModuleType, rows: int, grid: tuple[int, int]) -> Strata:
    """Give strata (φ, u) of rows. Strata of φ are much narrower than those of u: tiles are tall where they fit."""
    return Strata(lib, rows, *grid, tall=grid[0] % TALL == 0)
