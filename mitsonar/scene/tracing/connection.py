"""Connections between points of a scene along the exact bent ray, and a test if the way is free.

The ray is the earliest arrival (`device_rays.arrivals`), an exact eigenray. It starts at a source that has a ray fan,
or at any point of the water. It may be reflected by a flat surface; it then runs through water unfolded about that
surface (`tracing.water`). The way is free if none of the ray's chords meets anything (`shadows.occlusion`).
"""
from __future__ import annotations

from dataclasses import dataclass, replace
from typing import cast

import drjit as dr
import mitsuba as mi

from mitsonar.device.arrays import arrays_of, compressed, entries
from mitsonar.propagation.device_rays.aiming import aim
from mitsonar.propagation.device_rays.arrivals import earliest
from mitsonar.propagation.device_rays.ray_fans import RayFans
from mitsonar.propagation.device_rays.two_point import PointState

from ..geometry import Geometry
from ..sea import DeviceWaves
from ..shadows.occlusion import LIFT, LIFT_PER_RANGE, TOLERANCE, along_arcs, along_fan
from .tracer import Sources
from .water import DeviceWater

CLEAR = 0.5            # [m] over the scene's highest point, from where nothing is in the way of higher points
UPRIGHT = 1e-6         # [m] horizontal range below which a way runs straight up or down


@dataclass(frozen=True, kw_only=True)
class Connection:
    """Ways to points, one for each."""

    exists: mi.Bool  # (R,): a ray was found, direct or with a turning point
    free: mi.Bool  # (R,): nothing is in the way
    horizontal_range: mi.Float64  # (R,) [m]
    travel_time: mi.Float64  # (R,) [s]
    arc_length: mi.Float  # (R,) [m]
    spreading_area: mi.Float  # (R,) [m²/sr]
    launch_direction: mi.Vector3f  # (R,): unit, along the travel, at the start
    arrival_direction: mi.Vector3f  # (R,): unit, along the travel, at the point
    ray_parameter: mi.Float64  # (R,) [s/m]
    sound_speed: mi.Float64  # (R,) [m/s]: at the point
    later: mi.Float64 | None = None  # (R,) [s]: share of the time that the field of the water adds
    slope: dr.ArrayBase | None = None  # (R,) [s/m]: its change with the place of the start


