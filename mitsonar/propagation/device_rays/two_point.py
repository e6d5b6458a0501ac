"""Exact eigenray from a source to a hit, given the nearly right ray that found the hit.

With H the depth difference, <·> the mean over depth between the two points, s² = <1/c²>, m_n the central moments of
1/c², q² = s² - p², a_n = m_n / q^2n (expand the ray integrals about the mean; the code scales 1/c² by r0):

    X(p) = (H p / q) (1 + 3/8 a2 - 5/16 a3 + 35/128 a4)
    D    = dX/dp = (H / q) [... + (p/q)² (1 + 15/8 a2 - 35/16 a3 + 315/128 a4)]
    T    = p X + H q (1 - a2/8 + a3/16 - 5 a4/128)      at p one Newton step from the launched ray: stationary (Fermat)
    S    = H s/q (1 + ...)                                                       arc length
    A    = X |D| |sin θ| |sin θ0| / (c0 cos θ0)                                  ray-tube area per steradian

Relative error of T about 0.03 a4^1.25. Where a4 is above `SERIES_LIMIT`, and for rays that turned, the launched ray is
walked arc by arc instead (`walk`), exact in the launch angle, and carried the last millimetres dz to the hit by the
eikonal's second-order expansion, a along the ray and δ across it (`_carry`):

    T = T_ray + a/c - (g s a² + 2 g cos θ a δ) / (2 c²) + δ² / (2 c R_w),     a = s dz, δ = cos θ dz

R_w the wavefront's radius: V / (dθ/dθ0), dθ/dθ0 = (c s0/c0 - p g V cos θ) / s.
"""
from typing import cast

import drjit as dr
import numpy as np

from mitsonar.device.arrays import upload
from mitsonar.device.types import ArrayTypes, Bool, Float, Float64, Record, UInt32

from .device_arcs import arc_length, arc_step, arc_time, first_layer, wavefront_step
from .layer_table import LayerTable

SERIES_LIMIT = 2e-6
FAR_OFF = 0.02             # [m] a ray that passes its hit by more is aimed again, and its hit stays on its chord
SLANT = 0.01               # cosine between a facet's normal and a ray, below which a hit stays on its chord
LEVEL = 5e-3               # depth difference over distance below which moments are rounding noise
MAX_TUBE_GAIN = 1e4        # spreading area is kept above distance²/this: energy at a caustic stays finite


class SourceState(Record):
    """Medium at the source depths: Float64 (8 D,) rows of depth, sound speed, two unused, M_1..M_4."""

    rows: Float64

    def gather(self, lib: ArrayTypes, index: UInt32) -> tuple[Float64, Float64, list[Float64]]:
        """Return depth, sound speed and moments at the source of each ray (index UInt32 of the source)."""
        head = dr.gather(lib.Array4f64, self.rows, 2 * index)
        moments = dr.gather(lib.Array4f64, self.rows, 2 * index + 1)
        return head[0], head[1], [moments[i] for i in range(4)]


class PointState(Record):
    """Medium at one point per ray: depth, sound speed and moments, Float64 (R,)."""

    depth: Float64
    speed: Float64
    gradient: Float64
    moments: list[Float64]

    @classmethod
    def at(cls, table: LayerTable, depth: Float64) -> "PointState":
        """Return the medium at depths (R,) [m]."""
        speed, gradient, moments = table.medium(depth)
        return cls(depth=depth, speed=speed, gradient=gradient, moments=moments)

    def gather(self, lib: ArrayTypes, index: UInt32) -> tuple[Float64, Float64, list[Float64]]:
        """Return the same as `SourceState.gather`; the index is ignored."""
        return self.depth, self.speed, self.moments


def source_state(table: LayerTable, source_depth: np.ndarray) -> SourceState:
    """Evaluate the medium once per source depth ((D,) array [m])."""
    lib = table.lib
    z = upload(lib.Float64, source_depth)
    c, moments = table.at(z)
    count = dr.width(z)
    rows = dr.empty(lib.Float64, 8 * count)
    index = dr.arange(lib.UInt32, count)
    dr.scatter(rows, lib.Array4f64(z, c, 0, 0), 2 * index)
    dr.scatter(rows, lib.Array4f64(*moments), 2 * index + 1)
    dr.eval(rows)
    return SourceState(rows=rows)


def _means(lib: ArrayTypes, end: PointState, z0: Float64,
           moments0: list[Float64]) -> tuple[Float64, Float64, Float64, Float, Float]:
    """Return H, and the mean and the central moments m_2, m_3, m_4 of 1/c² between two depths, over r0."""
    F = lib.Float
    height = abs(end.depth - z0)
    per_height = dr.sign(end.depth - z0) / dr.maximum(height, 1e-9)
    n1, n2, n3, n4 = ((end.moments[i] - moments0[i]) * per_height for i in range(4))
    m2 = n2 - n1 * n1
    m3 = F(n3 - n1 * (3 * n2 - 2 * n1 * n1))
    m4 = F(n4 - n1 * (4 * n3 - n1 * (6 * n2 - 3 * n1 * n1)))
    return height, n1, m2, m3, m4


