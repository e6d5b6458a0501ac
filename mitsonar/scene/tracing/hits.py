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

__all__ = ["Hits", "towards_sound"]

LEAST_SINE = 0.02                  # of the grazing angle on a smooth normal, unless the facet's is less
TOLD = 0.01                        # square of the length below which an interpolated normal tells nothing


@dataclass(frozen=True, kw_only=True)
class Hits:
    """Meetings of sound and surfaces, one a ray; entries are meaningful where `valid`.

    The first nine say what was met and how: all that materials ask for. The others tell of the way there. Where the
    maker does not know the way, as of a cell seen along a leg that is kept elsewhere, they are NaN (`on_surface`).

    Attributes
    ----------
    valid : Bool (R,)
    point : Array3f64 (R,) [m]
        Scene coordinates.
    normal : Vector3f (R,)
        Unit, of the facet, on the side the ray came from.
    arrival_direction : Vector3f (R,)
        Unit, along the travel.
    sound_speed : Float64 (R,) [m/s]
        At the hit.
    shape : ShapePtr (R,)
    primitive, uv : UInt32 (R,), Point2f (R,)
        Facet, and texture coordinates (barycentric where the shape has none, or no material of the scene asks).
    label : UInt32 (R,)
        Number of the shape, see `Geometry.labels`; 0 where nothing was hit, or nobody asks.
    travel_time : Float64 (R,) [s]
    arc_length : Float (R,) [m]
    spreading_area : Float (R,) [m²/sr]
        NaN of free rays, too.
    launch_direction : Vector3f (R,)
        Unit, at the start.
    ray_parameter : Float64 (R,) [s/m]
    smooth : Vector3f (R,) or None
        Normal that the surface scatters by, on the same side; None if by the facet's in all of the scene.
    """

    valid: mi.Bool
    point: dr.ArrayBase
    normal: mi.Vector3f
    arrival_direction: mi.Vector3f
    sound_speed: mi.Float64
    shape: mi.ShapePtr
    primitive: mi.UInt32
    uv: mi.Point2f
    label: mi.UInt32
    travel_time: mi.Float64
    arc_length: mi.Float
    spreading_area: mi.Float
    launch_direction: mi.Vector3f
    ray_parameter: mi.Float64
    smooth: mi.Vector3f | None = None

    @classmethod
    def on_surface(cls, *, valid: mi.Bool, point: dr.ArrayBase, normal: mi.Vector3f, arrival_direction: mi.Vector3f,
                   sound_speed: mi.Float64, shape: mi.ShapePtr, primitive: mi.UInt32, uv: mi.Point2f,
                   label: mi.UInt32 | None = None, smooth: mi.Vector3f | None = None) -> Hits:
        """Give meetings without their way; the normals, and `smooth` as interpolated, may lie on either side."""
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
    """Give normals that surfaces scatter by, on the side of the sound.

    Parameters
    ----------
    smooth : Vector3f (R,) or None
        As interpolated between corners, of any length, on either side; of length 0 where facets are meant as they are.
    normal : Vector3f (R,)
        Unit, of facets, on the side of the sound.
    arrival_direction : Vector3f (R,)
        Unit, along the travel.
    """
    if smooth is None:
        return None
    told = dr.squared_norm(smooth) > TOLD
    bent = dr.normalize(dr.select(told, smooth, normal))
    bent = dr.select(dr.dot(bent, normal) < 0, -bent, bent)
    least = dr.minimum(LEAST_SINE, -dr.dot(normal, arrival_direction))
    bent = dr.normalize(bent - dr.maximum(least + dr.dot(bent, arrival_direction), 0) * arrival_direction)
    return dr.select(told, bent, normal)
