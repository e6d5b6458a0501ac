"""Directions of a ping's rays, drawn where the beam and the time axis need them, each with its weight.

A ray's direction is (u, φ) of `sidescan`. Both coordinates are drawn stratified through quantile tables: the edges of M
cells of equal probability. With a table e_0..e_M and a stratified ξ in [0, 1),

    i = ⌊ξ M⌋,  φ = e_i + (ξ M - i)(e_{i+1} - e_i),   density = 1 / (M (e_{i+1} - e_i))

so a draw costs one look-up, and the ray's solid angle is ΔΩ = 1 / (N density_u density_φ), exactly the reciprocal of
what was drawn: no choice of density can bias a level.

Along the platform the density follows the two-way beam within a core, |u| < u_c, that holds the main lobe and the lobes
next to it. A share w of the rays leaves aside of the core, evenly over azimuth; core and rest share no direction, so
that both sums simply add. Where the beam meets a shadow, what arrives came by the rest, and w is large.

In φ a first, sparse pass spreads rays evenly over travel time on a flat bed, and surface, and over the vertical beam;
what it hits tells each cell how many rays its time bins still lack (`refined`), and the second pass, which alone gives
the image, is drawn from that. The first pass decides where rays go, never what they weigh: the estimate stays unbiased.
"""
from __future__ import annotations

from types import ModuleType

import drjit as dr
import numpy as np

from mitsonar.sonar.faces.sidescan import Sidescan

CELLS = 1024
TIME_SHARE, BEAM_SHARE = 0.70, 0.25          # of the first pass; the rest is uniform in φ
WIDE_SHARE = 0.05                            # of the along-track draw that ignores the beam,
LIT_SHARE = 0.1                              # and that ignores the receiving one, where the platform turns
FINEST = 1 << 16                             # cells of u that tell the side lobes of one face apart
KEEP_SHARE = 0.25                            # of the first pass's density that the second keeps
SPREAD = 6                                   # cells either way over which the need of rays aside is averaged


