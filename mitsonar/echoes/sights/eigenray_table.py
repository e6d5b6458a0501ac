"""Eigenrays from one depth to the points around it, tabulated over horizontal range and depth.

The difference between a bent ray and the straight line to the same point is smooth, so few nodes suffice for:

    τ = T c_0 / R - 1                              T travel time, R straight distance, c_0 sound speed at the source
    λ = sin θ_0 - h / R,   α = sin θ_1 - h / R     sines of launch and arrival, positive up; h height gained
    γ = ln(g R²)                                   g gain of the leg, absorption included (`sonar_equation`)

The nodes are exact eigenrays (`tracing.connection`); between them all four are bilinear. In water of uniform sound
speed, τ, λ and α vanish. Elsewhere the error is the curvature of the four quantities over a cell.
"""
from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, held, upload
from mitsonar.scene.tracing.connection import Connector

from ..sonar_equation import leg_gain, speed_ratio

RANGES, DEPTHS = 192, 64           # nodes
BEYOND = 0.01                      # [m] margin of the table beyond the scene
NOTHING, FAINTEST = -60.0, -50.0   # γ of nodes without a ray; γ below which a point has such a node beside it
NEAREST = 1e-3                     # [m] avoids divisions by zero
STEEP = 0.05                       # sine of the angle to vertical or to level within which waves count as round
CLOSEST = 0.05                     # [m] from the source; nearer than this, the spreading stays the same


@dataclass(frozen=True, kw_only=True)
class TableLegs:
    """Legs from the source to points, one per entry."""

    exists: mi.Bool  # (R,)
    travel_time: mi.Float64  # (R,) [s]
    launch_direction: mi.Vector3f  # (R,): unit, along the travel
    arrival_direction: mi.Vector3f  # (R,): unit, along the travel
    gain: mi.Float  # (R,) [1/m²]: g
    horizontal_range: mi.Float  # (R,) [m]
    distance: mi.Float  # (R,) [m]: in a straight line


