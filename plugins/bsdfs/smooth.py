"""What perfectly smooth materials share: no scattering of their own, a reflection coefficient for their facets' echoes.

Their facets echo coherently (`mitsonar.echoes.smooth.targets`): highlights where a surface is met at right angles,
mirrors, corners. Rough sound, as rays of energy, they neither scatter nor send on.
"""
import drjit as dr
import mitsuba as mi

from .material import Material


class Smooth(Material):
    """A smooth surface; subclasses say how it reflects."""

    smooth = reflects = True

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props, flags=mi.BSDFFlags.DeltaReflection | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide)

    def scattering_strength(self, si: mi.SurfaceInteraction3f, wi: mi.Vector3f, wo: mi.Vector3f, frequency: mi.Float,
                            sound_speed: mi.Float, active: mi.Bool | bool = True) -> mi.Float:
        """None in any direction."""
        return dr.zeros(mi.Float, dr.width(wi))

    def coherent_reflection(self, si: mi.SurfaceInteraction3f, sin_grazing: mi.Float, frequency: mi.Float,
                            sound_speed: mi.Float, lowest_wavenumber: mi.Float,
                            active: mi.Bool | bool = True) -> tuple[mi.Float, mi.Float]:
        """R: nothing is rough."""
        return self.reflection(si, sin_grazing, frequency, sound_speed, active)

    def reflection(self, si: mi.SurfaceInteraction3f, sin_grazing: mi.Float, frequency: mi.Float,
                   sound_speed: mi.Float, active: mi.Bool | bool = True) -> tuple[mi.Float, mi.Float]:
        """Return the reflection coefficient in the convention e^(+iωt)."""
        # sin_grazing, frequency, sound_speed [m/s]; active (R,) -> real, imaginary (R,)
        # Mitsuba's classes have a metaclass of their own, so they cannot be abstract ones
        raise NotImplementedError(f"{type(self).__name__} lacks the method reflection")