def _series(table: LayerTable, lib: ArrayTypes, p: Float64, x: Float64, end: PointState, z0: Float64,
            moments0: list[Float64]) -> tuple[Float64, Float, Float, Float, Float64, Float, Float]:
    """Evaluate the O(1) series: T, D, S, X/p, refined p, a4 (NaN or large where the series is invalid) and the
    horizontal miss of the launched ray.

    Time and p are float64. The miss, which enters T squared, and D and S are float32 for twice as many lanes.
    """
    F, wide = lib.Float, lib.Float64
    height, n1, m2, m3, m4 = _means(lib, end, z0, moments0)
    # p and q in units of sqrt(r0): s² = 1 + <e>
    s2 = 1 + n1
    root = dr.sqrt(table.reference)
    per_root = F(dr.rcp(root))
    h, y = F(height), F(x)
    # one cheap Newton step from the launched ray to the eigenray, two terms deep
    scaled = F(p) * per_root
    w = dr.rcp(F(s2 - p * p * table.scale))
    q = dr.sqrt(w)                                                     # 1/q
    a2 = F(m2) * w * w
    slope = h * q * (1 + 0.375 * a2 + scaled * scaled * w * (1 + 1.875 * a2))
    first_miss = y - h * scaled * q * (1 + 0.375 * a2)
    p = p + wide(first_miss / slope) * root
    # the series at the eigenray
    q2 = s2 - p * p * table.scale
    wide_w = dr.rcp(q2)
    wide_a2 = m2 * wide_w * wide_w
    w, a2 = F(wide_w), F(wide_a2)
    a3, a4 = m3 * w * w * w, m4 * (w * w) * (w * w)
    higher = a3 * (1 / 16) - (5 / 128) * a4
    time = p * x + height * root * dr.sqrt(q2) * (1 - 0.125 * wide_a2 + wide(higher))
    q, p2 = dr.sqrt(w), F(p * p * table.scale)                         # 1/q
    per_p = h * q * (1 + 0.375 * a2 - 0.3125 * a3 + (35 / 128) * a4)
    slope = per_p + h * q * p2 * w * (1 + 1.875 * a2 - 2.1875 * a3 + (315 / 128) * a4)
    s2 = F(s2)
    u = F(q2) / s2
    b1, b2, b3, b4 = 0.5 * u, -0.125 * u * u, u * u * u / 16, -(5 / 128) * u * u * u * u
    arc = h * dr.sqrt(s2) * q * (
        1 + a2 * (0.375 - 0.5 * b1 + b2) + a3 * (-0.3125 + 0.375 * b1 - 0.5 * b2 + b3)
        + a4 * (35 / 128 - 0.3125 * b1 + 0.375 * b2 - 0.5 * b3 + b4))
    return time, slope * per_root, arc, per_p * per_root, p, a4, first_miss


@dr.syntax
def walk(table: LayerTable, lib: ArrayTypes, z0: Float64, c0: Float64, s0: Float64, p: Float64, x: Float64,
         active: Bool) -> tuple[Float64, Float64, Float64, Float64, Float64, Float64, Float64]:
    """Walk the launched ray to horizontal distance x; returns depth, time, arc length, V, sine, speed and
    gradient there."""
    F = lib.Float64
    z, s, r, t, arc, v, c, g_end = F(z0), F(s0), F(0), F(0), F(0), F(0), F(c0), F(0)
    k = first_layer(table, z, s)
    last_layer = lib.Int32(table.last)
    active = lib.Bool(active) & (x > 0) & (k >= 0) & (k <= last_layer)
    while active:
        k2, z2, s2, advance, descent, c1, c2, g = arc_step(table, k, z, s, p, F(1e30), active)
        curvature = p * g
        # the last arc ends at x: the sine falls linearly along it, s2 = s1 - κ dr
        ends = ~(r + advance < x)                            # so that NaN ends, too
        rest = x - r
        s_end = s - curvature * rest
        cosine = dr.sqrt(dr.maximum(1 - s_end * s_end, 0))
        descent = dr.select(ends, rest * (s + s_end) / (p * c1 + cosine), descent)
        advance = dr.select(ends, rest, advance)
        s2 = dr.select(ends, s_end, s2)
        c2 = dr.select(ends, dr.fma(g, descent, c1), c2)
        z2 = dr.select(ends, z + descent, z2)
        d2 = advance * advance + descent * descent
        t += arc_time(c1, c2, g, d2)
        arc += arc_length(curvature, d2)
        v = wavefront_step(v, s, s2, descent, c1, c2, g, p, s0 / c0)
        r += advance
        z, s, c, g_end, k = F(z2), F(s2), F(c2), F(g), k2
        active = active & ~ends & (k >= 0) & (k <= last_layer)
    return z, t, arc, v, s, c, g_end


