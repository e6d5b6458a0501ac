"""Ray fans: exact rays from given source depths, stored as polylines that a triangle tracer can follow.

A ray is made of the circular arcs of `device_arcs`. A row of a ray fan is one exact ray, simplified to chords that
stay within `tolerance` of the arcs; every vertex carries (r, z) and d(r, z)/dθ0, so that a launch angle between rows
moves the vertices along their wavefronts. Rows are split at the critical angles acos(c0/c_k), where neighbouring rays
part company.
"""
from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import drjit as dr
import numpy as np
from numpy.typing import ArrayLike

from mitsonar.device.arrays import held, upload
from mitsonar.device.types import ArrayTypes, Bool, Float, Float64, Record, UInt32
from mitsonar.water.profile import SoundSpeedProfile

from .device_arcs import arc_step, first_layer, wavefront_step
from .layer_table import LayerTable

HALF_SPAN = np.radians(90.02)      # rows cover every launch angle, and a little more for rounding
LOOKUP_PER_ROW = 2
FEWEST_VERTICES = 16               # initial capacity of a row
# as Dr.Jit's, with types that a checker need not work out of a loop's
_select: Callable[[Bool, Any, Any], Float64] = cast(Any, dr.select)
_select_number: Callable[[Bool, UInt32, UInt32], UInt32] = cast(Any, dr.select)
_fma: Callable[[Any, Any, Any], Float64] = cast(Any, dr.fma)
NARROWEST = 2e-7                   # [rad] narrower rows coincide in float32


class RayFans(Record):
    """Polylines of D ray fans, one for each source depth.

    ``vertex`` holds (r, z, dr/dθ0, dz/dθ0) of vertex v of row j of ray fan d at index ((d R + j) V + v), float32 [m,
    m/rad].
    """

    lib: ArrayTypes
    source_depth: np.ndarray      # (D,) [m]
    rows: UInt32                  # UInt32 (1,): R
    vertex: Float                 # Float (4 D R V,)
    size: UInt32                  # UInt32 (D R,): vertices in a row
    stride: UInt32                # UInt32 (1,): V
    middle: Float                 # Float (D R,): launch angle of a row [rad]
    edge: Float                   # Float (D (R + 1),): row limits [rad]
    lookup: UInt32                # UInt32 (D L,): first candidate row of an angle bin
    bins: UInt32                  # UInt32 (1,): L
    bins_per_radian: Float

    def row(self, source_index: UInt32, launch_angle: Float) -> tuple[UInt32, Float]:
        """Return the flat row index and the angle's distance from the row's middle [rad]; NaN is in the first row."""
        lib = self.lib
        launch_angle = held(launch_angle, float(-HALF_SPAN), float(HALF_SPAN))
        cell = held((launch_angle + float(HALF_SPAN)) * self.bins_per_radian, 0, lib.Float(self.bins) - 1)
        j = dr.gather(lib.UInt32, self.lookup, source_index * self.bins + lib.UInt32(cell))
        j = _step_rows(lib, self.edge, source_index * (self.rows + 1), j, launch_angle)
        j += source_index * self.rows
        return j, launch_angle - dr.gather(lib.Float, self.middle, j)


@dr.syntax
def _step_rows(lib: ArrayTypes, edge: Float, first: UInt32, j: UInt32, angle: Float) -> UInt32:
    more = angle >= dr.gather(lib.Float, edge, first + j + 1)
    while more:
        j += 1
        more = angle >= dr.gather(lib.Float, edge, first + j + 1, more)
    return j


