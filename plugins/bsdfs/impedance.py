"""Smooth surface of a fluid-like material (`impedance`): reflects as its density and sound speed ask, by angle.

- ``density`` [kg/m³], ``sound_speed`` [m/s]: of what lies behind the surface, deep enough that nothing comes back from
  its far side
- ``loss`` [0]: imaginary over real part of its wavenumber, at most 1

The water has 1025 kg/m³ and the sound speed it has at the surface.

.. code-block:: xml

    <bsdf type="impedance" id="rubber">
        <float name="density" value="1100"/> <float name="sound_speed" value="1600"/> <float name="loss" value="0.1"/>
    </bsdf>
"""
import drjit as dr
import mitsuba as mi

from mitsonar.plugins.attributes import Attributes
from mitsonar.plugins.bsdfs.smooth import Smooth
from mitsonar.scattering.reflection import WATER_DENSITY, fluid_reflection


class Impedance(Smooth):
    """See the module's text."""

    def __init__(self, props):
        attributes = Attributes(props)
        self.density = attributes.number("density", above=0, maximum=1e5, unit="kg/m³")
        self.sound_speed = attributes.number("sound_speed", above=0, maximum=1e5, unit="m/s")
        self.loss = attributes.number("loss", 0.0, minimum=0, maximum=1)
        attributes.finish()
        super().__init__(props)
        self._numbers = [dr.opaque(mi.Float, v) for v in (self.density / WATER_DENSITY, self.sound_speed, self.loss)]

    def reflection(self, si, sin_grazing, frequency, sound_speed, active=True):
        """R of a fluid half-space."""
        density_ratio, own_speed, loss = self._numbers
        return fluid_reflection(sin_grazing, density_ratio, own_speed / sound_speed, loss)

    def to_string(self):
        return f"Impedance[{self.density:g} kg/m³, {self.sound_speed:g} m/s, loss {self.loss:g}]"


mi.register_bsdf("impedance", Impedance)