def _carry(p: Float64, s: Float64, c: Float64, g: Float64, v: Float64, launch: Float64,
           dz: Float64) -> tuple[Float64, Float64]:
    """Return the change of time and ray parameter over a short step down from a point of a ray; `launch` = s0/c0."""
    cosine = p * c
    a, d = s * dz, cosine * dz
    level = abs(s) < 0.02                                    # the wavefront's radius is 0/0 where the ray runs level
    bend = dr.select(level, 0, (c * launch - p * g * v * cosine) / dr.select(level, 1, s * v * c))
    t_aa, t_ad = -g * s / (c * c), -g * cosine / (c * c)
    dt = a / c + 0.5 * (t_aa * a * a + 2 * t_ad * a * d + bend * d * d)
    dp = cosine * (t_aa * a + t_ad * d) - s * (t_ad * a + bend * d)
    return dt, dp


def to_hit(table: LayerTable, lib: ArrayTypes, source: SourceState | PointState, source_index: UInt32, s0: Float64,
           cosine0: Float64, x: Float64, end: PointState, valid: Bool, tolerance: Float64,
           facing: tuple[Float, Float] | None = None) -> tuple[
               Float64, Float, Float, Float64, Float, Float64, tuple[Float, Float]]:
    """Find travel time, arc length, spreading and directions of the eigenray from source to hit.

    With `facing`, the facet's normal along the heading and downwards, a hit first moves within its facet on to the ray
    as launched, which the last results tell. The ray passes a hit I at Q, m = x - X before it or dz above it, and goes
    on from there along its tangent t to the plane of normal n:

        I' = Q + t n·(I - Q) / n·t,     I - Q = (m, 0) or (0, dz)

    Neighbouring rows of a fan have different chords; without this, their hits would gape or crowd.
    """
    # source_index (R,); s0, cosine0 (R,); x (R,) [m]; valid (R,); tolerance [m] -> travel_time [s], arc_length [m],
    # spreading_area [m²/sr], ray_parameter [s/m], arrival_sine, sound_speed [m/s], move onwards and down [m]
    F, z = lib.Float, end.depth
    z0, c0, moments0 = source.gather(lib, source_index)
    p0, c, x_q = cosine0 / c0, lib.Float64(end.speed), x
    step, move = F(0), (F(0), F(0))
    if facing is not None:
        cosine = F(p0 * c)
        sine = cast(Float, dr.copysign(dr.sqrt(dr.maximum(1 - cosine * cosine, 0)), F(s0)))
        miss = F(x) - _range(table, lib, p0, end, z0, moments0)
        step, *move = _onto_ray(facing, miss, F(0), cosine, sine)
        x_q = dr.select(move[0] == 0, x, x - lib.Float64(miss))
    # to Q, or to the hit if it does not move
    time, slope, arc, range_per_p, p, a4, miss = _series(table, lib, p0, x_q, end, z0, moments0)
    sine0 = dr.sqrt(F(dr.maximum(1 - p * p * c0 * c0, 0)))
    sine = dr.sqrt(F(dr.maximum(1 - p * p * c * c, 0)))
    area = range_per_p * slope * sine * sine0 / F(c0 * c0)             # X |D| sinθ sinθ0 / (c0 cosθ0), cosθ0 = p c0
    sine = dr.select(z < z0, -sine, sine)
    if facing is not None:
        area *= 1 + 2 * step / arc
        time, arc = time + _time_ahead(end.gradient, c, sine, step), arc + step
        c = c + end.gradient * lib.Float64(move[1])
    # the ray heads away from the hit, or missed it: it turned; or the series is too slow: walk the arcs
    direct = ((z - z0) * s0 > 0) & (p0 * c < 1) & (abs(miss) < F(10 * tolerance + 0.05 * x))
    # a4 >= 0 but for rounding, which is what is left of it where the depths nearly agree
    close = abs(z - z0) < LEVEL * x
    bent = valid & ~(direct & (abs(a4) < SERIES_LIMIT) & ~close)
    time, arc, area, p, sine, c, *move = _by_walking(
        table, lib, z0, c0, s0, cosine0, x, z, facing, bent, (time, arc, area, p, sine, c, *move))
    area = dr.maximum(area, F(x * x + dr.square(z - z0)) * (1 / MAX_TUBE_GAIN))
    return time, arc, area, p, sine, c, (move[0], move[1])


