"""Point target (`point_target`): a small target of known strength, whose echo has a definite phase.

The target has no body: rays pass it, and it casts no shadow. Its echo adds as a pressure to the echoes of the bed and
of other targets: in the speckle of a sidescan its amplitude follows Rice's distribution. With `max_depth` 2 or more it
is also mirrored in beds of `sediment`, `elastic` or a smooth material, unless it lies within 2 cm of them.

Spheres scatter by their exact series, and targets with a table by that table, over the whole band of the pulse: a
calibration sphere has nulls and resonances, and rings after its first echo. `position` is the centre of the sphere.
The first 1500 / (1.3 W) seconds of the ringing are kept, where W is the bandwidth with its skirts. Resonances narrower
than the inverse of that time are smoothed, by up to several decibels at their peaks. Metals have such resonances, as
they are lossless here. Random echoes of more bounces than the images have take the mean strength.

`mi.traverse` lists the ``position`` and, for a target of one strength, the ``target_strength_db``.

A table has the columns ``frequency_khz``, ``target_strength_db`` and optionally ``phase_deg``: the phase of the
pressure at 1 m for a wave of phase 0 at `position`, with time e^(+iωt), by default 0. Columns ``real`` and
``imaginary`` [m] may replace the last two. Columns of angles are optional, with one row for every combination:
``aspect_deg``, between the target's x axis and the direction to the sonar; or ``incident_azimuth_deg``,
``incident_elevation_deg``, ``scattered_azimuth_deg``, ``scattered_elevation_deg``, the directions from the target to
source and receiver (azimuth from x towards y). A netCDF file has variables of these names, with frequency and angles as
dimensions with coordinates.
Outside the range of its angles, the values at its limits are used. Frequencies must cover the band of the pulse, in
steps below c / 4d, where d is the distance of the target's farthest part from `position`.

.. code-block:: xml

    <shape type="point_target" id="buoy">
        <point name="position" x="0" y="40" z="-12"/>
        <float name="target_strength_db" value="-20"/>
    </shape>
    <shape type="point_target" id="calibration_sphere">
        <point name="position" x="0" y="5" z="-8"/>
        <string name="scattering" value="elastic_sphere"/>
        <float name="radius" value="0.01905"/>
    </shape>
"""
import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import upload
from mitsonar.scattering.bodies.scattering_functions import ScatteringFunction, SphereScattering
from mitsonar.scattering.bodies.sphere_series import MATERIALS, Solid, SphereBody

from ..attributes import Attributes, Choice, File, Number, Point
from .grid_mesh import TO_WORLD, GridMesh, fill

SPHERES = "rigid_sphere", "soft_sphere", "fluid_sphere", "elastic_sphere"
FILLED = SPHERES[2:]
LOWEST_DB, HIGHEST_DB = -200, 100
FACE = np.zeros((1, 3), np.uint32)  # without any area: no ray meets it, and Mitsuba wants one

ATTRIBUTES = (
    Point("position", text="place of the target, z up"),
    Choice("scattering", default="constant", choices=("constant", *SPHERES, "table"),
           text="one strength for all frequencies and directions, an exact sphere, or a table"),
    Number("target_strength_db", default=0.0, minimum=LOWEST_DB, maximum=HIGHEST_DB, unit="dB",
           text="target strength relative to 1 m²",
           only=("scattering", ("constant",))),
    Number("radius", above=0, maximum=100, unit="m", text="radius of the sphere", only=("scattering", SPHERES)),
    Choice("material", default="tungsten_carbide", choices=tuple(MATERIALS),
           text="material of the sphere", only=("scattering", FILLED[1:])),
    Number("density", default=None, above=0, unit="kg/m³", otherwise="the material's", text="density of the sphere",
           only=("scattering", FILLED)),
    Number("compressional_speed", default=None, above=0, unit="m/s", otherwise="the material's",
           text="compressional wave speed in the sphere",
           only=("scattering", FILLED)),
    Number("shear_speed", default=None, above=0, unit="m/s", otherwise="the material's",
           text="shear wave speed in the sphere",
           only=("scattering", FILLED[1:])),
    File("table", text="CSV or netCDF file of the target, as described above", only=("scattering", ("table",))),
    TO_WORLD,
)


