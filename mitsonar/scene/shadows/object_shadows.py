"""Shadows of objects: rays along coarse chords against a scene of the objects alone.

A point is tested only if an object lies in its azimuth, nearer than the point. Chords keep within 8 mm of the ray. This
is enough to decide if something is in the way, but not where (`occlusion`).
"""
from __future__ import annotations

from typing import cast

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, held, upload

from ..geometry import Geometry
from ..labels import OBJECT
from ..moving import moving_shape
from ..protocols import target_shape
from ..queries.several_scenes import asked_together
from ..tracing.tracer import Sources, Tracer, angles
from ..tracing.water import DeviceWater
from .occlusion import LIFT, LIFT_PER_RANGE, TOLERANCE, along_fan

SECTORS = 1024                     # of azimuth
NOWHERE = 1e9                      # [m]: the distance in a sector without objects


class Sectors:
    """Distance of the nearest object in every sector of azimuth around a place, (SECTORS,) [m]."""

    def __init__(self, nearest: np.ndarray):
        self._nearest = upload(mi.Float, nearest.astype(np.float32))
        dr.eval(self._nearest)

    def behind(self, heading: mi.Vector2f, horizontal_range: mi.Float) -> mi.Bool:
        """Return True for points that may have an object in front of them."""
        turn = dr.atan2(heading.y, heading.x) * float(SECTORS / (2 * np.pi))
        turn = held(dr.select(turn < 0, turn + SECTORS, turn), 0.0, SECTORS - 1e-3)
        return horizontal_range > dr.gather(mi.Float, self._nearest, mi.UInt32(turn))


class ObjectShadows:
    """Shadows that objects cast on points of the scene, up to the range `farthest` [m]."""

    def __init__(self, geometry: Geometry, water: DeviceWater, farthest: float):
        self.lib, self.geometry = arrays_of(mi.Float), geometry
        kinds = geometry.named.label_kinds()
        self._objects = [shape for shape in geometry.scene.shapes() if kinds[geometry.named.of(shape)] == OBJECT
                         and target_shape(shape) is None]
        self.exist = bool(self._objects)
        if self.exist:
            still = [shape for shape in self._objects if moving_shape(shape) is None]
            self._scene = asked_together(geometry.loaded, still, geometry.moving_scene)
            self._tracer = Tracer(geometry, water, max_range=farthest, tolerance=TOLERANCE)
            boxes = [shape.bbox() for shape in self._objects]
            self._low, self._high = (np.array([np.array(end(box), float)[:2] for box in boxes])
                                     for end in (lambda box: box.min, lambda box: box.max))
            self._row = {shape.id(): row for row, shape in enumerate(self._objects)}
            geometry.follow(self._moved)

    def _moved(self) -> None:
        """Move the boxes of moving objects."""
        for body, _, low, high in self.geometry.body_boxes():
            if (row := self._row.get(body.part.id())) is not None:
                self._low[row], self._high[row] = low[:2], high[:2]

    def sources(self, depth: float) -> Sources:
        """Prepare the chords of rays that leave a depth [m]."""
        return self._tracer.sources([depth])

    def sectors(self, origin: np.ndarray) -> Sectors:
        """Return the distances of the nearest objects around a place (3,) [m]."""
        nearest, here = np.full(SECTORS, NOWHERE), origin[:2]
        away = np.maximum(np.maximum(self._low - here, here - self._high), 0)
        distance = np.hypot(*away.T)
        for low, high, near in zip(self._low - here, self._high - here, distance):
            if near == 0:
                return Sectors(np.zeros(SECTORS))
            corner = np.array([[x, y] for x in (low[0], high[0]) for y in (low[1], high[1])])
            turn = np.arctan2(corner[:, 1], corner[:, 0])
            middle = np.arctan2(*(0.5 * (low + high))[::-1])
            off = np.mod(turn - middle + np.pi, 2 * np.pi) - np.pi
            first, last = (np.array([off.min(), off.max()]) + middle) * SECTORS / (2 * np.pi)
            sector = np.arange(int(np.floor(first)) - 1, int(np.floor(last)) + 2) % SECTORS
            nearest[sector] = np.minimum(nearest[sector], near)
        return Sectors(nearest)

    def hidden(self, sources: Sources, origin: mi.Point3f, launch: mi.Vector3f, arrival: mi.Vector3f,
               point: mi.Point3f, normal: mi.Vector3f, horizontal_range: mi.Float, active: mi.Bool) -> mi.Bool:
        """Return True for points (R,) that objects hide, at horizontal ranges [m]."""
        angle, heading = angles(launch)
        lift = LIFT + LIFT_PER_RANGE * horizontal_range
        aside = cast(mi.Float, dr.copysign(lift, -dr.dot(normal, arrival)))
        end = point + mi.Point3f(aside * normal)
        return along_fan(self._scene, sources.ray_fans, origin, mi.UInt32(0), angle, heading, end, horizontal_range,
                         active)

    def first(self, sources: Sources, origin: mi.Point3f, launch: mi.Vector3f, horizontal_range: mi.Float) -> mi.UInt32:
        """Return the label of the first object along rays up to a horizontal range, 0 where there is none."""
        angle, heading = angles(launch)
        registry, primitive = _first(self._scene, sources.ray_fans, origin, angle, heading, horizontal_range)
        found, primitive = cast(mi.UInt32, registry), cast(mi.UInt32, primitive)
        rows = self.geometry.rows
        label = dr.gather(mi.UInt32, rows, 4 * found, found != 0)
        mesh = (found != 0) & (dr.gather(mi.UInt32, rows, 4 * found + 2, found != 0) != 0)
        face = dr.gather(mi.UInt32, rows, 4 * found + 1, mesh) + primitive
        own = dr.gather(mi.UInt32, self.geometry.faces, 4 * face + 3, mesh)
        return dr.select(mesh, own, label)


@dr.syntax
def _first(scene, fans, origin, launch_angle, heading, reach):
    """Return registry index and facet of the first object met, 0 where there is none."""
    row, off = fans.row(mi.UInt32(0), launch_angle)
    base = row * fans.stride
    size = dr.gather(mi.UInt32, fans.size, row)
    v = dr.gather(fans.lib.Array4f, fans.vertex, base)
    # -------------------------------------------------- loop state
    r0, z0 = dr.fma(off, v[2], v[0]), dr.fma(off, v[3], v[1])
    i = mi.UInt32(1)
    found, primitive = mi.UInt32(0), mi.UInt32(0)
    active = size > 1
    while active:
        v = dr.gather(fans.lib.Array4f, fans.vertex, base + i, active)
        r1, z1 = dr.fma(off, v[2], v[0]), dr.fma(off, v[3], v[1])
        across, down = r1 - r0, z1 - z0
        length = dr.sqrt(dr.maximum(across * across + down * down, 1e-12))
        start = mi.Point3f(dr.fma(r0, heading.x, origin.x), dr.fma(r0, heading.y, origin.y), -z0)
        way = mi.Vector3f(across * heading.x, across * heading.y, -down) / length
        pi = scene.ray_intersect_preliminary(mi.Ray3f(mi.Ray3f(start, way), length), coherent=True, active=active)
        met = pi.is_valid() & active
        solid = dr.select(pi.instance != None, pi.instance, pi.shape)    # noqa: E711  (element-wise)
        found = dr.select(met, dr.reinterpret_array(mi.UInt32, solid), found)
        primitive = dr.select(met, pi.prim_index, primitive)
        i += 1
        active = active & ~met & (r1 < reach) & (i < size)
        r0, z0 = dr.select(active, r1, r0), dr.select(active, z1, z0)
    return found, primitive
