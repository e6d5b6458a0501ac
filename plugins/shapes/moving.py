"""Moving object (`moving`): a shape that moves from ping to ping, and while the echoes of a ping come in.

The nested shape is written as it stands at the origin, heading north: x to starboard, y ahead, z up. The object takes
its id from `moving`. It follows a recorded `track`, a CSV file with the columns ``time``, ``x``, ``y``, ``z`` and
optionally ``roll``, ``pitch``, ``heading`` as for a sonar's track; or it leaves `start` at a `speed` along
`heading_deg`.

An object stands where the sound of each ping meets it. Its scatterers move with it: speckle, shadows, labels and the
box in the image's attributes follow. Its echoes have the Doppler of its own motion.

A swimmer's gait is given by a few poses: as many nested meshes, whose vertices alone differ, and a `gait_period`.
Pieces of the mesh that no face joins, such as legs and fins, keep their form and swing from pose to pose along smooth
curves.

Meshes, Mitsuba's `sphere`, `cylinder`, `disk` and `rectangle`, and `point_target` may move. Seabeds, sea surfaces and
`targets` may not, nor shapes of a smooth material (`rigid`, `soft`, `impedance`); a `point_target` with the scattering
of a sphere may.

.. code-block:: xml

    <shape type="moving" id="diver.1">
        <point name="start" x="-4" y="9" z="-10.5"/>
        <float name="heading_deg" value="80"/> <float name="speed" value="0.8"/>
        <shape type="ply"><string name="filename" value="meshes/diver.ply"/></shape>
    </shape>
"""
import mitsuba as mi
import numpy as np

from mitsonar.device.rotations import NORTH_EAST_DOWN, rotation_matrix
from mitsonar.io.tracks import tracks
from mitsonar.io.tracks.navigation import Waypoints
from mitsonar.scene.moving import MovingPart, moving_shape
from mitsonar.scene.protocols import is_sea_surface, is_seabed, is_smooth, parted_shape, target_shape
from mitsonar.scene.tessellation import KINDS, grid_of
from mitsonar.sonar.motion.gait import RigidPart, rigid_parts
from mitsonar.sonar.motion.trajectory import Recorded, Steered, Trajectory

from ..attributes import Angle, Attributes, File, Nested, Number, Point
from .grid_mesh import GridMesh, fill

ATTRIBUTES = (
    Nested("shape", many=True, text="the shape that moves, as it stands at the origin, heading north; of a swimmer two "
                                    "or more, the poses of its gait in their order: meshes with the same faces"),
    Number("gait_period", default=None, above=0, maximum=1000, unit="s",
           text="time in which a swimmer goes through all poses once"),
    File("track", default=None, text="CSV or XTF file of places and attitudes, in metres of the scene; not with "
                                     "`start` and what follows"),
    Number("begin", default=None, unit="s", otherwise="of a track: the time of the sonar's track, else 0",
           text="time of the object's motion at the first ping"),
    Point("start", default=None, text="place at time 0, z up"),
    Angle("heading_deg", default=0.0, text="heading at time 0, clockwise from north; the object moves along it"),
    Angle("pitch_deg", default=0.0, minimum=-90, maximum=90, text="pitch, positive nose up"),
    Angle("roll_deg", default=0.0, minimum=-180, maximum=180, text="roll, positive starboard side down"),
    Number("speed", default=0.0, minimum=0, maximum=50, unit="m/s", text="speed over the ground"),
    Number("climb", default=0.0, minimum=-20, maximum=20, unit="m/s", text="rate of climb, positive up"),
    Angle("turn_rate_deg", default=0.0, minimum=-360, maximum=360, text="rate of turn a second, positive clockwise"),
)
COURSE = ("start", "heading_deg", "pitch_deg", "roll_deg", "speed", "climb", "turn_rate_deg")