def build_ray_fans(table: LayerTable, profile: SoundSpeedProfile, source_depth: ArrayLike, *, slab: tuple[float, float],
               max_range: float, tolerance: float = 0.008, rows: int = 3072,
               max_vertices: int = FEWEST_VERTICES) -> RayFans:
    """Trace and simplify one ray fan per source depth."""
    # source_depth (D,) [m]; slab [m]; max_range [m]; tolerance [m]
    lib = table.lib
    source_depth = np.atleast_1d(np.asarray(source_depth, float))
    edges = _row_edges(profile, source_depth, rows)                                           # (D, R + 1)
    count = edges.shape[1] - 1
    middle = 0.5 * (edges[:, 1:] + edges[:, :-1])
    bins = rows * LOOKUP_PER_ROW
    lookup = _row_lookup(edges, bins)
    lanes = len(source_depth) * count
    # a launch angle off the row's middle moves vertices along the wavefront, also out of a thin slab
    margin = 0.1 + 0.01 * max_range
    accuracy, end, top, bottom = (dr.opaque(lib.Float64, float(v)) for v in
                                  (tolerance, max_range, slab[0] - margin, slab[1] + margin))
    depth = upload(lib.Float64, np.repeat(source_depth, count))
    angle = upload(lib.Float64, middle)
    # coincident edges make a row of no width, which no ray finds and which may never leave its depth
    wanted = upload(lib.UInt32, (np.diff(edges, axis=1) > NARROWEST).astype(np.uint32)) != 0
    edge32 = edges.astype(np.float32)
    edge32[:, -1] = 9.0                                     # no launch angle walks past the last row
    while True:
        stride = dr.opaque(lib.UInt32, max_vertices)
        vertex = dr.empty(lib.Float, 4 * lanes * max_vertices)
        size = dr.empty(lib.UInt32, lanes)
        full = _trace_rows(table, lib, depth, angle, wanted, accuracy, end, top, bottom, vertex, size, stride)
        dr.eval(vertex, size, full)
        if not dr.any(full):
            break
        max_vertices *= 2                                   # a duct bends rays many times: give the rows more room
    fans = RayFans(lib=lib, source_depth=source_depth, rows=dr.opaque(lib.UInt32, count), vertex=vertex, size=size,
                stride=stride, middle=upload(lib.Float, middle.astype(np.float32)), edge=upload(lib.Float, edge32),
                lookup=upload(lib.UInt32, lookup.astype(np.uint32)), bins=dr.opaque(lib.UInt32, bins),
                bins_per_radian=dr.opaque(lib.Float, bins / (2 * HALF_SPAN)))
    dr.eval(fans.middle, fans.edge, fans.lookup)
    return fans


def _row_edges(profile: SoundSpeedProfile, source_depth: np.ndarray, rows: int) -> np.ndarray:
    """Make equal rows, cut at the launch angles that just reach the speed of a node."""
    equal = np.linspace(-HALF_SPAN, HALF_SPAN, rows + 1)
    ratio = profile.at(source_depth)[:, None] / np.asarray(profile.sound_speed)[None]         # (D, node)
    critical = np.arccos(np.clip(ratio, -1, 1))                                 # 0 where the node is slower
    edges = np.concatenate([np.broadcast_to(equal, (len(source_depth), rows + 1)), critical, -critical], 1)
    edges = np.sort(edges, 1)
    # cuts that coincide in float32 would make rows that no angle finds: move them onto their neighbour
    edges[:, 1:] = np.where(np.diff(edges, axis=1) < NARROWEST, edges[:, :-1], edges[:, 1:])
    return edges


def _row_lookup(edges: np.ndarray, bins: int) -> np.ndarray:
    """Find the first row that can hold an angle of each equal bin; one bin early, for rounding."""
    start = -HALF_SPAN + 2 * HALF_SPAN * (np.arange(bins) - 0.01) / bins
    offset = 10.0 * np.arange(len(edges))[:, None]          # one sorted search for all ray fans
    found = np.searchsorted((edges + offset).ravel(), (start + offset).ravel(), side="right")
    row = found.reshape(len(edges), bins) - 1 - np.arange(len(edges))[:, None] * edges.shape[1]
    return np.clip(row, 0, edges.shape[1] - 2)


