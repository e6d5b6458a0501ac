"""Sea surface seen from below (`windy_sea`): bubbles, facets and ripples made by the wind.

The law is `mitsonar.scattering.laws.sea_surface`, after APL-UW TR 9407 (1994). It is valid from 10 to 100 kHz and
extrapolated beyond. Without wind the surface is a mirror that inverts the pressure and scatters nothing. This material
is the default of the shape `sea_surface`.

.. code-block:: xml

    <bsdf type="windy_sea"><float name="wind_speed" value="8"/></bsdf>

A `sea_surface` with waves has long waves as a mesh. Its material then has the slopes of shorter waves alone.
"""
import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.scattering.laws import sea_surface

from ..attributes import Attributes, Number
from .material import Material

WIND_SPEED = Number("wind_speed", default=5.0, minimum=0, maximum=60.0, unit="m/s", text="at 10 m height")

LONGEST_WAVE = Number("longest_wave", default=None, above=0, unit="m", otherwise="all waves",
                      text="length of the longest waves whose slopes the material has; a mesh has the others")

ATTRIBUTES = (WIND_SPEED, LONGEST_WAVE)


class WindySea(Material):
    """Rough sea surface."""

    coherence = 0.0

    def __init__(self, props: mi.Properties) -> None:
        attributes = Attributes(props, ATTRIBUTES)
        self.wind_speed, self.longest_wave = attributes.wind_speed, attributes.longest_wave
        super().__init__(props)
        self.mirror = self.wind_speed == 0
        self.roughness = sea_surface.Roughness(*(dr.opaque(mi.Float, value) for value in sea_surface.roughness(
            self.wind_speed, np.inf if self.longest_wave is None else self.longest_wave)))

    def scattering_strength(self, si: mi.SurfaceInteraction3f, wi: mi.Vector3f, wo: mi.Vector3f, frequency: mi.Float,
                            sound_speed: mi.Float, active: mi.Bool | bool = True) -> mi.Float:
        """Return σ of the law."""
        if self.mirror:
            return dr.zeros(mi.Float, dr.width(wo))
        return dr.select(active, sea_surface.strength(dr, self.roughness, wi, wo, frequency, sound_speed), 0)

    def drawn_direction(self, si: mi.SurfaceInteraction3f, wi: mi.Vector3f, frequency: mi.Float, sound_speed: mi.Float,
                        sample1: mi.Float, sample2: mi.Point2f, active: mi.Bool | bool = True) -> mi.Vector3f:
        """Draw from the lobe of facets, or for a small share of rays from a cosine for bubbles and ripples."""
        if self.mirror:
            return mi.Vector3f(-wi.x, -wi.y, wi.z)
        facet = mi.Vector3f(*sea_surface.facet_direction(dr, self.roughness.slope_variance, wi, sample2.x, sample2.y))
        return dr.select(sample1 < sea_surface.FACET_SHARE, facet, mi.warp.square_to_cosine_hemisphere(sample2))

    def direction_density(self, si: mi.SurfaceInteraction3f, wi: mi.Vector3f, wo: mi.Vector3f, frequency: mi.Float,
                          sound_speed: mi.Float, active: mi.Bool | bool = True) -> mi.Float:
        """Return the density of that mixture; 0 for a mirror."""
        if self.mirror:
            return dr.zeros(mi.Float, dr.width(wo))
        share = sea_surface.FACET_SHARE
        facets = sea_surface.facet_density(dr, self.roughness.slope_variance, wi, wo)
        return dr.select(active, share * facets + (1 - share) * mi.warp.square_to_cosine_hemisphere_pdf(wo), 0)

    def to_string(self) -> str:
        return f"WindySea[wind {self.wind_speed:g} m/s]"


mi.register_bsdf("windy_sea", WindySea)
