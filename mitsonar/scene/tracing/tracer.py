"""Bent rays against a Mitsuba scene.

Each ray follows the chords of its row of the ray fan (`device_rays.ray_fans`), with one triangle query for each chord,
until the first hit. The hit point is rebuilt in float64 from barycentrics and vertices (float32 along the ray would
cost 1e-5 m), and moves within its facet from the chord on to the ray. The exact eigenray to that point gives time,
spreading and angles (`device_rays.two_point`).
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import cast

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, where_any
from mitsonar.device.types import Record
from mitsonar.propagation.device_rays.ray_fans import FEWEST_VERTICES, RayFans, build_ray_fans
from mitsonar.propagation.device_rays.two_point import PointState, SourceState, to_hit

from ..geometry import Geometry, interpolated
from ..labels import OBJECT, SEABED
from .hits import Hits, towards_sound
from .water import DeviceWater

# [m] chord against arc: how far the edges of what hides and of what is hit are off. Hits themselves are not, as they
# move from the chords on to the rays.
FAN_TOLERANCE = 0.002
BEYOND = 0.001         # [m] behind a hit on an object, where its ray goes on; more than the rounding of float32


class Sources(Record):
    """Ray fans and medium for the source depths of a block of pings."""

    ray_fans: RayFans
    state: SourceState


@dataclass(frozen=True, kw_only=True, eq=False)
class FacetHit:
    """Hold where on surfaces rays end, one for each."""

    mesh: mi.Bool  # (R,): True on a mesh
    face: dr.ArrayBase  # Array4u (R,): corners and label, see `Geometry`
    edges: tuple[mi.Vector3f, mi.Vector3f]  # (R,) [m]: of the facet, from its first corner
    place: tuple[mi.Float, mi.Float]  # (R,): barycentrics along the edges
    point: dr.ArrayBase  # Array3f64 (R,) [m]
    normal: mi.Vector3f  # (R,): unit, of the facet
    uv: mi.Point2f  # (R,): of shapes that have their own texture coordinates
    row: mi.UInt32  # (R,): of `Geometry.rows`
    label: mi.UInt32  # (R,)
    shape: mi.ShapePtr  # (R,)

    def moved(self, shift: mi.Vector3f) -> FacetHit:
        """Return the same hits, moved within the planes of their facets by (R,) [m]."""
        (a, b), (u, v) = self.edges, self.place
        aa, ab, bb = dr.squared_norm(a), dr.dot(a, b), dr.squared_norm(b)
        along, across = dr.dot(shift, a), dr.dot(shift, b)
        scale = dr.select(self.mesh, dr.rcp(dr.maximum(aa * bb - ab * ab, 1e-30)), 0)
        return replace(self, point=self.point + type(self.point)(shift), place=(
            u + (bb * along - ab * across) * scale, v + (aa * across - ab * along) * scale))


class Tracer:
    """Find the hits of refracted rays, up to a range [m], on chords within a tolerance [m] of them."""

    def __init__(self, scene: mi.Scene | Geometry, water: DeviceWater, *, max_range: float,
                 tolerance: float = FAN_TOLERANCE):
        self.geometry = scene if isinstance(scene, Geometry) else Geometry(scene)
        self.water = water
        self.max_range = float(max_range)
        self.tolerance = float(tolerance)
        self.lib = arrays_of(mi.Float)
        self._layers = water.layers()
        self._known: tuple[bytes, Sources | None] = b"", None
        self._room = FEWEST_VERTICES

    def sources(self, source_depth: np.ndarray | list[float]) -> Sources:
        """Return the ray fans of source depths (D,) [m]; the last ones are kept for a straight track."""
        source_depth = np.atleast_1d(np.asarray(source_depth, float))
        key = source_depth.tobytes()
        known, sources = self._known
        if sources is None or known != key:
            fans = build_ray_fans(self._layers, self.water.profile, source_depth, slab=self.geometry.depth_range,
                                  max_range=self.max_range, tolerance=self.tolerance, max_vertices=self._room)
            self._room = int(fans.stride[0])        # found by trials; the next depths will need about as much
            sources = Sources(ray_fans=fans, state=self.water.direct.at(source_depth))
            self._known = key, sources
        return sources

    def trace(self, sources: Sources, origin: dr.ArrayBase, source: mi.UInt32, direction: mi.Vector3f,
              active: mi.Bool | bool = True) -> Hits:
        """Trace one ray per entry of `direction` (R,) from `origin` (R,) [m]."""
        return self.trace_met(sources, origin, source, direction, active)[0]

    def trace_met(self, sources: Sources, origin: dr.ArrayBase, source: mi.UInt32, direction: mi.Vector3f,
                  active: mi.Bool | bool = True) -> tuple[Hits, mi.PreliminaryIntersection3f]:
        """Trace as `trace` does, and return Mitsuba's intersections, too, for `facet`."""
        launch_angle, heading = angles(direction)
        valid, pi, chord, _ = _first_hit(self.geometry.scene, sources.ray_fans, mi.Point3f(origin), source,
                                         launch_angle, heading, mi.Bool(active))
        hits, on = self._hits(sources, origin, source, direction, heading, valid, pi, chord)
        pi.prim_uv = dr.select(on.mesh, mi.Point2f(*on.place), pi.prim_uv)
        return hits, pi

    def trace_with_hidden(self, sources: Sources, origin: dr.ArrayBase, source: mi.UInt32, direction: mi.Vector3f,
                          add_hidden: Callable[[Hits, Hits], None]) -> Hits:
        """Trace as `trace` does, and on through objects to the seabed behind them."""
        scene, kinds, o = self.geometry.scene, self.geometry.kinds, mi.Point3f(origin)
        launch_angle, heading = angles(direction)
        valid, pi, chord, vertex = _first_hit(scene, sources.ray_fans, o, source, launch_angle, heading, mi.Bool(True))
        hits, _ = self._hits(sources, origin, source, direction, heading, valid, pi, chord)

        def follow(met: mi.Bool) -> None:
            behind = _seabed_behind(scene, kinds, sources.ray_fans, o, source, launch_angle, heading, chord, vertex,
                                    pi.t, met)
            add_hidden(hits, self._hits(sources, origin, source, direction, heading, *behind)[0])

        where_any(valid & (_kind(kinds, pi, valid) == OBJECT), follow)
        return hits

    def _hits(self, sources, origin, source, direction, heading, valid, pi, chord):
        """Complete hits on chords with their eigenrays; return the hits and where on the facets they are."""
        lib, table, state = self.lib, self._layers, sources.state
        s0, cosine0 = _unit_sine(direction, lib.Float64)
        tolerance = dr.opaque(lib.Float64, self.tolerance)
        on = self.on_facet(pi, chord, mi.Point3f(origin), heading, valid)
        facing = dr.fma(on.normal.x, heading.x, on.normal.y * heading.y), -on.normal.z
        time, arc, area, p, sine, c, (onwards, down) = to_hit(
            table, lib, state, source, s0, cosine0, _horizontal(on.point, origin), PointState.at(table, -on.point.z),
            valid, tolerance, None if table.uniform else facing)
        on = on.moved(mi.Vector3f(heading.x * onwards, heading.y * onwards, -down))
        point, x = on.point, _horizontal(on.point, origin)
        # the hit may lie slightly off the launch bearing: directions are those of the eigenray
        along = mi.Vector2f(point.x - origin.x, point.y - origin.y) * dr.rcp(dr.maximum(mi.Float(x), 1e-9))
        along = dr.select(mi.Float(x) > 1e-6, along, heading)
        _, c0, _ = sources.state.gather(lib, source)
        cosine0, cosine = mi.Float(p * c0), mi.Float(p * c)
        sine0 = dr.sqrt(mi.Float(dr.maximum(1 - dr.square(p * c0), 0)))
        launch = mi.Vector3f(along.x * cosine0, along.y * cosine0, dr.copysign(sine0, direction.z))
        arrival = mi.Vector3f(along.x * cosine, along.y * cosine, -sine)
        normal = dr.select(dr.dot(on.normal, arrival) > 0, -on.normal, on.normal)
        if self.water.field is not None:
            time += self.water.through_field(origin, along, x, -point.z, arc, p, -launch.z).later
        smooth, uv = self.shading(on, valid)
        return Hits(valid=valid, point=point, normal=normal, shape=on.shape, primitive=pi.prim_index, uv=uv,
                    label=on.label, travel_time=time, arc_length=arc, spreading_area=area, ray_parameter=p,
                    sound_speed=c, launch_direction=launch, smooth=towards_sound(smooth, normal, arrival),
                    arrival_direction=arrival), on

    def facet(self, pi: mi.PreliminaryIntersection3f,
              valid: mi.Bool) -> tuple[mi.Bool, dr.ArrayBase, mi.Float64, mi.Float64]:
        """Return which hits are on meshes, their corners and label (Array4u, see `Geometry`), and barycentrics."""
        geometry, row = self.geometry, registry_index(pi)
        first_face = dr.gather(mi.UInt32, geometry.rows, 4 * row + 1, valid)
        mesh = valid
        if not geometry.only_meshes:
            mesh = valid & (dr.gather(mi.UInt32, geometry.rows, 4 * row + 2, valid) != 0)
        face = dr.gather(self.lib.Array4u, geometry.faces, dr.select(mesh, first_face + pi.prim_index, 0), mesh)
        # a miss leaves its barycentrics undefined, and a NaN depth would later be any index of a table
        u, v = (self.lib.Float64(dr.select(mesh, w, 0)) for w in (pi.prim_uv.x, pi.prim_uv.y))
        return mesh, face, u, v

    def on_facet(self, pi: mi.PreliminaryIntersection3f, chord: tuple[mi.Float, ...], origin: mi.Point3f,
                 heading: mi.Vector2f, valid: mi.Bool) -> FacetHit:
        """Return where on surfaces the hits on chords are."""
        geometry, wide, row = self.geometry, self.lib.Array3f64, registry_index(pi)
        mesh, face, u, v = self.facet(pi, valid)
        a, b, c = (mi.Point3f(v[0], v[1], v[2]) for v in
                   (dr.gather(self.lib.Array4f, geometry.vertices, face[i], mesh) for i in range(3)))
        point = wide(a) * (1 - u - v) + wide(b) * u + wide(c) * v
        first, second = mi.Vector3f(b - a), mi.Vector3f(c - a)
        normal = dr.cross(first, second)
        normal *= dr.rsqrt(dr.maximum(dr.squared_norm(normal), 1e-30))
        uv, label, shape = pi.prim_uv, face[3], pi.shape
        if not geometry.only_meshes:
            flags = mi.RayFlags.UV if geometry.textured else mi.RayFlags.Minimal
            si = pi.compute_surface_interaction(_chord_ray(origin, heading, *chord), flags, valid & ~mesh)
            uv = dr.select(mesh, uv, si.uv)
            point = dr.select(mesh, point, dr.select(valid, wide(si.p), 0))
            normal = dr.select(mesh, normal, mi.Vector3f(si.n))
            label = dr.select(mesh, label, dr.gather(mi.UInt32, geometry.rows, 4 * row, valid & ~mesh))
            # on an instance, the shape within its group is not known before
            shape = dr.select(valid & ~mesh, si.shape, shape)
        return FacetHit(mesh=mesh, face=face, edges=(first, second), place=(mi.Float(u), mi.Float(v)), point=point,
                        normal=normal, uv=uv, row=row, label=label, shape=shape)

    def shading(self, on: FacetHit, valid: mi.Bool) -> tuple[mi.Vector3f | None, mi.Point2f]:
        """Return the smooth normals of hits, None without any in the scene, and the texture coordinates."""
        geometry, (u, v), mesh, smooth, uv = self.geometry, on.place, on.mesh, None, on.uv
        if geometry.normals is not None:
            smooth = interpolated(self.lib, geometry.normals, on.face, u, v, mesh)
        if geometry.texcoords is not None:
            mapped = mesh & (dr.gather(mi.UInt32, geometry.rows, 4 * on.row + 3, valid) != 0)
            a, b, c = (mi.Point2f(dr.gather(self.lib.Array2f, geometry.texcoords, on.face[i], mapped))
                       for i in range(3))
            uv = dr.select(mapped, a * (1 - u - v) + b * u + c * v, uv)
        return smooth, uv