class Moving(mi.Mesh):
    """Mesh or point target that moves."""

    def __init__(self, props: mi.Properties) -> None:
        attributes = Attributes(props, ATTRIBUTES)
        shape, *more = attributes.shape
        for one in (shape, *more):
            _refuse(attributes, one)
        trajectory, self.known = _trajectory(attributes)
        self.mover: Trajectory = trajectory
        self.begin: float | None = attributes.begin
        if attributes.track is None and self.begin is None:
            self.begin = 0.0
        if (target := target_shape(shape)) is not None:
            self.position, self.target_strength_db = target.position, target.target_strength_db
            self.scattering, self.rotation = target.scattering, target.rotation
        self.smooth_normals = bool(getattr(shape, "smooth_normals", KINDS.get(shape.class_name(), 0) > 2))
        mesh = _mesh(attributes, shape)
        self.poses = mesh.vertices.astype(float)[None]
        if target is not None:
            self.poses = np.array([[self.position]], float)
        parts: list[RigidPart] = [RigidPart(vertices=np.arange(self.poses.shape[1]), gait=None)]
        if more or attributes.gait_period is not None:
            mesh, parts = self._swimming(attributes, mesh, more)
        first = np.cumsum([0, *(len(part.vertices) for part in parts)])
        self.parts = tuple(MovingPart(shape=self, first=int(start), rest=self.poses[0, start:end], gait=part.gait)
                           for part, start, end in zip(parts, first, first[1:]))
        if (material := shape.bsdf()) is not None:
            props["bsdf"] = material
        super().__init__("moving", len(mesh.vertices), len(mesh.faces), props=props, has_vertex_texcoords=True)
        position, attitude = trajectory.pose(np.array(max(self.known[0], self.begin or 0.0)))
        turn = rotation_matrix(*attitude) @ NORTH_EAST_DOWN
        fill(self, mesh._replace(vertices=(self.poses[0] @ turn.T + position).astype(np.float32)))
        self._filled = True
        self._description = f"Moving[{shape.class_name()} from {', '.join(f'{v:.3g}' for v in position)}]"

    def _swimming(self, attributes: Attributes, mesh: GridMesh,
                  more: list[mi.Shape]) -> tuple[GridMesh, list[RigidPart]]:
        """Take the poses of a gait; return the mesh with its vertices and faces in the order of its rigid parts."""
        if not more or attributes.gait_period is None:
            raise attributes.error("a gait has two or more nested meshes, its poses, and a gait_period; give both.")
        others = [_mesh(attributes, one) for one in more]
        for number, other in enumerate(others, 2):
            if not np.array_equal(other.faces, mesh.faces) or len(other.vertices) != len(mesh.vertices):
                raise attributes.error(
                    f"pose {number} has {len(other.vertices)} vertices and {len(other.faces)} faces, not those of the "
                    f"first pose ({len(mesh.vertices)} and {len(mesh.faces)}); give meshes that differ in the places "
                    "of their vertices alone.")
        poses = np.stack([one.vertices.astype(float) for one in (mesh, *others)])
        try:
            parts = list(rigid_parts(poses, mesh.faces, attributes.gait_period))
        except ValueError as error:
            raise attributes.error(error) from None
        order = np.concatenate([part.vertices for part in parts])
        place = np.argsort(order)
        faces = place[mesh.faces].astype(np.uint32)
        part_of = np.repeat(np.arange(len(parts)), [len(part.vertices) for part in parts])
        self.poses = poses[:, order]
        return GridMesh(mesh.vertices[order], faces[np.argsort(part_of[faces[:, 0]], kind="stable")],
                        mesh.texcoords[order]), parts

    def parameters_changed(self, keys: list[str]) -> None:
        if getattr(self, "_filled", False) and {"vertex_positions", "faces"} & {*keys}:
            raise ValueError(f'moving: the vertices of "{self.id()}" were changed, and they follow from its course; '
                             "change the file of the nested shape, or the course.")
        super().parameters_changed(keys)

    def to_string(self) -> str:
        return self._description


def _refuse(attributes: Attributes, shape: mi.Shape) -> None:
    """Refuse shapes that cannot move."""
    if moving_shape(shape) is not None:
        raise attributes.error("a moving shape is nested in it; an object has one motion, nest the shape itself.")
    if parted_shape(shape) is not None or is_seabed(shape) or is_sea_surface(shape):
        raise attributes.error(f"a {shape.class_name()} is nested in it, and seabeds, sea surfaces and targets on the "
                               "bed do not move; nest a mesh (ply, obj), a sphere or a point_target.")
    if target_shape(shape) is None and is_smooth(shape):
        raise attributes.error("the nested shape has a smooth material, and smooth surfaces do not move; give it a "
                               "material that scatters, such as lambert, or nest a point_target with the scattering "
                               "rigid_sphere.")


def _trajectory(attributes: Attributes) -> tuple[Trajectory, tuple[float, float]]:
    """Return the motion, and the first and last time that it is known for."""
    if attributes.track is None:
        if attributes.start is None:
            raise attributes.error("neither track nor start is given; give the file of a track, or the place that the "
                                   "object starts from.")
        attitude = np.array([attributes.roll_deg, attributes.pitch_deg, attributes.heading_deg])
        lead = Steered(start=attributes.start, attitude=attitude, speed=attributes.speed, climb=attributes.climb,
                       turn_rate=attributes.turn_rate_deg)
        return Trajectory(lead=lead), (-np.inf, np.inf)
    if written := attributes.given(*COURSE):
        raise attributes.error(f"track and {written[0]} are both given; leave one of them out.")
    try:
        record = tracks.load(attributes.track)
    except ValueError as error:
        raise attributes.error(error) from None
    if isinstance(record, Waypoints):
        raise attributes.error("the track has no column time; add the time of each place [s].")
    if record.geographic or record.z is None:
        missing = "is in latitude and longitude" if record.geographic else "does not say how deep the object is"
        raise attributes.error(f"the track {missing}; give x, y and z (or depth) in metres of the scene.")
    track = record.placed()
    return Trajectory(lead=Recorded.through(track)), (float(track.time[0]), float(track.time[-1]))


def _mesh(attributes: Attributes, shape: mi.Shape) -> GridMesh:
    """Return the mesh of a shape at rest; round shapes are cut into facets."""
    parameters = mi.traverse(shape)
    if "vertex_positions" not in parameters:
        try:
            grid = grid_of(shape)
        except ValueError as error:
            raise attributes.error(error) from None
        return GridMesh(grid.vertices, grid.faces, grid.texcoords.astype(np.float32))
    vertices, faces = (parameters[name].numpy().reshape(-1, 3) for name in ("vertex_positions", "faces"))
    texcoords = np.zeros((len(vertices), 2), np.float32)
    if "vertex_texcoords" in parameters and len(parameters["vertex_texcoords"]):
        texcoords = parameters["vertex_texcoords"].numpy().reshape(-1, 2)
    return GridMesh(vertices, faces, texcoords)


mi.register_shape("moving", Moving)
