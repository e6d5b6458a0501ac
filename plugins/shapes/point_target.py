"""Point target (`point_target`): a small target of known strength, whose echo has a phase but no chance in it.

It has no body: rays pass it, and nothing lies in its shadow. Its echo adds to those of the bed and of other targets as
pressures do: in a sidescan's speckle its amplitudes are Rice's. With `max_depth` 2 or more it has an image in beds of
`sediment`, `elastic` or a smooth material, unless it lies within 2 cm of them.

Spheres scatter by their exact series and other targets by a table of their own, over the whole band of the pulse: a
calibration sphere has its nulls and resonances, and rings on after its first echo. `position` is the sphere's middle.
Of its ringing the first 1500 / (1.3 W) seconds are kept, W the bandwidth with its skirts; narrower resonances than the
inverse of that are smoothed, up to several decibels at their peaks, and metals, which have no losses here, have such.
Echoes drawn by chance, of more bounces than images have, take the mean strength.

`mi.traverse` names its ``position`` and, of one strength, its ``target_strength_db``.

A table has the columns ``frequency_khz``, ``target_strength_db`` and, where it is known, ``phase_deg`` (that of the
pressure 1 m away for a wave of phase 0 at `position`, for time e^(+iωt); without it the phase is 0), or ``real`` and
``imaginary`` [m] in the place of both. Angles may go with it, every combination of them once: ``aspect_deg``, between
the target's x axis and the sonar; or ``incident_azimuth_deg``, ``incident_elevation_deg``, ``scattered_azimuth_deg``,
``scattered_elevation_deg``, in which the target sees source and receiver (azimuth from x towards y). In netCDF they are
the dimensions, with coordinates, of variables of these names. Beyond its angles the last ones count. Frequencies lie
closer than c / 4d, d the target's part farthest from `position`; the pulse's band lies within them.

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
    Point("position", text="its place, z up"),
    Choice("scattering", default="constant", choices=("constant", *SPHERES, "table"),
           text="one strength for all frequencies and directions, an exact sphere, or a table"),
    Number("target_strength_db", default=0.0, minimum=LOWEST_DB, maximum=HIGHEST_DB, unit="dB", text="re 1 m²",
           only=("scattering", ("constant",))),
    Number("radius", above=0, maximum=100, unit="m", text="of the sphere", only=("scattering", SPHERES)),
    Choice("material", default="tungsten_carbide", choices=tuple(MATERIALS),
           text="of the sphere", only=("scattering", FILLED[1:])),
    Number("density", default=None, above=0, unit="kg/m³", otherwise="the material's", text="of the sphere",
           only=("scattering", FILLED)),
    Number("compressional_speed", default=None, above=0, unit="m/s", otherwise="the material's", text="in the sphere",
           only=("scattering", FILLED)),
    Number("shear_speed", default=None, above=0, unit="m/s", otherwise="the material's", text="in the sphere",
           only=("scattering", FILLED[1:])),
    File("table", text="CSV or netCDF file, as above", only=("scattering", ("table",))),
    TO_WORLD,
)


class PointTarget(mi.Mesh):
    """See the module's text."""

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