def registry_index(pi: mi.PreliminaryIntersection3f | mi.SurfaceInteraction3f) -> mi.UInt32:
    """Return the row of `Geometry.rows` and `Geometry.kinds` for a hit; an instance has its own row."""
    solid = dr.select(pi.instance != None, pi.instance, pi.shape)    # noqa: E711  (element-wise)
    return cast(mi.UInt32, dr.reinterpret_array(mi.UInt32, solid))


def _kind(kinds: mi.UInt32, pi: mi.PreliminaryIntersection3f, active: mi.Bool) -> mi.UInt32:
    """Return the kinds of the shapes hit."""
    return dr.gather(mi.UInt32, kinds, registry_index(pi), active)


def angles(direction: mi.Vector3f) -> tuple[mi.Float, mi.Vector2f]:
    """Return the launch angle [rad], positive down, and the horizontal unit vector of directions."""
    across = dr.sqrt(dr.fma(direction.x, direction.x, direction.y * direction.y))
    upright = across < 1e-9
    scale = dr.rcp(dr.select(upright, 1, across))
    return (cast(mi.Float, dr.atan2(-direction.z, across)),
            mi.Vector2f(dr.select(upright, 1, direction.x * scale), direction.y * scale))


def _horizontal(point, origin):
    """Return the horizontal distances of points from origins [m]."""
    dx, dy = point.x - origin.x, point.y - origin.y
    return dr.sqrt(dr.fma(dx, dx, dy * dy))


