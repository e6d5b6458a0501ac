"""Walk rays arc by arc: range, time and spread as functions of profile, source depth and launch.

For the launched ray, at a fixed depth z of its hit, however often it turned before:

    dX = Σ_k ∂X/∂c_k dc_k + D dp - (p c0/s0) dz0,      D = dX/dp at fixed depths, both sums over its arcs
    dT = p dX - Σ_k φ_k dc_k - (s0/c0) dz0,            φ_k = ∫ hat_k / (c² s) dz   (Fermat)
    dD = dD/dp dp + Σ_k ∂D/∂c_k dc_k - (c0 / s0³) dz0
    dp = -(s0 ds0 / cos θ0 + p (Σ_k hat_k(z0) dc_k + g0 dz0)) / c0

hat_k -> the share of node k in the speed at a depth; s0 -> the sine of the launch angle, positive down. Arcs as in
`propagation.arc_derivatives`. No loop is differentiated: the walk is repeated, forward with the tangents of the nodes
it passes, backward with the weights of its end.
"""
from __future__ import annotations

from collections.abc import Callable
from typing import cast

import drjit as dr
import numpy as np

from mitsonar.device.arrays import looped, upload
from mitsonar.device.types import ArrayTypes, Bool, Float64, Int32, Record, UInt32
from mitsonar.propagation.device_rays.arc_derivatives import (
    ArcDerivatives,
    SpreadDerivatives,
    arc_derivatives,
    spread_derivatives,
)
from mitsonar.propagation.device_rays.device_arcs import arc_step, arc_time, first_layer, sine_on_branch
from mitsonar.propagation.device_rays.layer_table import LayerTable
from mitsonar.propagation.device_rays.two_point import walk

from .layers import layer_places

LEVEL_LAUNCH = 1e-7        # sine of a launch that is told from a level one: 0.1 mm in a kilometre
ELSEWHERE, NEAR = 0.05, 1.0    # of the range, and [m]: a ray that comes to the depth so far from the range misses it
Walked = tuple[Float64, Float64, Float64]
Visit = Callable[[UInt32, Float64, ArcDerivatives, SpreadDerivatives, Bool], Walked]


class _Nodes(Record):
    """Hold the nodes of the profile above and below each layer."""

    lib: ArrayTypes
    upper: UInt32            # UInt32 (L,)
    lower: UInt32
    depth: Float64           # Float64 (L,) of the upper node [m]
    per_metre: Float64       # Float64 (L,) one over their distance, 0 beyond the profile

    def of(self, layer: UInt32, active: Bool) -> tuple[UInt32, UInt32, Float64, Float64]:
        """Return upper and lower node, depth of the upper one and one over their distance."""
        whole, real = self.lib.UInt32, self.lib.Float64
        return (dr.gather(whole, self.upper, layer, active), dr.gather(whole, self.lower, layer, active),
                dr.gather(real, self.depth, layer, active), dr.gather(real, self.per_metre, layer, active))


class _Start(Record):
    """Hold the beginning of rays, Float64 (R,)."""

    depth: Float64
    sine: Float64
    cosine: Float64
    layer: UInt32
    speed: Float64
    gradient: Float64
    parameter: Float64


class _WalkSums(Record):
    """Hold sums over the arcs of rays, Float64 (R,): dX/dp, d²X/dp², and the sums of visits."""

    spread: Float64
    by_parameter: Float64
    first: Float64
    second: Float64
    third: Float64


def walked(table: LayerTable, lib: ArrayTypes, speeds: Float64, z0: Float64, s0: Float64, z: Float64, x: Float64,
           active: Bool) -> Walked:
    """Return range, travel time and spread [m²/s] of launched rays to a depth, with their gradients.

    Relative errors of gradients are about 1e-10. For a source at the depth of a node, the gradients by depth are those
    of the side that the ray heads into.
    """
    detached = LayerTable(**{**vars(table), "layers": dr.detach(table.layers)})
    return dr.custom(_WalkedRay, detached, _nodes(detached), speeds, z0, s0, dr.detach(z), dr.detach(x), active)


