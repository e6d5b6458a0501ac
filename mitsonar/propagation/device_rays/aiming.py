"""Aiming: launch angle of the ray from a source to a point, accurate enough for `two_point.to_hit`.

In the mean water between the two depths, t = p / q solves

    X = H t (1 + 3/8 a2(t))                                 H depth difference, a2 as in `two_point`

by fixed point, which is a ray to a few centimetres. Where the series is too slow, or the ray turns, the launched ray is
walked arc by arc and turned by dθ0 = dz cos θ / V until it passes the point, between a ray that passes above it and one
that passes below.
"""
from typing import cast

import drjit as dr

from mitsonar.device.types import ArrayTypes, Bool, Float64, UInt32

from .layer_table import LayerTable
from .two_point import LEVEL, SERIES_LIMIT, PointState, SourceState, walk

AIMING_STEPS = 4
WALKS = 16
CLOSE_ENOUGH = 0.01            # [m] largest miss of a walked ray, which `to_hit` carries to the point
CLOSE_BY = 1e-4                # [m] largest miss here: beside grazing rays, carrying is wrong by nanoseconds


def aim(table: LayerTable, lib: ArrayTypes, source: SourceState | PointState, source_index: UInt32,
        x: Float64, z: Float64, active: Bool,
        water: tuple[Float64, list[Float64]] | None = None) -> tuple[Float64, Float64, Bool]:
    """Find the launch angle of the ray from a source to a point; `water` is `LayerTable.at(z)`, if it is known."""
    # source_index (R,); x, z (R,) [m]; active (R,) -> sine, cosine (R,), found (R,)
    F = lib.Float64
    z0, c0, moments0 = source.gather(lib, source_index)
    c, moments = table.at(z) if water is None else water
    height = abs(z - z0)
    close = height < LEVEL * x
    per_height = dr.sign(z - z0) / dr.maximum(height, 1e-9)
    n1, n2 = ((moments[i] - moments0[i]) * per_height for i in range(2))
    n1 = dr.select(close, 0.5 * (dr.rcp(c0 * c0) + dr.rcp(c * c)) * table.scale - 1, n1)
    s2, m2 = 1 + n1, dr.select(close, 0, dr.maximum(n2 - n1 * n1, 0))
    start = x / dr.maximum(height, 1e-3)
    t, a2 = F(start), F(0)
    for _ in range(AIMING_STEPS):
        w = (1 + t * t) / s2                                           # 1/q²
        a2 = m2 * w * w
        t = start / (1 + 0.375 * dr.minimum(a2, 1))
    # slightly off the horizontal where the mean water has no ray: such a ray is walked
    p2 = s2 / table.scale * t * t / (1 + t * t)
    cosine = dr.minimum(dr.sqrt(p2) * c0, 1 - 1e-7)
    sine = cast(Float64, dr.copysign(dr.sqrt(1 - cosine * cosine), z - z0))
    sine = dr.select(abs(sine) < 1e-12, 1e-12, sine)
    doubtful = active & (close | (a2 * a2 > SERIES_LIMIT) | (cosine > 1 - 1e-6) | (p2 * c * c >= 1))
    sine, cosine, failed = _walked(table, lib, z0, c0, sine, cosine, x, z, doubtful)
    return sine, cosine, active & ~failed


@dr.syntax
def _walked(table: LayerTable, lib: ArrayTypes, z0: Float64, c0: Float64, sine: Float64, cosine: Float64, x: Float64,
            z: Float64, active: Bool) -> tuple[Float64, Float64, Bool]:
    """Turn rays until they pass (x, z); return their sines, cosines and a mask of rays that never pass.

    By Newton's method, held between the last ray that passed above and the last that passed below.
    """
    F = lib.Float64
    left = lib.UInt32(WALKS)
    one = dr.opaque(lib.UInt32, 1)
    upper_sine, upper_cosine, lower_sine, lower_cosine = F(-1), F(0), F(1), F(0)
    while active & (left > 0):
        z_x, t_x, arc_x, v, s_x, c_x, g_x = walk(table, lib, z0, c0, sine, cosine / c0, x, active)
        dz = z - z_x
        active = active & (abs(dz) > CLOSE_BY)
        above = dz > 0
        upper_sine, upper_cosine = dr.select(above, sine, upper_sine), dr.select(above, cosine, upper_cosine)
        lower_sine, lower_cosine = dr.select(above, lower_sine, sine), dr.select(above, lower_cosine, cosine)
        # V vanishes near a caustic: use the straight ray's lever instead
        lever = dr.select(abs(v) > 0.05 * x, v, dr.maximum(x, 1e-3))
        turn = dr.clip(dz * (cosine / c0) * c_x / lever, -0.1, 0.1)
        turned_sine, turned_cosine = sine + cosine * turn, cosine - sine * turn
        # sines of the angles from the bounds
        within = ((turned_sine * upper_cosine - turned_cosine * upper_sine > 0)
                  & (lower_sine * turned_cosine - lower_cosine * turned_sine > 0))
        turned_sine = dr.select(within, turned_sine, upper_sine + lower_sine)
        turned_cosine = dr.select(within, turned_cosine, upper_cosine + lower_cosine)
        unit = dr.rsqrt(dr.maximum(turned_sine * turned_sine + turned_cosine * turned_cosine, 1e-12))
        sine = dr.select(active, turned_sine * unit, sine)
        cosine = dr.select(active, turned_cosine * unit, cosine)
        left -= one
    return sine, cosine, active