def _unit_sine(direction, wide):
    """Return sine (positive down) and cosine of the launch angle in float64, with squares that add up to 1."""
    x, y, z = wide(direction.x), wide(direction.y), wide(direction.z)
    across = dr.sqrt(dr.fma(x, x, y * y))
    scale = dr.rsqrt(dr.fma(z, z, across * across))
    sine = -z * scale
    return dr.select(abs(sine) < 1e-12, 1e-12, sine), across * scale    # exactly level rays spread 0/0


def _chord_ray(origin: mi.Point3f, heading: mi.Vector2f, r0: mi.Float, z0: mi.Float, r1: mi.Float,
               z1: mi.Float) -> mi.Ray3f:
    """Return the ray along a chord, of unit direction: Mitsuba's spheres and cylinders misplace others' hits by cm."""
    across, down = r1 - r0, z1 - z0
    square = dr.fma(across, across, down * down)
    per_length = dr.rsqrt(dr.maximum(square, 1e-12))
    across, down = across * per_length, down * per_length
    start = mi.Point3f(dr.fma(r0, heading.x, origin.x), dr.fma(r0, heading.y, origin.y), -z0)
    return mi.Ray3f(mi.Ray3f(start, mi.Vector3f(across * heading.x, across * heading.y, -down)), square * per_length)


