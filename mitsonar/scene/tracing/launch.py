"""Launch directions of a ping's rays, drawn where the beam and the time axis need them, each with its weight.

A ray's direction is (u, φ) of `sidescan`. Both coordinates are drawn stratified through quantile tables: the edges of M
cells of equal probability. With a table e_0..e_M and a stratified ξ in [0, 1),

    i = ⌊ξ M⌋,  φ = e_i + (ξ M - i)(e_{i+1} - e_i),   density = 1 / (M (e_{i+1} - e_i))

A draw costs one look-up. The ray's solid angle is ΔΩ = 1 / (N density_u density_φ), exactly the reciprocal of the
density it was drawn with, so no choice of density can bias a level.

Along the platform the density follows the two-way beam within a core, |u| < u_c, that holds the main lobe and the lobes
next to it. A share w of the rays leaves outside the core, evenly over azimuth. Core and rest have no direction in
common, so that their sums simply add. Where the beam meets a shadow, the echo arrives by the rest, and w is large.

In φ a first, sparse pass spreads rays evenly over the travel time to a flat bed, and surface, and over the vertical
beam. Its hits show how many rays the time bins of each cell still lack (`refined`). The second pass is drawn from that
and alone gives the image. The first pass decides where rays go, never their weight, so the estimate stays unbiased.
"""
from __future__ import annotations

from types import ModuleType

import drjit as dr
import numpy as np

from mitsonar.sonar.faces.sidescan import Sidescan

CELLS = 1024
TIME_SHARE, BEAM_SHARE = 0.70, 0.25          # of the first pass; the rest is uniform in φ
WIDE_SHARE = 0.05                            # share of the along-track draw that ignores the beam
LIT_SHARE = 0.1                              # share of it that ignores the receiving beam where the platform turns
FINEST = 1 << 16                             # cells of u that resolve the side lobes of one face
KEEP_SHARE = 0.25                            # of the first pass's density that the second keeps
SPREAD = 6                                   # cells either way, over which the need outside the core is averaged


