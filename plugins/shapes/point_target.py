"""Point target (`point_target`): a small target of known strength, whose echo has a phase but no chance in it.

It has no body: rays pass it, and nothing lies in its shadow. Its echo adds to those of the bed and of other targets as
pressures do: in a sidescan's speckle its amplitudes are Rice's. With `max_depth` 2 or more it has an image in beds of
`sediment`, `elastic` or a smooth material, unless it lies within 2 cm of them.

.. code-block:: xml

    <shape type="point_target" id="buoy">
        <point name="position" x="0" y="40" z="-12"/>
        <float name="target_strength_db" value="-20"/>
    </shape>
"""
import numpy as np

import mitsuba as mi

from ..attributes import Attributes, Number, Point
from .grid_mesh import TO_WORLD, GridMesh, fill

FACE = np.zeros((1, 3), np.uint32)  # without any area: no ray meets it, and Mitsuba wants one

ATTRIBUTES = (
    Point("position", text="its place, z up"),
    Number("target_strength_db", default=0.0, minimum=-200, maximum=100, unit="dB", text="re 1 m²"),
    TO_WORLD,
)


class PointTarget(mi.Mesh):
    """See the module's text."""

    def __init__(self, props: mi.Properties) -> None:
        attributes = Attributes(props, ATTRIBUTES)
        self.position = (attributes.to_world @ [*attributes.position, 1.0])[:3]
        self.target_strength_db = attributes.target_strength_db
        super().__init__("point_target", 1, len(FACE), props=props, has_vertex_texcoords=True)
        fill(self, GridMesh(self.position[None].astype(np.float32), FACE, np.zeros((1, 2), np.float32)))

    def to_string(self) -> str:
        return f"PointTarget[{self.target_strength_db:g} dB at {', '.join(f'{v:g}' for v in self.position)}]"


mi.register_shape("point_target", PointTarget)
