"""Points of a scene connected to a source along the exact bent ray, and whether the way is free.

The ray is the earliest arrival (`propagation.arrivals`), an exact eigenray.
The way is free if none of the chords of the ray's fan row, the last of them ended just before the point, meets
anything.
"""
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from ..propagation.aiming import aim
from ..propagation.arrivals import earliest

__all__ = ["LIFT", "LIFT_PER_RANGE", "Connection", "Connector"]

LIFT, LIFT_PER_RANGE = 5e-4, 2e-5     # [m], [-] a ray ends this far in front of the surface it is to reach


@dataclass(frozen=True, kw_only=True)
class Connection:
    """Ways from a source to points, one each.

    Attributes
    ----------
    exists : Bool (R,)
        A direct ray, or one that turns between, was found.
    free : Bool (R,)
        Nothing is in its way.
    horizontal_range : Float64 (R,) [m]
    travel_time : Float64 (R,) [s]
    arc_length : Float (R,) [m]
    spreading_area : Float (R,) [m²/sr]
    launch_direction, arrival_direction : Vector3f (R,)
        Unit, along the travel, at the source and at the point.
    ray_parameter : Float64 (R,) [s/m]
    sound_speed : Float64 (R,) [m/s]
        At the point.
    """

    exists: object
    free: object
    horizontal_range: object
    travel_time: object
    arc_length: object
    spreading_area: object
    launch_direction: object
    arrival_direction: object
    ray_parameter: object
    sound_speed: object


class Connector:
    """Connect points to sources in the water and the scene of a tracer.

    Parameters
    ----------
    tracer : trace.Tracer
    """

    def __init__(self, tracer):
        self.tracer = tracer

    def __call__(self, sources, origin, source, point, normal, active=True, *, occlusion=True, short=0.0):
        """Connect one point an entry.

        Parameters
        ----------
        sources : trace.Sources
        origin : Array3f64 (R,) [m]
            Scene coordinates; the depth must be that of the source.
        source : UInt32 (R,)
            Index into `sources`.
        point : Array3f64 (R,) [m]
        normal : Vector3f (R,)
            Of the surface the point lies on, either side; zero for a point in free water.
        active : Bool (R,)
        occlusion : bool
            Look for what lies in the way; else every way is free.
        short : float [m]
            The last of the way that is not looked at, for a target that stands in front of itself.

        Returns
        -------
        Connection
        """
        lib, table = self.tracer.lib, self.tracer.table
        x, z, along = _seen_from(origin, point)
        active = lib.Bool(active)
        ray = earliest(table, lib, sources.state, source, x, z, active)
        time, area, p, c = ray.travel_time, ray.spreading_area, ray.ray_parameter, ray.sound_speed
        _, c0, _ = sources.state.gather(lib, source)
        launch_cosine, cosine = mi.Float(p * c0), mi.Float(p * c)
        launch_sine = dr.copysign(dr.sqrt(mi.Float(dr.maximum(1 - dr.square(p * c0), 0))), mi.Float(ray.launch_sine))
        launch = mi.Vector3f(along.x * launch_cosine, along.y * launch_cosine, -launch_sine)
        arrival = mi.Vector3f(along.x * cosine, along.y * cosine, -ray.arrival_sine)
        exists = ray.found & dr.isfinite(time) & dr.isfinite(area)
        lift = LIFT + LIFT_PER_RANGE * mi.Float(x)
        back = dr.copysign(lift, -dr.dot(normal, arrival)) * normal - short * arrival
        end, reach = mi.Point3f(point) + back, mi.Float(x) + dr.minimum(along.x * back.x + along.y * back.y, 0)
        blocked = mi.Bool(False)
        if occlusion:
            blocked = _blocked(self.tracer.geometry.scene, sources.fans, mi.Point3f(origin), source,
                               dr.atan2(launch_sine, launch_cosine), along, end, reach, exists)
        return Connection(exists=exists, free=exists & ~blocked, horizontal_range=x, travel_time=time,
                          arc_length=ray.arc_length, spreading_area=area, launch_direction=launch,
                          arrival_direction=arrival, ray_parameter=p, sound_speed=c)


    def launch_direction(self, sources, origin, source, point):
        """Where the ray to each point leaves for, Vector3f (R,), as aimed; arguments as of a call."""
        lib = self.tracer.lib
        x, z, along = _seen_from(origin, point)
        sine, cosine, _ = aim(self.tracer.table, lib, sources.state, source, x, z, lib.Bool(True))
        return mi.Vector3f(along.x * mi.Float(cosine), along.y * mi.Float(cosine), -mi.Float(sine))


def _seen_from(origin, point):
    """Horizontal distance and depth [m], Float64, of points, and the horizontal unit vector towards them."""
    dx, dy = point.x - origin.x, point.y - origin.y
    x = dr.sqrt(dr.fma(dx, dx, dy * dy))
    upright = x < 1e-6
    scale = mi.Float(dr.rcp(dr.maximum(x, 1e-9)))
    return x, -point.z, mi.Vector2f(dr.select(upright, 1, mi.Float(dx) * scale),
                                    dr.select(upright, 0, mi.Float(dy) * scale))


@dr.syntax
def _blocked(scene, fans, origin, source, launch_angle, heading, end, reach, active):
    """Tell whether something lies on the way to `end`, at horizontal range `reach`."""
    row, off = fans.row(source, launch_angle)
    base = row * fans.stride
    size = dr.gather(mi.UInt32, fans.size, row)
    v = dr.gather(fans.lib.Array4f, fans.vertex, base)
    # -------------------------------------------------- loop state
    r0, z0 = dr.fma(off, v[2], v[0]), dr.fma(off, v[3], v[1])    # start of the present chord
    i = mi.UInt32(1)                                             # its end
    blocked = mi.Bool(False)
    active = mi.Bool(active)
    one = dr.opaque(mi.UInt32, 1)
    while active:
        v = dr.gather(fans.lib.Array4f, fans.vertex, base + i, active & (i < size))
        r1, z1 = dr.fma(off, v[2], v[0]), dr.fma(off, v[3], v[1])
        last = (r1 >= reach) | (i + 1 >= size)
        start = mi.Point3f(dr.fma(r0, heading.x, origin.x), dr.fma(r0, heading.y, origin.y), -z0)
        stop = mi.Point3f(dr.fma(r1, heading.x, origin.x), dr.fma(r1, heading.y, origin.y), -z1)
        stop = dr.select(last, end, stop)
        way = stop - start
        length = dr.norm(way)
        # of unit direction: Mitsuba's spheres and cylinders misplace hits of others; and backwards, for of those that
        # are far from where a ray starts they do not know the edge, and a point on one is in its own shadow or not
        ray = mi.Ray3f(mi.Ray3f(stop, -way / dr.maximum(length, 1e-9)), length)
        met = scene.ray_test(ray, coherent=True, active=active & (length > 1e-6))
        blocked |= met & active
        active = active & ~blocked & ~last
        r0, z0 = dr.select(active, r1, r0), dr.select(active, z1, z0)
        i += one
    return blocked
