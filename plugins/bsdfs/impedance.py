"""Smooth surface of a fluid-like material (`impedance`): its reflection depends on density, sound speed and angle.

Its echo is coherent, highlights and corners included. The material is taken as infinitely thick: nothing returns from
its far side. The water has a density of 1025 kg/m³ and the sound speed at the surface.

.. code-block:: xml

    <bsdf type="impedance" id="rubber">
        <float name="density" value="1100"/> <float name="sound_speed" value="1600"/> <float name="loss" value="0.1"/>
    </bsdf>
"""
import drjit as dr
import mitsuba as mi

from mitsonar.scattering.surfaces.reflection import WATER_DENSITY, fluid_reflection

from ..attributes import Attributes, Number
from .smooth import Smooth

ATTRIBUTES = (
    Number("density", above=0, maximum=1e5, unit="kg/m³", text="of what lies behind the surface; the water's is 1025"),
    Number("sound_speed", above=0, maximum=1e5, unit="m/s", text="there"),
    Number("loss", default=0.0, minimum=0, maximum=1, text="imaginary over real part of the wavenumber there"),
)


class Impedance(Smooth):
    """Body of a given impedance."""

    def __init__(self, props: mi.Properties) -> None:
        attributes = Attributes(props, ATTRIBUTES)
        self.density, self.sound_speed, self.loss = attributes.density, attributes.sound_speed, attributes.loss
        super().__init__(props)
        self._numbers = [dr.opaque(mi.Float, v) for v in (self.density / WATER_DENSITY, self.sound_speed, self.loss)]

    def reflection(self, si: mi.SurfaceInteraction3f, sin_grazing: mi.Float, frequency: mi.Float,
                   sound_speed: mi.Float, active: mi.Bool | bool = True) -> tuple[mi.Float, mi.Float]:
        """Return R of a fluid half-space."""
        density_ratio, own_speed, loss = self._numbers
        return fluid_reflection(sin_grazing, density_ratio, own_speed / sound_speed, loss)

    def to_string(self) -> str:
        return f"Impedance[{self.density:g} kg/m³, {self.sound_speed:g} m/s, loss {self.loss:g}]"


mi.register_bsdf("impedance", Impedance)