class PointTarget(mi.Mesh):
    """Small target of known strength."""

    def __init__(self, props: mi.Properties) -> None:
        attributes = Attributes(props, ATTRIBUTES)
        self.position = (attributes.to_world @ [*attributes.position, 1.0])[:3]
        self.target_strength_db = attributes.target_strength_db if attributes.scattering == "constant" else np.nan
        self.scattering = _scattering(attributes)
        self.rotation = _rotation(attributes) if self.scattering is not None else None
        super().__init__("point_target", 1, len(FACE), props=props, has_vertex_texcoords=True)
        self.place, self.strength_db = upload(mi.Float64, self.position), upload(
            mi.Float64, np.array([float(self.target_strength_db)]))
        fill(self, GridMesh(self.position[None].astype(np.float32), FACE, np.zeros((1, 2), np.float32)))

    def traverse(self, callback: mi.TraversalCallback) -> None:
        super().traverse(callback)
        callback.put("position", self.place, mi.ParamFlags.Differentiable)
        if self.scattering is None:
            callback.put("target_strength_db", self.strength_db, mi.ParamFlags.Differentiable)

    def parameters_changed(self, keys: list[str]) -> None:
        place, strength = (dr.detach(value).numpy() for value in (self.place, self.strength_db))
        if len(place) != 3 or not np.all(np.isfinite(place)):
            raise ValueError(f"point_target: position is {place.tolist()}; give three finite numbers [m].")
        if self.scattering is None and not (len(strength) == 1 and LOWEST_DB <= strength[0] <= HIGHEST_DB):
            raise ValueError(f"point_target: target_strength_db is {strength.tolist()}; give one number from "
                             f"{LOWEST_DB} to {HIGHEST_DB}.")
        if np.any(place != self.position):
            self.position = np.array(place)
            mi.traverse(self)["vertex_positions"] = upload(mi.Float, place.astype(np.float32))
            keys = [*keys, "vertex_positions"]
        elif "vertex_positions" in keys:
            vertex = dr.detach(mi.traverse(self)["vertex_positions"]).numpy()
            if np.any(vertex != self.position.astype(np.float32)):
                self.position = vertex.astype(float)
                mi.traverse(self)["position"] = upload(mi.Float64, self.position)
        if self.scattering is None:
            self.target_strength_db = float(strength[0])
        super().parameters_changed(keys)

    def to_string(self) -> str:
        what = f"{self.target_strength_db:g} dB" if self.scattering is None else type(self.scattering).__name__
        return f"PointTarget[{what} at {', '.join(f'{v:g}' for v in self.position)}]"


def _scattering(attributes: Attributes) -> ScatteringFunction | None:
    kind = attributes.scattering
    try:
        if kind == "constant":
            return None
        if kind == "table":
            from mitsonar.io.scene_files import scattering_tables  # with xarray, a third of a second

            return scattering_tables.read(attributes.table)
        if kind not in FILLED:
            return SphereScattering(radius=attributes.radius, body=SphereBody(inside=kind.removesuffix("_sphere")))
        return SphereScattering(radius=attributes.radius, body=SphereBody(inside=_solid(attributes)))
    except (ValueError, OSError) as error:
        raise attributes.error(f"{str(error).rstrip('.')}.") from None


def _solid(attributes: Attributes) -> Solid:
    names = ("density", "compressional_speed", "shear_speed")
    given = {name: getattr(attributes, name) for name in names if getattr(attributes, name) is not None}
    if attributes.scattering == "elastic_sphere":
        return Solid(**{**vars(MATERIALS[attributes.material]), **given})
    if len(given) < 2:
        raise attributes.error("a fluid_sphere needs its density and its compressional_speed; give both.")
    return Solid(**given)


def _rotation(attributes: Attributes) -> np.ndarray:
    turn = attributes.to_world[:3, :3]
    if not np.allclose(turn.T @ turn, np.eye(3), atol=1e-5) or np.linalg.det(turn) < 0:
        raise attributes.error("to_world scales, shears or mirrors it; such a target is turned and moved alone.")
    return turn


mi.register_shape("point_target", PointTarget)