def _range(table: LayerTable, lib: ArrayTypes, p: Float64, end: PointState, z0: Float64,
           moments0: list[Float64]) -> Float:
    """Return X(p), to its third term."""
    F = lib.Float
    height, n1, m2, m3, _ = _means(lib, end, z0, moments0)
    w = dr.rcp(F(1 + n1 - p * p * table.scale))
    a2 = F(m2) * w * w
    return F(height) * dr.sqrt(w) * F(p / dr.sqrt(table.reference)) * (1 + 0.375 * a2 - 0.3125 * m3 * w * w * w)


def _onto_ray(facing: tuple[Float, Float], x: Float, z: Float, cosine: Float,
              sine: Float) -> tuple[Float, Float, Float]:
    """Return how far a ray goes on from Q, and the move I' - I; 0 where it hardly meets the facet or is far off."""
    # facing, n; x, z (R,) [m], I - Q; cosine, sine (R,), t
    onwards, down = facing
    towards = dr.fma(onwards, cosine, down * sine)
    step = dr.fma(onwards, x, down * z) / towards
    moves = (abs(towards) > SLANT) & (abs(dr.fma(x, sine, z * cosine)) < FAR_OFF)
    return (dr.select(moves, step, 0), dr.select(moves, dr.fma(step, cosine, -x), 0),
            dr.select(moves, dr.fma(step, sine, -z), 0))


def _time_ahead(g: Float64, c: Float64, sine: Float | Float64, step: Float | Float64) -> Float64:
    """Return the time [s] that a ray takes for a step (R,) [m]."""
    way = type(c)(step)
    return way / c - g * type(c)(sine) * way * way / (2 * c * c)


@dr.syntax
def _by_walking(table, lib, z0, c0, s0, cosine0, x, z, facing, bent, found):
    """Return what `to_hit` does where rays are `bent`, by walking their arcs; elsewhere what was `found`."""
    F = lib.Float
    time, arc, area, p, sine, c, onwards, down = found
    if bent:
        p0 = cosine0 / c0
        z_x, t_x, arc_x, v, s_x, c_x, g_x = walk(table, lib, z0, c0, s0, p0, x, bent)
        dz = z - z_x
        # beside a critical angle a row bends away from its rays: aim again, dz = V dθ0 / cos θ at fixed distance
        again = bent & (abs(dz * p0 * c_x) > FAR_OFF)
        if again:
            turn = dr.clip(dz * p0 * c_x / dr.select(abs(v) > 1e-3, v, 1e-3), -1e-2, 1e-2)
            s_a, cosine_a = s0 + cosine0 * turn, cosine0 - s0 * turn
            unit = dr.rsqrt(s_a * s_a + cosine_a * cosine_a)
            s_a, cosine_a = s_a * unit, cosine_a * unit
            z_a, t_a, arc_a, v_a, s_b, c_a, g_a = walk(table, lib, z0, c0, s_a, cosine_a / c0, x, again)
            better = again & (abs(z - z_a) < abs(dz))
            s0, cosine0 = dr.select(better, s_a, s0), dr.select(better, cosine_a, cosine0)
            p0 = cosine0 / c0
            t_x, arc_x, v = dr.select(better, t_a, t_x), dr.select(better, arc_a, arc_x), dr.select(better, v_a, v)
            s_x, c_x, g_x = dr.select(better, s_b, s_x), dr.select(better, c_a, c_x), dr.select(better, g_a, g_x)
            dz = dr.select(better, z - z_a, dz)
        if dr.hint(facing is not None, mode="scalar"):
            tangent = F(p0 * c_x), F(s_x)
            step, onwards, down = _onto_ray(facing, F(0), F(dz), *tangent)
            # the arc leaves its tangent by p g cos θ step² / 2
            more = _onto_ray(facing, F(0), F(0.5 * p0 * g_x) * tangent[0] * step * step, *tangent)
            onwards, down = dr.select(again, 0, onwards + more[1]), dr.select(again, 0, down + more[2])
            # along the ray, so that only what is left of dz is carried
            ahead = lib.Float64(dr.select(again, 0, step + more[0]))
            t_x += _time_ahead(g_x, c_x, s_x, ahead)
            arc_x += ahead
            dz += lib.Float64(down) - ahead * s_x
            c_x += g_x * s_x * ahead
        dt, dp = _carry(p0, s_x, c_x, g_x, v, s0 / c0, dz)
        time, arc, p = t_x + dt, F(arc_x + s_x * dz), p0 + dp
        area = F(x * abs(v) / dr.maximum(cosine0, 1e-9))
        c = dr.fma(g_x, dz, c_x)
        sine = cast(Float, dr.copysign(dr.sqrt(F(dr.maximum(1 - p * p * c * c, 0))), F(s_x)))
    return time, arc, area, p, sine, c, onwards, down