class _WalkedRay(dr.CustomOp):
    """Walk rays, with derivatives; see `walked`."""

    def eval(self, table: LayerTable, nodes: _Nodes, speeds: Float64, z0: Float64, s0: Float64, z: Float64,
             x: Float64, active: Bool) -> Walked:
        lib = table.lib
        start = _start(table, z0, s0)
        depth, time, _, _, s, c, g = walk(table, lib, z0, start.speed, s0, start.parameter, x, active)
        # the last millimetres along the same arc
        rest = z - depth
        c_z = dr.fma(g, rest, c)
        s_z = sine_on_branch(start.parameter, s, c, c_z)
        ahead = rest * start.parameter * (c + c_z) / (s + s_z)
        aside = arc_time(c, c_z, g, dr.fma(ahead, ahead, rest * rest)) * dr.sign(rest * s)
        reach, time = x + ahead, time + aside
        # a ray that turned on its way, or comes by elsewhere, has no gradient here
        self.arrives = active & dr.isfinite(time) & (abs(ahead) <= ELSEWHERE * x + NEAR)
        self.inputs = table, nodes, dr.width(speeds), z0, s0, z, x
        spread = _followed(table, start, z, x, self.arrives, _nothing).spread
        return dr.select(self.arrives, reach, x), dr.select(self.arrives, time, 0), dr.select(self.arrives, spread, 1)

    def forward(self) -> None:
        table, nodes, count, z0, s0, z, x = self.inputs
        lib, start = table.lib, _start(table, z0, s0)
        tangents = cast(Float64, self.grad_in("speeds"))
        tangents = tangents if dr.width(tangents) == count else dr.zeros(lib.Float64, count)

        def visit(layer: UInt32, place: Float64, arc: ArcDerivatives, wide: SpreadDerivatives, on: Bool) -> Walked:
            upper, lower, depth, per_metre = nodes.of(layer, on)
            above, below = (dr.gather(lib.Float64, tangents, node, on) for node in (upper, lower))
            slope = (below - above) * per_metre
            there = above + slope * (place - depth)
            return (dr.fma(there, arc.range, slope * arc.range_slope),
                    dr.fma(there, arc.time, slope * arc.time_slope), dr.fma(there, wide.speed, slope * wide.slope))

        way = _followed(table, start, z, x, self.arrives, visit)
        upper, lower, depth, per_metre = nodes.of(start.layer, self.arrives)
        above, below = (dr.gather(lib.Float64, tangents, node, self.arrives) for node in (upper, lower))
        dz0, ds0 = cast(Float64, self.grad_in("z0")), cast(Float64, self.grad_in("s0"))
        dc0 = above + (below - above) * per_metre * (z0 - depth) + start.gradient * dz0
        dp = -(start.sine * ds0 / start.cosine + start.parameter * dc0) / start.speed
        dx = way.first + way.spread * dp - start.parameter * start.speed / start.sine * dz0
        dt = start.parameter * dx - way.second - start.sine / start.speed * dz0
        wider = way.third + way.by_parameter * dp - start.speed / start.sine ** 3 * dz0
        self.set_grad_out((dr.select(self.arrives, dx, 0), dr.select(self.arrives, dt, 0),
                           dr.select(self.arrives, wider, 0)))

    def backward(self) -> None:
        table, nodes, count, z0, s0, z, x = self.inputs
        lib, start, on = table.lib, _start(table, z0, s0), self.arrives
        by_x, by_t, by_d = (dr.select(on, weight, 0) for weight in cast(Walked, self.grad_out()))
        by_x = by_x + start.parameter * by_t
        gradient = dr.zeros(lib.Float64, count)

        def add(layer: UInt32, place: Float64, whole: Float64, slope: Float64, wanted: Bool) -> None:
            """Add weights of the speed at a depth and of its gradient there to the nodes."""
            upper, lower, depth, per_metre = nodes.of(layer, wanted)
            below = (whole * (place - depth) + slope) * per_metre
            dr.scatter_add(gradient, below, lower, wanted)
            dr.scatter_add(gradient, whole - below, upper, wanted)

        def visit(layer: UInt32, place: Float64, arc: ArcDerivatives, wide: SpreadDerivatives, wanted: Bool) -> Walked:
            add(layer, place, by_x * arc.range - by_t * arc.time + by_d * wide.speed,
                by_x * arc.range_slope - by_t * arc.time_slope + by_d * wide.slope, wanted)
            return lib.Float64(0), lib.Float64(0), lib.Float64(0)

        way = _followed(table, start, z, x, on, visit)
        by_p = (by_x * way.spread + by_d * way.by_parameter) / start.speed
        by_c0 = dr.select(on, -start.parameter * by_p, 0)
        add(start.layer, z0, by_c0, lib.Float64(0), on)
        by_z0 = (by_c0 * start.gradient - by_x * start.parameter * start.speed / start.sine
                 - by_t * start.sine / start.speed - by_d * start.speed / start.sine ** 3)
        by_s0 = -by_p * start.sine / start.cosine
        self.set_grad_in("speeds", gradient)
        self.set_grad_in("z0", _fitted(dr.select(on, by_z0, 0), z0))
        self.set_grad_in("s0", _fitted(dr.select(on, by_s0, 0), s0))