class Connector:
    """Connect points in the water and the scene by eigenrays."""

    def __init__(self, geometry: Geometry, water: DeviceWater):
        self.geometry, self.water = geometry, water
        self.lib = arrays_of(mi.Float)

    def connect(self, sources: Sources, origin: dr.ArrayBase, source: mi.UInt32, point: dr.ArrayBase,
                normal: mi.Vector3f, active: mi.Bool | bool = True, *, occlusion: bool = True,
                short: float = 0.0, end: dr.ArrayBase | None = None) -> Connection:
        """Connect each point (R,) to a source (R,) at `origin`, and stop `short` [m] of the point.

        Obstacles are searched for up to `end` (R,) [m], a place of the surface near the point.
        """
        x, heading = _seen_from(origin, point)
        way, (cosine, _) = self._eigenray(self.water.layers(), sources.state, source, x, heading, -point.z, active)
        through = self._through_field(way, origin, heading, point)
        if not occlusion:
            return through
        blocked = self._blocked(sources.ray_fans, origin, source, way, cosine, heading, point if end is None else end,
                                normal, short)
        return replace(through, free=way.exists & ~blocked)

    def connect_in_water(self, sources: Sources, origin: dr.ArrayBase, point: dr.ArrayBase) -> Connection:
        """Connect points (R,) that lie on nothing to source 0, evaluated; rays are traced only to those in doubt.

        A ray without a turning point stays between the depths of its ends. Nothing is in its way if both lie above
        everything in the scene.
        """
        source, nowhere = mi.UInt32(0), mi.Vector3f(0, 0, 0)
        x, heading = _seen_from(origin, point)
        way, (cosine, _) = self._eigenray(self.water.layers(), sources.state, source, x, heading, -point.z, True)
        through = self._through_field(way, origin, heading, point)
        top = dr.opaque(self.lib.Float64, -self.geometry.depth_range[0] + CLEAR)
        above = (dr.minimum(point.z, origin.z) > top) & (way.launch_direction.z * way.arrival_direction.z > 0)
        doubt = way.exists & ~above
        dr.eval(through, way, cosine, heading, x, point, doubt)
        index = compressed(doubt)
        blocked = dr.zeros(mi.Bool, dr.width(doubt))
        if dr.width(index):
            some, facing, far, cosine = entries((way, heading, point, cosine), index)
            met = self._blocked(sources.ray_fans, origin, source, some, cosine, facing, far, nowhere, 0.0)
            dr.scatter(blocked, met, index)
        return replace(through, free=way.exists & ~blocked)

    def _blocked(self, fans: RayFans, origin: dr.ArrayBase, source: mi.UInt32, way: Connection, cosine: mi.Float,
                 heading: mi.Vector2f, point: dr.ArrayBase, normal: mi.Vector3f, short: float) -> mi.Bool:
        """Return True for ways from a source to points (R,) that something blocks."""
        end, nearer = _end(way, point, normal, heading, short)
        return along_fan(self.geometry.scene, fans, mi.Point3f(origin), source,
                         dr.atan2(-way.launch_direction.z, cosine), heading, end,
                         mi.Float(way.horizontal_range) + nearer, way.exists)

    def _through_field(self, way: Connection, origin: dr.ArrayBase, heading: mi.Vector2f,
                       point: dr.ArrayBase) -> Connection:
        """Return ways with what the water's field adds to their times, and turns their waves by at the start."""
        if self.water.field is None:
            return way
        launch = way.launch_direction
        ray = self.water.through_field(origin, heading, way.horizontal_range, -point.z, way.arc_length,
                                       way.ray_parameter, -launch.z)
        slope = ray.slope_upwards(self.lib.Array3f64)
        return replace(way, travel_time=way.travel_time + ray.later, later=ray.later, slope=slope,
                       launch_direction=turned(launch, slope, self.water.layers().at(-origin.z)[0]))

    def join(self, start: dr.ArrayBase, start_normal: mi.Vector3f, end: dr.ArrayBase, end_normal: mi.Vector3f,
             active: mi.Bool | bool = True, *, folded: bool = False, occlusion: bool = True,
             short: float = 0.0, begin: dr.ArrayBase | None = None) -> Connection:
        """Connect each start point (R,) to an end point (R,), anywhere in the water, without the water's field.

        Obstacles are searched for from `begin` (R,) [m] on, a place of the surface near the start point.
        """
        table = self.water.medium(folded).layers
        z0 = start.z if folded else -start.z
        x, heading = _seen_from(start, end)
        here = PointState.at(table, z0)
        way, (_, sine) = self._eigenray(table, here, self.lib.UInt32(0), x, heading, -end.z, active)
        if folded:
            image = way.launch_direction
            way = replace(way, launch_direction=mi.Vector3f(image.x, image.y, -image.z))
            if (sea := self.geometry.sea) is not None:
                speed = table.at(self.lib.Float64(0))[0]
                way = replace(way, travel_time=way.travel_time + lifted(sea.device, way, heading, start, end, speed))
        if not occlusion:
            return way
        lift = LIFT + LIFT_PER_RANGE * mi.Float(x)
        aside = cast(mi.Float, dr.copysign(lift, dr.dot(start_normal, way.launch_direction)))
        raised = mi.Point3f(start if begin is None else begin) + mi.Point3f(aside * start_normal)
        finish, nearer = _end(way, end, end_normal, heading, short)
        blocked = along_arcs(self.geometry.scene, table, self.lib, raised, heading, z0, sine, way.ray_parameter, finish,
                             x + nearer, dr.opaque(self.lib.Float64, 8 * TOLERANCE), folded,
                             self.geometry.only_meshes, way.exists)
        return replace(way, free=way.exists & ~blocked)

    def launch_direction(self, sources: Sources, origin: dr.ArrayBase, source: mi.UInt32,
                         point: dr.ArrayBase) -> mi.Vector3f:
        """Return the direction in which the ray to each point leaves, as aimed; arguments as in `connect`."""
        x, heading = _seen_from(origin, point)
        table = self.water.layers()
        sine, cosine, _ = aim(table, self.lib, sources.state, source, x, PointState.at(table, -point.z),
                              self.lib.Bool(True))
        return mi.Vector3f(heading.x * mi.Float(cosine), heading.y * mi.Float(cosine), -mi.Float(sine))

    def _eigenray(self, table, state, source, x, heading, z, active):
        """Return ways, all of them free, and cosine (Float) and sine (Float64) of the launch angle, positive down."""
        ray = earliest(table, self.lib, state, source, x, z, self.lib.Bool(active))
        time, area, p, c = ray.travel_time, ray.spreading_area, ray.ray_parameter, ray.sound_speed
        _, c0, _ = state.gather(self.lib, source)
        cosine0, cosine = mi.Float(p * c0), mi.Float(p * c)
        square = dr.maximum(1 - dr.square(p * c0), 0)
        sine0 = cast(mi.Float, dr.copysign(dr.sqrt(mi.Float(square)), mi.Float(ray.launch_sine)))
        exists = ray.found & dr.isfinite(time) & dr.isfinite(area)
        way = Connection(exists=exists, free=exists, horizontal_range=x, travel_time=time, arc_length=ray.arc_length,
                         spreading_area=area, ray_parameter=p, sound_speed=c,
                         launch_direction=mi.Vector3f(heading.x * cosine0, heading.y * cosine0, -sine0),
                         arrival_direction=mi.Vector3f(heading.x * cosine, heading.y * cosine, -ray.arrival_sine))
        return way, (cosine0, cast(mi.Float64, dr.copysign(dr.sqrt(square), ray.launch_sine)))