class Strata:
    """Rays of some rows, numbered so that neighbours in a tile of 16 strata follow each other: one packet of rays is
    then one small patch of seabed.
    """
    # high_bits (1,)

    def __init__(self, lib: ModuleType, rows: int, first: int, second: int, *, tall: bool = False):
        self.lib, self.rows, self.shape = lib, rows, (first, second)
        # of a tile, as powers of two: 16 high, 1 wide, or 4 by 4
        self.high_bits, self._wide = (dr.opaque(lib.UInt32, bits) for bits in ((4, 0) if tall else (2, 2)))
        self._across = dr.opaque(lib.UInt32, across := second if tall else second // 4)
        self.first, self.second = (dr.opaque(lib.UInt32, count) for count in (first, second))
        self.per_row = self.first * self.second
        self.rays = rows * first * second
        # a vector has no division of integers: reciprocals, exact as far as 32 bits count, take a tenth of the time
        self._rows_a_ray, self._tiles_across = (dr.opaque(lib.Float64, 1 / count)
                                                for count in (first * second, across))

    def split(self, index: dr.ArrayBase) -> tuple[dr.ArrayBase, dr.ArrayBase, dr.ArrayBase, dr.ArrayBase]:
        """Row, number within it, and strata (i, j) of rays, UInt32."""
        row = self._quotient(index, self._rows_a_ray)
        within = index - row * self.per_row
        tile, inner = within // 16, within & 15
        tile_i = self._quotient(tile, self._tiles_across)
        tile_j = tile - tile_i * self._across
        in_i = inner >> self._wide
        return row, within, (tile_i << self.high_bits) + in_i, (tile_j << self._wide) + (inner - (in_i << self._wide))

    def _quotient(self, number, reciprocal):
        """Whole part of numbers over a whole number: half a step from the next one, rounding cannot reach it."""
        return self.lib.UInt32((self.lib.Float64(number) + 0.5) * reciprocal)

    def index(self, row: dr.ArrayBase, i: dr.ArrayBase, j: dr.ArrayBase) -> dr.ArrayBase:
        """Number of the ray of a row in strata (i, j)."""
        tile_i, tile_j = i >> self.high_bits, j >> self._wide
        in_i, in_j = i - (tile_i << self.high_bits), j - (tile_j << self._wide)
        return row * self.per_row + 16 * (tile_i * self._across + tile_j) + (in_i << self._wide) + in_j


def quantiles(edges: np.ndarray, density: np.ndarray, cells: int = CELLS) -> np.ndarray:
    """Edges of cells of equal probability of piecewise constant densities."""
    # density (D, M)
    edges = np.broadcast_to(edges, (len(density), density.shape[1] + 1))
    cumulative = np.concatenate([np.zeros((len(density), 1)), np.cumsum(density * np.diff(edges, axis=1), 1)], 1)
    cumulative /= cumulative[:, -1:]
    # one interpolation for all rows: row d lives on [2 d, 2 d + 1], shifted exactly so that its place changes no bit
    cumulative = np.round(cumulative * 2.0 ** 40) / 2.0 ** 40
    shift = 2.0 * np.arange(len(density))[:, None]
    wanted = np.linspace(0, 1, cells + 1)[None] + shift
    found = np.interp(wanted.ravel(), (cumulative + shift).ravel(), edges.ravel()).reshape(wanted.shape)
    found[:, 0], found[:, -1] = edges[:, 0], edges[:, -1]
    return found


def along_quantiles(sonar: Sidescan, shifts: np.ndarray | tuple[float, ...] = (0.0,)) -> np.ndarray:
    """Quantile table (CELLS + 1,) of u: the two-way beam, and a share spread over all directions.

    `shifts` (S,) are those of u until reception: a share of the draw goes to each, and where they differ one to what
    the transmitting face ensonifies alone, so that no echo weighs much more than others whatever the platform does.
    """
    return quantiles(*_along_density(sonar, shifts))[0]


def core_quantiles(sonar: Sidescan, shifts: np.ndarray, core: float) -> tuple[np.ndarray, float]:
    """Return the part of `along_quantiles` with |u| < core, (CELLS + 1,), and the share of rays that lies outside."""
    edges, density = _along_density(sonar, shifts, core)
    first, last = np.flatnonzero(np.abs(edges) <= core)[[0, -1]]
    heard = sonar.along_intensity(0.5 * (edges[1:] + edges[:-1])) * np.diff(edges)
    outside = 1 - heard[first:last].sum() / heard.sum()
    return (quantiles(edges[first:last + 1], density[:, first:last])[0],
            float(WIDE_SHARE * (1 - core) + (1 - WIDE_SHARE) * outside))


def core_of(sonar: Sidescan, shift: float = 0.0) -> float:
    """Return how far the main lobe and the lobes next to it reach in u, where u shifts by up to so much on the way."""
    return min(4 * sonar.wavelength / max(sonar.longest, 4 * sonar.wavelength) + shift, 1.0)


def _along_density(sonar: Sidescan, shifts: np.ndarray | tuple[float, ...],
                   core: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Edges of cells of u, `core` among them, and the density (1, cells) of `along_quantiles` in each."""
    core = core_of(sonar, np.abs(shifts).max()) if core is None else core
    fine = np.linspace(-min(core, 1), min(core, 1), 8193)
    edges = np.union1d(fine, np.linspace(-1, 1, 1025))
    middle = 0.5 * (edges[1:] + edges[:-1])
    beams = (_normalised(sonar.along_intensity(middle, middle + shift), edges) for shift in shifts)
    beam = sum(beams, np.zeros(middle.shape)) / len(shifts)
    if len(shifts) > 1:
        lit = _normalised(sonar.transmit.along(middle, sonar.wavelength) ** 2, edges)
        beam = (1 - LIT_SHARE) * beam + LIT_SHARE * lit
    return edges, ((1 - WIDE_SHARE) * beam + WIDE_SHARE / 2)[None]


def one_way_quantiles(sonar: Sidescan, shifts: np.ndarray | tuple[float, ...] = (0.0,)) -> np.ndarray:
    """Quantile table (CELLS + 1,) of u where sound goes out one way and comes back another.

    Either end of such a path is seen by one face alone: a share of the draw follows the beam that sends, as much the
    beam that receives, and one is spread over all directions. `shifts` (S,) are those of u until reception.
    """
    edges = np.linspace(-1, 1, FINEST + 1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    sent = _normalised(sonar.transmit.along(middle, sonar.wavelength) ** 2, edges)
    received = (_normalised(sonar.receive.along(middle + shift, sonar.wavelength) ** 2, edges) for shift in shifts)
    beams = 0.5 * (sent + sum(received, np.zeros(middle.shape)) / len(shifts))
    return quantiles(edges, ((1 - WIDE_SHARE) * beams + WIDE_SHARE / 2)[None])[0]


def _normalised(density: np.ndarray, edges: np.ndarray) -> np.ndarray:
    return density / np.sum(density * np.diff(edges))


def across_quantiles(sonar: Sidescan) -> np.ndarray:
    """Quantile table (CELLS + 1,) of φ: the two-way beam, and a share spread over all directions."""
    phi = np.linspace(-np.pi / 2, np.pi / 2, 4 * CELLS + 1)
    middle = 0.5 * (phi[1:] + phi[:-1])
    beam = sonar.across_intensity(np.sin(middle - sonar.depression_angle))
    return quantiles(phi, ((1 - WIDE_SHARE) * beam / beam.mean() + WIDE_SHARE)[None])[0]


def first_quantiles(sonar: Sidescan, depression: np.ndarray, depth_below: np.ndarray, sound_speed: float,
                    window: tuple[float, float], depth_above: np.ndarray | None = None) -> np.ndarray:
    """Quantile tables of φ for the first pass."""
    # depression [rad]; depth_below (D,) [m]; sound_speed [m/s]; window [s]; depth_above (D,) [m] -> [rad]
    steps = depression.shape[1] - 1
    phi = np.linspace(-np.pi / 2, np.pi / 2, steps + 1)
    width = np.pi / steps
    with np.errstate(divide="ignore", invalid="ignore"):
        time = np.where(depression > 0, 2 * np.abs(depth_below[:, None]) / (sound_speed * np.sin(depression)), np.inf)
        if depth_above is not None:
            up = 2 * np.abs(depth_above[:, None]) / (sound_speed * np.sin(-depression))
            time = np.where(depression < 0, up, time)
    time = np.clip(time, *window)
    even = np.abs(np.diff(time, axis=1))
    even_total = even.sum(1, keepdims=True)
    even = np.where(even_total > 0, even / np.maximum(even_total, 1e-30), 1 / steps)
    middle = 0.5 * (phi[1:] + phi[:-1])
    beam = np.sqrt(sonar.across_intensity(np.sin(middle - sonar.depression_angle)))
    density = (TIME_SHARE * even + BEAM_SHARE * beam / beam.sum() + (1 - TIME_SHARE - BEAM_SHARE) / steps) / width
    return quantiles(phi, density)


def refine_quantiles(first: np.ndarray, need: np.ndarray) -> np.ndarray:
    """Quantile tables of φ for the second pass."""
    # first [rad]; need (D, CELLS) -> [rad]
    return refined(first, need, np.zeros_like(need), 0.0)[0]


def refined(first: np.ndarray, need: np.ndarray, aside_need: np.ndarray,
            aside: float) -> tuple[np.ndarray, np.ndarray]:
    """Quantile tables of φ for the second pass where rays within the core and aside of it have needs of their own."""
    # aside_need (D, CELLS) -> tables [rad], aside (D, CELLS)
    # a silhouette may lie in the next cell: lend it the need of its neighbours
    padded = np.pad(need.astype(float), ((0, 0), (1, 1)), mode="edge")
    spread = (padded[:, :-2] + 2 * padded[:, 1:-1] + padded[:, 2:]) / 4
    # side lobes see no silhouette sharply, and the few rays of a first pass that follow them leave gaps
    reach = np.arange(CELLS + 1)
    low, high = np.maximum(reach[:-1] - SPREAD, 0), np.minimum(reach[1:] + SPREAD, CELLS)
    summed = np.concatenate([np.zeros((len(first), 1)), np.cumsum(aside_need.astype(float), 1)], 1)
    spread_aside = (summed[:, high] - summed[:, low]) / (high - low)
    total = (spread + spread_aside).sum(1, keepdims=True)
    share = np.where(total > 0, (spread + spread_aside) / np.maximum(total, 1e-30), 1 / CELLS)
    share_aside = np.where(total > 0, spread_aside / np.maximum(total, 1e-30), aside / CELLS)
    share = KEEP_SHARE / CELLS + (1 - KEEP_SHARE) * share
    share_aside = KEEP_SHARE / CELLS * aside + (1 - KEEP_SHARE) * share_aside
    tables = quantiles(first, share / np.maximum(np.diff(first, axis=1), 1e-12))
    middles = 0.5 * (tables[:, 1:] + tables[:, :-1])
    found = [np.searchsorted(old, new, side="right") for old, new in zip(first[:, 1:-1], middles)]
    return tables, np.take_along_axis(share_aside / share, np.array(found), 1)


def draw(table: dr.ArrayBase, row: dr.ArrayBase, xi: dr.ArrayBase,
         cells: int = CELLS) -> tuple[dr.ArrayBase, dr.ArrayBase, dr.ArrayBase]:
    """Look a stratified sample up in a quantile table."""
    # row (R,); xi (R,) -> value (R,), width (R,), cell (R,)
    place = xi * cells
    index = dr.minimum(type(row)(place), cells - 1)
    base = row * (cells + 1) + index
    low = dr.gather(type(xi), table, base)
    high = dr.gather(type(xi), table, base + 1)
    return dr.fma(place - type(xi)(index), high - low, low), (high - low) * cells, row * cells + index
