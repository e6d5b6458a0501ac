"""Echoes of the water: points drawn in the volume, each connected to the sonar along its bent ray.

    S = s_v(z) dV,       dV = r² ΔΩ dr

S is the strength of a point in the sonar equation (`sonar_equation.along_legs`). The point lies at r along a straight
line from the sonar, for which dV is exact; the eigenray gives the sound's way there, if there is one.

    r_n = r_0 + dr frac(n/φ + x),      φ the golden ratio, n the number of a direction, x a random number of the row

Any run of directions has distances that are nearly even: the number of points in a time gate is nearly constant, and so
is that in a cell of range and angle if the numbers follow the angle. `plane_lattice` is even in a second angle as well.
The points differ from ping to ping.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, compressed, entries
from mitsonar.device.chance import pair, uniform
from mitsonar.scene.tracing.connection import Connection, Connector
from mitsonar.scene.tracing.tracer import Sources

from ..sonar_equation import along_legs, leg_gain, speed_ratio

GOLDEN = round((np.sqrt(5) - 1) / 2 * 2 ** 32)         # 1/φ of 2^32: products of 32 bits wrap
BESIDE = round(0.5564184853613068 * 2 ** 32)           # b, found by search: in runs of n, points lie 0.6 / √n apart
NO_NUMBER = (1 << 32) - 1          # that no direction has
NEAREST = 0.25                     # [m] nearer points are not in the far field, and echo while the pulse is still sent
NEARER, FARTHER = 0.97, 1.03       # margins of the window's straight ranges, because rays bend
UnderBed = Callable[[dr.ArrayBase], "mi.Bool"]       # of points (R,) [m]: True only for those that the bed hides


@dataclass(frozen=True, kw_only=True)
class DrawnPoints:
    """Points of the water and their echoes."""

    point: dr.ArrayBase  # (R,) [m]
    way: Connection
    energy: mi.Float  # (R,): p² relative to 10^(SL/10), without B and absorption [1/m²]
    loss_db: mi.Float  # (R,): two-way absorption
    active: mi.Bool  # (R,)


class WaterEchoes:
    """Random points of a stratified volume and their echoes."""

    def __init__(self, connector: Connector, window: tuple[float, float]):                     # window [s]
        self.connector, self.water, self.lib = connector, connector.water, connector.lib
        near, far = 0.5 * window[0] * self.water.slowest * NEARER, 0.5 * window[1] * self.water.fastest * FARTHER
        near, far = max(near, NEAREST), max(far, 2 * NEAREST)
        self.farthest = far
        self.near, self.span = dr.opaque(mi.Float, near), dr.opaque(mi.Float, far - near)

    def draw(self, sources: Sources, origin: dr.ArrayBase, source: mi.UInt32, direction: mi.Vector3f,
             solid_angle: mi.Float, place: mi.Float) -> DrawnPoints:
        """Return one point along each direction, at a `place` in [0, 1) of the window."""
        # direction (R,); solid_angle (R,) [sr]; place (R,)
        r = self.near + self.span * place
        point = origin + type(origin)(direction * r)
        in_water = point.z < 0
        way = self.connector.connect(sources, origin, source, point, mi.Vector3f(0, 0, 0), in_water)
        return self._drawn(sources, origin, source, point, r, solid_angle, way, in_water)

    def draw_connected(self, sources: Sources, origin: dr.ArrayBase, direction: mi.Vector3f, solid_angle: mi.Float,
                       place: mi.Float) -> tuple[mi.UInt32, DrawnPoints] | None:
        """Return numbers (V,) of directions, and the points along them, as `draw` does from source 0; None if none.

        Points above the water are left out before they are connected.
        """
        index, r = self.spread(origin, direction, place)
        if not dr.width(index):
            return None
        direction, solid_angle, r = entries((direction, solid_angle, r), index)
        point = origin + type(origin)(direction * r)
        way = self.connector.connect_in_water(sources, origin, point)
        return index, self._drawn(sources, origin, mi.UInt32(0), point, r, solid_angle, way, mi.Bool(True))

    def spread(self, origin: dr.ArrayBase, direction: mi.Vector3f, place: mi.Float,
               under_bed: UnderBed | None = None) -> tuple[mi.UInt32, mi.Float]:
        """Return the distances [m] of points along all directions, and numbers (V,) of those in the water.

        Points that lie under the bed are left out.
        """
        r = self.near + self.span * place
        point = origin + type(origin)(direction * r)
        possible = point.z < 0
        if under_bed is not None:
            possible &= ~under_bed(point)
        dr.eval(direction, r, possible)
        return compressed(possible), r

    def strength(self, depth: mi.Float, r: mi.Float, solid_angle: mi.Float, active: mi.Bool | bool = True) -> mi.Float:
        """Return the strengths S (R,) [m²] of points at depths [m] and distances `r` [m]."""
        return self.water.volume.at(depth, active) * r * r * solid_angle * self.span

    def _drawn(self, sources: Sources, origin: dr.ArrayBase, source: mi.UInt32, point: dr.ArrayBase, r: mi.Float,
               solid_angle: mi.Float, way: Connection, in_water: mi.Bool) -> DrawnPoints:
        """Return points at distances [m] with the energies of their echoes."""
        strength = self.strength(mi.Float(-point.z), r, solid_angle, in_water)
        source_speed = mi.Float(sources.state.gather(self.lib, source)[1])
        gain = leg_gain(spreading_area=way.spreading_area, speed_ratio=speed_ratio(way.sound_speed, source_speed))
        energy = along_legs(strength, gain, gain)
        return DrawnPoints(point=point, way=way, energy=energy, loss_db=self.water.loss_db(origin, point, way),
                           active=in_water & way.free & (energy > 0) & dr.isfinite(energy))


def line_lattice(number: mi.UInt32, key: mi.UInt32) -> mi.Float:
    """Return frac(n/φ + x) of the module for numbers n (R,); a row has one key, from which x is drawn."""
    return _shifted(number, GOLDEN, _shifts(number, key)[0])


def plane_lattice(number: mi.UInt32, key: mi.UInt32) -> tuple[mi.Float, mi.Float]:
    """Return frac(n b + y) and `line_lattice` for numbers n (R,): together, any run of them is even in the square."""
    place, beside = _shifts(number, key)
    return _shifted(number, BESIDE, beside), _shifted(number, GOLDEN, place)


def _shifts(number: mi.UInt32, key: mi.UInt32) -> tuple[mi.Float, mi.Float]:
    lib = arrays_of(number)
    first, second = pair(lib.UInt32(NO_NUMBER), key)
    return uniform(lib, first), uniform(lib, second)


def _shifted(number: mi.UInt32, step: int, shift: mi.Float) -> mi.Float:
    place = uniform(arrays_of(number), number * step) + shift
    return place - dr.floor(place)
