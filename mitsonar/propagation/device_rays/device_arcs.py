"""Arc of a ray inside one layer, as Dr.Jit numbers: its end, its time and length, and the wavefront after it.

The arc is circular. With p = cos θ / c constant along the ray, g = dc/dz, s = sin θ (positive down), κ = p g the
curvature (the ray turns towards slower water, dθ/dl = -κ), d the chord:

    s2² = s1² - p² (c2 - c1)(c2 + c1)            exit sine; negative: the ray turns inside the layer
    dr  = dz p (c1 + c2) / (s1 + s2)              horizontal advance, |dr| = (|s1| + |s2|)/|κ| when it turns
    V2  = (s2/s1) V1 + (s0/c0) dz (c1 + c2) / (s1 (s1 + s2))     wavefront displacement per launch radian
    t   = (d/√(c1c2)) asinh(u)/u,  u² = g² d² / (4 c1 c2)
    l   = d asin(w)/w,             w² = κ² d² / 4

(physics of plane-stratified media, e.g. Jensen et al., Computational Ocean Acoustics, ch. 3; the third line keeps V
finite through turning points). t and l hold for any two points of an arc, also with the turning point between them; the
forms of `numpy_rays.layer_arcs` take a layer's depth and sines instead, which keeps what a chord of float64 numbers
loses beside a turning point. Derivatives by the sound speed are in `arc_derivatives`.
"""
from __future__ import annotations

import drjit as dr

from mitsonar.device.types import Bool, Float64, Int32

from .layer_table import LayerTable


def arc_step(table: LayerTable, k: Int32, z: Float64, s: Float64, p: Float64, longest: Float64,
             active: Bool) -> tuple[Int32, Float64, Float64, Float64, Float64, Float64, Float64, Float64]:
    """Advance along the arc inside layer k to its end, or by an arc of squared length `longest`/|κ| at most.

    Returns the new layer, depth and sine, the advance (dr, dz), the speeds at both ends and the gradient.
    """
    lib = table.lib
    z_k, c_k, g, z_next = table.shape(lib.UInt32(k), active)
    c1 = dr.fma(g, z - z_k, c_k)
    c_next = dr.fma(g, z_next - z_k, c_k)
    curvature = p * g
    down = (s > 0) | ((s == 0) & (g < 0))
    ahead, behind = dr.select(down, c_next, c_k), dr.select(down, c_k, c_next)
    s_ahead = dr.fma(s, s, -p * p * (ahead - c1) * (ahead + c1))
    s_behind = dr.fma(s, s, -p * p * (behind - c1) * (behind + c1))
    turns = s_ahead <= 0
    leaves_down = down ^ turns
    s_exit = dr.sqrt(dr.maximum(dr.select(turns, s_behind, s_ahead), 0))
    c_exit = dr.select(turns, behind, ahead)
    z_exit = dr.select(leaves_down, z_next, z_k)
    dz = z_exit - z
    dr_exit = dr.select(turns, (abs(s) + s_exit) / dr.maximum(abs(curvature), 1e-20),
                        abs(dz) * p * (c1 + c_exit) / dr.maximum(abs(s) + s_exit, 1e-20))
    length2 = longest / dr.maximum(abs(curvature), 1e-12)
    whole = dr.fma(dr_exit, dr_exit, dz * dz) <= length2
    # part of the arc: turn by half the angle, walk the chord, turn again
    length = dr.sqrt(length2)
    half = dr.select(whole, 0, 0.5 * curvature * length)
    sin_half, cos_half = dr.sincos(half)
    cosine = p * c1
    s_mid, c_mid = s * cos_half - cosine * sin_half, cosine * cos_half + s * sin_half
    chord = length * (1 - half * half / 6)
    dr_part, dz_part, s_part = chord * c_mid, chord * s_mid, s_mid * cos_half - c_mid * sin_half
    advance, descent = dr.select(whole, dr_exit, dr_part), dr.select(whole, dz, dz_part)
    s2 = dr.select(whole, dr.select(leaves_down, s_exit, -s_exit), s_part)
    k2 = dr.select(whole, dr.select(leaves_down, k + 1, k - 1), k)
    z2 = dr.select(whole, z_exit, z + dz_part)
    c2 = dr.select(whole, c_exit, dr.fma(g, z2 - z_k, c_k))
    return k2, z2, s2, advance, descent, c1, c2, g


def wavefront_step(v: Float64, s1: Float64, s2: Float64, dz: Float64, c1: Float64, c2: Float64, g: Float64, p: Float64,
                   launch: Float64) -> Float64:
    """Return the displacement V after an arc; `launch` = s0/c0. The second form holds where s changes sign (turning).
    """
    total = s1 + s2
    plain = abs(total) > 1e-3 * abs(s1 - s2)
    s1 = dr.select(abs(s1) > 1e-12, s1, 1e-12)
    curved = dr.maximum(abs(p * p * g), 1e-30) * dr.sign(g)
    gain = dr.select(plain, dz * (c1 + c2) / (s1 * dr.select(plain, total, 1)), (1 - s2 / s1) / curved)
    return s2 / s1 * v + launch * gain


def first_layer(table: LayerTable, z: Float64, s: Float64) -> Int32:
    """Find the layer that a ray starts in: at a node, the one it is heading into."""
    k = table.lib.Int32(table.find(z))
    z_k, _, _, _ = table.shape(table.lib.UInt32(k))
    return dr.select((s < 0) & (z <= z_k), k - 1, k)


def arc_time(c1: Float64, c2: Float64, g: Float64, d2: Float64) -> Float64:
    """Return the travel time [s] of an arc between two points of squared distance d2 [m²] in one layer."""
    product = c1 * c2
    u2 = 0.25 * g * g * d2 / product
    ratio = dr.fma(u2, 6435 / 557056, -143 / 10240)
    for coefficient in (231 / 13312, -63 / 2816, 35 / 1152, -5 / 112, 3 / 40, -1 / 6, 1.0):
        ratio = dr.fma(ratio, u2, coefficient)
    u = dr.sqrt(u2)
    ratio = dr.select(u2 > 0.02, dr.asinh(u) / dr.maximum(u, 1e-9), ratio)
    return dr.sqrt(d2 / product) * ratio


def arc_length(curvature: Float64, d2: Float64) -> Float64:
    """Return the length [m] of an arc over a chord of squared length d2 [m²]."""
    w2 = 0.25 * curvature * curvature * d2
    ratio = 35 / 1152 + w2 * 63 / 2816
    for coefficient in (5 / 112, 3 / 40, 1 / 6, 1.0):
        ratio = dr.fma(ratio, w2, coefficient)
    w = dr.minimum(dr.sqrt(w2), 1)
    ratio = dr.select(w2 > 0.02, dr.asin(w) / dr.maximum(w, 1e-9), ratio)
    return dr.sqrt(d2) * ratio


def sine_on_branch(p: Float64, s1: Float64, c1: Float64, c2: Float64) -> Float64:
    """Return the sine where the speed is c2, on the same side of the turning point as s1."""
    return dr.sqrt(dr.maximum(s1 * s1 - p * p * (c2 - c1) * (c2 + c1), 0)) * dr.sign(s1)