def _along(distance: mi.Float, r0: mi.Float, z0: mi.Float, r1: mi.Float, z1: mi.Float) -> tuple[mi.Float, mi.Float]:
    """Return r and z [m] at distances [m] along chords, at their ends at most."""
    across, down = r1 - r0, z1 - z0
    share = dr.minimum(distance * dr.rsqrt(dr.maximum(across * across + down * down, 1e-12)), 1)
    return dr.fma(share, across, r0), dr.fma(share, down, z0)


@dr.syntax
def _first_hit(scene, fans, origin, source, launch_angle, heading, active):
    """Follow each ray's chords to its first hit.

    Returns the validity, the preliminary intersection, the chord's end points (r0, z0, r1, z1) and the vertex after.
    """
    row, off = fans.row(source, launch_angle)
    base = row * fans.stride
    size = dr.gather(mi.UInt32, fans.size, row)
    v = dr.gather(fans.lib.Array4f, fans.vertex, base)
    # -------------------------------------------------- loop state
    r0, z0 = dr.fma(off, v[2], v[0]), dr.fma(off, v[3], v[1])    # start of the current chord
    r1, z1 = mi.Float(r0), mi.Float(z0)                          # end of the chord
    i = mi.UInt32(1)                                             # vertex of the end
    pi = dr.zeros(mi.PreliminaryIntersection3f, dr.width(launch_angle))
    valid = mi.Bool(False)
    active &= size > 1
    while active:
        v = dr.gather(fans.lib.Array4f, fans.vertex, base + i, active)
        r1, z1 = dr.fma(off, v[2], v[0]), dr.fma(off, v[3], v[1])
        pi = scene.ray_intersect_preliminary(_chord_ray(origin, heading, r0, z0, r1, z1), coherent=True, active=active)
        valid = pi.is_valid() & active
        i += 1
        active = active & ~valid & (i < size)
        r0, z0 = dr.select(active, r1, r0), dr.select(active, z1, z0)
    return valid, pi, (r0, z0, r1, z1), i


@dr.syntax
def _seabed_behind(scene, kinds, fans, origin, source, launch_angle, heading, chord, vertex, distance, active):
    """Follow rays on, from an object hit at a `distance` along a chord, through all objects to the seabed.

    Returns the same as `_first_hit`, without the vertex.
    """
    row, off = fans.row(source, launch_angle)
    base = row * fans.stride
    size = dr.gather(mi.UInt32, fans.size, row)
    # -------------------------------------------------- loop state
    r0, z0, r1, z1 = (mi.Float(end) for end in chord)            # the current chord, from the last hit on
    i, t = mi.UInt32(vertex), mi.Float(distance)                 # the vertex after it; distance of the last hit
    pi = dr.zeros(mi.PreliminaryIntersection3f, dr.width(launch_angle))
    valid = mi.Bool(False)
    while active:
        r0, z0 = _along(t + BEYOND, r0, z0, r1, z1)
        pi = scene.ray_intersect_preliminary(_chord_ray(origin, heading, r0, z0, r1, z1), coherent=True, active=active)
        met = pi.is_valid() & active
        valid = met & (_kind(kinds, pi, met) == SEABED)
        t = dr.select(met, pi.t, 0)
        # past the end of a chord, the next one begins if there is one; else the ray goes on through the object met
        ended = active & ~met
        more = ended & (i < size)
        v = dr.gather(fans.lib.Array4f, fans.vertex, base + i, more)
        r0, z0 = dr.select(more, r1, r0), dr.select(more, z1, z0)
        r1 = dr.select(more, dr.fma(off, v[2], v[0]), r1)
        z1 = dr.select(more, dr.fma(off, v[3], v[1]), z1)
        t = dr.select(ended, -BEYOND, t)
        i = dr.select(more, i + 1, i)
        active = active & ~valid & (met | more)
    return valid, pi, (r0, z0, r1, z1)
