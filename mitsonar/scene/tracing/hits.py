"""Where sound meets a surface.

Coarse meshes of smooth ground show their facets: each sends back by its own tilt. A shape with ``smooth_normals``
scatters by the tilt of the smooth surface that its facets stand for (Phong 1975, Communications of the ACM 18, 311),

    n = Σ_i λ_i n_i / |Σ_i λ_i n_i|,       n <- n + max(s - n·w, 0) w,  normalised

λ_i barycentric coordinates, n_i the normals at the corners, w the way back that sound came, s = min(facet's n·w, 0.02):
no normal looks away from where sound comes. Places, times, shadows and areas stay those of the facets. So a bin has
σ(smooth grazing angle) times the facets' area in it, whose sum is that of the mesh.
"""
from __future__ import annotations

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi

from mitsonar.device.arrays import picked

LEAST_SINE = 0.02                  # of the grazing angle on a smooth normal, unless the facet's is less
TOLD = 0.01                        # square of the length below which an interpolated normal tells nothing


@dataclass(frozen=True, kw_only=True)
class Hits:
    """Meetings of sound and surfaces, one a ray; entries are meaningful where `valid`.

    The first nine say what was met and how: all that materials ask for. The others tell of the way there. Where the
    maker does not know the way, as of a cell seen along a leg that is kept elsewhere, they are NaN (`on_surface`).
    """

    valid: mi.Bool  # (R,)
    point: dr.ArrayBase  # (R,) [m]: scene coordinates
    normal: mi.Vector3f  # (R,): unit, of the facet, on the side the ray came from
    arrival_direction: mi.Vector3f  # (R,): unit, along the travel
    sound_speed: mi.Float64  # (R,) [m/s]: at the hit
    shape: mi.ShapePtr  # (R,)
    primitive: mi.UInt32  # (R,)
    uv: mi.Point2f  # (R,)
    label: mi.UInt32  # (R,): number of the shape, see `Geometry.labels`
    travel_time: mi.Float64  # (R,) [s]
    arc_length: mi.Float  # (R,) [m]
    spreading_area: mi.Float  # (R,) [m²/sr]: naN of free rays, too
    launch_direction: mi.Vector3f  # (R,): unit, at the start
    ray_parameter: mi.Float64  # (R,) [s/m]
    smooth: mi.Vector3f | None = None  # (R,): normal that the surface scatters by, on the same side

    @classmethod
    def on_surface(cls, *, valid: mi.Bool, point: dr.ArrayBase, normal: mi.Vector3f, arrival_direction: mi.Vector3f,
                   sound_speed: mi.Float64, shape: mi.ShapePtr, primitive: mi.UInt32, uv: mi.Point2f,
                   label: mi.UInt32 | None = None, smooth: mi.Vector3f | None = None) -> Hits:
        """Return meetings without their way; the normals, and `smooth` as interpolated, may lie on either side."""
        unknown, long = mi.Float(dr.nan), mi.Float64(dr.nan)
        flat = dr.select(dr.dot(normal, arrival_direction) > 0, -normal, normal)
        return cls(valid=valid, point=point, normal=flat, arrival_direction=arrival_direction,
                   sound_speed=sound_speed, shape=shape, primitive=primitive, uv=uv,
                   label=mi.UInt32(0) if label is None else label, travel_time=long, arc_length=unknown,
                   spreading_area=unknown, launch_direction=mi.Vector3f(dr.nan), ray_parameter=long,
                   smooth=towards_sound(smooth, flat, arrival_direction))

    def without_way(self) -> Hits:
        """The same meetings, their way forgotten: what is kept of them is less."""
        unknown, long = mi.Float(dr.nan), mi.Float64(dr.nan)
        return replace(self, travel_time=long, arc_length=unknown, spreading_area=unknown,
                        launch_direction=mi.Vector3f(dr.nan), ray_parameter=long)

    def chosen(self, index: mi.UInt32) -> Hits:
        """The meetings with these numbers."""
        return Hits(**{name: picked(value, index) for name, value in vars(self).items() if value is not None})


def towards_sound(smooth: mi.Vector3f | None, normal: mi.Vector3f,
                  arrival_direction: mi.Vector3f) -> mi.Vector3f | None:
    """Return normals that surfaces scatter by, on the side of the sound."""
    # smooth (R,); normal (R,); arrival_direction (R,)
    if smooth is None:
        return None
    told = dr.squared_norm(smooth) > TOLD
    bent = dr.normalize(dr.select(told, smooth, normal))
    bent = dr.select(dr.dot(bent, normal) < 0, -bent, bent)
    least = dr.minimum(LEAST_SINE, -dr.dot(normal, arrival_direction))
    bent = dr.normalize(bent - dr.maximum(least + dr.dot(bent, arrival_direction), 0) * arrival_direction)
    return dr.select(told, bent, normal)