class Strata:
    """Strata of rays in rows, numbered so that the 16 neighbours of a tile follow each other: a packet of rays is then
    one small patch of seabed.
    """

    def __init__(self, lib: ModuleType, rows: int, first: int, second: int, *, tall: bool = False):
        self.lib, self.rows, self.shape = lib, rows, (first, second)
        # sizes of a tile as powers of two: 16 high and 1 wide, or 4 by 4
        self.high_bits, self._wide = (dr.opaque(lib.UInt32, bits) for bits in ((4, 0) if tall else (2, 2)))
        self._across = dr.opaque(lib.UInt32, across := second if tall else second // 4)
        self.first, self.second = (dr.opaque(lib.UInt32, count) for count in (first, second))
        self.per_row = self.first * self.second
        self.rays = rows * first * second
        # SIMD has no integer division: reciprocals, exact for 32-bit counts, take a tenth of the time
        self._rows_a_ray, self._tiles_across = (dr.opaque(lib.Float64, 1 / count)
                                                for count in (first * second, across))

    def split(self, index: dr.ArrayBase) -> tuple[dr.ArrayBase, dr.ArrayBase, dr.ArrayBase, dr.ArrayBase]:
        """Return row, number within the row, and strata (i, j) of rays, UInt32."""
        row = self._quotient(index, self._rows_a_ray)
        within = index - row * self.per_row
        tile, inner = within // 16, within & 15
        tile_i = self._quotient(tile, self._tiles_across)
        tile_j = tile - tile_i * self._across
        in_i = inner >> self._wide
        return row, within, (tile_i << self.high_bits) + in_i, (tile_j << self._wide) + (inner - (in_i << self._wide))

    def _quotient(self, number, reciprocal):
        """Return the quotients of integers; the half step keeps them clear of rounding."""
        return self.lib.UInt32((self.lib.Float64(number) + 0.5) * reciprocal)

    def index(self, row: dr.ArrayBase, i: dr.ArrayBase, j: dr.ArrayBase) -> dr.ArrayBase:
        """Return the number of the ray in strata (i, j) of a row."""
        tile_i, tile_j = i >> self.high_bits, j >> self._wide
        in_i, in_j = i - (tile_i << self.high_bits), j - (tile_j << self._wide)
        return row * self.per_row + 16 * (tile_i * self._across + tile_j) + (in_i << self._wide) + in_j


def quantiles(edges: np.ndarray, density: np.ndarray, cells: int = CELLS) -> np.ndarray:
    """Return the edges of cells of equal probability of piecewise constant densities (D, M)."""
    edges = np.broadcast_to(edges, (len(density), density.shape[1] + 1))
    cumulative = np.concatenate([np.zeros((len(density), 1)), np.cumsum(density * np.diff(edges, axis=1), 1)], 1)
    cumulative /= cumulative[:, -1:]
    # one interpolation for all rows: row d lives on [2 d, 2 d + 1], shifted exactly so that its place changes no bit
    cumulative = np.round(cumulative * 2.0 ** 40) / 2.0 ** 40
    shift = 2.0 * np.arange(len(density))[:, None]
    wanted = np.linspace(0, 1, cells + 1)[None] + shift
    table = np.interp(wanted.ravel(), (cumulative + shift).ravel(), edges.ravel()).reshape(wanted.shape)
    table[:, 0], table[:, -1] = edges[:, 0], edges[:, -1]
    return table


def along_quantiles(sonar: Sidescan, shifts: np.ndarray | tuple[float, ...] = (0.0,)) -> np.ndarray:
    """Return the quantile table (CELLS + 1,) of u: the two-way beam, and a share spread over all directions.

    `shifts` (S,) are those of u until reception. Each gets an equal share of the draw; where they differ, another share
    follows the transmitting face alone, so that no echo weighs much more than others when the platform turns.
    """
    return quantiles(*_along_density(sonar, shifts))[0]


def core_quantiles(sonar: Sidescan, shifts: np.ndarray, core: float) -> tuple[np.ndarray, float]:
    """Return the part of `along_quantiles` with |u| < core, (CELLS + 1,), and the share of rays outside it."""
    edges, density = _along_density(sonar, shifts, core)
    first, last = np.flatnonzero(np.abs(edges) <= core)[[0, -1]]
    received = sonar.along_intensity(0.5 * (edges[1:] + edges[:-1])) * np.diff(edges)
    outside = 1 - received[first:last].sum() / received.sum()
    return (quantiles(edges[first:last + 1], density[:, first:last])[0],
            float(WIDE_SHARE * (1 - core) + (1 - WIDE_SHARE) * outside))


def core_of(sonar: Sidescan, shift: float = 0.0) -> float:
    """Return the limit in u of the main lobe and the lobes next to it, where u shifts by up to `shift`."""
    return min(4 * sonar.wavelength / max(sonar.longest, 4 * sonar.wavelength) + shift, 1.0)


def _along_density(sonar: Sidescan, shifts: np.ndarray | tuple[float, ...],
                   core: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return the edges of cells of u, `core` among them, and the density (1, cells) of `along_quantiles`."""
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
    """Return the quantile table (CELLS + 1,) of u if sound goes out one way and comes back another.

    Either end of such a path is seen by one face alone. Equal shares of the draw follow the transmitting and the
    receiving beam, and one is spread over all directions. `shifts` (S,) are those of u until reception.
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
    """Return the quantile table (CELLS + 1,) of φ: the two-way beam, and a share spread over all directions."""
    phi = np.linspace(-np.pi / 2, np.pi / 2, 4 * CELLS + 1)
    middle = 0.5 * (phi[1:] + phi[:-1])
    beam = sonar.across_intensity(np.sin(middle - sonar.depression_angle))
    return quantiles(phi, ((1 - WIDE_SHARE) * beam / beam.mean() + WIDE_SHARE)[None])[0]


def first_quantiles(sonar: Sidescan, depression: np.ndarray,    # [rad]
                    depth_below: np.ndarray,                    # (D,) [m]
                    sound_speed: float, window: tuple[float, float],    # [m/s], [s]
                    depth_above: np.ndarray | None = None) -> np.ndarray:
    """Return the quantile tables of φ [rad] for the first pass."""
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
    """Return the quantile tables of φ [rad] for the second pass, with rays needed in cells (D, CELLS)."""
    return refined(first, need, np.zeros_like(need), 0.0)[0]


def refined(first: np.ndarray, need: np.ndarray, aside_need: np.ndarray,
            aside: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the tables of φ for the second pass, and the shares (D, CELLS) of rays outside the core.

    `need` and `aside_need` (D, CELLS) are the rays needed within and outside the core.
    """
    # a silhouette may lie in the next cell, which gets a part of the need
    padded = np.pad(need.astype(float), ((0, 0), (1, 1)), mode="edge")
    spread = (padded[:, :-2] + 2 * padded[:, 1:-1] + padded[:, 2:]) / 4
    # side lobes see no sharp silhouettes, and the few rays of a first pass that follow them leave gaps
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
    cells = [np.searchsorted(old, new, side="right") for old, new in zip(first[:, 1:-1], middles)]
    return tables, np.take_along_axis(share_aside / share, np.array(cells), 1)


def draw(table: dr.ArrayBase, row: dr.ArrayBase, xi: dr.ArrayBase,
         cells: int = CELLS) -> tuple[dr.ArrayBase, dr.ArrayBase, dr.ArrayBase]:
    """Look stratified samples (R,) up in a quantile table; return values, widths and cells (R,)."""
    place = xi * cells
    index = dr.minimum(type(row)(place), cells - 1)
    base = row * (cells + 1) + index
    low = dr.gather(type(xi), table, base)
    high = dr.gather(type(xi), table, base + 1)
    return dr.fma(place - type(xi)(index), high - low, low), (high - low) * cells, row * cells + index