class EigenrayTable:
    """Table of the eigenrays that leave one depth, to the depths of the scene or to others."""

    def __init__(self, connector: Connector, *, depth: float, farthest: float,                 # depth, farthest [m]
                 depths: tuple[float, float] | None = None):                                   # [m]
        self.lib, self.depth = arrays_of(mi.Float), float(depth)
        water = connector.water
        self.sound_speed = float(water.profile.at(depth))
        top, bottom = depths or connector.geometry.depth_range
        z0, z1 = max(top, depth - farthest) - BEYOND, min(bottom, depth + farthest) + BEYOND
        z1, reach = max(z1, z0 + BEYOND), farthest + 1
        x, z = (a.ravel() for a in np.meshgrid(np.maximum(np.linspace(0, reach, RANGES), NEAREST),
                                               np.linspace(z0, z1, DEPTHS), indexing="ij"))
        start = self.lib.Array3f64(*(dr.opaque(mi.Float64, v, len(x)) for v in (0.0, 0.0, -self.depth)))
        point = self.lib.Array3f64(upload(mi.Float64, x), dr.opaque(mi.Float64, 0.0), upload(mi.Float64, -z))
        nothing = mi.Vector3f(0, 0, 0)
        way = connector.join(start, nothing, point, nothing, occlusion=False)
        c0 = dr.opaque(mi.Float64, self.sound_speed)
        height = point.z - start.z
        R = dr.sqrt(point.x * point.x + height * height)
        rise = mi.Float(height / R)
        gain = leg_gain(spreading_area=way.spreading_area, speed_ratio=speed_ratio(way.sound_speed, c0),
                        loss_db=water.loss_db(start, point, way))
        nodes = [mi.Float(way.travel_time * c0 / R - 1), way.launch_direction.z - rise,
                 way.arrival_direction.z - rise, dr.log(dr.maximum(gain * dr.square(mi.Float(R)), 1e-30))]
        good = way.exists
        for node in nodes:
            good &= dr.isfinite(node)
        nodes = [dr.select(good, node, missing) for node, missing in zip(nodes, (0, 0, 0, NOTHING))]
        self._table = dr.zeros(mi.Float, 4 * len(x))
        dr.scatter(self._table, self.lib.Array4f(*nodes), dr.arange(mi.UInt32, len(x)))
        dr.eval(self._table)
        self._per_x, self._per_z, self._top = (
            dr.opaque(mi.Float, v) for v in ((RANGES - 1) / reach, (DEPTHS - 1) / (z1 - z0), z0))
        self._speed = dr.opaque(mi.Float64, self.sound_speed)

    def values(self, horizontal_range: mi.Float, depth: mi.Float) -> tuple[mi.Float, mi.Float, mi.Float, mi.Float]:
        """Return τ, λ, α and γ at horizontal ranges and depths [m], Float (R,)."""
        at, fx, fz = self._node(horizontal_range, depth)
        near, below, far, far_below = (dr.gather(self.lib.Array4f, self._table, at + step)
                                       for step in (0, 1, DEPTHS, DEPTHS + 1))
        low, high = near + (below - near) * fz, far + (far_below - far) * fz
        value = low + (high - low) * fx
        return value[0], value[1], value[2], value[3]

    def _node(self, horizontal_range: mi.Float, depth: mi.Float) -> tuple[mi.UInt32, mi.Float, mi.Float]:
        """Return the number of the node below a place, and the shares of the way to the next ones."""
        px = held(horizontal_range * self._per_x, 0.0, RANGES - 1.001)
        pz = held((depth - self._top) * self._per_z, 0.0, DEPTHS - 1.001)
        i, j = mi.UInt32(px), mi.UInt32(pz)
        return i * DEPTHS + j, px - mi.Float(i), pz - mi.Float(j)

    def _one(self, number: int, horizontal_range: mi.Float, depth: mi.Float) -> mi.Float:
        """Return one of the four numbers of `values` at horizontal ranges and depths [m]."""
        node, fx, fz = self._node(horizontal_range, depth)
        near, below, far, far_below = (dr.gather(mi.Float, self._table, 4 * (node + step) + number)
                                       for step in (0, 1, DEPTHS, DEPTHS + 1))
        low, high = near + (below - near) * fz, far + (far_below - far) * fz
        return low + (high - low) * fx

    def lateness(self, horizontal_range: mi.Float, height: mi.Float) -> mi.Float:
        """Return τ of points `height` [m] above the source: the share by which a ray takes longer than a straight line.
        """
        return self._one(0, horizontal_range, dr.opaque(mi.Float, self.depth) - height)

    def launch_rise(self, horizontal_range: mi.Float, height: mi.Float) -> mi.Float:
        """Return sin θ_0, positive up, of the rays to points `height` [m] above the source."""
        launch = self._one(1, horizontal_range, dr.opaque(mi.Float, self.depth) - height)
        return height * dr.rsqrt(height * height + dr.square(dr.maximum(horizontal_range, NEAREST))) + launch

    def curvatures(self, horizontal_range: mi.Float, height: mi.Float) -> tuple[mi.Float, mi.Float]:
        """Return curvatures [1/m], Float (R,), at the source, of waves from points `height` [m] above it.

        They are those across the ray's plane and in it: k / x and -(d sin θ_0 / dx) / (k sin θ_0), with k = cos θ_0 and
        the horizontal range x. In water of uniform sound speed both are 1 / R.
        """
        x, step = dr.maximum(horizontal_range, NEAREST), 0.5 / self._per_x
        R = dr.sqrt(dr.fma(x, x, height * height))
        depth = dr.opaque(mi.Float, self.depth) - height
        before, after = dr.maximum(x - step, 0), x + step
        bent = (self._one(1, after, depth) - self._one(1, before, depth)) / (after - before)
        rise = height / R + self._one(1, x, depth)
        level = dr.sqrt(dr.maximum(1 - rise * rise, 0))
        across = level / x
        within = (height * x / (R * R * R) - bent) / (rise * level)
        # straight below the source, both are equal
        steep = x < STEEP * R
        across, within = dr.select(steep, 1 / R, across), dr.select(steep | (abs(rise) < STEEP), 1 / R, within)
        good = (within * R > 0.2) & (within * R < 5)
        return across, dr.select(good, within, across)

    def legs(self, offset: dr.ArrayBase) -> TableLegs:
        """Return the legs to points at `offset` (R,) [m] from the source."""
        square = dr.fma(offset.x, offset.x, offset.y * offset.y)
        R = dr.maximum(dr.sqrt(dr.fma(offset.z, offset.z, square)), CLOSEST)
        x, distance = mi.Float(dr.sqrt(square)), mi.Float(R)
        time, launch, arrival, gain = self.values(x, dr.opaque(mi.Float, self.depth) - mi.Float(offset.z))
        rise, per_x = mi.Float(offset.z / R), dr.rcp(dr.maximum(x, NEAREST))
        # straight up or down, any heading is right
        heading = mi.Vector2f(dr.select(x > NEAREST, mi.Float(offset.x) * per_x, 1), mi.Float(offset.y) * per_x)
        return TableLegs(
            exists=gain > FAINTEST, travel_time=R / self._speed * (1 + mi.Float64(time)),
            launch_direction=_towards(heading, rise + launch), arrival_direction=_towards(heading, rise + arrival),
            gain=dr.exp(gain) / dr.square(distance), horizontal_range=x, distance=distance)


def _towards(heading: mi.Vector2f, rise: mi.Float) -> mi.Vector3f:
    """Return unit vectors with a horizontal heading and a sine of elevation."""
    cosine = dr.sqrt(dr.maximum(1 - rise * rise, 0))
    return mi.Vector3f(heading.x * cosine, heading.y * cosine, rise)