def _followed(table: LayerTable, start: _Start, z: Float64, x: Float64, active: Bool,
              visit: Visit) -> _WalkSums:
    """Follow rays to a depth, and return the sums over their arcs."""
    lib = table.lib
    F, last, p = lib.Float64, lib.Int32(table.last), start.parameter
    k = lib.Int32(start.layer)

    def going(on: Bool, *_: Int32 | Float64) -> Bool:
        return on

    def body(on: Bool, k: Int32, z1: Float64, s1: Float64, r: Float64, spread: Float64, by_range: Float64,
             by_time: Float64, by_spread: Float64, by_parameter: Float64) -> tuple:
        k2, z2, s2, advance, descent, c1, c2, g = arc_step(table, k, z1, s1, p, F(1e30), on)
        ends = ~(r + advance < x)
        # the last arc ends at the depth, on the branch that it is on at the range
        branch = s1 - p * g * (x - r)
        c_z = dr.fma(g, z - z1, c1)
        s_z = dr.copysign(abs(sine_on_branch(p, s1, c1, c_z)), branch)
        descent, c2, s2 = (dr.select(ends, mine, other) for mine, other in
                           ((z - z1, descent), (c_z, c2), (s_z, s2)))
        arc = arc_derivatives(p, g, descent, c1, s1, c2, s2)
        wide = spread_derivatives(p, g, descent, c1, s1, c2, s2)
        first, second, third = visit(lib.UInt32(k), z1, arc, wide, on)
        on = on & ~ends & (k2 >= 0) & (k2 <= last)
        return (on, k2, z2, s2, r + advance, spread + arc.spread, by_range + first, by_time + second,
                by_spread + third, by_parameter + wide.parameter)

    width = dr.width(start.depth + x + z)
    zero = dr.zeros(F, width)
    begun = lib.Bool(active) & (x > 0) & (k >= 0) & (k <= last)
    state = looped((begun, k, F(start.depth), F(start.sine), zero, F(zero), F(zero), F(zero), F(zero), F(zero)),
                   going, body)
    return _WalkSums(spread=state[5], first=state[6], second=state[7], third=state[8], by_parameter=state[9])


def _nothing(layer: UInt32, place: Float64, arc: ArcDerivatives, wide: SpreadDerivatives, on: Bool) -> Walked:
    """Return no sums for a visit."""
    return place * 0, place * 0, place * 0


def _start(table: LayerTable, z0: Float64, s0: Float64) -> _Start:
    """Return the beginning of rays; a level launch is replaced by a nearly level one."""
    sine = dr.select(abs(s0) > LEVEL_LAUNCH, s0, dr.select(s0 < 0, -LEVEL_LAUNCH, LEVEL_LAUNCH))
    layer = table.lib.UInt32(dr.maximum(first_layer(table, z0, s0), 0))
    z_k, c_k, g, _ = table.shape(layer)
    speed = dr.fma(g, z0 - z_k, c_k)
    cosine = dr.sqrt(dr.maximum(1 - s0 * s0, 1e-18))
    return _Start(depth=z0, sine=sine, cosine=cosine, layer=layer, speed=speed, gradient=g, parameter=cosine / speed)


def _fitted(gradient: Float64, like: Float64) -> Float64:
    """Return one summed gradient where all rays share the number."""
    shared = dr.width(like) == 1 and dr.width(gradient) > 1
    return cast(Float64, dr.sum(gradient)) if shared else gradient


def _nodes(table: LayerTable) -> _Nodes:
    lib, places = table.lib, layer_places(table)
    upper, lower = (upload(lib.UInt32, node.astype(np.uint32)) for node in (places.upper, places.lower))
    return _Nodes(lib=lib, upper=upper, lower=lower, depth=upload(lib.Float64, places.node_depth),
                  per_metre=upload(lib.Float64, places.per_metre))
