"""Smooth soft surface (`soft`): pressure release, such as air behind a thin skin, R = -1 at all angles.

Its echo is coherent and carries a phase: Kirchhoff's integral over the facets, corners included.

.. code-block:: xml

    <bsdf type="soft" id="hull"/>
"""
import drjit as dr
import mitsuba as mi

from mitsonar.plugins.attributes import Attributes
from mitsonar.plugins.bsdfs.smooth import Smooth


class Soft(Smooth):
    """See the module's text."""

    def __init__(self, props):
        Attributes(props).finish()
        super().__init__(props)

    def reflection(self, si, sin_grazing, frequency, sound_speed, active=True):
        """R, the same at all angles."""
        return dr.full(mi.Float, -1.0, dr.width(sin_grazing)), dr.zeros(mi.Float, dr.width(sin_grazing))

    def to_string(self):
        return "Soft[]"


mi.register_bsdf("soft", Soft)
