"""Sea surface (`sea_surface`): a level square at z = 0 about the origin, rough by its material.

- ``size`` [m, 4000]: side of the square
- ``wind_speed`` [m/s, 5]: of the material `windy_sea` that it has where none is nested

It is no seabed: tracks and altitudes are laid as if it were not there.

.. code-block:: xml

    <shape type="sea_surface"><float name="wind_speed" value="8"/></shape>
"""
import numpy as np

import mitsuba as mi
from mitsonar.plugins.attributes import Attributes
from mitsonar.plugins.bsdfs.windy_sea import STRONGEST_WIND

from .grid_mesh import fill, triangulate


SQUARES = 64                       # along a side


class SeaSurface(mi.Mesh):
    """See the module's text.

    Attributes
    ----------
    sea_surface : bool
        True: whoever looks for the seabed leaves the shape out.
    """

    sea_surface = True

    def __init__(self, props):
        attributes = Attributes(props)
        self.size = attributes.number("size", 4000.0, above=0, unit="m")
        wind_speed = attributes.number("wind_speed", 5.0, minimum=0, maximum=STRONGEST_WIND, unit="m/s")
        attributes.finish()
        if attributes.given("to_world"):
            raise attributes.error("to_world is given; the sea surface lies level at z = 0: leave it out.")
        if attributes.object(mi.BSDF, None) is None:
            props["bsdf"] = mi.load_dict({"type": "windy_sea", "wind_speed": wind_speed})
        elif attributes.given("wind_speed"):
            raise attributes.error("wind_speed is given beside a nested bsdf; give it to the bsdf.")
        # many, so that arrays may cut each into cells of millimetres
        edges = 0.5 * self.size * np.linspace(-1, 1, SQUARES + 1)
        grid = triangulate(edges, edges, np.zeros((SQUARES + 1, SQUARES + 1)), np.eye(4))
        super().__init__("sea_surface", len(grid.vertices), len(grid.faces), props=props, has_vertex_texcoords=True)
        fill(self, grid)

    def to_string(self):
        return f"SeaSurface[{self.size:g} m, {self.bsdf().to_string()}]"


mi.register_shape("sea_surface", SeaSurface)