@dr.syntax
def _trace_rows(table: LayerTable, lib: ArrayTypes, depth: Float64, angle: Float64, wanted: Bool, tolerance: Float64,
                max_range: Float64, slab_top: Float64, slab_bottom: Float64, vertex: Float, size: UInt32,
                stride: UInt32) -> Bool:
    """Trace one row a lane along exact arcs, simplified by the swing-door rule within ±tolerance."""
    F, U = lib.Float64, lib.UInt32
    s, cosine = dr.sincos(angle)
    k = first_layer(table, depth, s)
    z_k, c_k, g_k, _ = table.shape(U(k))
    c0 = _fma(g_k, depth - z_k, c_k)
    p = cosine / c0
    launch = s / c0
    row = dr.arange(U, dr.width(angle))
    base = row * stride
    last = lib.Int32(table.last)
    # --------------------------------------------------------------- loop state
    z, r, v = F(depth), F(0), F(0)                     # present point and wavefront displacement
    m = U(0)                                           # vertices written
    r_a, z_a = F(0), F(depth)                          # anchor: start of the chord being stretched
    r_p, z_p, vr_p, vz_p = F(0), F(depth), F(0), F(0)  # previous point, the chord's end if the next one fails
    lo_r, lo_z, hi_r, hi_z = F(0), F(0), F(0), F(0)    # the open door: directions the chord may take
    fresh = lib.Bool(True)                             # no door yet
    inside = (depth >= slab_top)                       # has entered the slab (a source inside it has)
    started = lib.Bool(inside)
    first = lib.Bool(inside)
    full = lib.Bool(False)
    slab_bottom = dr.maximum(slab_bottom, depth + 1)   # a scene may lie above the source
    surface = dr.minimum(slab_top, 0)                  # above it there is nothing to hit, and no water
    active = wanted & (k >= 0) & (k <= last)
    while active:
        k2, z2, s2, advance, descent, c1, c2, g = arc_step(table, k, z, s, p, tolerance, active)
        r2 = r + advance
        v2 = wavefront_step(v, s, s2, descent, c1, c2, g, p, launch)
        # a ray leaves the region on a straight piece: cut it there, long chords cost precision
        cut = dr.minimum((max_range - r) / dr.maximum(advance, 1e-9),
                         dr.minimum((slab_bottom - z) / _select(z2 > slab_bottom, z2 - z, 1e-9),
                                    (z - surface) / _select(z2 < surface, z - z2, 1e-9)))
        leaves = (r2 > max_range) | (z2 > slab_bottom) | (z2 < surface)
        cut = _select(active & leaves & (cut > 0), dr.minimum(cut, 1), 1)
        r2, z2 = _fma(cut, advance, r), _select(cut < 1, _fma(cut, z2 - z, z), z2)
        v2 = _fma(cut, v2 - v, v)
        vr, vz = -v2 * s2, v2 * p * c2
        # entry into the slab
        enters = ~started & (z2 >= slab_top)
        f = dr.clip((slab_top - z) / _select(abs(z2 - z) > 1e-12, z2 - z, 1), 0, 1)
        r_p = _select(enters, _fma(f, r2 - r, r), r_p)
        z_p = _select(enters, slab_top, z_p)
        vr_p = _select(enters, _fma(f, vr - vr_p, vr_p), vr_p)
        vz_p = _select(enters, _fma(f, vz - vz_p, vz_p), vz_p)
        r_a, z_a = _select(enters, r_p, r_a), _select(enters, z_p, z_a)
        started |= enters
        fresh |= enters
        # does the new point still lie in the open door?
        dx, dz = r2 - r_a, z2 - z_a
        shut = started & ~fresh & ((lo_r * dz - lo_z * dx < 0) | (dx * hi_z - dz * hi_r < 0))
        emit = first | enters | shut
        _put(lib, vertex, base + m, r_p, z_p, vr_p, vz_p, emit)
        m = _select_number(emit, m + 1, m)
        first = lib.Bool(False)
        r_a, z_a = _select(shut, r_p, r_a), _select(shut, z_p, z_a)
        fresh |= shut
        # narrow the door by the directions that pass within ±tolerance of the new point
        dx, dz = r2 - r_a, z2 - z_a
        w = tolerance * dr.rsqrt(dr.maximum(_fma(dx, dx, dz * dz), 1e-18))
        narrow = (w < 0.7) & started
        w = _select(narrow, w, 0.7)
        cw = dr.sqrt(1 - w * w)
        ax, az = dx * cw + dz * w, dz * cw - dx * w
        bx, bz = dx * cw - dz * w, dz * cw + dx * w
        lower = narrow & (fresh | (lo_r * az - lo_z * ax > 0))
        upper = narrow & (fresh | (bx * hi_z - bz * hi_r > 0))
        lo_r, lo_z = _select(lower, ax, lo_r), _select(lower, az, lo_z)
        hi_r, hi_z = _select(upper, bx, hi_r), _select(upper, bz, hi_z)
        fresh &= ~narrow
        r_p, z_p, vr_p, vz_p = F(r2), F(z2), F(vr), F(vz)
        r, z, s, k, v = F(r2), F(z2), F(s2), k2, F(v2)
        room = m < stride - 2
        within = (cut >= 1) & (k >= 0) & (k <= last) & (r < max_range) & (z < slab_bottom) & ((z > surface) | (s > 0))
        full |= active & within & ~room
        active = active & within & room
    # a second scatter to the same array begins another kernel, which would walk all rays again
    dr.eval(m, r_p, z_p, vr_p, vz_p, started, full)
    started &= wanted
    _put(lib, vertex, base + m, r_p, z_p, vr_p, vz_p, started)
    m = _select_number(started, m + 1, m)
    dr.scatter(size, m, row)
    return full


def _put(lib: ArrayTypes, vertex: Float, index: UInt32, r: Float64, z: Float64, vr: Float64, vz: Float64,
         active: Bool) -> None:
    dr.scatter(vertex, lib.Array4f(lib.Float(r), lib.Float(z), lib.Float(vr), lib.Float(vz)), index, active)
