"""Where rays meet a scene."""
from dataclasses import dataclass

__all__ = ["Hits"]


@dataclass(frozen=True, kw_only=True)
class Hits:
    """Meetings of rays and scene, one a ray; entries are meaningful where `valid`.

    Attributes
    ----------
    valid : Bool (R,)
    point : Array3f64 (R,) [m]
        Scene coordinates.
    normal : Vector3f (R,)
        Unit, of the facet, on the side the ray came from.
    label : UInt32 (R,)
        Number of the shape, see `Geometry.labels`; 0 where nothing was hit.
    shape : ShapePtr (R,)
    primitive, uv : UInt32 (R,), Point2f (R,)
        Facet, and texture coordinates (barycentric where the shape has none, or no material of the scene asks).
    travel_time : Float64 (R,) [s]
    arc_length : Float (R,) [m]
    spreading_area : Float (R,) [m²/sr]
    launch_direction, arrival_direction : Vector3f (R,)
        Unit, along the travel, at the source and at the hit.
    ray_parameter : Float64 (R,) [s/m]
    sound_speed : Float64 (R,) [m/s]
        At the hit.
    """

    valid: object
    point: object
    normal: object
    label: object
    shape: object
    primitive: object
    uv: object
    travel_time: object
    arc_length: object
    spreading_area: object
    launch_direction: object
    arrival_direction: object
    ray_parameter: object
    sound_speed: object
