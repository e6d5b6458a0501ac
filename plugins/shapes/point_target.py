"""Point target (`point_target`): a small target of known strength, whose echo has a phase but no chance in it.

- ``position`` (point) [m]: z up
- ``target_strength_db`` [0 dB re 1 µPa at 1 m, that is re 1 m²]

It is drawn as an octahedron of 1 cm, which casts as good as no shadow. Its echo adds to those of the bed and of other
targets as pressures do: in a sidescan's speckle its amplitudes are Rice's.

.. code-block:: xml

    <shape type="point_target" id="buoy">
        <point name="position" x="0" y="40" z="-12"/>
        <float name="target_strength_db" value="-20"/>
    </shape>
"""
import numpy as np

import mitsuba as mi
from mitsonar.plugins.properties import Attributes

from .grid_mesh import GridMesh, fill

RADIUS = 0.01                      # [m]
CORNERS = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
FACES = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [1, 0, 5], [2, 1, 5], [3, 2, 5], [0, 3, 5]], np.uint32)


class PointTarget(mi.Mesh):
    """See the module's text."""

    def __init__(self, props):
        attributes = Attributes(props)
        self.position = attributes.point("position")
        self.target_strength_db = attributes.number("target_strength_db", 0.0, minimum=-200, maximum=100, unit="dB")
        attributes.finish()
        vertices = (self.position + RADIUS * CORNERS).astype(np.float32)
        super().__init__("point_target", len(vertices), len(FACES), props=props, has_vertex_texcoords=True)
        fill(self, GridMesh(vertices, FACES, np.zeros((len(vertices), 2), np.float32)))

    def to_string(self):
        return f"PointTarget[{self.target_strength_db:g} dB at {self.position}]"


mi.register_shape("point_target", PointTarget)
