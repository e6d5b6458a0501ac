"""Sea surface (`sea_surface`): a level square at z = 0 about the origin, rough by its material.

Tracks and altitudes refer to the seabed, not to this surface.

.. code-block:: xml

    <shape type="sea_surface"><float name="wind_speed" value="8"/></shape>
"""
from dataclasses import replace

import mitsuba as mi
import numpy as np

from ..attributes import Attributes, Nested, Number
from ..bsdfs.windy_sea import WIND_SPEED
from .grid_mesh import fill, triangulate

SQUARES = 64                       # along a side

ATTRIBUTES = (
    Number("size", default=4000.0, above=0, unit="m", text="side of the square about the origin"),
    replace(WIND_SPEED, text=f"{WIND_SPEED.text}, for the default material"),
    Nested("bsdf", default=None, otherwise="`windy_sea`", text="material of the surface"),
)


class SeaSurface(mi.Mesh):
    """Level square at the sea surface."""

    sea_surface = True

    def __init__(self, props: mi.Properties) -> None:
        attributes = Attributes(props, ATTRIBUTES)
        self.size = attributes.size
        if attributes.given("to_world"):
            raise attributes.error("to_world is given; the sea surface lies level at z = 0: leave it out.")
        if attributes.bsdf is None:
            props["bsdf"] = mi.load_dict({"type": "windy_sea", "wind_speed": attributes.wind_speed})
        elif attributes.given("wind_speed"):
            raise attributes.error("wind_speed is given beside a nested bsdf; give it to the bsdf.")
        # many, so that arrays may cut each into cells of millimetres
        edges = 0.5 * self.size * np.linspace(-1, 1, SQUARES + 1)
        grid = triangulate(edges, edges, np.zeros((SQUARES + 1, SQUARES + 1)), np.eye(4))
        super().__init__("sea_surface", len(grid.vertices), len(grid.faces), props=props, has_vertex_texcoords=True)
        fill(self, grid)

    def to_string(self) -> str:
        return f"SeaSurface[{self.size:g} m, {self.bsdf()}]"


mi.register_shape("sea_surface", SeaSurface)
