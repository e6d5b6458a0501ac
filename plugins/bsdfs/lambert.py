"""Lambert bottom (`lambert`): σ = μ sin θ_i sin θ_s, in the facet's own frame.

In `mi.traverse` its parameter is ``strength``, µ itself, or ``mu_db.data``, the decibels of a texture.

Decibels of a texture are clipped at -4.97; write the texture with ``raw`` true.

.. code-block:: xml

    <bsdf type="lambert" id="sand"><float name="mu_db" value="-25"/></bsdf>
"""
import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.scattering.laws import lambert
from mitsonar.units import db_from_power, power_from_db

from ..attributes import Attributes, NumberOrTexture
from .material import COHERENCE, Material
from .variation import VARIATION, variation_of

ATTRIBUTES = (
    NumberOrTexture("mu_db", default=-27.0, unit="dB", maximum=float(db_from_power(lambert.STRONGEST)),
                    text="scattering strength, 10 log µ of σ = µ sin θ_i sin θ_s; -35 for mud to -10 for gravel and "
                         "rock"),
    COHERENCE, *VARIATION,
)


class Lambert(Material):
    """Lambertian surface."""

    def __init__(self, props: mi.Properties) -> None:
        attributes = Attributes(props, ATTRIBUTES)
        self.mu_db, self.variation = attributes.mu_db, variation_of(attributes)
        self.coherence = attributes.coherence
        super().__init__(props, flags=mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide)
        self.textured = any(isinstance(value, mi.Texture) for value in (self.mu_db, self.coherence))
        if not isinstance(self.mu_db, mi.Texture):
            self.strength = dr.opaque(mi.Float, float(power_from_db(self.mu_db)))

    def traverse(self, callback: mi.TraversalCallback) -> None:
        super().traverse(callback)
        if isinstance(self.mu_db, mi.Texture):
            callback.put("mu_db", self.mu_db, mi.ParamFlags.Differentiable)
        else:
            callback.put("strength", self.strength, mi.ParamFlags.Differentiable)

    def parameters_changed(self, keys: list[str]) -> None:
        if isinstance(self.mu_db, mi.Texture):
            return
        strength = dr.detach(self.strength).numpy()
        # float32 may round up above the strongest
        if len(strength) != 1 or not 0 <= strength[0] <= lambert.STRONGEST * (1 + 1e-6):
            raise ValueError(f"lambert: strength is {strength.tolist()}; give one number from 0 to "
                             f"{lambert.STRONGEST:.4g}, µ of σ = µ sin θ_i sin θ_s.")
        dr.make_opaque(self.strength)

    def scattering_strength(self, si: mi.SurfaceInteraction3f, wi: mi.Vector3f, wo: mi.Vector3f, frequency: mi.Float,
                            sound_speed: mi.Float, active: mi.Bool | bool = True) -> mi.Float:
        """Return σ of the law, which depends on neither frequency nor sound speed."""
        sin_i, sin_s = mi.Frame3f.cos_theta(wi), mi.Frame3f.cos_theta(wo)
        if isinstance(self.mu_db, mi.Texture):
            strength = dr.exp(float(np.log(10) / 10) * self.mu_db.eval_1(si, mi.Bool(active)))
            strength = dr.minimum(strength, lambert.STRONGEST)
        else:
            strength = self.strength
        return dr.select(active, lambert.scattering_strength(strength, sin_i, sin_s), 0)

    def to_string(self) -> str:
        return f"Lambert[mu_db={'texture' if isinstance(self.mu_db, mi.Texture) else self.mu_db}]"


mi.register_bsdf("lambert", Lambert)