def lifted(waves: DeviceWaves, way: Connection, heading: mi.Vector2f, start: dr.ArrayBase, end: dr.ArrayBase,
           speed: mi.Float64) -> mi.Float64:
    """Return what waves add to the times [s] of ways by the mirror, 2 η sin θ / c where they meet it at a speed c."""
    share = start.z / dr.minimum(start.z + end.z, -1e-9)
    out = share * way.horizontal_range
    x, y = mi.Float64(start.x) + out * mi.Float64(heading.x), mi.Float64(start.y) + out * mi.Float64(heading.y)
    sine = dr.sqrt(dr.maximum(1 - dr.square(way.ray_parameter * speed), 0))
    return 2 * mi.Float64(waves.height(x, y, share * way.travel_time)) * sine / speed


def turned(launch: mi.Vector3f, slope: dr.ArrayBase, speed: mi.Float64) -> mi.Vector3f:
    """Return launch directions of waves whose times change with the start's place by a slope [s/m], too."""
    return dr.normalize(launch - mi.Vector3f(slope * speed))


def _seen_from(origin, point):
    """Return the horizontal distance [m], Float64, of points, and the horizontal unit vector towards them."""
    dx, dy = point.x - origin.x, point.y - origin.y
    x = dr.sqrt(dr.fma(dx, dx, dy * dy))
    upright = x < UPRIGHT
    scale = mi.Float(dr.rcp(dr.maximum(x, 1e-9)))
    return x, mi.Vector2f(dr.select(upright, 1, mi.Float(dx) * scale), dr.select(upright, 0, mi.Float(dy) * scale))


def _end(way, point, normal, heading, short):
    """Return a way's end in front of its point's surface, and the change of horizontal range [m], <= 0."""
    lift = LIFT + LIFT_PER_RANGE * mi.Float(way.horizontal_range)
    arrival = way.arrival_direction
    back = cast(mi.Float, dr.copysign(lift, -dr.dot(normal, arrival))) * normal - short * arrival
    return mi.Point3f(point) + back, dr.minimum(heading.x * back.x + heading.y * back.y, 0)
