"""Smooth rigid surface (`rigid`): an immovable wall, R = 1 at all angles.

Its echo is coherent and has a phase, computed by Kirchhoff's integral over the facets, corners included.

.. code-block:: xml

    <bsdf type="rigid" id="hull"/>
"""
import drjit as dr
import mitsuba as mi

from ..attributes import Attributes
from .smooth import Smooth

ATTRIBUTES = ()


class Rigid(Smooth):
    """Rigid body."""

    def __init__(self, props: mi.Properties) -> None:
        Attributes(props, ATTRIBUTES)
        super().__init__(props)

    def reflection(self, si: mi.SurfaceInteraction3f, sin_grazing: mi.Float, frequency: mi.Float,
                   sound_speed: mi.Float, active: mi.Bool | bool = True) -> tuple[mi.Float, mi.Float]:
        """Return R, the same at all angles."""
        return dr.full(mi.Float, 1.0, dr.width(sin_grazing)), dr.zeros(mi.Float, dr.width(sin_grazing))

    def to_string(self) -> str:
        return "Rigid[]"


mi.register_bsdf("rigid", Rigid)
