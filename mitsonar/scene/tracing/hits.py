"""Hits of rays on surfaces.

A coarse mesh of smooth ground shows its facets, because each scatters by its own tilt. A shape with ``smooth_normals``
scatters by the tilt of the smooth surface that its facets stand for (Phong 1975, Communications of the ACM 18, 311),

    n = Σ_i λ_i n_i / |Σ_i λ_i n_i|,       n <- n + max(s - n·w, 0) w,  normalised

with barycentric coordinates λ_i, normals n_i at the corners, w the direction back to the sound's origin, and
s = min(facet's n·w, 0.02), so that no normal looks away from the sound. Places, times, shadows and areas stay those of
the facets. A bin therefore has σ(smooth grazing angle) times its facets' area, and these areas add up to the mesh's.
"""
from __future__ import annotations

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi

from mitsonar.device.arrays import picked

LEAST_SINE = 0.02                  # of the grazing angle on a smooth normal, unless the facet's is less
LEAST_SQUARE = 0.01                # squared length below which an interpolated normal has no meaning


@dataclass(frozen=True, kw_only=True)
class Hits:
    """Hits on surfaces, one for each ray; entries are meaningful where `valid`.

    The fields up to `uv` describe the surface hit, and are all that materials need. Those from `travel_time` describe
    the way there. They are NaN if it is not known, as for a cell seen along a leg stored elsewhere (`on_surface`).
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
    spreading_area: mi.Float  # (R,) [m²/sr]: NaN for free rays, too
    launch_direction: mi.Vector3f  # (R,): unit, at the start
    ray_parameter: mi.Float64  # (R,) [s/m]
    smooth: mi.Vector3f | None = None  # (R,): normal that the surface scatters by, on the same side

    @classmethod
    def on_surface(cls, *, valid: mi.Bool, point: dr.ArrayBase, normal: mi.Vector3f, arrival_direction: mi.Vector3f,
                   sound_speed: mi.Float64, shape: mi.ShapePtr, primitive: mi.UInt32, uv: mi.Point2f,
                   label: mi.UInt32 | None = None, smooth: mi.Vector3f | None = None) -> Hits:
        """Return hits without a way; `normal` and the interpolated `smooth` may lie on either side."""
        unknown, long = mi.Float(dr.nan), mi.Float64(dr.nan)
        flat = dr.select(dr.dot(normal, arrival_direction) > 0, -normal, normal)
        return cls(valid=valid, point=point, normal=flat, arrival_direction=arrival_direction,
                   sound_speed=sound_speed, shape=shape, primitive=primitive, uv=uv,
                   label=mi.UInt32(0) if label is None else label, travel_time=long, arc_length=unknown,
                   spreading_area=unknown, launch_direction=mi.Vector3f(dr.nan), ray_parameter=long,
                   smooth=towards_sound(smooth, flat, arrival_direction))

    def without_way(self) -> Hits:
        """Return the hits without their way, to store less."""
        unknown, long = mi.Float(dr.nan), mi.Float64(dr.nan)
        return replace(self, travel_time=long, arc_length=unknown, spreading_area=unknown,
                        launch_direction=mi.Vector3f(dr.nan), ray_parameter=long)

    def chosen(self, index: mi.UInt32) -> Hits:
        """Return the hits at an index."""
        return Hits(**{name: picked(value, index) for name, value in vars(self).items() if value is not None})


def towards_sound(smooth: mi.Vector3f | None, normal: mi.Vector3f,
                  arrival_direction: mi.Vector3f) -> mi.Vector3f | None:
    """Return interpolated normals (R,) turned to the side of the sound, to scatter by."""
    if smooth is None:
        return None
    usable = dr.squared_norm(smooth) > LEAST_SQUARE
    bent = dr.normalize(dr.select(usable, smooth, normal))
    bent = dr.select(dr.dot(bent, normal) < 0, -bent, bent)
    least = dr.minimum(LEAST_SINE, -dr.dot(normal, arrival_direction))
    bent = dr.normalize(bent - dr.maximum(least + dr.dot(bent, arrival_direction), 0) * arrival_direction)
    return dr.select(usable, bent, normal)
