"""Lambert bottom (`lambert`): σ = μ sin θ_i sin θ_s, in the facet's own frame.

- ``mu_db`` [dB, -27]: 10 log μ; -35 for mud to -10 for gravel and rock, at most -4.97. A number, or a texture of
  decibels (best ``raw``; what is above -4.97 counts as that).
- ``patchiness``, ``patch_size`` [m, 1]: shape of the gamma distribution by which the strength of squares of that size
  varies, so that echoes are K-distributed; none by default.

.. code-block:: xml

    <bsdf type="lambert" id="sand"><float name="mu_db" value="-25"/></bsdf>
"""
import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.plugins.attributes import Attributes
from mitsonar.plugins.bsdfs.material import Material, read_patches
from mitsonar.scattering import lambert
from mitsonar.units import power_from_db


class Lambert(Material):
    """See the module's text."""

    def __init__(self, props):
        attributes = Attributes(props)
        mu_db = attributes.number_or_texture("mu_db", -27.0, unit="dB", maximum=10 * np.log10(lambert.STRONGEST))
        self.patches = read_patches(attributes)
        attributes.finish()
        super().__init__(props, flags=mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide)
        self.mu_db = mu_db
        self.textured = isinstance(mu_db, mi.Texture)
        if not self.textured:
            self.strength = dr.opaque(mi.Float, float(power_from_db(mu_db)))

    def traverse(self, callback):
        if self.textured:
            callback.put("mu_db", self.mu_db, mi.ParamFlags.Differentiable)
        else:
            callback.put("strength", self.strength, mi.ParamFlags.Differentiable)

    def parameters_changed(self, keys):
        if not self.textured:
            dr.make_opaque(self.strength)

    def scattering_strength(self, si, wi, wo, frequency, sound_speed, active=True):
        """σ of the law; neither frequency nor sound speed plays a part."""
        sin_i, sin_s = mi.Frame3f.cos_theta(wi), mi.Frame3f.cos_theta(wo)
        if self.textured:
            strength = dr.exp(float(np.log(10) / 10) * self.mu_db.eval_1(si, active))
            strength = dr.minimum(strength, lambert.STRONGEST)
        else:
            strength = self.strength
        return dr.select(active, lambert.scattering_strength(strength, sin_i, sin_s), 0)

    def to_string(self):
        return f"Lambert[mu_db={'texture' if self.textured else self.mu_db}]"


mi.register_bsdf("lambert", Lambert)
