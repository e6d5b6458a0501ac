"""Closed cylinder (`capped_cylinder`): a tube with a flat cap at both ends, as a mesh.

Mitsuba's own `cylinder` is an open tube. Normals at the vertices are those of the true cylinder: `rigid`, `soft` and
`impedance` echo from a round tube with sharp rims, however many facets it has.

.. code-block:: xml

    <shape type="capped_cylinder" id="drum">
        <float name="radius" value="0.3"/>
        <point name="p0" x="20" y="-0.45" z="-19.7"/> <point name="p1" x="20" y="0.45" z="-19.7"/>
        <ref id="steel"/>
    </shape>
"""
import mitsuba as mi
import numpy as np

from ..attributes import Attributes, Integer, Number, Point, Transform
from .grid_mesh import MATERIAL, GridMesh, fill

SAGITTA = 2e-4                     # [m] between facets and the true cylinder: as of `tessellation`
FEWEST, MOST = 12, 4096            # facets round it
MOST_FACES = 5_000_000
COARSER = 1.5                      # from ring to ring of a cap, inwards

ATTRIBUTES = (
    Number("radius", above=0, unit="m", text="radius of the tube"),
    Point("p0", text="middle of one cap"),
    Point("p1", text="middle of the other"),
    Integer("facets", default=None, minimum=3, maximum=MOST, otherwise="within 0.2 mm of round",
            text="number of facets around it; by default as many as the accuracy of the round shape needs, 12 at "
                 "least"),
    Transform("to_world", otherwise="the identity",
              text="transform of the whole shape, without shear or unequal scales"),
    MATERIAL,
)


class CappedCylinder(mi.Mesh):
    """Mesh of a closed cylinder."""

    def __init__(self, props: mi.Properties) -> None:
        attributes = Attributes(props, ATTRIBUTES)
        radius, ends, facets = attributes.radius, np.stack([attributes.p0, attributes.p1]), attributes.facets
        to_world = attributes.to_world
        turn, scale = to_world[:3, :3], abs(np.linalg.det(to_world[:3, :3])) ** (1 / 3)
        if not scale > 0 or not np.allclose(turn.T @ turn, scale ** 2 * np.eye(3), atol=1e-5 * scale ** 2):
            raise attributes.error("to_world shears it or scales it unevenly; a cylinder needs one scale for all axes.")
        radius, ends = radius * scale, ends @ turn.T + to_world[:3, 3]
        length = float(np.linalg.norm(ends[1] - ends[0]))
        if not length > 0:
            raise attributes.error("p0 and p1 are the same point; give the middles of its two caps.")
        if facets is None:
            chord = np.sqrt(8 * radius * min(SAGITTA, radius))
            facets = int(np.clip(np.ceil(2 * np.pi * radius / chord), FEWEST, MOST))
        along = max(1, int(np.ceil(length / (2 * np.pi * radius / facets))))
        if 2 * facets * along > MOST_FACES:
            raise attributes.error(f"{facets} facets round a length of {length:g} m and a radius of {radius:g} m are "
                                   f"more than {MOST_FACES} triangles; give fewer facets.")
        mesh, normals = _mesh(radius, ends, facets, along)
        super().__init__("capped_cylinder", len(mesh.vertices), len(mesh.faces), props=props, has_vertex_normals=True,
                         has_vertex_texcoords=True)
        fill(self, mesh)
        # by themselves: with the vertices, Mitsuba would take its own means of the facets' in their place
        parameters = mi.traverse(self)
        parameters["vertex_normals"] = mi.Float(normals.astype(np.float32).ravel())
        parameters.update()
        self._description = f"CappedCylinder[radius {radius:g} m, length {length:g} m, {facets} facets]"

    def to_string(self) -> str:
        return self._description


def _mesh(radius, ends, facets, along):
    """Return the mesh and the normals of its vertices: `along` rings of `facets` quads, and two caps."""
    axis = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    x = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    x /= np.linalg.norm(x)
    y = np.cross(axis, x)
    # both ends of a seam have their own vertices, for their texture coordinates; places are the same to the last bit
    step = np.arange(facets + 1)
    turn = 2 * np.pi * (step % facets) / facets
    out = np.cos(turn)[:, None] * x + np.sin(turn)[:, None] * y                                       # (facets + 1, 3)
    share = np.arange(along + 1) / along
    middle = ends[0] * (1 - share)[:, None] + ends[1] * share[:, None]
    parts = [(middle[:, None] + radius * out, np.broadcast_to(out, (along + 1, facets + 1, 3)),
              np.stack(np.broadcast_arrays(step / facets, share[:, None]), -1))]
    number = np.arange((along + 1) * (facets + 1), dtype=np.uint32).reshape(along + 1, facets + 1)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    faces = [np.stack([a, b, c, a, c, d], -1).reshape(-1, 3)]
    flat, cap = _cap(facets)
    for end, normal in zip(ends, (-axis, axis)):
        place = end + radius * (flat[:, :1] * x + flat[:, 1:] * y)
        place[:facets] = end + radius * out[:-1]                       # those of the tube's rim
        first = sum(part[0].reshape(-1, 3).shape[0] for part in parts)
        parts.append((place, np.broadcast_to(normal, place.shape), 0.5 + 0.5 * flat))
        faces.append(np.uint32(first) + (cap if normal @ axis > 0 else cap[:, ::-1]))
    vertices, normals, texcoords = (np.concatenate([part.reshape(-1, part.shape[-1]) for part in column])
                                    for column in zip(*parts))
    return GridMesh(vertices.astype(np.float32), np.concatenate(faces).astype(np.uint32),
                    texcoords.astype(np.float32)), normals


def _cap(facets):
    """Return the points (V, 2) of a disc of radius 1, its `facets` rim points first, and counter-clockwise triangles.

    Rings grow coarser inwards, so that no triangle is much longer than wide.
    """
    from scipy.spatial import Delaunay

    radius, side, rings = 1.0, 2 * np.pi / facets, []
    count = facets
    while count >= 6:
        turn = 2 * np.pi * (np.arange(count) + 0.5 * (len(rings) % 2)) / count
        rings.append(radius * np.stack([np.cos(turn), np.sin(turn)], -1))
        side *= COARSER
        radius -= side
        count = int(2 * np.pi * radius / side)
    points = np.concatenate([*(rings or [np.stack([np.cos(t), np.sin(t)], -1) for t in
                                         [2 * np.pi * np.arange(facets) / facets]]), np.zeros((1, 2))])
    triangles = Delaunay(points).simplices
    a, b, c = (points[triangles[:, i]] for i in range(3))
    turned = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    triangles = np.where((turned < 0)[:, None], triangles[:, ::-1], triangles)
    return points, triangles[np.abs(turned) > 1e-12]


mi.register_shape("capped_cylinder", CappedCylinder)
