"""Base class of perfectly smooth materials: a reflection coefficient for coherent echoes, and no scattering.

Facets echo coherently (`mitsonar.echoes.smooth.targets`): highlights at normal incidence, mirrors, corners. They
neither scatter nor reflect the rays of energy that stand for sound from rough surfaces.
"""
import drjit as dr
import mitsuba as mi

from .material import Material


class Smooth(Material):
    """Smooth surface; a subclass defines its reflection coefficient."""

    smooth = reflects = True

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props, flags=mi.BSDFFlags.DeltaReflection | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide)

    def scattering_strength(self, si: mi.SurfaceInteraction3f, wi: mi.Vector3f, wo: mi.Vector3f, frequency: mi.Float,
                            sound_speed: mi.Float, active: mi.Bool | bool = True) -> mi.Float:
        """Return zero for all directions."""
        return dr.zeros(mi.Float, dr.width(wi))

    def coherent_reflection(self, si: mi.SurfaceInteraction3f, sin_grazing: mi.Float, frequency: mi.Float,
                            sound_speed: mi.Float, lowest_wavenumber: mi.Float,
                            active: mi.Bool | bool = True) -> tuple[mi.Float, mi.Float]:
        """Return the reflection coefficient, which no roughness reduces."""
        return self.reflection(si, sin_grazing, frequency, sound_speed, active)

    def reflection(self, si: mi.SurfaceInteraction3f, sin_grazing: mi.Float, frequency: mi.Float,
                   sound_speed: mi.Float, active: mi.Bool | bool = True) -> tuple[mi.Float, mi.Float]:
        """Return the reflection coefficient in the convention e^(+iωt), as real and imaginary parts (R,)."""
        # not abstract: Mitsuba's classes have a metaclass of their own
        raise NotImplementedError(f"{type(self).__name__} lacks the method reflection")
